//! Means, spreads, quantiles and the bootstrap, written once.
//!
//! Sums run from the first value to the last, so the same values give the same bits.

use rand::RngExt as _;
use statrs::distribution::{ContinuousCDF as _, StudentsT};

use crate::basics::seed::Rng;

/// The mean of some values; NaN if there are none.
pub fn mean(values: &[f64]) -> f64 {
    mean_of(values.iter().copied())
}

/// The mean of values that are worked out one by one; NaN if there are none.
pub(crate) fn mean_of(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}

/// The mean of some values; 0 if there are none.
pub(crate) fn mean_or_zero(values: &[f64]) -> f64 {
    if values.is_empty() { 0.0 } else { mean(values) }
}

/// Mean and variance of values that are all there is, not a sample: the squared deviations by the number of values.
pub(crate) fn mean_and_variance(values: impl ExactSizeIterator<Item = f64> + Clone) -> (f64, f64) {
    let mean = mean_of(values.clone());
    (mean, mean_of(values.map(|value| (value - mean).powi(2))))
}

/// Mean and standard deviation of values that are all there is, not a sample.
pub(crate) fn mean_and_deviation(values: impl ExactSizeIterator<Item = f64> + Clone) -> (f64, f64) {
    let (mean, variance) = mean_and_variance(values);
    (mean, variance.sqrt())
}

/// Squared deviations from the mean, summed.
pub(crate) fn squared_deviations(values: &[f64]) -> f64 {
    let mean = mean(values);
    values.iter().map(|value| (value - mean).powi(2)).sum()
}

/// The standard error of the mean of a sample, √(Σ(x − x̄)² ÷ (n − 1) ÷ n); 0 of one value.
pub(crate) fn standard_error(sample: &[f64]) -> f64 {
    let count = sample.len() as f64;
    (squared_deviations(sample) / (count - 1.0).max(1.0) / count).sqrt()
}

/// The variance that the few values of one group are taken to have, drawn toward what all groups have in common
/// (Smyth 2004, "Linear models and empirical Bayes methods", with a fixed weight in place of a fitted one).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moderation {
    /// Mean variance of all groups.
    pub(crate) common: f64,
    /// How many degrees of freedom it is worth beside a group's own.
    pub(crate) worth: f64,
}

impl Moderation {
    /// Degrees of freedom of a moderated variance.
    pub(crate) fn freedom(&self, own: f64) -> f64 {
        own + self.worth
    }

    /// (Σ(x − x̄)² + d₀·s₀²) ÷ (d + d₀), of squared deviations with d degrees of freedom.
    pub(crate) fn variance(&self, squared_deviations: f64, own_freedom: f64) -> f64 {
        (squared_deviations + self.worth * self.common) / self.freedom(own_freedom)
    }
}

/// A quantile of ascending values, between neighbors by a straight line.
pub(crate) fn quantile(ascending: &[f64], share: f64) -> f64 {
    let place = share * (ascending.len() - 1) as f64;
    let (below, above) = (ascending[place.floor() as usize], ascending[place.ceil() as usize]);
    below + (above - below) * place.fract()
}

/// The value that Student's t passes with this probability; `None` without a degree of freedom.
pub(crate) fn student_quantile(probability: f64, freedom: f64) -> Option<f64> {
    let student = StudentsT::new(0.0, 1.0, freedom).ok().filter(|_| freedom >= 1.0)?;
    Some(student.inverse_cdf(1.0 - probability))
}

/// The positions of one draw of a bootstrap: `count` of them, with replacement.
///
/// Lists whose values belong together by position are drawn by the same positions; that makes a bootstrap paired.
pub(crate) fn resample(count: usize, rng: &mut Rng) -> Vec<usize> {
    (0..count).map(|_| rng.random_range(0..count)).collect()
}

/// The mean of the values at the positions of a draw.
pub(crate) fn mean_at(values: &[f64], positions: &[usize]) -> f64 {
    mean_of(positions.iter().map(|&position| values[position]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basics::seed::Seed;

    /// statistics.mean, pvariance and pstdev of Python, and scipy.stats.sem.
    #[test]
    fn means_and_spreads_agree_with_python() {
        let values = [2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0];
        assert_eq!(mean(&values), 5.0);
        assert_eq!(mean_and_variance(values.iter().copied()), (5.0, 4.0));
        assert_eq!(mean_and_deviation(values.iter().copied()), (5.0, 2.0));
        assert_eq!(squared_deviations(&values), 32.0);
        assert!((standard_error(&values) - 0.755_928_946_018_454_5).abs() < 1e-15);
        assert_eq!(standard_error(&[3.0]), 0.0);
    }

    #[test]
    fn of_nothing_there_is_no_mean() {
        assert!(mean(&[]).is_nan());
        assert_eq!(mean_or_zero(&[]), 0.0);
    }

    /// numpy.quantile, whose method is the same.
    #[test]
    fn a_quantile_lies_between_its_neighbors() {
        let values = [1.0, 2.0, 4.0, 8.0];
        for (share, wanted) in [(0.0, 1.0), (0.25, 1.75), (0.5, 3.0), (0.9, 6.8), (1.0, 8.0)] {
            assert!((quantile(&values, share) - wanted).abs() < 1e-12, "{share}");
        }
    }

    /// From tables of Student's t.
    #[test]
    fn quantiles_of_student_are_those_of_the_tables() {
        for (probability, freedom, wanted) in
            [(0.05, 4.0, 2.132), (0.025, 9.0, 2.262), (0.01, 2.0, 6.965), (0.0125, 1.0, 25.452)]
        {
            let found = student_quantile(probability, freedom).expect("has freedom");
            assert!((found - wanted).abs() < 1e-3, "{found}");
        }
        assert!(student_quantile(0.05, 0.0).is_none());
    }

    #[test]
    fn a_moderated_variance_lies_between_its_own_and_the_common_one() {
        let moderation = Moderation { common: 3.0, worth: 4.0 };
        assert_eq!(moderation.variance(4.0, 4.0), 2.0, "own 1, common 3, each worth four");
        assert_eq!(moderation.variance(0.0, 0.0), 3.0, "nothing of its own");
    }

    /// All 27 draws of three positions are equally likely.
    #[test]
    fn a_bootstrap_draws_every_position_alike_and_with_replacement() {
        let mut rng = Seed::new(1).into_rng();
        let mut counts = [0; 27];
        for _ in 0..27_000 {
            let draw = resample(3, &mut rng);
            counts[draw.iter().fold(0, |code, position| 3 * code + position)] += 1;
        }
        assert!(counts.iter().all(|count| (850..1150).contains(count)), "{counts:?}");
        assert_eq!(mean_at(&[1.0, 5.0, 9.0], &[2, 2, 0]), 19.0 / 3.0);
    }
}
