//! What judging takes, by counting.

use super::{Judging, race};
use crate::learning::adapt::InnerUpdate;
use crate::world::environment::Specification;

/// What judging a set takes at most, where episodes last to the horizon; exact where no repeats are added. Where episodes end
/// early, batches are filled with further ones, so that adapting takes about as many steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effort {
    /// Adaptations and evaluations of the agent before, over all variants.
    pub units: usize,
    /// Inner updates of all adaptations.
    pub updates: usize,
    /// Trainings by somebody else's trainer, where that imitates.
    pub by_trainer: usize,
    /// Environment steps that adapting plays.
    pub adapting_steps: u64,
    /// Environment steps that evaluating plays.
    pub evaluating_steps: u64,
}

impl Effort {
    /// Judging so many demonstrations of a task; `inner` is `None` where somebody else's trainer imitates, and `starts_anew`
    /// says that each repeat starts from a policy of its own ([`Start::Untrained`](super::Start::Untrained)).
    pub fn of(
        demonstrations: usize,
        task: &Specification,
        judging: &Judging,
        inner: Option<&InnerUpdate>,
        starts_anew: bool,
    ) -> Self {
        let (variants, repeats) = (task.variants.len(), judging.repeats.max(judging.most_repeats));
        let contested = race::most_contested(demonstrations).min(demonstrations);
        let further = contested * (repeats - judging.repeats);
        let adaptations = (demonstrations * judging.repeats + further) * variants;
        let starts = if starts_anew { repeats } else { 1 } * variants;
        let updates = inner.map_or(0, |_| adaptations * judging.iterations);
        let steps_of_update = inner.map_or(0, |inner| inner.episodes(task.horizon) * task.horizon);
        let batches_before = inner.map_or(0, |inner| judging.scoring_batches(inner).len()) * starts;
        let units = adaptations + starts;
        Self {
            units,
            updates,
            by_trainer: if inner.is_some() { 0 } else { adaptations },
            adapting_steps: (updates * steps_of_update) as u64,
            evaluating_steps: (units * judging.episodes(task.horizon) * task.horizon
                + batches_before * steps_of_update) as u64,
        }
    }

    /// With so many demonstrations looked at afterward, where the set is so large that [`judge`] leaves that out.
    #[must_use]
    pub fn and_looking_at(
        self,
        demos: usize,
        task: &Specification,
        judging: &Judging,
        inner: &InnerUpdate,
    ) -> Self {
        let once = Judging { repeats: 1, most_repeats: 0, ..judging.clone() };
        let of = |demos| Self::of(demos, task, &once, Some(inner), false);
        let (looked, start) = (of(demos), of(0));
        Self {
            updates: self.updates + looked.updates,
            adapting_steps: self.adapting_steps + looked.adapting_steps,
            evaluating_steps: self.evaluating_steps + looked.evaluating_steps - start.evaluating_steps,
            ..self
        }
    }

    /// Environment steps in all.
    pub fn steps(&self) -> u64 {
        self.adapting_steps + self.evaluating_steps
    }
}
