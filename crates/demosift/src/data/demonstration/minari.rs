//! Minari data sets, in HDF5 or parquet.
//!
//! HDF5 is one file, `data/main_data.hdf5`, with a group `episode_<i>` each:
//!
//! | dataset | shape | element | |
//! |---|---|---|---|
//! | `observations` | `[T+1, obs]` | f32 or f64 | a group of such where the observation space is a dictionary or tuple |
//! | `actions` | `[T, act]` | f32 or f64 | the same |
//!
//! Parquet is a folder `data/<i>` each, whose tables have T+1 rows; what the last row says of an action is padding.
//! Unless columns are named, the parts of a dictionary stand in alphabetical order, as Gymnasium flattens it.
//! The final observation is no pair with an action, so no demonstration holds it.
//! Rewards, terminations and infos are never read.

use std::fs;
use std::path::{Path, PathBuf};

use hdf5_pure::Group;
use serde::Deserialize;

use crate::basics::error::{Error, Result};
use crate::basics::files;
use crate::data::demonstration::episode::{Columns, Episode, Format, Says, Source, trailing_number};
use crate::data::demonstration::hdf5::{self, damaged, find, find_below, find_group};
use crate::data::demonstration::named::{json_in_words, listed};
use crate::data::demonstration::parquet_table::{self, Table};
use crate::data::demonstration::pointer;
use crate::math::rows::Rows;

mod seeds;
mod subset;
mod writing;

pub use seeds::{Seeded, seeds};
pub use subset::write_subset;
pub use writing::write;

/// What a data set says of itself.
const METADATA: &str = "metadata.json";

/// What is needed of [`METADATA`].
#[derive(Deserialize)]
struct Counts {
    total_episodes: Option<usize>,
    total_steps: Option<usize>,
}

/// How the episodes are stored.
#[derive(Deserialize)]
struct Stored {
    data_format: Option<String>,
}

/// Nesting of spaces that is followed; nobody nests deeper.
const DEEPEST: usize = 8;

/// What a layout with a group an episode and one observation more than actions calls its parts.
struct Layout {
    format: Format,
    /// A group's name without its number.
    group: &'static str,
    observations: &'static str,
    actions: &'static str,
}

/// Reads `main_data.hdf5`; `columns` names datasets below an episode's group.
///
/// # Errors
/// `is_bad_input` if the file is not of this layout or damaged; `is_io` if it may not be read.
pub(super) fn read_hdf5(path: &Path, columns: &Columns) -> Result<Source> {
    let layout = Layout {
        format: Format::MinariHdf5,
        group: "episode_",
        observations: "observations",
        actions: "actions",
    };
    let source = read_groups(path, columns, &layout)?;
    let metadata = path.with_file_name(METADATA);
    check_counts(&metadata, &source.episodes)?;
    Ok(Source { says: says(&metadata), ..source })
}

/// Reads a trajectory file of ManiSkill: groups `traj_<i>` with `obs`, a table or a dictionary, and `actions`.
///
/// # Errors
/// As [`read_hdf5`].
pub(super) fn read_maniskill(path: &Path, columns: &Columns) -> Result<Source> {
    let layout =
        Layout { format: Format::ManiSkill, group: "traj_", observations: "obs", actions: "actions" };
    read_groups(path, columns, &layout).map_err(|error| {
        error.with_hint(
            "python -m mani_skill.trajectory.replay_trajectory --traj-path FILE -o state --save-traj writes observations as \
             one table",
        )
    })
}

fn read_groups(path: &Path, columns: &Columns, layout: &Layout) -> Result<Source> {
    let opened = hdf5::open(path)?;
    let root = opened.file.root();
    let prefix = layout.group;
    let hdf5::NumberedGroups { names, not_read } = hdf5::numbered_groups(&root, "the file", prefix)?;
    let first = root.group(&names[0]).map_err(damaged)?;
    let mut observed = usual(&first, &columns.observations, layout.observations)?;
    let mut not_read = not_read;
    if columns.observations.is_empty() {
        not_read.extend(leave_out_what_is_no_number(&first, &mut observed)?);
    }
    let columns =
        Columns { observations: observed, actions: usual(&first, &columns.actions, layout.actions)? };
    let episodes = names.iter().map(|name| {
        let label = trailing_number(name).map_or_else(|| name.clone(), |number| number.to_string());
        let read = || {
            let group = root.group(name).map_err(damaged)?;
            let observations = hdf5::read_columns(&group, &columns.observations, opened.file_len)?;
            let actions = hdf5::read_columns(&group, &columns.actions, opened.file_len)?;
            Episode::with_last(label.clone(), &observations, actions)
        };
        (label.clone(), read().map_err(|error| error.during(name)))
    });
    let episodes = Episode::all_or_some(episodes.collect())?;
    Ok(Source { not_read, ..Source::new(layout.format, columns, episodes) })
}

/// The columns that were named, or all below `name`.
fn usual(episode: &Group, named: &[String], name: &str) -> Result<Vec<String>> {
    if !named.is_empty() {
        return Ok(named.to_vec());
    }
    let mut names = Vec::new();
    match find_group(episode, name)? {
        Some(group) => leaves(&group, name, DEEPEST, &mut names)?,
        None => names.push(name.to_owned()),
    }
    Ok(names)
}

/// Leaves images and words out of an observation in parts, and says so; what has nothing else is left as it is, for its error.
fn leave_out_what_is_no_number(episode: &Group, observed: &mut Vec<String>) -> Result<Option<String>> {
    let (mut numbers, mut others) = (Vec::new(), Vec::new());
    for path in observed.iter() {
        let Some(dataset) = find_below(episode, path)? else { return Ok(None) };
        let (shape, element) = (dataset.shape().map_err(damaged)?, dataset.dtype().map_err(damaged)?);
        match shape.len() {
            _ if !hdf5::is_number(&element) => others.push(format!("{path} (no numbers)")),
            0..=2 => numbers.push(path.clone()),
            _ => others.push(format!("{path} (an image or a table a step)")),
        }
    }
    if numbers.is_empty() || others.is_empty() {
        return Ok(None);
    }
    *observed = numbers;
    Ok(Some(format!("Left out of the observation: {}.", listed(&others))))
}

/// Paths of all datasets below a group, in alphabetical order and tuples in theirs.
fn leaves(group: &Group, path: &str, deepest: usize, found: &mut Vec<String>) -> Result<()> {
    let mut names = group.datasets().map_err(damaged)?;
    names.extend(group.groups().map_err(damaged)?);
    names.sort_by_key(|name| (name.strip_prefix("_index_").and_then(trailing_number), name.clone()));
    for name in names {
        let path = format!("{path}/{name}");
        if find(group, &name)?.is_some() {
            found.push(path);
        } else if deepest == 0 {
            return Err(Error::bad_input(format!(
                "'{path}' is nested too deeply; wanted at most {DEEPEST} groups"
            )));
        } else {
            leaves(&group.group(&name).map_err(damaged)?, &path, deepest - 1, found)?;
        }
    }
    Ok(())
}

/// Refuses a data set whose `metadata.json` names another storage than the one that is looked for.
///
/// # Errors
/// `is_bad_input` if it does; says what is missing or how to go on.
pub(super) fn check_storage(data: &Path) -> Result<()> {
    let file = data.join(METADATA);
    let stored: Option<Stored> =
        files::read(&file).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok());
    match stored.and_then(|stored| stored.data_format).as_deref() {
        Some("hdf5") => Err(Error::bad_input(format!(
            "{METADATA} says that the episodes are in main_data.hdf5, and that is missing"
        ))
        .with_hint("was the whole folder copied or downloaded?")
        .at(data)),
        Some("arrow") => Err(Error::bad_input(
            "this Minari data set is stored as Arrow files, which are not read; wanted hdf5 or parquet",
        )
        .with_hint(
            "minari.DataCollector(env, data_format=\"hdf5\") records in HDF5; or write observations and actions by the ten lines \
             of docs/formats.md",
        )
        .at(data)),
        _ => Ok(()),
    }
}

/// Reads the folders of a data folder; `columns` names columns, with `/` into a dictionary.
///
/// # Errors
/// `is_bad_input` if it is not of this layout or damaged; `is_io` if it may not be read.
pub(super) fn read_parquet(path: &Path, columns: &Columns) -> Result<Source> {
    check_storage(path)?;
    let folders = episode_folders(path)?;
    let mut resolved = columns.or("observations", "actions");
    let mut episodes = Vec::with_capacity(folders.len());
    for (index, (number, folder)) in folders.iter().enumerate() {
        let mut observations = Vec::new();
        let mut actions = Vec::new();
        for file in parquet_table::files_below(folder)? {
            let table = Table::open(&file)?;
            let read = |names: &[String]| table.floats_side_by_side(names).map_err(|error| error.at(&file));
            if index == 0 {
                resolved.observations = table.leaves(&resolved.observations);
                resolved.actions = table.leaves(&resolved.actions);
            }
            observations.push(read(&resolved.observations)?);
            actions.push(read(&resolved.actions)?);
        }
        let both =
            stacked(observations, "observations").and_then(|all| Ok((all, stacked(actions, "actions")?)));
        let (Some(observations), Some(padded)) = both.map_err(|error| error.at(folder))? else {
            return Err(Error::bad_input("there is no parquet file in this folder of an episode").at(folder));
        };
        let actions = padded.head(padded.len().saturating_sub(1));
        episodes.push(
            Episode::with_last(number.to_string(), &observations, actions)
                .map_err(|error| error.at(folder))?,
        );
    }
    let metadata = path.join(METADATA);
    check_counts(&metadata, &episodes)?;
    Ok(Source { says: says(&metadata), ..Source::new(Format::MinariParquet, resolved, episodes) })
}

/// Refuses a data set that holds more or less than the file beside it says, if there is one.
fn check_counts(metadata: &Path, episodes: &[Episode]) -> Result<()> {
    pointer::refuse(metadata)?;
    let bytes = match fs::read(metadata) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        Err(error) => {
            return Err(Error::io("cannot read the description of the data set", metadata, &error));
        }
    };
    let counts: Counts = serde_json::from_slice(&bytes).map_err(|error| {
        let words = json_in_words(&error);
        Error::bad_input(format!("this does not describe a Minari data set: {words}")).at(metadata)
    })?;
    // What could not be read is named when somebody wants to learn from it.
    if episodes.iter().any(|episode| episode.unreadable.is_some()) {
        return Ok(());
    }
    let steps = episodes.iter().map(|episode| episode.actions.len()).sum();
    for (what, claimed, found) in
        [("episodes", counts.total_episodes, episodes.len()), ("steps", counts.total_steps, steps)]
    {
        if let Some(claimed) = claimed
            && claimed != found
        {
            return Err(Error::bad_input(format!(
                "{METADATA} says {claimed} {what}, and the data set holds {found}"
            ))
            .with_hint("was the whole folder copied?"));
        }
    }
    Ok(())
}

/// Where actions lie by the box that the metadata describe; nothing where it is none, or has no ends.
fn says(metadata: &Path) -> Says {
    let bounds = || {
        #[derive(Deserialize)]
        struct Spaces {
            action_space: Option<String>,
        }
        let spaces: Spaces = serde_json::from_slice(&fs::read(metadata).ok()?).ok()?;
        // JSON in a string, in which infinity is a bare word.
        let text = spaces.action_space?.replace("-Infinity", "null").replace("Infinity", "null");
        let space: serde_json::Value = serde_json::from_str(&text).ok()?;
        let (low, high) = (flat(&space["low"])?, flat(&space["high"])?);
        let bounds: Vec<[f64; 2]> = low.into_iter().zip(high).map(|(low, high)| [low, high]).collect();
        (space["type"] == "Box" && !bounds.is_empty()).then_some(bounds)
    };
    Says { steps_per_sec: None, action_bounds: bounds(), file: METADATA }
}

/// All numbers of an array, whatever its shape; `None` if one is missing.
fn flat(array: &serde_json::Value) -> Option<Vec<f64>> {
    let each = array.as_array()?.iter().map(|entry| match entry.as_f64() {
        Some(number) => Some(vec![number]),
        None => flat(entry),
    });
    each.collect::<Option<Vec<_>>>().map(|numbers| numbers.concat())
}

/// Tables one below the other; those of one episode that was written in parts.
///
/// # Errors
/// `is_bad_input` if they differ in width.
fn stacked(tables: Vec<Rows>, what: &str) -> Result<Option<Rows>> {
    let mut tables = tables.into_iter();
    let Some(mut all) = tables.next() else { return Ok(None) };
    for next in tables {
        if next.width() != all.width() {
            return Err(Error::bad_input(format!(
                "the {what} of an episode have {} numbers a step in one of its files and {} in another; wanted as many in each",
                all.width(),
                next.width()
            )));
        }
        all.append(&next);
    }
    Ok(Some(all))
}

/// All parquet files, episode by episode.
pub(super) fn parquet_files(path: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for (_, folder) in episode_folders(path)? {
        files.extend(parquet_table::files_below(&folder)?);
    }
    Ok(files)
}

/// The folders `0`, `1`, … by their numbers, at least one.
fn episode_folders(path: &Path) -> Result<Vec<(u64, PathBuf)>> {
    let failed = |source: std::io::Error| Error::io("cannot look into the data set", path, &source);
    let mut folders = Vec::new();
    for entry in fs::read_dir(path).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        if let Some(number) = entry.file_name().to_str().and_then(|name| name.parse().ok())
            && entry.path().is_dir()
        {
            folders.push((number, entry.path()));
        }
    }
    folders.sort();
    if folders.is_empty() {
        return Err(Error::bad_input(
            "the data set holds no episode; wanted folders 0, 1, … of parquet files",
        ));
    }
    Ok(folders)
}
