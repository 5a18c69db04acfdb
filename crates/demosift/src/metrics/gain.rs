//! Whether selecting was worth it: the policy from the subset beside others, by their finished learning curves.
//!
//! The referee is the trained policy and never the score that chose (docs/traps/evaluation-noise.md).

use serde::{Deserialize, Serialize};

use super::mean;
use crate::heuristic::Score;
use crate::imitate::{CurvePoint, LearningCurve};

/// Standard errors on each side of a gain's interval: about 95 %.
const STANDARD_ERRORS: f64 = 2.0;

/// How much better one policy is than another, with the noise that the episodes or trainings show.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gain {
    /// The difference of the mean heuristics.
    pub gain: Score,
    /// Lower end of its interval, two standard errors down.
    pub low: Score,
    /// Upper end of its interval, two standard errors up.
    pub high: Score,
    /// What that says.
    pub verdict: Verdict,
}

/// What a [`Gain`] says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The interval is above 0.
    Better,
    /// The interval holds 0: nothing is gained that the noise would let see.
    NoDifference,
    /// The interval is below 0.
    Worse,
}

impl Gain {
    fn new(gain: Score, standard_error: f64) -> Self {
        let (low, high) = (gain - STANDARD_ERRORS * standard_error, gain + STANDARD_ERRORS * standard_error);
        let verdict = match (low > 0.0, high < 0.0) {
            (true, _) => Verdict::Better,
            (_, true) => Verdict::Worse,
            _ => Verdict::NoDifference,
        };
        Self { gain, low, high, verdict }
    }
}

/// The gain of one policy over another, such as of the subset's over the whole set's, by the episodes that evaluated them.
///
/// The interval knows the luck of the episodes only: one training each says nothing of what another would change.
/// Both evaluations use the same seeds, so treating them as independent is on the safe side.
pub fn gain(of: &CurvePoint, over: &CurvePoint) -> Gain {
    Gain::new(of.score - over.score, of.standard_error.hypot(over.standard_error))
}

/// The gain by several trainings of each, one score a training, so that the luck of a training is in the interval.
///
/// The standard error is Welch's, for unequal spreads; with a single training on either side it is NaN, and the verdict
/// no difference.
pub fn gain_of_trainings(of: &[Score], over: &[Score]) -> Gain {
    let squared_error = |scores: &[Score]| {
        let center = mean(scores);
        let count = scores.len() as f64;
        scores.iter().map(|score| (score - center).powi(2)).sum::<f64>() / (count - 1.0) / count
    };
    Gain::new(mean(of) - mean(over), (squared_error(of) + squared_error(over)).sqrt())
}

/// A subset beside random subsets of the same size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AgainstRandom {
    /// By how much it is better than they are on average.
    pub gain: Score,
    /// Which share of them it beats; ties count half.
    pub beaten: f64,
}

/// The score of the policy from the subset beside those from random subsets of the same size; NaN if there are none.
pub fn against_random(subset: Score, random: &[Score]) -> AgainstRandom {
    let wins = random.iter().map(|other| f64::from(subset > *other) + 0.5 * f64::from(subset == *other));
    AgainstRandom { gain: subset - mean(random), beaten: wins.sum::<f64>() / random.len() as f64 }
}

/// How much of the way from the untrained policy to the best single demonstration's the subset's policy went: 1 is as
/// good, more is better.
///
/// A quotient of the heuristics themselves would mean nothing where they are negative, as negated distances are, so both
/// are counted from the first point of the curves, where nothing has been learned yet. NaN where the best single
/// demonstration taught nothing, or a curve has no point.
pub fn share_of_best(subset: &LearningCurve, best_single: &LearningCurve) -> f64 {
    let untrained = |curve: &LearningCurve| curve.points.first().map_or(f64::NAN, |point| point.score);
    let start = mean(&[untrained(subset), untrained(best_single)]);
    let way = best_single.outcome.score - start;
    if way > 0.0 { (subset.outcome.score - start) / way } else { f64::NAN }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::demonstration::DemoId;
    use crate::observation_filter::ObservationFilter;
    use crate::policy::{Policy, PolicyShape};
    use crate::seed::Seed;

    fn point(score: Score, standard_error: f64) -> CurvePoint {
        CurvePoint { updates: 0, environment_steps: 0, score, standard_error, success: None }
    }

    fn curve(scores: &[Score]) -> LearningCurve {
        let shape = PolicyShape { hidden: vec![1], initial_std: 1.0 };
        LearningCurve {
            demos: vec![DemoId(0)],
            points: scores.iter().map(|score| point(*score, 0.0)).collect(),
            outcome: point(scores[scores.len() - 1], 0.0),
            best: Policy::untrained(&shape, ObservationFilter::identity(1), 1, Seed::new(1)),
        }
    }

    #[test]
    fn a_gain_within_the_noise_is_no_difference() {
        let over = point(1.0, 0.4);
        let near = gain(&point(1.9, 0.3), &over);
        assert!(
            (near.gain - 0.9).abs() < 1e-12
                && (near.low + 0.1).abs() < 1e-12
                && (near.high - 1.9).abs() < 1e-12
        );
        assert_eq!(near.verdict, Verdict::NoDifference);
        assert_eq!(gain(&point(2.1, 0.3), &over).verdict, Verdict::Better);
        assert_eq!(gain(&point(-0.1, 0.3), &over).verdict, Verdict::Worse);
        assert_eq!(gain(&over, &over).verdict, Verdict::NoDifference);
    }

    /// scipy.stats.ttest_ind of the same lists with equal_var=False.
    #[test]
    fn the_gain_of_several_trainings_has_welchs_standard_error() {
        let found = gain_of_trainings(&[5.0, 7.0, 9.0, 11.0], &[2.0, 3.0, 4.0]);
        let standard_error: f64 = (found.high - found.low) / 4.0;
        assert!((found.gain / standard_error - 3.535_533_905_932_737_8).abs() < 1e-12);
        assert_eq!((found.gain, found.verdict), (5.0, Verdict::Better));
        assert_eq!(gain_of_trainings(&[5.0], &[2.0, 3.0]).verdict, Verdict::NoDifference);
    }

    #[test]
    fn a_subset_beside_random_ones_and_the_best_single_demonstration() {
        assert_eq!(against_random(2.0, &[1.0, 2.0, 4.0, 1.0]), AgainstRandom { gain: 0.0, beaten: 0.625 });
        assert!(against_random(2.0, &[]).gain.is_nan());
        // From −2 to −0.5 is three quarters of the way from −2 to 0.
        assert_eq!(share_of_best(&curve(&[-2.0, -1.0, -0.5]), &curve(&[-2.0, 0.0])), 0.75);
        assert!(share_of_best(&curve(&[-2.0, -0.5]), &curve(&[-2.0, -3.0])).is_nan());
    }
}
