//! The seeds from which the episodes of a data set were recorded, which Minari keeps beside them, and what acted then.
//!
//! They say nothing of how well an episode went; with the environment it can be played again from them.

use std::path::Path;

use hdf5_pure::AttrValue;

use crate::basics::error::Result;
use crate::data::demonstration::episode::{Format, Source};
use crate::data::demonstration::hdf5::{self, damaged};

/// How an episode began and what acted in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Seeded {
    /// What the environment was reset with.
    pub seed: u64,
    /// `[T][act]`, with all the bits that are stored: what 32 bits round off leads elsewhere in a long episode.
    pub actions: Vec<Vec<f64>>,
}

/// How each episode began, by its position in the file; `None` where an episode does not say, or is not among those of
/// `source`. At most `most` of them are read; none of a set that is not of Minari in HDF5.
///
/// # Errors
/// `is_bad_input` if the file is damaged; `is_io` if it may not be read.
pub fn seeds(path: &Path, source: &Source, most: usize) -> Result<Vec<Option<Seeded>>> {
    if source.format != Format::MinariHdf5 {
        return Ok(Vec::new());
    }
    let opened = hdf5::open(path)?;
    let root = opened.file.root();
    let hdf5::NumberedGroups { names, .. } = hdf5::numbered_groups(&root, "the file", "episode_")?;
    let (mut found, mut count) = (Vec::with_capacity(names.len()), 0);
    for (position, name) in names.iter().enumerate() {
        let is_chosen = count < most && source.ids.iter().any(|id| id.0 == position);
        let group = root.group(name).map_err(damaged)?;
        let attributes = group.attrs().map_err(damaged)?;
        let seeded = match attributes.get("seed").and_then(whole).filter(|_| is_chosen) {
            Some(seed) => {
                let read = hdf5::read_columns_in_full(&group, &source.columns.actions, opened.file_len);
                Some(Seeded { seed, actions: read.map_err(|error| error.during(name))? })
            }
            None => None,
        };
        count += usize::from(seeded.is_some());
        found.push(seeded);
    }
    Ok(found)
}

/// Recorders take any type of whole numbers.
fn whole(number: &AttrValue) -> Option<u64> {
    match *number {
        AttrValue::U64(number) => Some(number),
        AttrValue::U32(number) => Some(number.into()),
        AttrValue::I64(number) => number.try_into().ok(),
        AttrValue::I32(number) => number.try_into().ok(),
        _ => None,
    }
}
