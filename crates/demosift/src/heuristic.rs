//! K: the task's own opinion of an outcome, a pure fold over what the environment measured (§4.3, A.1).

use crate::rows::Rows;

/// How good an outcome is. Higher is better, always; a distance is negated where the heuristic is made.
pub type Score = f64;

/// K: scores one episode from its measurements (§4.3).
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
