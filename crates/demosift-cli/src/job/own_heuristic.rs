//! What the recorded demonstrations themselves scored: a column beside the ranking, worked out after it.
//!
//! Nothing that judges could read it: it comes from the simulator's states in the file, through a door of their own.

use demosift::data::demonstration::DemonstrationSet;
use demosift::data::trajectory::StateLog;
use demosift::results::data_only::{Column, DataOnly};
use demosift::world::environment::Task as _;
use demosift::world::heuristic::Score;
use demosift::{Error, Result};
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::replay;

use crate::job::demonstrations;

/// What is shown beside a ranking.
pub(crate) struct Beside {
    /// What the scorers of the recordings say.
    pub(crate) data_only: DataOnly,
    /// What the recorded demonstrations themselves scored, if it is known.
    pub(crate) own: Option<Column>,
    /// Why it is not known, where the set holds states that this task cannot replay.
    pub(crate) unusable: Option<Error>,
}

/// Replays the demonstrations of the set from their `states`, if it holds any and the task has a simulator for them.
///
/// A ranking that took hours is worth showing without this column, so what is wrong here fails nothing.
pub(crate) fn beside(
    data_only: DataOnly,
    task: Option<&MujocoTask>,
    set: &DemonstrationSet,
    states: Result<Option<Vec<StateLog>>>,
) -> Beside {
    let (own, unusable) = match task.map(|task| scores(task, set, states)) {
        None | Some(Ok(None)) => (None, None),
        Some(Ok(Some(scores))) => (Some(column(scores)), None),
        Some(Err(error)) => (None, Some(error)),
    };
    Beside { data_only, own, unusable }
}

impl Beside {
    /// All that there is to show, the demonstrations' own heuristic last.
    pub(crate) fn columns(&self) -> impl Iterator<Item = &Column> {
        self.data_only.columns.iter().chain(&self.own)
    }
}

fn column(scores: Vec<Score>) -> Column {
    let meaning =
        "the task's heuristic of the recorded demonstration itself, under the goal that it was recorded for";
    Column { name: "heuristic".to_owned(), meaning: meaning.to_owned(), scores }
}

fn scores(
    task: &MujocoTask,
    set: &DemonstrationSet,
    states: Result<Option<Vec<StateLog>>>,
) -> Result<Option<Vec<Score>>> {
    let Some(states) = states? else { return Ok(None) };
    let scores = set.iter().map(|(id, demonstration)| {
        let states = demonstrations::states_of(&states, id)?;
        replay::measurements(task, states, demonstration.actions())
            .map(|measured| task.heuristic().score(&measured))
            .map_err(|error| error.during(&format!("demonstration {id}")))
    });
    scores.collect::<Result<_>>().map(Some)
}
