//! Handing on some episodes of a Minari data set with everything that it holds of them.

use std::collections::BTreeMap;
use std::path::Path;

use hdf5_pure::{AttrValue, DType, Dataset, FileBuilder, Group, GroupBuilder};
use serde_json::{Map, Value, json};

use super::{DEEPEST, METADATA, writing};
use crate::basics::error::{Error, Result};
use crate::basics::files;
use crate::data::demonstration::episode::Columns;
use crate::data::demonstration::hdf5::{self, check_size, damaged};
use crate::data::demonstration::named::json_in_words;
use crate::data::demonstration::pointer;

/// Writes a new data set of some episodes of the `main_data.hdf5` at `original`, numbered again from 0, with rewards, infos and all
/// else as they are there; its spaces come from the metadata beside it, or from the tables where there is none.
///
/// # Errors
/// `is_bad_input` if the folder exists, an episode is not there, or holds what cannot be copied; `is_io` if a file cannot be
/// read or written.
pub fn write_subset(path: &Path, original: &Path, labels: &[String], name: &str) -> Result<()> {
    let mut metadata = read_metadata(original)?;
    let (bytes, steps) = copy_episodes(original, labels).map_err(|error| error.at(original))?;
    for (key, value) in [
        ("total_episodes", json!(labels.len())),
        ("total_steps", json!(steps)),
        ("dataset_id", json!(name)),
        ("dataset_size", json!((bytes.len() as f64 / 1e5).round() / 10.0)),
    ] {
        metadata.insert(key.to_owned(), value);
    }
    let metadata = format!("{:#}\n", Value::Object(metadata)).into_bytes();
    files::write_folder(path, &[("data/main_data.hdf5", bytes), ("data/metadata.json", metadata)])
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

/// The bytes of the new file, and how many actions it holds.
fn copy_episodes(original: &Path, labels: &[String]) -> Result<(Vec<u8>, u64)> {
    let opened = hdf5::open(original)?;
    let mut file = FileBuilder::new();
    let mut steps = 0;
    for (index, label) in labels.iter().enumerate() {
        let episode = opened.file.root().group(&format!("episode_{label}")).map_err(damaged)?;
        steps += count_actions(&episode).map_err(|error| error.during(&format!("episode_{label}")))?;
        let mut copy = file.create_group(&format!("episode_{index}"));
        fill(&mut copy, &episode, opened.file_len, DEEPEST)?;
        copy.set_attr("id", AttrValue::I64(index as i64));
        file.add_group(copy.finish());
    }
    Ok((file.finish().map_err(damaged)?, steps))
}

/// Each part of an action has one row a step, where it has several.
fn count_actions(episode: &Group) -> Result<u64> {
    let parts = super::usual(episode, &[], "actions")?;
    let first = parts.first().map_or("actions", String::as_str);
    let dataset =
        hdf5::find_below(episode, first)?.map_or_else(|| Err(hdf5::missing_below(episode, first)?), Ok)?;
    Ok(dataset.shape().map_err(damaged)?.first().copied().unwrap_or(0))
}

/// Copies everything in a group but the number of its episode.
fn fill(copy: &mut GroupBuilder, group: &Group, file_len: u64, deepest: usize) -> Result<()> {
    let attributes: BTreeMap<String, AttrValue> = group.attrs().map_err(damaged)?.into_iter().collect();
    attributes
        .into_iter()
        .filter(|(name, _)| name != "id")
        .for_each(|(name, value)| copy.set_attr(&name, value));
    for name in group.datasets().map_err(damaged)? {
        copy_dataset(copy, &group.dataset(&name).map_err(damaged)?, &name, file_len)?;
    }
    for name in group.groups().map_err(damaged)? {
        let Some(deeper) = deepest.checked_sub(1) else {
            return Err(Error::bad_input(format!(
                "'{name}' is nested too deeply; wanted at most {DEEPEST} groups"
            )));
        };
        let inner = group.group(&name).map_err(damaged)?;
        let mut inner_copy = copy.create_group(&name);
        fill(&mut inner_copy, &inner, file_len, deeper)?;
        copy.add_group(inner_copy.finish());
    }
    Ok(())
}

fn copy_dataset(copy: &mut GroupBuilder, dataset: &Dataset, name: &str, file_len: u64) -> Result<()> {
    let shape = dataset.shape().map_err(damaged)?;
    check_size(dataset, name, &shape, file_len)?;
    match dataset.dtype().map_err(damaged)? {
        DType::VariableLengthString => {
            let words = dataset.read_string().map_err(damaged)?;
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            copy.create_dataset(name).with_vlen_strings(&words).with_shape(&shape);
        }
        element if points_elsewhere(&element) => {
            return Err(Error::bad_input(format!(
                "'{name}' holds elements of type {element}, which cannot be copied"
            ))
            .with_hint("`demosift convert --to minari` writes observations and actions alone"));
        }
        _ => {
            let (datatype, bytes) =
                (dataset.datatype().map_err(damaged)?, dataset.read_raw().map_err(damaged)?);
            copy.create_dataset(name)
                .with_raw_data(datatype, bytes, shape.iter().product())
                .with_shape(&shape);
        }
    }
    Ok(())
}

/// Whether an element holds places in its file, which mean nothing in another one: a reference, or a part of variable length.
fn points_elsewhere(element: &DType) -> bool {
    match element {
        DType::Compound(fields) => fields.iter().any(|(_, field)| points_elsewhere(field)),
        DType::Array(base, _) => points_elsewhere(base),
        DType::VariableLengthString | DType::ObjectReference | DType::Other(_) => true,
        _ => false,
    }
}
