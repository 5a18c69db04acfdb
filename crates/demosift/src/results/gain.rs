//! One policy beside others, by their finished learning curves.
//!
//! What is compared is the trained policy and never the score that chose (docs/traps/evaluation-noise.md).
//! Whether selecting helps cannot be seen in one training each; [`crate::stages::referee`] makes several.

use serde::{Deserialize, Serialize};

use crate::math::statistics::{mean, mean_of};
use crate::stages::imitate::{CurvePoint, LearningCurve};
use crate::world::heuristic::Score;

/// Standard errors on each side of a gain's interval: about 95 %.
const STANDARD_ERRORS: f64 = 2.0;

/// How much better one policy is than another, with the noise that the episodes show.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Gain {
    /// The difference of the mean heuristics.
    pub gain: Score,
    /// Lower end of its interval, two standard errors down.
    pub low: Score,
    /// Upper end of its interval, two standard errors up.
    pub high: Score,
}

/// The gain of one policy over another, such as of the subset's over the whole set's, by the episodes that evaluated them.
///
/// The interval knows the luck of the episodes only: one training each says nothing of what another would change.
/// Both evaluations use the same seeds, so treating them as independent is on the safe side.
pub fn gain(of: &CurvePoint, over: &CurvePoint) -> Gain {
    let (gain, error) = (of.score - over.score, of.standard_error.hypot(over.standard_error));
    Gain { gain, low: gain - STANDARD_ERRORS * error, high: gain + STANDARD_ERRORS * error }
}

/// A subset beside random subsets of the same size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct AgainstRandom {
    /// By how much it is better than they are on average.
    pub gain: Score,
    /// Which share of them it beats; ties count half.
    pub beaten: f64,
}

/// The score of the policy from the subset beside those from random subsets of the same size; NaN if there are none.
pub fn against_random(subset: Score, random: &[Score]) -> AgainstRandom {
    let wins = random.iter().map(|other| f64::from(subset > *other) + 0.5 * f64::from(subset == *other));
    AgainstRandom { gain: subset - mean(random), beaten: mean_of(wins) }
}

/// How much of the way from the untrained policy to those of the best single demonstration the subset's policy went: 1 is as
/// good, more is better.
///
/// A quotient of the heuristics themselves would mean nothing where they are negative, as negated distances are, so both
/// are counted from the first point of the curves, where nothing has been learned yet, to their end. Trainings on the best
/// one are averaged before they divide, since one that hardly learned would make a quotient of any size. `None` where they
/// taught nothing, or a curve has no point.
pub fn share_of_best(subset: &LearningCurve, best_single: &[LearningCurve]) -> Option<f64> {
    let untrained = |curve: &LearningCurve| curve.points.first().map_or(f64::NAN, |point| point.score);
    let starts: Vec<Score> = best_single.iter().chain([subset]).map(untrained).collect();
    let ends: Vec<Score> = best_single.iter().map(|curve| curve.end.score).collect();
    let start = mean(&starts);
    let way = mean(&ends) - start;
    (way > 0.0).then(|| (subset.end.score - start) / way).filter(|share| share.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basics::seed::Seed;
    use crate::data::demonstration::DemoId;
    use crate::data::observation_filter::ObservationFilter;
    use crate::world::policy::{Policy, PolicyShape};

    fn point(score: Score, standard_error: f64) -> CurvePoint {
        CurvePoint {
            updates: 0,
            environment_steps: 0,
            score,
            standard_error,
            success: None,
            true_return: None,
        }
    }

    fn curve(scores: &[Score]) -> LearningCurve {
        let shape = PolicyShape { hidden: vec![1], initial_std: 1.0 };
        LearningCurve {
            demos: vec![DemoId(0)],
            points: scores.iter().map(|score| point(*score, 0.0)).collect(),
            outcome: point(scores[scores.len() - 1], 0.0),
            end: point(scores[scores.len() - 1], 0.0),
            played: 0,
            best: Policy::untrained(&shape, ObservationFilter::identity(1), 1, Seed::new(1)),
        }
    }

    #[test]
    fn a_gain_has_two_standard_errors_of_the_episodes_on_each_side() {
        let found = gain(&point(1.9, 0.3), &point(1.0, 0.4));
        assert!((found.gain - 0.9).abs() < 1e-12);
        assert!((found.low + 0.1).abs() < 1e-12 && (found.high - 1.9).abs() < 1e-12);
    }

    #[test]
    fn a_subset_beside_random_ones_and_the_best_single_demonstration() {
        assert_eq!(against_random(2.0, &[1.0, 2.0, 4.0, 1.0]), AgainstRandom { gain: 0.0, beaten: 0.625 });
        assert!(against_random(2.0, &[]).gain.is_nan());
        // From −2 to −0.5 is three quarters of the way from −2 to 0.
        let kept = curve(&[-2.0, -1.0, -0.5]);
        assert_eq!(share_of_best(&kept, &[curve(&[-2.0, 0.0])]), Some(0.75));
        assert_eq!(
            share_of_best(&kept, &[curve(&[-2.0, -1.75]), curve(&[-2.0, -0.25])]),
            Some(1.5),
            "of the mean"
        );
        assert_eq!(share_of_best(&kept, &[curve(&[-2.0, -3.0])]), None);
        assert_eq!(share_of_best(&kept, &[]), None);
    }
}
