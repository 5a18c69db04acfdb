//! Martial Arts (§5.1, A.1): the part of the task reward that leads the right foot to the target.
//!
//! The foot is paid for being near the target, in each step in which the head is higher than the pelvis.
//! The pay rises steeply close to the target, so that a kick that nearly reaches it is worth more than a leg that stays halfway
//! up; nobody can hover there, since the target hangs higher than a leg of who stands.
//! Nothing of this judges: heuristic and success are in `task.toml`.

use demosift::Result;
use demosift::world::environment::Specification;

use crate::task::reward::{RewardShaping, Transition};

/// Pairs of reward for a step at the target, and the distance in m at which it has fallen to 1/e.
/// The first one leads the last bit of the way, the second one lifts the leg.
const REWARDS: [(f64, f64); 2] = [(2.0, 0.2), (0.5, 1.0)];

/// Columns of the measurements that the reward needs.
struct MartialArts {
    distance: usize,
    head_above_pelvis: usize,
}

/// Finds the measurements that the reward is made of.
///
/// # Errors
/// If the task does not measure one of them.
pub(crate) fn shaping(task: &Specification) -> Result<Box<dyn RewardShaping>> {
    let column = |name| task.measurement(name);
    Ok(Box::new(MartialArts {
        distance: column("distance")?,
        head_above_pelvis: column("head_above_pelvis")?,
    }))
}

impl RewardShaping for MartialArts {
    /// Σ weight · exp(−distance / scale), between 0 and 2.5, of the state after the step; 0 while the head is below the pelvis.
    fn reward(&self, step: &Transition<'_>) -> f64 {
        if step.after[self.head_above_pelvis] <= 0.0 {
            return 0.0;
        }
        let distance = step.after[self.distance];
        REWARDS.iter().map(|(weight, scale)| weight * (-distance / scale).exp()).sum()
    }
}
