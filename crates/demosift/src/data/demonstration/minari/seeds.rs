//! The seeds from which the episodes of a data set were recorded, which Minari keeps beside them.
//!
//! They say nothing of how well an episode went; with the environment it can be played again from them.

use std::path::Path;

use hdf5_pure::AttrValue;

use crate::basics::error::Result;
use crate::data::demonstration::episode::{Format, Source};
use crate::data::demonstration::hdf5::{self, damaged};

/// The seed of each episode by its position in the file; none of a set that is not of Minari in HDF5, or does not say.
///
/// # Errors
/// `is_bad_input` if the file is damaged; `is_io` if it may not be read.
pub fn seeds(path: &Path, source: &Source) -> Result<Vec<Option<u64>>> {
    if source.format != Format::MinariHdf5 {
        return Ok(Vec::new());
    }
    let opened = hdf5::open(path)?;
    let root = opened.file.root();
    let hdf5::NumberedGroups { names, .. } = hdf5::numbered_groups(&root, "the file", "episode_")?;
    let seed = |name: &String| {
        let attributes = root.group(name).and_then(|group| group.attrs()).map_err(damaged)?;
        Ok(attributes.get("seed").and_then(whole))
    };
    names.iter().map(seed).collect()
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
