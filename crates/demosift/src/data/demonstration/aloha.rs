//! Folders of ALOHA and what records like it: a HDF5 file `episode_<i>.hdf5` an episode.
//!
//! | dataset | shape | element | |
//! |---|---|---|---|
//! | `observations/qpos` | `[T, ·]` | numbers | what is usual as the observation |
//! | `observations/qvel`, `observations/effort` | `[T, ·]` | numbers | where they are named |
//! | `action` | `[T, act]` | numbers | |
//!
//! Images (`observations/images/<camera>`) are not read. There is no final observation.

use std::fs;
use std::path::{Path, PathBuf};

use crate::basics::error::{Error, Result};
use crate::data::demonstration::episode::{Columns, Episode, Format, Source, trailing_number};
use crate::data::demonstration::hdf5;

/// Reads the files of a folder in the order of their numbers; `columns` names datasets.
///
/// # Errors
/// `is_bad_input` if the folder holds no such file or one is damaged; `is_io` if it may not be read.
pub(super) fn read_source(path: &Path, columns: &Columns) -> Result<Source> {
    let columns = columns.or("observations/qpos", "action");
    let mut read = Vec::new();
    for file in files(path)? {
        let label = file
            .file_stem()
            .and_then(|stem| trailing_number(&stem.to_string_lossy()))
            .map_or_else(String::new, |number| number.to_string());
        let episode = read_episode(&file, &label, &columns).map_err(|error| error.at(&file));
        read.push((label, episode));
    }
    Ok(Source::new(Format::Aloha, columns, Episode::all_or_some(read)?))
}

fn read_episode(path: &Path, label: &str, columns: &Columns) -> Result<Episode> {
    let opened = hdf5::open(path)?;
    let root = opened.file.root();
    let observations = hdf5::read_columns(&root, &columns.observations, opened.file_len)?;
    let actions = hdf5::read_columns(&root, &columns.actions, opened.file_len)?;
    if observations.len() != actions.len() {
        return Err(Error::bad_input(format!(
            "there are {} observations and {} actions; wanted one observation an action",
            observations.len(),
            actions.len()
        )));
    }
    Ok(Episode::new(label.to_owned(), observations, actions, None))
}

/// Whether a file is called as one of an episode.
pub(super) fn is_episode(path: &Path) -> bool {
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let is_hdf5 = path.extension().is_some_and(|extension| extension == "hdf5" || extension == "h5");
    is_hdf5 && stem.strip_prefix("episode_").is_some_and(|number| number.parse::<u64>().is_ok())
}

/// The files of the episodes by their numbers, at least one.
///
/// # Errors
/// `is_bad_input` if there is none; `is_io` if the folder cannot be listed.
pub(super) fn files(path: &Path) -> Result<Vec<PathBuf>> {
    let failed = |source: std::io::Error| Error::io("cannot look into the data set", path, &source);
    let mut files = Vec::new();
    for entry in fs::read_dir(path).map_err(failed)? {
        let file = entry.map_err(failed)?.path();
        if is_episode(&file) {
            files.push(file);
        }
    }
    if files.is_empty() {
        return Err(Error::bad_input("the folder holds no episode_<number>.hdf5"));
    }
    files.sort_by_cached_key(|file| {
        (file.file_stem().and_then(|stem| trailing_number(&stem.to_string_lossy())), file.clone())
    });
    Ok(files)
}
