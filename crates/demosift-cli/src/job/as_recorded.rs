//! Demonstrations that an environment in Python plays again: as they were recorded, and how each began.

use demosift::Result;
use demosift::data::demonstration::episode::Format;
use demosift::data::demonstration::{DemonstrationSet, minari, robomimic};
use demosift_gymnasium::replay::Starts;
use demosift_gymnasium::task::GymnasiumTask;

use super::demonstrations::Opened;

/// Demonstrations as they were recorded, in the environment's own unit, and how they began.
pub(crate) struct AsRecorded {
    pub(crate) set: DemonstrationSet,
    pub(crate) starts: Starts,
}

impl AsRecorded {
    /// Reads a set; of how they began what is needed to play `most` of them again.
    pub(crate) fn of(task: &GymnasiumTask, opened: &Opened, most: usize) -> Result<Self> {
        let Opened { source, path, .. } = opened;
        let set = source.set_of_any_size().map_err(|error| error.at(path))?;
        let starts = match source.format {
            Format::Robomimic if task.is_put() => {
                Starts::States(robomimic::read_states(path, source, most).map_err(|error| error.at(path))?)
            }
            _ => Starts::Seeds(minari::seeds(path, source)?),
        };
        Ok(Self { set, starts })
    }
}
