//! Handing on some episodes of a Minari data set with everything that it holds of them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use hdf5_pure::{AttrValue, DType, Dataset, Datatype, FileBuilder, Group, GroupBuilder};
use serde_json::{Map, Value, json};

use super::{DEEPEST, METADATA, writing};
use crate::basics::counting::counted;
use crate::basics::error::{Error, Result};
use crate::basics::files;
use crate::data::demonstration::episode::Columns;
use crate::data::demonstration::hdf5::{self, check_size, damaged};
use crate::data::demonstration::named::json_in_words;
use crate::data::demonstration::pointer;

/// Writes a new data set of some episodes of the `main_data.hdf5` at `original`, numbered again from 0, with rewards, infos and all
/// else as they are there; its spaces come from the metadata beside it, or from the tables where there is none. Says in words what
/// could not be written as it is there.
///
/// # Errors
/// `is_bad_input` if the folder exists, an episode is not there, or holds what cannot be copied; `is_io` if a file cannot be
/// read or written.
pub fn write_subset(path: &Path, original: &Path, labels: &[String], name: &str) -> Result<Vec<String>> {
    let mut metadata = read_metadata(original)?;
    let Copied { bytes, steps, changed } =
        copy_episodes(original, labels).map_err(|error| error.at(original))?;
    for (key, value) in [
        ("total_episodes", json!(labels.len())),
        ("total_steps", json!(steps)),
        ("dataset_id", json!(name)),
        ("dataset_size", json!((bytes.len() as f64 / 1e5).round() / 10.0)),
    ] {
        metadata.insert(key.to_owned(), value);
    }
    let metadata = format!("{:#}\n", Value::Object(metadata)).into_bytes();
    files::write_folder(path, &[("data/main_data.hdf5", bytes), ("data/metadata.json", metadata)])?;
    let words = |(what, count): (String, usize)| format!("{what}, in {}", counted(count, "episode"));
    Ok(changed.into_iter().map(words).collect())
}

fn read_metadata(original: &Path) -> Result<Map<String, Value>> {
    let path = original.with_file_name(METADATA);
    pointer::refuse(&path)?;
    let bytes = match std::fs::read(&path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            return described(original).map_err(|error| error.at(original));
        }
        Err(error) => return Err(Error::io("cannot read the description of the data set", &path, &error)),
    };
    serde_json::from_slice(&bytes).map_err(|error| {
        let words = json_in_words(&error);
        Error::bad_input(format!("this does not describe a Minari data set: {words}")).at(&path)
    })
}

/// What can be said of a `main_data.hdf5` that came alone.
///
/// # Errors
/// `is_bad_input` if its observations or actions are not one table each: how Minari nests them stands in the metadata only.
fn described(original: &Path) -> Result<Map<String, Value>> {
    let source = super::read_hdf5(original, &Columns::default())?;
    if (&source.columns.observations[..], &source.columns.actions[..])
        != (&["observations".to_owned()], &["actions".to_owned()])
    {
        return Err(Error::bad_input(format!(
            "there is no {METADATA} beside this file, and its observations or actions are spread over several tables; \
             wanted the folder as Minari wrote it"
        ))
        .with_hint("`demosift convert --to minari` writes observations and actions as one table each"));
    }
    let table =
        hdf5::open(original)?.file.dataset(&format!("episode_{}/observations", source.episodes[0].label));
    let element = table.and_then(|table| table.dtype()).map_err(damaged)?;
    let element = if element == DType::F64 { "float64" } else { "float32" };
    let layout = writing::layout(&source.episodes, None, element);
    Ok(layout.into_iter().map(|(key, value)| (key.to_owned(), value)).collect())
}

/// The new file.
struct Copied {
    bytes: Vec<u8>,
    /// How many actions it holds.
    steps: u64,
    /// In words, what is not as in the original, and in how many episodes.
    changed: BTreeMap<String, usize>,
}

fn copy_episodes(original: &Path, labels: &[String]) -> Result<Copied> {
    let opened = hdf5::open(original)?;
    let mut file = FileBuilder::new();
    let (mut steps, mut changed) = (0, BTreeMap::new());
    for (index, label) in labels.iter().enumerate() {
        let episode = opened.file.root().group(&format!("episode_{label}")).map_err(damaged)?;
        steps += count_actions(&episode).map_err(|error| error.during(&format!("episode_{label}")))?;
        let mut copying = Copying { file_len: opened.file_len, changed: BTreeSet::new() };
        let mut copy = file.create_group(&format!("episode_{index}"));
        copying.fill(&mut copy, &episode, &Place { path: "", deepest: DEEPEST })?;
        copy.set_attr("id", AttrValue::I64(index as i64));
        file.add_group(copy.finish());
        for what in copying.changed {
            *changed.entry(what).or_insert(0) += 1;
        }
    }
    Ok(Copied { bytes: file.finish().map_err(damaged)?, steps, changed })
}

/// Each part of an action has one row a step, where it has several.
fn count_actions(episode: &Group) -> Result<u64> {
    let parts = super::usual(episode, &[], "actions")?;
    let first = parts.first().map_or("actions", String::as_str);
    let dataset =
        hdf5::find_below(episode, first)?.map_or_else(|| Err(hdf5::missing_below(episode, first)?), Ok)?;
    Ok(dataset.shape().map_err(damaged)?.first().copied().unwrap_or(0))
}

/// The copying of an episode.
struct Copying {
    file_len: u64,
    /// In words, what is not as in the original.
    changed: BTreeSet<String>,
}

/// A group within an episode.
struct Place<'a> {
    /// Its path with `/` at its end; empty for the episode itself.
    path: &'a str,
    /// How many groups deeper there may be others.
    deepest: usize,
}

impl Copying {
    /// Copies everything in a group but the number of its episode.
    fn fill(&mut self, copy: &mut GroupBuilder, group: &Group, place: &Place<'_>) -> Result<()> {
        let Place { path, deepest } = place;
        let (kinds, values) = (group.attr_datatypes().map_err(damaged)?, group.attrs().map_err(damaged)?);
        for (name, value) in self.attributes(kinds, values, path) {
            if !(path.is_empty() && name == "id") {
                copy.set_attr(&name, value);
            }
        }
        for name in group.datasets().map_err(damaged)? {
            self.copy_dataset(copy, &group.dataset(&name).map_err(damaged)?, &name, path)?;
        }
        for name in group.groups().map_err(damaged)? {
            let Some(deepest) = deepest.checked_sub(1) else {
                return Err(Error::bad_input(format!(
                    "'{name}' is nested too deeply; wanted at most {DEEPEST} groups"
                )));
            };
            let inner = group.group(&name).map_err(damaged)?;
            let mut inner_copy = copy.create_group(&name);
            self.fill(&mut inner_copy, &inner, &Place { path: &format!("{path}{name}/"), deepest })?;
            copy.add_group(inner_copy.finish());
        }
        Ok(())
    }

    /// The attributes of a group or dataset that can be written, by their names; the reader hands over numbers and words, and passes
    /// by what is of another kind.
    fn attributes(
        &mut self,
        kinds: impl IntoIterator<Item = (String, Datatype)>,
        values: impl IntoIterator<Item = (String, AttrValue)>,
        of: &str,
    ) -> BTreeMap<String, AttrValue> {
        let values: BTreeMap<String, AttrValue> = values.into_iter().collect();
        for (name, kind) in kinds {
            let what = format!("the attribute '{of}{name}'");
            if !values.contains_key(&name) {
                self.changed.insert(format!("{what} is of a kind that cannot be copied and is left out"));
            } else if let Datatype::Enumeration { .. } = kind {
                self.changed.insert(format!("{what} is written as its number, such as 1 for true"));
            }
        }
        values
    }

    /// Copies a dataset. One without a value, as h5py's `Empty` is, cannot be written, and is left out.
    fn copy_dataset(
        &mut self,
        copy: &mut GroupBuilder,
        dataset: &Dataset,
        name: &str,
        path: &str,
    ) -> Result<()> {
        let shape = dataset.shape().map_err(damaged)?;
        check_size(dataset, name, &shape, self.file_len)?;
        let element = dataset.dtype().map_err(damaged)?;
        let (kinds, values) = (dataset.attr_datatypes().map_err(damaged)?, dataset.attrs().map_err(damaged)?);
        let attributes = self.attributes(kinds, values, &format!("{path}{name}/"));
        let nothing = format!("'{path}{name}' holds no value and is left out");
        let copied = if element == DType::VariableLengthString {
            let words = dataset.read_string().map_err(damaged)?;
            if is_without_a_value(&shape, words.len()) {
                self.changed.insert(nothing);
                return Ok(());
            }
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            copy.create_dataset(name).with_vlen_strings(&words)
        } else {
            let datatype = dataset.datatype().map_err(damaged)?;
            if points_elsewhere(&datatype) {
                return Err(Error::bad_input(format!(
                    "'{name}' holds elements of type {element}, which cannot be copied"
                ))
                .with_hint("`demosift convert --to minari` writes observations and actions alone"));
            }
            let bytes = dataset.read_raw().map_err(damaged)?;
            if is_without_a_value(&shape, bytes.len()) {
                self.changed.insert(nothing);
                return Ok(());
            }
            copy.create_dataset(name).with_raw_data(datatype, bytes, shape.iter().product())
        };
        copied.with_shape(&shape);
        for (name, value) in attributes {
            copied.set_attr(&name, value);
        }
        Ok(())
    }
}

/// What has no dimensions is one value, or none, of which nothing can be read.
fn is_without_a_value(shape: &[u64], read: usize) -> bool {
    shape.is_empty() && read == 0
}

/// Whether an element holds places in its file, which mean nothing in another one: a reference, or a part of variable length.
fn points_elsewhere(kind: &Datatype) -> bool {
    match kind {
        Datatype::Compound { members, .. } => members.iter().any(|member| points_elsewhere(&member.datatype)),
        Datatype::Array { base_type, .. } => points_elsewhere(base_type),
        Datatype::FixedPoint { .. }
        | Datatype::FloatingPoint { .. }
        | Datatype::Time { .. }
        | Datatype::String { .. }
        | Datatype::BitField { .. }
        | Datatype::Opaque { .. }
        | Datatype::Enumeration { .. } => false,
        _ => true,
    }
}
