//! Writing LeRobot v3.0: one table of steps, one of episodes, one of tasks, and their description.

use std::path::Path;

use serde_json::{Map, Value, json};

use super::INFO;
use super::description::Described;
use super::states::{QPOS, QVEL};
use super::videos::{Camera, Shot, Videos};
use crate::basics::error::{Error, Result};
use crate::basics::files;
use crate::data::demonstration::episode::Episode;
use crate::data::demonstration::parquet_writing::{Column, Values, encode};
use crate::data::trajectory::StateLog;
use crate::math::statistics;

/// LeRobot's own limits, which it goes on with when it adds episodes.
const DATA_MEGABYTES: u32 = 100;
const VIDEO_MEGABYTES: u32 = 200;
/// Shares of the values below the quantiles that LeRobot keeps.
const QUANTILES: [(&str, f64); 5] = [("q01", 0.01), ("q10", 0.1), ("q50", 0.5), ("q90", 0.9), ("q99", 0.99)];

/// A table of steps, column after column.
struct Feature {
    name: &'static str,
    element: &'static str,
    values: Vec<f64>,
    width: usize,
}

/// Writes episodes as a LeRobot v3.0 data set into a new folder, which appears whole or not at all.
///
/// Episodes are numbered from 0 in their order; `states` become the columns `simulator.qpos` and `simulator.qvel`.
/// A final observation has no row and is left out.
/// Files of videos are copied as they are.
///
/// # Errors
/// `is_bad_input` if the folder exists, there is no episode, a video is not of as many episodes, or the states do not fit the episodes; `is_io` if a file cannot
/// be written.
pub fn write(
    path: &Path,
    episodes: &[Episode],
    states: Option<&[StateLog]>,
    described: &Described,
) -> Result<()> {
    let lengths: Vec<usize> = episodes.iter().map(|episode| episode.actions.len()).collect();
    if lengths.iter().sum::<usize>() == 0 {
        return Err(Error::bad_input("no step of an episode to write; at least 1 is needed"));
    }
    let features = features(episodes, states)?;
    for camera in &described.videos.cameras {
        if camera.shots.len() != episodes.len() {
            return Err(Error::bad_input(format!(
                "there are {} videos of {}; wanted one of each of the {} episodes",
                camera.shots.len(),
                camera.name,
                episodes.len()
            )));
        }
    }
    let tasks = Tasks::of(&described.tasks, episodes.len());
    let indices = Indices::of(&lengths, described.steps_per_sec, &tasks);
    let description = format!("{:#}\n", describe(&features, &lengths, described, tasks.all.len()));
    let statistics = format!("{:#}\n", statistics(&features, &indices, &described.videos));
    let steps = steps_table(&features, indices)?;
    let contents: [(&str, Vec<u8>); 5] = [
        ("data/chunk-000/file-000.parquet", steps),
        ("meta/episodes/chunk-000/file-000.parquet", episodes_table(&lengths, &tasks, &described.videos)?),
        ("meta/tasks.parquet", tasks_table(&tasks)?),
        ("meta/stats.json", statistics.into_bytes()),
        (INFO, description.into_bytes()),
    ];
    files::write_folder_with(path, &contents, &described.videos.files())
}

/// The columns of the recording, checked against each other.
fn features(episodes: &[Episode], states: Option<&[StateLog]>) -> Result<Vec<Feature>> {
    let (observations, actions) = (episodes[0].observations.width(), episodes[0].actions.width());
    for episode in episodes {
        let found = (episode.observations.width(), episode.actions.width());
        if found != (observations, actions) || episode.observations.len() != episode.actions.len() {
            return Err(Error::bad_input(format!(
                "episode {} has {} observations of {} numbers and {} actions of {}; wanted as many of each, of {observations} and {actions}",
                episode.label,
                episode.observations.len(),
                found.0,
                episode.actions.len(),
                found.1
            )));
        }
    }
    let flat = |rows: fn(&Episode) -> &crate::math::rows::Rows| {
        episodes.iter().flat_map(|episode| rows(episode).flat()).map(|&value| f64::from(value)).collect()
    };
    let mut features = vec![
        Feature {
            name: "observation.state",
            element: "float32",
            values: flat(|episode| &episode.observations),
            width: observations,
        },
        Feature {
            name: "action",
            element: "float32",
            values: flat(|episode| &episode.actions),
            width: actions,
        },
    ];
    let steps = features[1].values.len() / actions;
    for (name, of) in [(QPOS, (|log| &log.qpos) as fn(&StateLog) -> &Vec<f64>), (QVEL, |log| &log.qvel)] {
        let values: Vec<f64> = states.iter().copied().flatten().flat_map(of).copied().collect();
        if states.is_none() || values.is_empty() {
            continue;
        }
        if !values.len().is_multiple_of(steps) {
            return Err(Error::bad_input(format!(
                "{} numbers of {name} do not make rows for {steps} steps",
                values.len()
            )));
        }
        features.push(Feature { name, element: "float64", width: values.len() / steps, values });
    }
    Ok(features)
}

/// The tasks of the episodes, each task once.
struct Tasks {
    all: Vec<String>,
    of_episode: Vec<usize>,
}

impl Tasks {
    /// Of fewer sentences than episodes the last counts for the rest.
    fn of(sentences: &[String], episodes: usize) -> Self {
        let mut tasks = Self { all: Vec::new(), of_episode: Vec::with_capacity(episodes) };
        for index in 0..episodes {
            let sentence = sentences.get(index).or(sentences.last()).cloned().unwrap_or_default();
            let place = tasks.all.iter().position(|known| *known == sentence).unwrap_or_else(|| {
                tasks.all.push(sentence);
                tasks.all.len() - 1
            });
            tasks.of_episode.push(place);
        }
        tasks
    }
}

/// Where each step stands.
struct Indices {
    timestamp_secs: Vec<f32>,
    frame: Vec<i64>,
    episode: Vec<i64>,
    task: Vec<i64>,
}

impl Indices {
    fn of(lengths: &[usize], steps_per_sec: u32, tasks: &Tasks) -> Self {
        let frame: Vec<i64> = lengths.iter().flat_map(|&len| 0..len as i64).collect();
        let numbered = (0_i64..).zip(lengths);
        Self {
            timestamp_secs: frame.iter().map(|&step| step as f32 / steps_per_sec as f32).collect(),
            episode: numbered.flat_map(|(index, &len)| std::iter::repeat_n(index, len)).collect(),
            task: tasks
                .of_episode
                .iter()
                .zip(lengths)
                .flat_map(|(&task, &len)| std::iter::repeat_n(task as i64, len))
                .collect(),
            frame,
        }
    }

    /// The columns that every LeRobot data set has, as numbers.
    fn columns(&self) -> [(&'static str, Vec<f64>); 5] {
        let numbers = |values: &[i64]| values.iter().map(|&value| value as f64).collect();
        let steps = self.frame.len();
        [
            ("timestamp", self.timestamp_secs.iter().map(|&secs| f64::from(secs)).collect()),
            ("frame_index", numbers(&self.frame)),
            ("episode_index", numbers(&self.episode)),
            ("index", (0..steps).map(|step| step as f64).collect()),
            ("task_index", numbers(&self.task)),
        ]
    }
}

fn steps_table(features: &[Feature], indices: Indices) -> Result<Vec<u8>> {
    let steps = indices.frame.len();
    let mut columns: Vec<Column> = features
        .iter()
        .map(|feature| {
            let floats = || feature.values.iter().map(|&value| value as f32).collect();
            // LeRobot takes a shape of [1] for a plain column, and does not read a list there.
            let values = match (feature.element, feature.width) {
                ("float32", 1) => Values::Floats(floats()),
                ("float32", width) => Values::FloatLists(floats(), width),
                (_, 1) => Values::Doubles(feature.values.clone()),
                (_, width) => Values::DoubleLists(feature.values.clone(), width),
            };
            (feature.name, values)
        })
        .collect();
    columns.extend([
        ("timestamp", Values::Floats(indices.timestamp_secs)),
        ("frame_index", Values::Integers(indices.frame)),
        ("episode_index", Values::Integers(indices.episode)),
        ("index", Values::Integers((0..steps as i64).collect())),
        ("task_index", Values::Integers(indices.task)),
    ]);
    encode(&columns, Vec::new())
}

fn episodes_table(lengths: &[usize], tasks: &Tasks, videos: &Videos) -> Result<Vec<u8>> {
    let count = lengths.len();
    let ends: Vec<i64> = lengths
        .iter()
        .scan(0, |end, &len| {
            *end += len as i64;
            Some(*end)
        })
        .collect();
    let lengths: Vec<i64> = lengths.iter().map(|&len| len as i64).collect();
    let starts = ends.iter().zip(&lengths).map(|(end, len)| end - len).collect();
    let zeros = || Values::Integers(vec![0; count]);
    let mut columns = vec![
        ("episode_index", Values::Integers((0..count as i64).collect())),
        ("tasks", Values::WordLists(tasks.of_episode.iter().map(|&task| tasks.all[task].clone()).collect())),
        ("length", Values::Integers(lengths)),
        ("data/chunk_index", zeros()),
        ("data/file_index", zeros()),
        ("dataset_from_index", Values::Integers(starts)),
        ("dataset_to_index", Values::Integers(ends)),
        ("meta/episodes/chunk_index", zeros()),
        ("meta/episodes/file_index", zeros()),
    ];
    let of_videos = videos.cameras.iter().flat_map(of_video).collect::<Vec<_>>();
    columns.extend(of_videos.iter().map(|(name, values)| (name.as_str(), values.clone())));
    encode(&columns, Vec::new())
}

/// Where a camera's video of each episode is.
fn of_video(camera: &Camera) -> [(String, Values); 4] {
    let integers = |number: fn(&Shot) -> i64| Values::Integers(camera.shots.iter().map(number).collect());
    let seconds = |number: fn(&Shot) -> f64| Values::Doubles(camera.shots.iter().map(number).collect());
    let column = |what: &str| format!("videos/{}/{what}", camera.name);
    [
        (column("chunk_index"), integers(|shot| shot.chunk)),
        (column("file_index"), integers(|shot| shot.number)),
        (column("from_timestamp"), seconds(|shot| shot.from_secs)),
        (column("to_timestamp"), seconds(|shot| shot.to_secs)),
    ]
}

/// LeRobot reads this table with pandas, and looks the task up by the name of its row.
fn tasks_table(tasks: &Tasks) -> Result<Vec<u8>> {
    const NAME: &str = "__index_level_0__";
    let columns = [
        ("task_index", Values::Integers((0..tasks.all.len() as i64).collect())),
        (NAME, Values::Words(tasks.all.clone())),
    ];
    let described = |name: Value, field: &str, kind: &str, element: &str| json!({ "name": name, "field_name": field, "pandas_type": kind, "numpy_type": element, "metadata": null });
    let pandas = json!({
        "index_columns": [NAME],
        "column_indexes": [
            { "name": null, "field_name": null, "pandas_type": "unicode", "numpy_type": "object", "metadata": { "encoding": "UTF-8" } }
        ],
        "columns": [
            described(json!("task_index"), "task_index", "int64", "int64"),
            described(Value::Null, NAME, "unicode", "object"),
        ],
        "creator": { "library": "demosift", "version": env!("CARGO_PKG_VERSION") },
        "pandas_version": "2.0.0",
    });
    encode(&columns, vec![("pandas", pandas.to_string())])
}

fn describe(features: &[Feature], lengths: &[usize], of: &Described, tasks: usize) -> Value {
    let mut described = Map::new();
    for feature in features {
        let known = match feature.name {
            "observation.state" => of.observation_names.clone(),
            "action" => of.action_names.clone(),
            _ => None,
        };
        let numbered = || (0..feature.width).map(|column| format!("{}_{column}", feature.name)).collect();
        let names: Value = known.unwrap_or_else(numbered);
        described.insert(
            feature.name.to_owned(),
            json!({ "dtype": feature.element, "shape": [feature.width], "names": names }),
        );
    }
    for (name, element) in [
        ("timestamp", "float32"),
        ("frame_index", "int64"),
        ("episode_index", "int64"),
        ("index", "int64"),
        ("task_index", "int64"),
    ] {
        described.insert(name.to_owned(), json!({ "dtype": element, "shape": [1], "names": null }));
    }
    for camera in &of.videos.cameras {
        described.insert(camera.name.clone(), camera.feature.clone());
    }
    let has_videos = !of.videos.cameras.is_empty();
    json!({
        "codebase_version": "v3.0",
        "robot_type": of.robot_type,
        "total_episodes": lengths.len(),
        "total_frames": lengths.iter().sum::<usize>(),
        "total_tasks": tasks,
        "chunks_size": 1000,
        "data_files_size_in_mb": DATA_MEGABYTES,
        "video_files_size_in_mb": VIDEO_MEGABYTES,
        "fps": of.steps_per_sec,
        "splits": { "train": format!("0:{}", lengths.len()) },
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": has_videos.then_some("videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"),
        "features": described,
    })
}

/// Spread of every column over all steps, by which LeRobot normalizes; of videos that of the source, as nobody looks into them.
fn statistics(features: &[Feature], indices: &Indices, videos: &Videos) -> Value {
    let mut all = Map::new();
    for feature in features {
        all.insert(feature.name.to_owned(), spread(&feature.values, feature.width));
    }
    for (name, values) in indices.columns() {
        all.insert(name.to_owned(), spread(&values, 1));
    }
    for camera in &videos.cameras {
        all.extend(camera.statistics.clone().map(|statistics| (camera.name.clone(), statistics)));
    }
    Value::Object(all)
}

/// Least, greatest, mean, population standard deviation and quantiles of each column.
fn spread(values: &[f64], width: usize) -> Value {
    let count = values.len() / width;
    let columns: Vec<Vec<f64>> = (0..width)
        .map(|column| {
            let mut column: Vec<f64> = values.iter().skip(column).step_by(width).copied().collect();
            column.sort_by(f64::total_cmp);
            column
        })
        .collect();
    let each = |number: &dyn Fn(&[f64]) -> f64| -> Vec<f64> {
        columns.iter().map(|column| number(column)).collect()
    };
    let mut spread = json!({
        "min": each(&|column| column[0]),
        "max": each(&|column| column[count - 1]),
        "mean": each(&|column| statistics::mean(column)),
        "std": each(&|column| statistics::mean_and_deviation(column.iter().copied()).1),
        "count": [count],
    });
    for (name, share) in QUANTILES {
        spread[name] = json!(each(&|column| column[((count - 1) as f64 * share).round() as usize]));
    }
    spread
}
