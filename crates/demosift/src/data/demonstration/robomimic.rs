//! The HDF5 layout of robomimic: a group an episode.
//!
//! | item | shape | element | |
//! |---|---|---|---|
//! | `data/demo_<i>/actions` | `[T, act]` | f32 or f64 | |
//! | `data/demo_<i>/obs/<k>` | `[T, ·]` | f32 or f64 | an observation is split over these |
//! | `data/demo_<i>/next_obs/<k>` | `[T, ·]` | f32 or f64 | optional; its last row is the final observation |
//! | `mask/<name>` | `[n]` | strings | filter keys: named subsets |
//!
//! Unless columns are named, an observation is every `obs/<k>` with two dimensions of floats, in alphabetical order; images
//! have more dimensions and stay out.
//! Rewards and dones are never read, and states of the simulator for a replay alone.

use std::path::Path;

use hdf5_pure::{DType, File, Group};

use crate::basics::error::{Error, Result};
use crate::data::demonstration::episode::{Columns, Episode, Format, Says, Source};
use crate::data::demonstration::hdf5::{self, damaged, find, find_below, find_group};
use crate::data::demonstration::listing::ColumnSeen;
use crate::data::demonstration::named::{Named, listed};

mod recording;

pub use recording::{NamedEnvironment, Observed, Recording, environment, read_states};

const OBSERVATIONS: &str = "obs/";
const NEXT_OBSERVATIONS: &str = "next_obs/";

/// Reads the episodes in the order of their numbers, as robomimic does; `columns` names datasets below an episode's group.
///
/// # Errors
/// `is_bad_input` if the file is not of this layout or damaged; `is_io` if it may not be read.
pub(super) fn read_source(path: &Path, columns: &Columns) -> Result<Source> {
    let opened = hdf5::open(path)?;
    let root = opened.file.root();
    let data = match find_group(&root, "data")? {
        Some(data) => data,
        // Some tools leave out the group around the episodes.
        None if root.groups().map_err(damaged)?.iter().any(|name| name.starts_with("demo_")) => {
            opened.file.root()
        }
        None => return Err(hdf5::missing(&root, "data/")?),
    };
    let hdf5::NumberedGroups { names: labels, mut not_read } =
        hdf5::numbered_groups(&data, "'data'", "demo_")?;
    let first = data.group(&labels[0]).map_err(damaged)?;
    let columns = Columns {
        observations: if columns.observations.is_empty() {
            usual_observations(&first).map_err(|error| error.during(&labels[0]))?
        } else {
            columns.observations.iter().map(|name| in_full(&first, name)).collect::<Result<_>>()?
        },
        ..columns.or("", "actions")
    };
    not_read.extend(left_out(&first, &columns.observations)?);
    let episodes = labels.iter().map(|label| {
        let read = data
            .group(label)
            .map_err(damaged)
            .and_then(|group| {
                let read = read_episode(&group, label, &columns, opened.file_len);
                read.map_err(|error| error.with_hint(hdf5::option_below(&group)))
            })
            .map_err(|error| error.during(label));
        (label.clone(), read)
    });
    let episodes = Episode::all_or_some(episodes.collect())?;
    let says = Says { steps_per_sec: rate(&data), action_bounds: None, file: "env_args" };
    Ok(Source { not_read, says, ..Source::new(Format::Robomimic, columns, episodes) })
}

/// Steps a second, where the description of the environment tells it; robosuite calls it `control_freq`.
fn rate(data: &Group) -> Option<f64> {
    let text = recording::text(data, "env_args").ok()??;
    let arguments: serde_json::Value = serde_json::from_str(&text).ok()?;
    arguments["env_kwargs"]["control_freq"].as_f64().filter(|rate| *rate > 0.0)
}

/// What is said of observations that are not read, and why not; `None` if all are.
fn left_out(episode: &Group, read: &[String]) -> Result<Option<String>> {
    let Some(group) = find_group(episode, "obs")? else { return Ok(None) };
    let (mut others, mut first) = (Vec::new(), None);
    let mut names = group.datasets().map_err(damaged)?;
    names.sort();
    for name in names {
        let full = format!("{OBSERVATIONS}{name}");
        if read.iter().any(|column| *column == full || Named::new(column).column == full) {
            continue;
        }
        let dataset = group.dataset(&name).map_err(damaged)?;
        let (shape, element) = (dataset.shape().map_err(damaged)?, dataset.dtype().map_err(damaged)?);
        let why = match shape.len() {
            _ if !hdf5::is_number(&element) => "no numbers".to_owned(),
            1 => "one number a step".to_owned(),
            2 => element.to_string(),
            _ => "an image".to_owned(),
        };
        if hdf5::is_number(&element) && shape.len() <= 2 {
            first.get_or_insert_with(|| full.clone());
        }
        others.push(format!("{full} ({why})"));
    }
    let way = first.map_or_else(String::new, |name| {
        format!("; what holds numbers is read by name: --observation-columns {},{name}", read.join(","))
    });
    Ok((!others.is_empty()).then(|| format!("Left out of the observation: {}{way}.", listed(others))))
}

/// All columns of the first episode.
///
/// # Errors
/// As [`read_source`].
pub(super) fn list(path: &Path, label: &str, read: &Columns) -> Result<Vec<ColumnSeen>> {
    let opened = hdf5::open(path)?;
    let root = opened.file.root();
    let data = match find_group(&root, "data")? {
        Some(data) => data,
        None => root,
    };
    hdf5::list(&data.group(label).map_err(damaged)?, read)
}

/// A column as the file names it: robomimic's own configurations leave `obs/` out.
fn in_full(episode: &Group, name: &str) -> Result<String> {
    let column = Named::new(name).column;
    let full = format!("{OBSERVATIONS}{column}");
    let is_short = find_below(episode, column)?.is_none() && find_below(episode, &full)?.is_some();
    Ok(if is_short { format!("{OBSERVATIONS}{name}") } else { name.to_owned() })
}

/// Tables of floating point; where there is none, columns of one number and integers.
fn usual_observations(episode: &Group) -> Result<Vec<String>> {
    if find(episode, "obs")?.is_some() {
        // Isaac Lab keeps all of an observation in one table, if it is asked to.
        return Ok(vec!["obs".to_owned()]);
    }
    let (mut names, mut others) = (Vec::new(), Vec::new());
    if let Some(group) = find_group(episode, "obs")? {
        for name in group.datasets().map_err(damaged)? {
            let dataset = group.dataset(&name).map_err(damaged)?;
            let flat = dataset.shape().map_err(damaged)?.len();
            let element = dataset.dtype().map_err(damaged)?;
            let of_numbers = hdf5::is_number(&element);
            let full = format!("{OBSERVATIONS}{name}");
            match element {
                DType::F32 | DType::F64 if flat == 2 => names.push(full),
                _ if of_numbers && matches!(flat, 1 | 2) => others.push(full),
                _ => {}
            }
        }
    }
    if names.is_empty() {
        names = others;
    }
    names.sort();
    if names.is_empty() {
        let error = Error::bad_input("there is no observation 'obs/<name>' [T, numbers]");
        return Err(match find(episode, "states")? {
            Some(_) => error.with_hint(
                "robomimic's dataset_states_to_obs.py adds observations to a file of states; or name columns, such as states",
            ),
            None => error.with_hint(hdf5::option_below(episode)),
        });
    }
    Ok(names)
}

fn read_episode(group: &Group, label: &str, columns: &Columns, file_len: u64) -> Result<Episode> {
    let observations = hdf5::read_columns(group, &columns.observations, file_len)?;
    let actions = hdf5::read_columns(group, &columns.actions, file_len)?;
    if observations.len() != actions.len() {
        return Err(Error::bad_input(format!(
            "there are {} observations and {} actions; wanted one observation an action",
            observations.len(),
            actions.len()
        )));
    }
    let last = last_observation(group, &columns.observations, observations.len(), file_len)?;
    Ok(Episode::new(label.to_owned(), observations, actions, last))
}

/// The last row of `next_obs`, if all columns have one there.
///
/// # Errors
/// `is_bad_input` if one is of another shape than its observations.
fn last_observation(
    group: &Group,
    names: &[String],
    steps: usize,
    file_len: u64,
) -> Result<Option<Vec<f32>>> {
    let mut row = Vec::new();
    for name in names {
        let named = Named::new(name);
        let name = named.column;
        let Some(key) = name.strip_prefix(OBSERVATIONS) else { return Ok(None) };
        let next = format!("{NEXT_OBSERVATIONS}{key}");
        let Some(dataset) = find_below(group, &next)? else { return Ok(None) };
        let table = hdf5::read_table(&dataset, &next, file_len)?;
        let width = match find_below(group, name)? {
            Some(observed) => hdf5::check_table(&observed, name, file_len)?.1,
            None => return Ok(None),
        };
        if (table.len(), table.width()) != (steps, width) {
            return Err(Error::bad_input(format!(
                "'{next}' has shape [{}, {}], and '{name}' [{steps}, {width}]; wanted the same of both",
                table.len(),
                table.width()
            )));
        }
        if table.is_empty() {
            return Ok(None);
        }
        let table = named.part_of(table)?;
        row.extend_from_slice(table.row(table.len() - 1));
    }
    Ok(Some(row))
}

/// The names of the episodes of a filter key.
///
/// # Errors
/// `is_bad_input` if the file has no such key; names those that it has.
pub(super) fn filter_key(path: &Path, name: &str) -> Result<Vec<String>> {
    let opened = hdf5::open(path)?;
    let root = opened.file.root();
    let mask = find_group(&root, "mask")?;
    let known = mask.as_ref().map_or(Ok(Vec::new()), |mask| mask.datasets().map_err(damaged))?;
    let dataset = match &mask {
        Some(mask) if known.iter().any(|key| key == name) => mask.dataset(name).map_err(damaged)?,
        _ => {
            return Err(Error::bad_input(format!(
                "there is no filter key '{name}'; the file has: {}",
                listed(&known)
            )));
        }
    };
    hdf5::check_size(&dataset, name, &dataset.shape().map_err(damaged)?, opened.file_len)?;
    dataset.read_string().map_err(damaged)
}

/// Adds a filter key to the file: a named subset, which robomimic trains on if asked for it by name.
///
/// This is the only thing here that changes a file of the user's, and it changes nothing else in it.
///
/// # Errors
/// `is_bad_input` if the file has a key of this name already, or cannot be edited.
pub fn add_filter_key(path: &Path, name: &str, labels: &[String]) -> Result<()> {
    add_key(path, name, labels).map_err(|error| error.at(path))
}

fn add_key(path: &Path, name: &str, labels: &[String]) -> Result<()> {
    if name.is_empty() || name.contains('/') {
        return Err(Error::bad_input(format!(
            "'{name}' is no name of a filter key; wanted a word without '/'"
        )));
    }
    let file = File::open_rw(path).map_err(damaged)?;
    let root = file.root();
    match find_group(&root, "mask")? {
        Some(mask) if mask.datasets().map_err(damaged)?.iter().any(|known| known == name) => {
            return Err(Error::bad_input(format!(
                "there is a filter key '{name}' already; wanted another name"
            ))
            .with_hint("--name NAME gives another name to the key"));
        }
        Some(_) => {}
        None => {
            root.create_group_with("mask", |_| {}).map_err(damaged)?;
        }
    }
    let labels: Vec<&str> = labels.iter().map(String::as_str).collect();
    let mut encoded = Ok(());
    root.create_dataset(&format!("mask/{name}"), |dataset| {
        encoded = dataset.with_ascii_strings(&labels).map(|_| ());
    })
    .map_err(damaged)?;
    encoded.map_err(|source| Error::bad_input(format!("the names cannot be stored: {source}")))?;
    file.commit().map_err(damaged)
}
