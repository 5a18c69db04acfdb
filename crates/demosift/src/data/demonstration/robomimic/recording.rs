//! What a file of robomimic says of the simulator in which it was recorded: which environment that was, and the states that
//! each episode went through.
//!
//! | item | shape | element | |
//! |---|---|---|---|
//! | `data@env_args` | | text | JSON: `env_name`, `type`, `env_kwargs` and often `env_version` |
//! | `data/demo_<i>@model_file` | | text | the model in which it was recorded |
//! | `data/demo_<i>/states` | `[T, ·]` | f64 | time, positions and velocities before each action |
//!
//! They say nothing of how well an episode went; with the environment it can be played again from its first state.

use std::path::Path;

use hdf5_pure::{AttrValue, Group};
use serde::{Deserialize, Serialize};

use super::{OBSERVATIONS, in_full, usual_observations};
use crate::basics::error::{Error, Result};
use crate::data::demonstration::episode::Source;
use crate::data::demonstration::hdf5::{self, damaged, find, find_group};
use crate::data::demonstration::named::Named;

/// The environment that a file names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedEnvironment {
    /// `env_args`, as it stands in the file: JSON.
    pub arguments: String,
    /// What an observation is made of, in its order.
    pub observed: Vec<Observed>,
    /// Steps of the longest episode.
    pub longest: usize,
}

/// A part of an observation.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Observed {
    /// The name of the environment's observation, without `obs/`.
    pub key: String,
    /// Which of its numbers are meant, where it is not all of them: the first, and the one after the last, if not to the end.
    pub part: Option<(usize, Option<usize>)>,
}

/// The states that an episode went through, with what acted on them.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// The model, as the simulator reads it, where the file keeps one.
    pub model: Option<String>,
    /// Time, positions and velocities before each action, `[T][·]`.
    pub states: Vec<Vec<f64>>,
    /// `[T][act]`, with all the bits that are stored.
    pub actions: Vec<Vec<f64>>,
}

/// The environment in which a file says that it was recorded, and what of it `columns` name; without any, what is usual.
///
/// # Errors
/// `is_bad_input` if the file names none, a column is none of the environment's observations, or the file is damaged; `is_io`
/// if it may not be read.
pub fn environment(path: &Path, columns: &[String]) -> Result<NamedEnvironment> {
    read_environment(path, columns).map_err(|error| error.at(path))
}

fn read_environment(path: &Path, columns: &[String]) -> Result<NamedEnvironment> {
    let opened = hdf5::open(path)?;
    let root = opened.file.root();
    let data = find_group(&root, "data")?.ok_or_else(|| unnamed("there is no group 'data'"))?;
    let arguments = text(&data, "env_args")?.ok_or_else(|| unnamed("'data' has no attribute env_args"))?;
    let hdf5::NumberedGroups { names: labels, .. } = hdf5::numbered_groups(&data, "'data'", "demo_")?;
    let first = data.group(&labels[0]).map_err(damaged)?;
    let columns = match columns {
        [] => usual_observations(&first).map_err(|error| error.during(&labels[0]))?,
        named => named.iter().map(|name| in_full(&first, name)).collect::<Result<_>>()?,
    };
    let observed = columns.iter().map(|column| {
        let named = Named::new(column);
        let key = named.column.strip_prefix(OBSERVATIONS).ok_or_else(|| {
            Error::bad_input(format!(
                "'{column}' is none of the observations of the environment that the set names; wanted '{OBSERVATIONS}<name>'"
            ))
            .with_hint("name an environment of your own that makes such observations: --env my_env.py:make")
        })?;
        Ok(Observed { key: key.to_owned(), part: named.part() })
    });
    let observed = observed.collect::<Result<_>>()?;
    let mut longest = 0;
    for label in &labels {
        let group = data.group(label).map_err(damaged)?;
        if let Some(actions) = find(&group, "actions")? {
            longest = longest.max(hdf5::check_table(&actions, "actions", opened.file_len)?.0);
        }
    }
    Ok(NamedEnvironment { arguments, observed, longest })
}

fn unnamed(why: &str) -> Error {
    Error::bad_input(format!("the set names no environment: {why}"))
        .with_hint("name it yourself, such as --env my_env.py:make")
}

/// The states of each episode of a file by its position; `None` where an episode has none, or is not among those of `source`.
/// At most `most` of them are read.
///
/// # Errors
/// `is_bad_input` if the file is damaged, or an episode has not one state for each action; `is_io` if it may not be read.
pub fn read_states(path: &Path, source: &Source, most: usize) -> Result<Vec<Option<Recording>>> {
    let opened = hdf5::open(path)?;
    let root = opened.file.root();
    let data = match find_group(&root, "data")? {
        Some(data) => data,
        None => root,
    };
    let hdf5::NumberedGroups { names: labels, .. } = hdf5::numbered_groups(&data, "'data'", "demo_")?;
    let (mut found, mut count) = (Vec::with_capacity(labels.len()), 0);
    for (position, label) in labels.iter().enumerate() {
        let is_chosen = count < most && source.ids.iter().any(|id| id.0 == position);
        let group = data.group(label).map_err(damaged)?;
        let recording = match is_chosen {
            true => recording(&group, source, opened.file_len).map_err(|error| error.during(label))?,
            false => None,
        };
        count += usize::from(recording.is_some());
        found.push(recording);
    }
    Ok(found)
}

fn recording(group: &Group, source: &Source, file_len: u64) -> Result<Option<Recording>> {
    let Some(states) = find(group, "states")? else { return Ok(None) };
    let states = hdf5::rows_in_full(&states, "states", file_len)?;
    let actions = hdf5::read_columns_in_full(group, &source.columns.actions, file_len)?;
    if states.len() != actions.len() {
        return Err(Error::bad_input(format!(
            "there are {} states and {} actions; wanted one state an action",
            states.len(),
            actions.len()
        )));
    }
    Ok(Some(Recording { model: text(group, "model_file")?, states, actions }))
}

/// The text of an attribute, if it is there and is one.
pub(super) fn text(group: &Group, name: &str) -> Result<Option<String>> {
    let mut attributes = group.attrs().map_err(damaged)?;
    Ok(match attributes.remove(name) {
        Some(AttrValue::String(text) | AttrValue::AsciiString(text)) => Some(text),
        Some(AttrValue::VarLenString(text) | AttrValue::VarLenAsciiString(text)) => Some(text),
        Some(AttrValue::StringSized { value, .. } | AttrValue::AsciiStringSized { value, .. }) => Some(value),
        _ => None,
    })
}
