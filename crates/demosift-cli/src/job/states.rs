//! The simulator's states of a set, where they are only beside the point: what is wrong with them is said, and stops nobody.

use std::path::Path;

use demosift::data::demonstration::episode::{Episode, Source};
use demosift::data::demonstration::open;
use demosift::data::trajectory::StateLog;
use demosift::{Error, Result};
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::replay::Replay;

use crate::console::terminal;
use crate::job::demonstrations;

/// The states of the chosen episodes, in the order of the source; `None`, with a note why, where they cannot be used. With a
/// task they are also of its model.
///
/// # Errors
/// `is_io` if the set may not be read.
pub(crate) fn usable(
    path: &Path,
    source: &Source,
    task: Option<&MujocoTask>,
) -> Result<Option<Vec<StateLog>>> {
    match of_chosen(path, source, task) {
        Err(error) if error.is_bad_input() => {
            terminal::note(&format!("the recorded states are left out: {}", error.at(path)));
            Ok(None)
        }
        states => states,
    }
}

fn of_chosen(path: &Path, source: &Source, task: Option<&MujocoTask>) -> Result<Option<Vec<StateLog>>> {
    let Some(all) = open::read_states(path, Some(source.format))? else { return Ok(None) };
    let logs: Vec<StateLog> = source
        .ids
        .iter()
        .map(|&demo| demonstrations::states_of(&all, demo).cloned())
        .collect::<Result<_>>()?;
    for (episode, log) in source.episodes.iter().zip(&logs) {
        check(episode, log, task).map_err(|error| error.during(&format!("episode {}", episode.label)))?;
    }
    Ok(Some(logs))
}

/// Whether all numbers are finite and, with a task, as many as its model has.
fn check(episode: &Episode, log: &StateLog, task: Option<&MujocoTask>) -> Result<()> {
    let steps = episode.actions.len();
    for (name, values) in [("qpos", &log.qpos), ("qvel", &log.qvel)] {
        let width = (values.len() / steps.max(1)).max(1);
        if let Some(at) = values.iter().position(|value| !value.is_finite()) {
            return Err(Error::bad_input(format!(
                "{name}[{}] at step {} is {}, and must be a finite number",
                at % width,
                at / width,
                values[at]
            )));
        }
    }
    task.map_or(Ok(()), |task| Replay::new(task, log, steps).map(|_| ()))
}
