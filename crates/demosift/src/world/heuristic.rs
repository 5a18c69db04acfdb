//! K: the task's own opinion of an outcome, a pure fold over what the environment measured (§4.3, A.1).

use crate::math::rows::Rows;

/// How good an outcome is. Higher is better, always; a distance is negated where the heuristic is made.
pub type Score = f64;

/// K: scores one episode from its measurements (§4.3).
///
/// ```
/// use demosift::math::rows::Rows;
/// use demosift::world::heuristic::{Heuristic, Score};
///
/// /// The greatest height that was reached while the first measurement, a contact, was 0.
/// struct HighestFlight;
///
/// impl Heuristic for HighestFlight {
///     fn score(&self, measurements: &Rows) -> Score {
///         let flying = measurements.iter().filter(|row| row[0] == 0.0);
///         flying.map(|row| f64::from(row[1])).fold(0.0, f64::max)
///     }
///
///     fn unit(&self) -> &str {
///         "m"
///     }
/// }
///
/// // Four steps of contact and height; the 1.5 m are those of a hand that was held.
/// let episode = Rows::from_flat(vec![1.0, 1.5, 0.0, 0.5, 0.0, 0.75, 1.0, 0.25], 2)?;
/// assert_eq!(HighestFlight.score(&episode), 0.75);
/// # Ok::<(), demosift::Error>(())
/// ```
pub trait Heuristic: Send + Sync {
    /// The score of an episode with these measurements, `[T+1, measurements]`.
    ///
    /// A pure function of its argument: it asks no simulator and remembers nothing.
    fn score(&self, measurements: &Rows) -> Score;

    /// The unit of the score, for people, such as `m`; empty if it has none.
    fn unit(&self) -> &str {
        ""
    }
}
