//! Backtracking: try the whole step, then ever smaller fractions of it.

/// The first of the fractions 1, `shrink`, `shrink`², … (`attempts` in all) whose try is accepted, and what it gave.
///
/// `accept` gets the fraction of the step, tries it, and answers `None` to refuse it.
/// `None` means that no fraction was accepted; the caller then keeps what it had.
pub fn backtrack<T>(
    shrink: f64,
    attempts: usize,
    mut accept: impl FnMut(f64) -> Option<T>,
) -> Option<(f64, T)> {
    let fractions = std::iter::successors(Some(1.0), |fraction| Some(fraction * shrink));
    fractions.take(attempts).find_map(|fraction| Some((fraction, accept(fraction)?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_the_first_fraction_that_is_accepted() {
        let mut tried = Vec::new();
        let found = backtrack(0.5, 10, |fraction| {
            tried.push(fraction);
            (fraction < 0.3).then_some("good")
        });
        assert_eq!(found, Some((0.25, "good")));
        assert_eq!(tried, [1.0, 0.5, 0.25]);
    }

    #[test]
    fn gives_up_after_the_attempts() {
        let mut tries = 0;
        let found: Option<(f64, ())> = backtrack(0.8, 15, |_| {
            tries += 1;
            None
        });
        assert_eq!((found, tries), (None, 15));
        assert_eq!(backtrack(0.8, 0, |_| Some(())), None);
    }
}
