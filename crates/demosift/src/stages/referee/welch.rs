//! Welch's t of two lists of trainings, one-sided, with floors under the spread.
//!
//! Where we differ from the book: of Welch's standard error and Student's pooled one the larger counts.
//! They are the same for lists of one length. For ten against three, Welch believes the spread of the three, and three
//! trainings are easily alike by chance: of scores that are all or nothing it was wrong in 21 % at a level of 5 %, and in
//! 11 % of skewed ones. With the larger it is 5 % and 1 %.

use super::Training;
use crate::math::statistics::{mean, mean_of, squared_deviations, student_quantile};
use crate::world::heuristic::Score;

/// A spread below this share of the scores is rounding.
const ROUNDING: f64 = 1e-9;

/// The scores of a pair's trainings.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) mean: Score,
    /// s².
    variance: f64,
    /// n.
    count: f64,
}

impl Sample {
    /// Of at least one training.
    ///
    /// A few trainings may score the same by chance, and their spread would claim a certainty that nobody has. What the
    /// episodes alone show is part of the spread of any training, so s² is at least the mean of their squared errors.
    pub(super) fn of(trainings: &[Training]) -> Self {
        let count = trainings.len() as f64;
        let scores: Vec<Score> = trainings.iter().map(|training| training.outcome.score).collect();
        let episodes = mean_of(trainings.iter().map(|training| training.outcome.standard_error.powi(2)));
        let variance = (squared_deviations(&scores) / (count - 1.0).max(1.0)).max(episodes);
        Self { mean: mean(&scores), variance, count }
    }

    /// Limits of the mean, each of which is passed with this probability; `None` with a single training.
    pub(super) fn limits(&self, probability: f64) -> Option<(Score, Score)> {
        let reach = student_quantile(probability, self.count - 1.0)? * (self.variance / self.count).sqrt();
        Some((self.mean - reach, self.mean + reach))
    }

    /// How much better this one is than another.
    ///
    /// t = (x̄ − ȳ) ÷ √(s²ₓ/n + s²ᵧ/m), with (s²ₓ/n + s²ᵧ/m)² ÷ ((s²ₓ/n)²/(n−1) + (s²ᵧ/m)²/(m−1)) degrees of freedom
    /// (Welch–Satterthwaite).
    pub(super) fn over(&self, other: &Self) -> Welch {
        let (a, b) = (self.variance / self.count, other.variance / other.count);
        let freedoms = (self.count - 1.0, other.count - 1.0);
        let freedom = (a + b).powi(2) / (a.powi(2) / freedoms.0 + b.powi(2) / freedoms.1);
        let summed = self.variance * freedoms.0 + other.variance * freedoms.1;
        let pooled = summed / (freedoms.0 + freedoms.1) * (1.0 / self.count + 1.0 / other.count);
        let rounding = (ROUNDING * self.mean.abs().max(other.mean.abs())).powi(2);
        Welch {
            by: self.mean - other.mean,
            standard_error: (a + b).max(pooled).max(rounding).sqrt(),
            freedom: if freedom.is_finite() { freedom } else { freedoms.0.min(freedoms.1) },
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
        student_quantile(probability, self.freedom)
            .map_or(f64::INFINITY, |quantile| quantile * self.standard_error)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::scored;
    use super::*;

    fn over(of: &[Score], other: &[Score]) -> Welch {
        Sample::of(&scored(of, 0.0)).over(&Sample::of(&scored(other, 0.0)))
    }

    /// scipy.stats.ttest_ind([5, 7, 9, 11], [2, 3, 4, 4], equal_var=False), with its confidence_interval(0.9).
    #[test]
    fn the_limits_are_welchs() {
        let found = over(&[5.0, 7.0, 9.0, 11.0], &[2.0, 3.0, 4.0, 4.0]);
        assert!((found.by / found.standard_error - 3.449_796_936_212_173).abs() < 1e-12);
        assert!((found.freedom - 3.809_691_765_066_708).abs() < 1e-12, "{}", found.freedom);
        assert!(
            (found.low(0.05) - 1.772_034_889_666_831).abs() < 1e-6
                && (found.high(0.05) - 7.727_965_110_333_167).abs() < 1e-6
        );
    }

    #[test]
    fn three_that_are_alike_do_not_make_ten_others_sure() {
        let ten = [1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0];
        let found = over(&ten, &[0.0; 3]);
        let pooled = (2.5 / 11.0 * (0.1 + 1.0 / 3.0_f64)).sqrt();
        assert!((found.standard_error - pooled).abs() < 1e-12 && found.low(0.05) < 0.0);
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
