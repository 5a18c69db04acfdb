//! The simulator's states of recorded episodes, whatever the format: for replays, never for what judges.

use std::path::Path;

use crate::basics::error::{Error, Result};
use crate::data::demonstration::source::Format;
use crate::data::demonstration::{d4rl, detect, lerobot};
use crate::data::trajectory::StateLog;

/// Reads the states from which each demonstration's actions were taken, in file order; `None` if the set has none that say
/// which numbers are positions and which velocities.
///
/// # Errors
/// As the reader of the format; see [`d4rl::read_states`] and [`lerobot::read_states`].
pub fn read_states(path: &Path, format: Option<Format>) -> Result<Option<Vec<StateLog>>> {
    let at = |error: Error| error.at(path);
    let format = format.map_or_else(|| detect::format(path), Ok).map_err(at)?;
    let entry = detect::entry(path, format).map_err(at)?;
    match format {
        Format::D4rl => d4rl::read_states(&entry),
        Format::LeRobotV3 | Format::LeRobotV2 => lerobot::read_states(&entry),
        _ => Ok(None),
    }
}
