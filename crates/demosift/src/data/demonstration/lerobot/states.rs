//! The simulator's states of recorded episodes: a door of their own, which nothing that judges goes through.

use std::path::Path;

use super::data_files;
use crate::basics::error::{Error, Result};
use crate::data::demonstration::parquet_table::Table;
use crate::data::trajectory::StateLog;

/// Column of generalized positions.
pub(super) const QPOS: &str = "simulator.qpos";
/// Column of generalized velocities.
pub(super) const QVEL: &str = "simulator.qvel";

/// Reads the states from which each demonstration's actions were taken, in file order; `None` if the data set has none.
///
/// # Errors
/// `is_bad_input` if a table is damaged, or not all have both columns.
pub fn read_states(path: &Path) -> Result<Option<Vec<StateLog>>> {
    read_logs(path).map_err(|error| error.at(path))
}

fn read_logs(path: &Path) -> Result<Option<Vec<StateLog>>> {
    let mut logs: Vec<StateLog> = Vec::new();
    let mut last = None;
    for (at, file) in data_files(path)?.iter().enumerate() {
        let table = Table::open(file)?;
        match (table.has(QPOS), table.has(QVEL)) {
            (true, true) => {}
            (false, false) if at == 0 => return Ok(None),
            _ => {
                return Err(Error::bad_input(format!(
                    "a state needs both '{QPOS}' and '{QVEL}', in every table of the data set"
                ))
                .at(file));
            }
        }
        let (qpos, positions) = table.doubles(QPOS)?;
        let (qvel, velocities) = table.doubles(QVEL)?;
        let indices = table.integers("episode_index")?;
        if qpos.len() != indices.len() * positions || qvel.len() != indices.len() * velocities {
            return Err(Error::bad_input("the states are not one per row").at(file));
        }
        for (row, &index) in indices.iter().enumerate() {
            if last != Some(index) {
                logs.push(StateLog::default());
            }
            last = Some(index);
            let log = logs.last_mut().expect("one was begun");
            log.qpos.extend_from_slice(&qpos[row * positions..(row + 1) * positions]);
            log.qvel.extend_from_slice(&qvel[row * velocities..(row + 1) * velocities]);
        }
    }
    Ok(Some(logs))
}
