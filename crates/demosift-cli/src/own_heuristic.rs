//! What the recorded demonstrations themselves scored: a column beside the ranking, worked out after it.
//!
//! Nothing that judges could read it: it comes from the simulator's states in the file, through a door of their own.

use std::path::Path;

use demosift::demonstration::{DemonstrationSet, d4rl};
use demosift::environment::Task as _;
use demosift::heuristic::Score;
use demosift::select::Ranking;
use demosift::{Error, Result, metrics};
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::replay;

/// The heuristic of each demonstration of a set, in file order.
pub(crate) enum Own {
    Known(Vec<Score>),
    /// The set holds no states, or the task has no simulator that they could be states of.
    Unknown,
    /// It holds states that this task cannot replay.
    Unusable(Error),
}

impl Own {
    pub(crate) fn scores(&self) -> Option<&[Score]> {
        match self {
            Self::Known(scores) => Some(scores),
            Self::Unknown | Self::Unusable(_) => None,
        }
    }

    pub(crate) fn agreement(&self, ranking: &Ranking) -> Option<f64> {
        agreement(ranking, self.scores()?)
    }
}

/// Replays the demonstrations of the set in this file.
///
/// A ranking that took hours is worth showing without this column, so what is wrong here fails nothing.
pub(crate) fn of(task: Option<&MujocoTask>, set: &DemonstrationSet, path: &Path) -> Own {
    match task.map(|task| scores(task, set, path)) {
        None | Some(Ok(None)) => Own::Unknown,
        Some(Ok(Some(scores))) => Own::Known(scores),
        Some(Err(error)) => Own::Unusable(error),
    }
}

fn scores(task: &MujocoTask, set: &DemonstrationSet, path: &Path) -> Result<Option<Vec<Score>>> {
    let Some(states) = d4rl::read_states(path)? else { return Ok(None) };
    let scores = set.iter().zip(&states).map(|((id, demonstration), states)| {
        replay::measurements(task, states, demonstration.actions())
            .map(|measured| task.heuristic().score(&measured))
            .map_err(|error| error.during(&format!("demonstration {id}")))
    });
    scores.collect::<Result<_>>().map(Some)
}

/// Spearman's rank correlation of the suitability with these scores; `None` where either does not vary.
pub(crate) fn agreement(ranking: &Ranking, own: &[Score]) -> Option<f64> {
    let (judged, own): (Vec<Score>, Vec<Score>) =
        ranking.entries.iter().map(|entry| (entry.score, own[entry.demo.0])).unzip();
    Some(metrics::spearman(&judged, &own)).filter(|agreement| agreement.is_finite())
}
