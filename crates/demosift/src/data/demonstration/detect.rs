//! Telling formats apart by looking at a file or folder.

use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use crate::basics::error::{Error, Result};
use crate::data::demonstration::source::{Format, MINARI_HDF5, RECORDED};
use crate::data::demonstration::{hdf5, lerobot, npz};

const KNOWN: &str = "known are: HDF5 files of D4RL, robomimic and Minari; npz files of baselines and imitation; \
                     folders of LeRobot (meta/info.json), Minari (data/main_data.hdf5 or data/metadata.json) \
                     and demosift (demonstrations.hdf5)";

/// The format of what lies there.
///
/// # Errors
/// `is_bad_input` if it is of none; says which are known.
pub(super) fn format(path: &Path) -> Result<Format> {
    let metadata = fs::metadata(path).map_err(|source| match source.kind() {
        std::io::ErrorKind::NotFound => {
            Error::bad_input("the demonstration file does not exist").with_hint("check the path")
        }
        _ => Error::io("cannot read the demonstrations", path, &source),
    })?;
    if metadata.is_dir() { of_folder(path) } else { of_file(path) }
}

/// The file or folder that the reader of a format takes.
pub(super) fn entry(path: &Path, format: Format) -> Result<PathBuf> {
    let folder_of_data = |named: &str| {
        if path.join("data").join(named).exists() { path.join("data") } else { path.to_owned() }
    };
    Ok(match format {
        _ if !path.is_dir() => path.to_owned(),
        Format::D4rl => path.join(RECORDED),
        Format::MinariHdf5 => folder_of_data(MINARI_HDF5).join(MINARI_HDF5),
        Format::MinariParquet => folder_of_data("metadata.json"),
        Format::LeRobotV3 | Format::LeRobotV2 => path.to_owned(),
        Format::Robomimic | Format::BaselinesNpz | Format::ImitationNpz => {
            return Err(Error::bad_input(format!(
                "this is a folder; a demonstration set in {format} is a file"
            )));
        }
    })
}

fn of_folder(path: &Path) -> Result<Format> {
    let data = path.join("data");
    if path.join(lerobot::INFO).exists() {
        lerobot::version(path)
    } else if [path, data.as_path()].iter().any(|folder| folder.join(MINARI_HDF5).exists()) {
        Ok(Format::MinariHdf5)
    } else if [path, data.as_path()].iter().any(|folder| folder.join("metadata.json").exists()) {
        Ok(Format::MinariParquet)
    } else if path.join(RECORDED).exists() {
        Ok(Format::D4rl)
    } else {
        Err(Error::bad_input(format!("this folder holds no {RECORDED}, so it is no demonstration set"))
            .with_hint(KNOWN))
    }
}

fn of_file(path: &Path) -> Result<Format> {
    let mut start = Vec::new();
    fs::File::open(path)
        .and_then(|file| file.take(8).read_to_end(&mut start))
        .map_err(|source| Error::io("cannot read the demonstrations", path, &source))?;
    if start.is_empty() {
        return Err(Error::bad_input("the file is empty; it should hold demonstrations")
            .with_hint("was it copied or downloaded completely?"));
    }
    if start.starts_with(b"PK") {
        return npz::names(path).and_then(|names| of_npz(&names));
    }
    if start.starts_with(b"PAR1") {
        return Err(Error::bad_input(
            "this is one parquet file of a data set; wanted the folder of the whole set",
        ));
    }
    // An HDF5 file may have something else before it, so its own reader looks for the signature.
    if !hdf5_pure::is_hdf5(path)
        .map_err(|source| Error::io("cannot read the demonstrations", path, &source))?
    {
        return Err(Error::bad_input("not an HDF5 file, and not an npz file either").with_hint(KNOWN));
    }
    let opened = hdf5::open(path)?;
    let groups = opened.file.root().groups().map_err(hdf5::damaged)?;
    if groups.iter().any(|name| name == "data") {
        Ok(Format::Robomimic)
    } else if groups.iter().any(|name| name.starts_with("episode_")) {
        Ok(Format::MinariHdf5)
    } else {
        // Its reader says what is missing.
        Ok(Format::D4rl)
    }
}

fn of_npz(names: &[String]) -> Result<Format> {
    let has = |wanted: &str| names.iter().any(|name| name == wanted);
    if has("acts") {
        Ok(Format::ImitationNpz)
    } else if has("acs") {
        Ok(Format::BaselinesNpz)
    } else {
        Err(Error::bad_input(format!(
            "this npz file holds neither 'acs' (baselines) nor 'acts' (imitation); it holds: {}",
            names.join(", ")
        )))
    }
}
