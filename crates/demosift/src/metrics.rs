//! How well a ranking agrees with another opinion.

/// Spearman's rank correlation of two lists of values, ties sharing their mean rank; NaN if one list is constant.
///
/// ```
/// let (ours, oracle) = ([0.9, 0.1, 0.5], [10.0, 2.0, 7.0]);
/// assert_eq!(demosift::metrics::spearman(&ours, &oracle), 1.0);
/// ```
pub fn spearman(left: &[f64], right: &[f64]) -> f64 {
    pearson(&ranks(left), &ranks(right))
}

/// The mean of some values; NaN if there are none.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn ranks(values: &[f64]) -> Vec<f64> {
    let mean_rank = |value: &f64| {
        let below = values.iter().filter(|other| *other < value).count();
        let equal = values.iter().filter(|other| *other == value).count();
        below as f64 + (equal as f64 + 1.0) / 2.0
    };
    values.iter().map(mean_rank).collect()
}

fn pearson(left: &[f64], right: &[f64]) -> f64 {
    let (left_mean, right_mean) = (mean(left), mean(right));
    let product = |a: &[f64], a_mean: f64, b: &[f64], b_mean: f64| -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - a_mean) * (b - b_mean)).sum()
    };
    let scale = product(left, left_mean, left, left_mean) * product(right, right_mean, right, right_mean);
    product(left, left_mean, right, right_mean) / scale.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// scipy.stats.spearmanr of the same lists.
    #[test]
    fn spearman_agrees_with_scipy() {
        let left = [106.0, 86.0, 100.0, 101.0, 99.0, 103.0, 97.0, 113.0, 112.0, 110.0];
        let right = [7.0, 0.0, 27.0, 50.0, 28.0, 29.0, 20.0, 12.0, 6.0, 17.0];
        assert!((spearman(&left, &right) - -0.175_757_575_757_575_75).abs() < 1e-12);
        let tied = [1.0, 2.0, 2.0, 3.0, 3.0, 3.0, 4.0, 5.0, 5.0, 9.0];
        assert!((spearman(&tied, &left) - 0.524_781_348_825_117_3).abs() < 1e-12);
    }

    #[test]
    fn spearman_of_the_same_order_is_one_and_of_the_opposite_minus_one() {
        assert_eq!(spearman(&[1.0, 5.0, 9.0], &[0.1, 0.2, 7.0]), 1.0);
        assert_eq!(spearman(&[1.0, 5.0, 9.0], &[3.0, 2.0, 1.0]), -1.0);
    }
}
