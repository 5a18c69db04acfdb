//! The simulator's states of recorded episodes: a door of their own, which nothing that judges goes through.

use std::path::Path;

use hdf5_pure::Group;

use super::read_ends;
use crate::basics::error::{Error, Result};
use crate::data::demonstration::hdf5::{self, check_table, damaged, find, missing};
use crate::data::trajectory::StateLog;

/// Reads the states from which each demonstration's actions were taken, in file order; `None` if the file has none.
///
/// # Errors
/// As [`read`](super::read), and `is_bad_input` if there are positions without velocities, velocities without positions,
/// or not one of each a step.
pub fn read_states(path: &Path) -> Result<Option<Vec<StateLog>>> {
    read_logs(path).map_err(|error| error.at(path))
}

fn read_logs(path: &Path) -> Result<Option<Vec<StateLog>>> {
    let hdf5::Opened { file, file_len } = hdf5::open(path)?;
    let root = file.root();
    if !root.groups().map_err(damaged)?.iter().any(|known| known == "infos") {
        return Ok(None);
    }
    let infos = root.group("infos").map_err(damaged)?;
    let positions = read_numbers(&infos, "qpos", file_len)?;
    let velocities = read_numbers(&infos, "qvel", file_len)?;
    let (positions, velocities) = match (positions, velocities) {
        (Some(positions), Some(velocities)) => (positions, velocities),
        (None, None) => return Ok(None),
        (None, _) => return Err(incomplete("qvel", "qpos")),
        (_, None) => return Err(incomplete("qpos", "qvel")),
    };
    let actions = find(&root, "actions")?.map_or_else(|| Err(missing(&root, "actions")?), Ok)?;
    let (steps, _) = check_table(&actions, "actions", file_len)?;
    for (name, table) in [("qpos", &positions), ("qvel", &velocities)] {
        if table.steps != steps {
            return Err(Error::bad_input(format!(
                "'actions' has {steps} rows but 'infos/{name}' has {}; both must have one row a step",
                table.steps
            )));
        }
    }
    let ends = read_ends(&root, steps, file_len)?.ends;
    let starts = std::iter::once(0).chain(ends.iter().copied());
    let logs = starts
        .zip(&ends)
        .map(|(start, &end)| StateLog { qpos: positions.cut(start, end), qvel: velocities.cut(start, end) });
    Ok(Some(logs.collect()))
}

/// A table in full precision: contacts of a state depend on it.
struct Table {
    values: Vec<f64>,
    steps: usize,
    width: usize,
}

impl Table {
    fn cut(&self, start: usize, end: usize) -> Vec<f64> {
        self.values[start * self.width..end * self.width].to_vec()
    }
}

fn read_numbers(infos: &Group, name: &str, file_len: u64) -> Result<Option<Table>> {
    let Some(dataset) = find(infos, name)? else { return Ok(None) };
    let (steps, width) = check_table(&dataset, &format!("infos/{name}"), file_len)?;
    let values = dataset.read_f64().map_err(damaged)?;
    if values.len() != steps * width {
        return Err(Error::bad_input(format!(
            "'infos/{name}' of {steps} rows of {width} holds {} numbers",
            values.len()
        )));
    }
    Ok(Some(Table { values, steps, width }))
}

fn incomplete(there: &str, lacking: &str) -> Error {
    Error::bad_input(format!("the file holds 'infos/{there}' but no 'infos/{lacking}'; a state needs both"))
}
