//! Handing on some episodes of a Minari data set with everything that it holds of them.

use std::path::Path;

use hdf5_pure::{AttrValue, File, FileBuilder};
use serde_json::{Map, Value, json};

use super::METADATA;
use crate::demonstration::hdf5::{self, damaged};
use crate::error::{Error, Result};
use crate::files;

/// Writes a new data set of some episodes of `main_data.hdf5` at `original`, numbered anew from 0, with rewards, infos and all else as
/// they are there; its spaces come from the metadata beside it.
///
/// # Errors
/// `is_bad_input` if the folder exists, an episode is not there, or the metadata is damaged; `is_io` if a file cannot be read
/// or written.
pub fn write_subset(path: &Path, original: &Path, labels: &[String], name: &str) -> Result<()> {
    let metadata = read_metadata(original)?;
    let source = hdf5::open(original).map_err(|error| error.at(original))?.file;
    let empty = FileBuilder::new().finish().map_err(damaged)?;
    let mut total_steps = 0;
    files::write_folder_by(path, |partial| {
        let failed = |what: &std::io::Error| Error::io("cannot write", path, what);
        let data = partial.join("data");
        std::fs::create_dir_all(&data).map_err(|error| failed(&error))?;
        let file_path = data.join("main_data.hdf5");
        files::write_atomically(&file_path, &empty)?;
        let copy = File::open_rw(&file_path).map_err(damaged)?;
        for (index, label) in labels.iter().enumerate() {
            let (from, to) = (format!("episode_{label}"), format!("episode_{index}"));
            let group = source.group(&from).map_err(damaged)?;
            total_steps += group.dataset("actions").and_then(|actions| actions.shape()).map_err(damaged)?[0];
            copy.copy_from(&source, &from, &to).map_err(damaged)?;
            copy.commit().map_err(damaged)?;
            let group = copy.group(&to).map_err(damaged)?;
            group.set_attr("id", AttrValue::I64(index as i64)).map_err(damaged)?;
            copy.commit().map_err(damaged)?;
        }
        drop(copy);
        let bytes = std::fs::metadata(&file_path).map_err(|error| failed(&error))?.len();
        let mut metadata = metadata.clone();
        metadata.insert("total_episodes".to_owned(), json!(labels.len()));
        metadata.insert("total_steps".to_owned(), json!(total_steps));
        metadata.insert("dataset_id".to_owned(), json!(name));
        metadata.insert("dataset_size".to_owned(), json!((bytes as f64 / 1e5).round() / 10.0));
        files::write_atomically(&data.join(METADATA), format!("{:#}\n", Value::Object(metadata)).as_bytes())
    })
}

fn read_metadata(original: &Path) -> Result<Map<String, Value>> {
    let path = original.with_file_name(METADATA);
    let bytes = std::fs::read(&path)
        .map_err(|error| Error::io("cannot read the description of the data set", &path, &error))?;
    serde_json::from_slice(&bytes).map_err(|error| {
        Error::bad_input(format!("this does not describe a Minari data set: {error}")).at(&path)
    })
}
