//! Whether an imitation was far better on its way than at its end, by its learning curve.
//!
//! The best policy on the way is the one that is kept, so nothing is lost with it; but a curve that falls again often says
//! that the reward stopped leading anywhere (docs/traps/one-demonstration-discriminators.md), and the kept policy is then
//! partly luck.

use crate::stages::imitate::{CurvePoint, LearningCurve};

/// Standard errors that a loss must exceed: the best of many noisy points is always a little better than the last.
const STANDARD_ERRORS: f64 = 3.0;

/// An imitation that was far better on its way than at its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decline {
    /// The best point.
    pub best: CurvePoint,
    /// The last point.
    pub last: CurvePoint,
}

/// Says so where, from its best point to its last, a curve lost at least half of what it had gained since its first, and
/// both are more than noise.
pub fn decline(curve: &LearningCurve) -> Option<Decline> {
    let (first, last) = (*curve.points.first()?, *curve.points.last()?);
    let best = *curve.best_point()?;
    let (gained, lost) = (best.score - first.score, best.score - last.score);
    let noise = |other: CurvePoint| STANDARD_ERRORS * best.standard_error.hypot(other.standard_error);
    (gained > noise(first) && lost > noise(last) && lost >= 0.5 * gained).then_some(Decline { best, last })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basics::seed::Seed;
    use crate::data::demonstration::DemoId;
    use crate::data::observation_filter::ObservationFilter;
    use crate::world::policy::{Policy, PolicyShape};

    fn declines(scores: &[f64], standard_error: f64) -> Option<usize> {
        let shape = PolicyShape { hidden: vec![1], initial_std: 1.0 };
        let point = |(updates, score): (usize, &f64)| CurvePoint {
            updates,
            environment_steps: 0,
            score: *score,
            standard_error,
            success: None,
            true_return: None,
        };
        let points: Vec<CurvePoint> = scores.iter().enumerate().map(point).collect();
        let curve = LearningCurve {
            demos: vec![DemoId(0)],
            outcome: points[0],
            end: points[0],
            played: 0,
            points,
            best: Policy::untrained(&shape, ObservationFilter::identity(1), 1, Seed::new(1)),
        };
        decline(&curve).map(|found| found.best.updates)
    }

    #[test]
    fn half_of_the_gain_must_be_lost_and_more_than_the_noise() {
        assert_eq!(declines(&[-1.8, -0.6, -0.7, -1.3], 0.05), Some(1));
        assert_eq!(declines(&[-1.8, -0.6, -0.7, -1.1], 0.05), None, "less than half");
        assert_eq!(declines(&[-1.8, -0.6, -0.7, -1.3], 0.2), None, "within three standard errors of 0.28");
        assert_eq!(declines(&[-1.8, -1.3, -0.7, -0.6], 0.05), None, "it still learns");
        assert_eq!(declines(&[-0.4, -0.6, -0.7], 0.05), None, "a bad demonstration was imitated well");
        assert_eq!(declines(&[-1.8, -0.6, -0.6, -1.3], 0.05), Some(2), "the later of equals is kept");
        assert_eq!(declines(&[-0.4], 0.05), None);
    }
}
