//! How many decimals a number is written with.

/// As many as the largest of these numbers asks for, so that three or four of its digits are told: none from 1000 on, three from 0.1
/// to 10, and more where all are smaller.
pub fn decimals(numbers: impl IntoIterator<Item = f64>) -> usize {
    let largest = numbers.into_iter().map(f64::abs).filter(|number| number.is_finite()).fold(0.0, f64::max);
    match largest {
        1000.0.. => 0,
        100.0.. => 1,
        10.0.. => 2,
        0.1.. => 3,
        // A number that is smaller than any measurement has no digits worth telling.
        1e-12.. => (2.0 - largest.log10().floor()) as usize,
        _ => 3,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_numbers_have_digits_too() {
        let each = [4200.0, -120.0, 12.0, 9.0, 0.5, 0.1, 0.0123, -0.0004, 0.0, f64::NAN];
        assert_eq!(each.map(|number| decimals([number])), [0, 1, 2, 3, 3, 3, 4, 6, 3, 3]);
        assert_eq!(decimals([0.0001, 42.0]), 2);
    }
}
