//! Demonstrations that an environment in Python plays again: as they were recorded, and how each began.

use demosift::Result;
use demosift::data::demonstration::episode::Format;
use demosift::data::demonstration::{DemonstrationSet, minari, robomimic};
use demosift_gymnasium::replay::Starts;
use demosift_gymnasium::task::GymnasiumTask;

use super::demonstrations::Opened;

/// Demonstrations with actions as the environment takes them, in its own unit, and how they began.
pub(crate) struct AsRecorded {
    pub(crate) set: DemonstrationSet,
    pub(crate) starts: Starts,
}

impl AsRecorded {
    /// Of a set that is [read as the environment takes it](Opened::read_as_taken); of how they began what is needed to play
    /// `most` of them again.
    pub(crate) fn of(task: &GymnasiumTask, opened: &Opened, most: usize) -> Result<Self> {
        let Opened { source, path, .. } = opened;
        let set = source.set_of_any_size().map_err(|error| error.at(path))?;
        let taken = |recorded: &mut Vec<Vec<f64>>| {
            recorded.iter_mut().for_each(|action| *action = source.conversion.action(action));
        };
        let starts = match source.format {
            Format::Robomimic if task.is_put() => {
                let mut recordings =
                    robomimic::read_states(path, source, most).map_err(|error| error.at(path))?;
                recordings.iter_mut().flatten().for_each(|recording| taken(&mut recording.actions));
                Starts::States(recordings)
            }
            _ => {
                let mut seeds = minari::seeds(path, source, most).map_err(|error| error.at(path))?;
                seeds.iter_mut().flatten().for_each(|seeded| taken(&mut seeded.actions));
                Starts::Seeds(seeds)
            }
        };
        Ok(Self { set, starts })
    }
}
