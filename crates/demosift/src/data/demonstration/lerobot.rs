//! LeRobot data sets: a folder of parquet tables with `meta/info.json`.
//!
//! | column of `data/**/*.parquet` | a row | element | |
//! |---|---|---|---|
//! | `observation.state` | list | f32 or f64 | what is usual as the observation |
//! | `action` | list | f32 or f64 | |
//! | `episode_index` | number | i64 | which episode the row is of |
//! | `frame_index` | number | i64 | its step |
//! | `timestamp` | number | f32 or f64 | when it was recorded, s; for checks only |
//! | `simulator.qpos`, `simulator.qvel` | list | f64 | written by demosift where known; for replays, see [`read_states`] |
//!
//! Versions 3.0 and 2.x differ in how rows are spread over files, which reading need not know.
//! An episode has T rows and no final observation.
//! Rewards and what the tables say of success are never read, nor are images.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::basics::error::{Error, Result};
use crate::basics::files;
use crate::data::demonstration::episode::{Columns, Episode, Format, Says, Source};
use crate::data::demonstration::listing::{ColumnSeen, Used};
use crate::data::demonstration::named::json_in_words;
use crate::data::demonstration::parquet_ragged::Ragged;
use crate::data::demonstration::parquet_table::{self, Table};
use crate::data::demonstration::pointer;
use crate::math::rows::Rows;

mod camera_statistics;
mod description;
mod states;
mod videos;
mod writing;

pub use description::{Described, description};
pub use states::read_states;
pub use videos::Videos;
pub use writing::write;

/// The file that makes a folder a LeRobot data set.
pub(super) const INFO: &str = "meta/info.json";
/// Longer descriptions of a data set do not occur.
const LONGEST_INFO: u64 = 1 << 24;

/// What is needed of `meta/info.json`.
#[derive(Deserialize)]
struct Info {
    codebase_version: String,
    total_episodes: Option<usize>,
    total_frames: Option<usize>,
    fps: Option<f64>,
    robot_type: Option<String>,
    #[serde(default)]
    features: BTreeMap<String, Feature>,
}

impl Info {
    /// Steps a second, if that means something.
    fn rate(&self) -> Option<f64> {
        self.fps.filter(|rate| rate.is_finite() && *rate > 0.0)
    }
}

/// What a data set says of one of its columns.
#[derive(Deserialize)]
struct Feature {
    #[serde(default)]
    dtype: String,
    #[serde(default)]
    shape: Vec<u64>,
    #[serde(default)]
    names: serde_json::Value,
}

/// Which version of the layout a folder is of.
///
/// # Errors
/// `is_bad_input` if it is of another than 2.0, 2.1 or 3.0.
pub(super) fn version(path: &Path) -> Result<Format> {
    format_of(&read_info(path)?).map_err(|error| error.at(&path.join(INFO)))
}

fn format_of(info: &Info) -> Result<Format> {
    match info.codebase_version.as_str() {
        "v3.0" => Ok(Format::LeRobotV3),
        "v2.0" | "v2.1" => Ok(Format::LeRobotV2),
        other => Err(Error::bad_input(format!(
            "this LeRobot data set is of version '{other}'; wanted v3.0, v2.1 or v2.0"
        ))),
    }
}

fn read_info(path: &Path) -> Result<Info> {
    let file = path.join(INFO);
    let failed = |source: std::io::Error| match source.kind() {
        std::io::ErrorKind::NotFound => {
            Error::bad_input(format!("there is no {INFO}, so this is no LeRobot data set")).at(path)
        }
        _ => Error::io("cannot read the description of the data set", &file, &source),
    };
    pointer::refuse(&file)?;
    let len = fs::metadata(&file).map_err(failed)?.len();
    if len > LONGEST_INFO {
        return Err(
            Error::bad_input(format!("{len} bytes are too long; wanted at most {LONGEST_INFO}")).at(&file)
        );
    }
    serde_json::from_str(&files::read_text(&file, "the description of the data set")?).map_err(|error| {
        let words = json_in_words(&error);
        Error::bad_input(format!("this does not describe a LeRobot data set: {words}")).at(&file)
    })
}

/// Reads the episodes; `columns` names columns of the tables.
///
/// # Errors
/// `is_bad_input` if the folder is not of this layout, is damaged, or holds other rows than it says; `is_io` if it may not
/// be read.
pub(super) fn read_source(path: &Path, columns: &Columns) -> Result<Source> {
    let info = read_info(path)?;
    let format = format_of(&info).map_err(|error| error.at(&path.join(INFO)))?;
    let columns = columns.or("observation.state", "action");
    let mut read = Read { episodes: Vec::new(), last: None, frames: 0 };
    for file in data_files(path)? {
        let table = Table::open(&file)?;
        append(&mut read, &table, &columns, &file).map_err(|error| error.at(&file))?;
    }
    let Read { episodes, frames, .. } = read;
    let mut episodes = without_unreadable(episodes)?;
    if info.total_episodes.is_some_and(|claimed| claimed > episodes.len()) {
        for index in empty_episodes(path) {
            let number = |episode: &Episode| episode.label.parse().unwrap_or(i64::MAX);
            if let Err(place) = episodes.binary_search_by_key(&index, number) {
                episodes.insert(place, empty(index, &Rows::default(), &Rows::default()));
            }
        }
    }
    for (what, claimed, found) in
        [("episodes", info.total_episodes, episodes.len()), ("frames", info.total_frames, frames)]
    {
        if claimed.is_some_and(|claimed| claimed != found) {
            return Err(Error::bad_input(format!(
                "{INFO} says {} {what}, and the tables hold {found}",
                claimed.unwrap_or(0)
            ))
            .with_hint("was the whole folder copied?"));
        }
    }
    let says = Says { steps_per_sec: info.rate(), action_bounds: None, file: INFO };
    let no_rate = info.fps.filter(|_| info.rate().is_none());
    let not_read =
        no_rate.map(|rate| format!("{INFO} says fps = {rate}, which is no rate, so none is known"));
    let not_read = not_read.into_iter().collect();
    Ok(Source { says, not_read, ..Source::new(format, columns, episodes) })
}

/// All columns, with those that are not in the tables, such as videos.
///
/// # Errors
/// As [`read_source`].
pub(super) fn list(path: &Path, read: &Columns) -> Result<Vec<ColumnSeen>> {
    let info = read_info(path)?;
    let mut seen = match data_files(path)?.first() {
        Some(file) => Table::open(file)?.list(read),
        None => Vec::new(),
    };
    for column in &mut seen {
        column.shape = info.features.get(&column.name).map(|feature| feature.shape.clone());
    }
    for (name, Feature { dtype, shape, .. }) in info.features {
        if !seen.iter().any(|column| column.name == name) {
            let is_image = dtype.contains("video") || dtype.contains("image");
            let used = if is_image { Used::Image } else { Used::NotThere };
            seen.push(ColumnSeen { name, shape: Some(shape), kind: dtype, used });
        }
    }
    Ok(seen)
}

/// Episodes that were recorded without a step: the tables hold nothing of them, and only the list of episodes tells.
fn empty_episodes(path: &Path) -> Vec<i64> {
    #[derive(Deserialize)]
    struct Line {
        episode_index: i64,
        length: i64,
    }
    let mut empty = Vec::new();
    if let Ok(lines) = files::read_text(&path.join("meta/episodes.jsonl"), "the list of episodes") {
        let lines = lines.lines().filter_map(|line| serde_json::from_str::<Line>(line).ok());
        empty.extend(lines.filter(|line| line.length == 0).map(|line| line.episode_index));
    }
    let files = parquet_table::files_below(&path.join("meta/episodes")).unwrap_or_default();
    for table in files.iter().filter_map(|file| Table::open(file).ok()) {
        let (indices, lengths) = (table.integers("episode_index"), table.integers("length"));
        let rows = indices.unwrap_or_default().into_iter().zip(lengths.unwrap_or_default());
        empty.extend(rows.filter(|(_, length)| *length == 0).map(|(index, _)| index));
    }
    empty
}

/// What the tables held so far.
struct Read {
    episodes: Vec<Episode>,
    /// The number of the last episode.
    last: Option<i64>,
    frames: usize,
}

/// One bad row makes its episode unreadable and leaves the others as they are.
///
/// # Errors
/// The first reason, if none can be read.
fn without_unreadable(mut episodes: Vec<Episode>) -> Result<Vec<Episode>> {
    let mut first = None;
    for episode in &mut episodes {
        let Some(why) = episode.unreadable.take() else { continue };
        first.get_or_insert_with(|| format!("episode {}: {why}", episode.label));
        let label = std::mem::take(&mut episode.label);
        let none = Episode::new(label, Rows::default(), Rows::default(), None);
        *episode = Episode { unreadable: Some(why), ..none };
    }
    match first {
        Some(why) if episodes.iter().all(|episode| episode.unreadable.is_some()) => {
            Err(Error::bad_input(why))
        }
        _ => Ok(episodes),
    }
}

/// The columns side by side; where rows differ, the faults of those that are not as most are.
fn rows_of(table: &Table, names: &[String]) -> Result<Ragged> {
    match table.floats_side_by_side(names) {
        Ok(rows) => Ok(Ragged { rows, faults: BTreeMap::new() }),
        Err(error) if error.is_bad_input() => table.ragged_side_by_side(names).map_err(|_| error),
        Err(error) => Err(error),
    }
}

/// Adds the rows of a file to the episode that they go on with, or to new ones.
fn append(read: &mut Read, table: &Table, columns: &Columns, file: &Path) -> Result<()> {
    let Ragged { rows: observations, faults: mut bad } = rows_of(table, &columns.observations)?;
    let Ragged { rows: actions, faults } = rows_of(table, &columns.actions)?;
    bad.extend(faults);
    if !table.has("episode_index") {
        return Err(Error::bad_input(
            "there is no column 'episode_index', which says of each row of which episode it is",
        )
        .with_hint("LeRobot writes it; was this table written or changed by something else?"));
    }
    let indices = table.integers("episode_index")?;
    let frames = if table.has("frame_index") { Some(table.integers("frame_index")?) } else { None };
    // Nobody learns from these, so a column that is none of numbers is no reason to refuse a set.
    let seconds = match table.has("timestamp").then(|| table.doubles("timestamp")) {
        Some(Ok((seconds, 1))) if seconds.len() == indices.len() => seconds,
        _ => Vec::new(),
    };
    for (name, len) in [
        ("action", actions.len()),
        ("episode_index", indices.len()),
        ("frame_index", frames.as_ref().map_or(observations.len(), Vec::len)),
    ] {
        if len != observations.len() {
            return Err(Error::bad_input(format!(
                "there are {} observations but '{name}' has {len} rows; wanted as many",
                observations.len()
            )));
        }
    }
    for (row, &index) in indices.iter().enumerate() {
        match read.last {
            Some(before) if index == before => {}
            Some(before) if index < before => {
                return Err(Error::bad_input(format!(
                    "row {row} is of episode {index} but follows one of episode {before}; wanted the rows in order"
                )));
            }
            _ => read.episodes.push(empty(index, &observations, &actions)),
        }
        read.last = Some(index);
        read.frames += 1;
        let episode = read.episodes.last_mut().expect("one was begun");
        let step = episode.actions.len();
        let frame = frames.as_ref().map(|frames| frames[row]);
        let jumped = frame.filter(|frame| usize::try_from(*frame) != Ok(step));
        let fault = match (bad.get(&row), jumped) {
            (Some(why), _) => Some(format!("at step {step} {why}")),
            (None, Some(frame)) => Some(format!("step {step} has frame_index {frame}; wanted {step}")),
            (None, None) => None,
        };
        if let Some(fault) = fault {
            episode.unreadable.get_or_insert_with(|| format!("{fault}: {}", file.display()));
        }
        if episode.observations.width() != observations.width() || episode.actions.width() != actions.width()
        {
            return Err(Error::bad_input(format!(
                "episode {index} goes on in a file with rows of another length"
            )));
        }
        episode.observations.push(observations.row(row));
        episode.actions.push(actions.row(row));
        episode.timestamps_secs.extend(seconds.get(row));
    }
    Ok(())
}

fn empty(index: i64, observations: &Rows, actions: &Rows) -> Episode {
    let (observations, actions) = (observations.width(), actions.width());
    let none = |width| Rows::with_capacity(width, 0);
    Episode::new(index.to_string(), none(observations), none(actions), None)
}

fn data_files(path: &Path) -> Result<Vec<PathBuf>> {
    let data = path.join("data");
    if !data.is_dir() {
        return Err(Error::bad_input("the LeRobot data set has no folder 'data' with its tables"));
    }
    let files = parquet_table::files_below(&data)?;
    if files.is_empty() {
        return Err(Error::bad_input("the folder 'data' of the LeRobot data set holds no parquet file"));
    }
    Ok(files)
}

/// The description and all tables, in order.
pub(super) fn files(path: &Path) -> Result<Vec<PathBuf>> {
    let mut files = vec![path.join(INFO)];
    files.extend(data_files(path)?);
    Ok(files)
}
