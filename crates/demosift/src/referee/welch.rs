//! Welch's t of two lists of trainings, one-sided, with a floor under the spread.

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::Training;
use crate::heuristic::Score;

/// A spread below this share of the scores is rounding.
const ROUNDING: f64 = 1e-9;

/// The scores of a pair's trainings.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) mean: Score,
    /// s² ÷ n.
    squared_error: f64,
    /// n − 1.
    freedom: f64,
}

impl Sample {
    /// Of at least one training.
    ///
    /// A few trainings may score the same by chance, and their spread would claim a certainty that nobody has. What the
    /// episodes alone show is part of the spread of any training, so s² is at least the mean of their squared errors.
    pub(super) fn of(trainings: &[Training]) -> Self {
        let count = trainings.len() as f64;
        let mean = trainings.iter().map(|training| training.outcome.score).sum::<f64>() / count;
        let squares = trainings.iter().map(|training| (training.outcome.score - mean).powi(2)).sum::<f64>();
        let episodes = trainings.iter().map(|training| training.outcome.standard_error.powi(2)).sum::<f64>();
        let variance = (squares / (count - 1.0).max(1.0)).max(episodes / count);
        Self { mean, squared_error: variance / count, freedom: count - 1.0 }
    }

    /// Limits of the mean, each of which is passed with this probability; `None` with a single training.
    pub(super) fn limits(&self, probability: f64) -> Option<(Score, Score)> {
        let reach = quantile(probability, self.freedom)? * self.squared_error.sqrt();
        Some((self.mean - reach, self.mean + reach))
    }

    /// How much better this one is than another.
    ///
    /// t = (x̄ − ȳ) ÷ √(s²ₓ/n + s²ᵧ/m), with (s²ₓ/n + s²ᵧ/m)² ÷ ((s²ₓ/n)²/(n−1) + (s²ᵧ/m)²/(m−1)) degrees of freedom
    /// (Welch–Satterthwaite).
    pub(super) fn over(&self, other: &Self) -> Welch {
        let (a, b) = (self.squared_error, other.squared_error);
        let rounding = (ROUNDING * self.mean.abs().max(other.mean.abs())).powi(2);
        let least = self.freedom.min(other.freedom);
        let freedom = (a + b).powi(2) / (a.powi(2) / self.freedom + b.powi(2) / other.freedom);
        Welch {
            by: self.mean - other.mean,
            standard_error: (a + b).max(rounding).sqrt(),
            freedom: if freedom.is_finite() { freedom } else { least },
        }
    }
}

/// A difference of two means as Welch sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Welch {
    pub(super) by: Score,
    pub(super) standard_error: f64,
    freedom: f64,
}

impl Welch {
    /// The lower limit, which is above the true difference with this probability.
    pub(super) fn low(&self, probability: f64) -> Score {
        self.by - self.reach(probability)
    }

    /// The upper limit, which is below the true difference with this probability.
    pub(super) fn high(&self, probability: f64) -> Score {
        self.by + self.reach(probability)
    }

    fn reach(&self, probability: f64) -> Score {
        quantile(probability, self.freedom).map_or(f64::INFINITY, |quantile| quantile * self.standard_error)
    }
}

/// The value that Student's t passes with this probability; `None` without a degree of freedom.
fn quantile(probability: f64, freedom: f64) -> Option<f64> {
    let student = StudentsT::new(0.0, 1.0, freedom).ok().filter(|_| freedom >= 1.0)?;
    Some(student.inverse_cdf(1.0 - probability))
}

#[cfg(test)]
mod tests {
    use super::super::tests::scored;
    use super::*;

    /// scipy.stats.ttest_ind([5, 7, 9, 11], [2, 3, 4], equal_var=False), with its confidence_interval(0.9).
    #[test]
    fn the_limits_are_welchs() {
        let [of, over] =
            [&[5.0, 7.0, 9.0, 11.0][..], &[2.0, 3.0, 4.0]].map(|scores| Sample::of(&scored(scores, 0.0)));
        let found = of.over(&over);
        assert!((found.by / found.standard_error - 3.535_533_905_932_737_8).abs() < 1e-12);
        assert!((found.freedom - 4.075_471_698_113_207_5).abs() < 1e-12, "{}", found.freedom);
        assert!((found.low(0.05) - 2.001_083_538_050_066).abs() < 1e-6);
        assert!((found.high(0.05) - 7.998_916_461_949_932).abs() < 1e-6);
    }

    /// From tables of Student's t.
    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (probability, freedom, wanted) in
            [(0.05, 4.0, 2.132), (0.025, 9.0, 2.262), (0.01, 2.0, 6.965), (0.0125, 1.0, 25.452)]
        {
            let found = quantile(probability, freedom).expect("has freedom");
            assert!((found - wanted).abs() < 1e-3, "{found}");
        }
        assert!(quantile(0.05, 0.0).is_none());
    }

    #[test]
    fn equal_scores_are_not_certainty() {
        let [same, other] = [0.9, 0.8].map(|score| Sample::of(&scored(&[score; 5], 0.1)));
        let found = same.over(&other);
        assert!((found.standard_error - (0.02_f64 / 5.0).sqrt()).abs() < 1e-12);
        assert!(found.low(0.05) < 0.0, "0.1 is within the noise of the episodes");
        // Where not even the episodes differ, rounding is no difference.
        let (five, ten) = (Sample::of(&scored(&[0.1; 5], 0.0)), Sample::of(&scored(&[0.1; 10], 0.0)));
        assert!(five.over(&ten).low(0.05) < 0.0 && five.over(&ten).high(0.05) > 0.0);
    }
}
