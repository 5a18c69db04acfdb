//! The videos of a LeRobot data set: files beside the tables, which demosift passes on and never looks into.
//!
//! | | a file holds | where an episode is |
//! |---|---|---|
//! | v3.0 | `videos/<camera>/chunk-<c>/file-<f>.mp4`: several episodes | `meta/episodes`: file and seconds |
//! | v2.x | `videos/chunk-<c>/<camera>/episode_<e>.mp4`: one | the whole file |
//!
//! Whole files are copied, so an episode that is left out is still in a file that it shares with one that is kept; LeRobot plays
//! the seconds that its table of episodes says.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::INFO;
use super::camera_statistics::CameraStatistics;
use crate::basics::files;
use crate::data::demonstration::parquet_table::{self, Table};

/// Files in a folder, as LeRobot has it.
pub(super) const CHUNK: i64 = 1000;

/// What one camera saw.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Its column, such as `observation.images.top`.
    pub(super) name: String,
    /// What `meta/info.json` says of it.
    pub(super) feature: Value,
    /// What the data set says of its brightness.
    pub(super) statistics: Option<Value>,
    /// One an episode, in the order of the episodes.
    pub(super) shots: Vec<Shot>,
}

/// Where the video of an episode is.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Shot {
    /// The file of the source.
    pub(super) file: PathBuf,
    /// The folder that it is written to.
    pub(super) chunk: i64,
    /// The number of the file that it is written to.
    pub(super) number: i64,
    /// Where the episode begins in it.
    pub(super) from_secs: f64,
    /// Where it ends.
    pub(super) to_secs: f64,
}

/// The videos of a data set, and what is not there of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Videos {
    /// Each camera that has a video of every episode.
    pub cameras: Vec<Camera>,
    /// In words, what is described and cannot be passed on.
    pub missing: Vec<String>,
}

impl Videos {
    /// Those of some of the episodes, by their places.
    pub fn of(&self, places: &[usize]) -> Self {
        let of = |camera: &Camera| Camera {
            shots: places.iter().filter_map(|&place| camera.shots.get(place).cloned()).collect(),
            ..camera.clone()
        };
        Self { cameras: self.cameras.iter().map(of).collect(), missing: self.missing.clone() }
    }

    /// Each file once, with its place in a data set of version 3.0.
    pub(super) fn files(&self) -> Vec<(String, PathBuf)> {
        let of = |camera: &Camera| -> BTreeSet<(String, PathBuf)> {
            let place = |shot: &Shot| {
                let Shot { chunk, number, .. } = shot;
                let place = format!("videos/{}/chunk-{chunk:03}/file-{number:03}.mp4", camera.name);
                (place, shot.file.clone())
            };
            camera.shots.iter().map(place).collect()
        };
        self.cameras.iter().flat_map(of).collect()
    }
}

/// Looks for the videos of these episodes, by the numbers that the data set gives them, with their lengths in steps.
pub(super) fn find(path: &Path, is_v3: bool, episodes: &[(i64, usize)]) -> Videos {
    let info = files::read(&path.join(INFO)).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let info: Value = info.unwrap_or_default();
    let statistics = CameraStatistics::read(path, &episodes.iter().map(|(episode, _)| *episode).collect());
    let mut videos = Videos::default();
    let features = info["features"].as_object().into_iter().flatten();
    for (name, feature) in features.filter(|(_, feature)| feature["dtype"] == "video") {
        let is_folder = !name.contains(['/', '\\']) && !name.starts_with('.');
        let shots = match is_v3 {
            _ if !is_folder => Err("that is no name of a folder".to_owned()),
            true => shots_of_v3(path, name, episodes),
            false => shots_of_v2(path, name, episodes, &info),
        };
        match shots {
            Ok(shots) => {
                let statistics = statistics.of(name);
                if statistics.is_none() {
                    videos.missing.push(format!(
                        "the statistics of {name} are not passed on, as neither meta/stats.json nor meta/episodes_stats.jsonl \
                         holds them; LeRobot wants them for a training on this camera"
                    ));
                }
                videos.cameras.push(Camera {
                    name: name.clone(),
                    feature: feature.clone(),
                    statistics,
                    shots,
                });
            }
            Err(why) => videos.missing.push(format!("the videos of {name} are not passed on: {why}")),
        }
    }
    videos
}

fn shots_of_v3(path: &Path, name: &str, episodes: &[(i64, usize)]) -> Result<Vec<Shot>, String> {
    let mut known = BTreeMap::new();
    let files = parquet_table::files_below(&path.join("meta/episodes")).unwrap_or_default();
    for table in files.iter().filter_map(|file| Table::open(file).ok()) {
        let integers = |column: &str| table.integers(column).unwrap_or_default();
        let column = |what: &str| format!("videos/{name}/{what}");
        let seconds = |what: &str| table.doubles(&column(what)).map(|found| found.0).unwrap_or_default();
        let of_file = integers(&column("chunk_index")).into_iter().zip(integers(&column("file_index")));
        let when = seconds("from_timestamp").into_iter().zip(seconds("to_timestamp"));
        let rows = integers("episode_index").into_iter().zip(of_file.zip(when));
        known.extend(rows);
    }
    let shot = |&(episode, _): &(i64, usize)| {
        let ((chunk, number), (from_secs, to_secs)) = *known
            .get(&episode)
            .ok_or_else(|| format!("meta/episodes does not say where that of episode {episode} is"))?;
        let file = path.join(format!("videos/{name}/chunk-{chunk:03}/file-{number:03}.mp4"));
        there(path, &file).map(|()| Shot { file, chunk, number, from_secs, to_secs })
    };
    episodes.iter().map(shot).collect()
}

/// A file an episode, which becomes one of its own in version 3.0 too.
fn shots_of_v2(
    path: &Path,
    name: &str,
    episodes: &[(i64, usize)],
    info: &Value,
) -> Result<Vec<Shot>, String> {
    let fps = info["fps"].as_f64().filter(|rate| *rate > 0.0).ok_or("their rate is not known")?;
    let chunk_size = info["chunks_size"].as_i64().filter(|size| *size > 0).unwrap_or(CHUNK);
    let shot = |&(episode, steps): &(i64, usize)| {
        let of = episode / chunk_size;
        let file = path.join(format!("videos/chunk-{of:03}/{name}/episode_{episode:06}.mp4"));
        let (chunk, number) = (episode / CHUNK, episode % CHUNK);
        let to_secs = steps as f64 / fps;
        there(path, &file).map(|()| Shot { file, chunk, number, from_secs: 0.0, to_secs })
    };
    episodes.iter().map(shot).collect()
}

fn there(set: &Path, file: &Path) -> Result<(), String> {
    let shown = file.strip_prefix(set).unwrap_or(file);
    if file.is_file() { Ok(()) } else { Err(format!("{} is not there", shown.display())) }
}
