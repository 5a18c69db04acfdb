//! What a LeRobot data set keeps of a recording beside its steps: rate, robot, names and tasks, which are passed on.

use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use super::videos::{self, Videos};
use super::{Info, read_info};
use crate::basics::error::Result;
use crate::basics::files;
use crate::data::demonstration::episode::{Format, Source};
use crate::data::demonstration::parquet_table::{self, Table};

/// What stands beside the steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Described {
    /// The rate of the steps, a whole number in LeRobot.
    pub steps_per_sec: u32,
    /// What was recorded.
    pub robot_type: Option<String>,
    /// Names of the numbers of an observation, as the data set writes them.
    pub observation_names: Option<Value>,
    /// Names of the numbers of an action, as the data set writes them.
    pub action_names: Option<Value>,
    /// The sentence of each episode; of fewer sentences the last counts for the rest.
    pub tasks: Vec<String>,
    /// The videos of the episodes, in their order.
    pub videos: Videos,
}

/// What a data set says of the episodes of `source`; the rate is 0 and tasks are none where it does not say.
///
/// # Errors
/// `is_bad_input` if its description is damaged; `is_io` if it may not be read.
pub fn description(path: &Path, source: &Source) -> Result<Described> {
    let info = read_info(path)?;
    let rate = info.rate();
    let Info { robot_type, features, .. } = info;
    let numbered =
        source.episodes.iter().filter_map(|one| Some((one.label.parse().ok()?, one.actions.len())));
    let videos = videos::find(path, source.format == Format::LeRobotV3, &numbered.collect::<Vec<_>>());
    let names = |columns: &[String], width: usize| {
        let [column] = columns else { return None };
        // Other tools name what is not there.
        let names = features.get(column)?.names.clone();
        let flat = names.as_array().is_some_and(|names| names.len() == width);
        (flat || names.is_object()).then_some(names)
    };
    let sizes = source.episodes.first().map_or((0, 0), |one| (one.observations.width(), one.actions.width()));
    let known = tasks(path);
    let task = |label: &str| {
        let index = label.parse::<i64>().ok()?;
        known.iter().find(|(of, _)| *of == index).map(|(_, task)| task.clone())
    };
    let tasks: Option<Vec<String>> = source.episodes.iter().map(|episode| task(&episode.label)).collect();
    Ok(Described {
        steps_per_sec: rate.filter(|rate| *rate >= 0.5 && *rate < 1e6).map_or(0, |rate| rate.round() as u32),
        robot_type,
        observation_names: names(&source.columns.observations, sizes.0),
        action_names: names(&source.columns.actions, sizes.1),
        tasks: tasks.unwrap_or_default(),
        videos,
    })
}

/// The first sentence of each episode; none where the list of episodes cannot be read, which nobody learns from.
fn tasks(path: &Path) -> Vec<(i64, String)> {
    #[derive(Deserialize)]
    struct Line {
        episode_index: i64,
        tasks: Vec<String>,
    }
    let mut tasks = Vec::new();
    if let Ok(lines) = files::read_text(&path.join("meta/episodes.jsonl"), "the list of episodes") {
        let lines = lines.lines().filter_map(|line| serde_json::from_str::<Line>(line).ok());
        tasks.extend(lines.filter_map(|line| Some((line.episode_index, line.tasks.into_iter().next()?))));
    }
    let files = parquet_table::files_below(&path.join("meta/episodes")).unwrap_or_default();
    for table in files.iter().filter_map(|file| Table::open(file).ok()) {
        if let (Ok(indices), Ok(words)) = (table.integers("episode_index"), table.words("tasks")) {
            tasks.extend(indices.into_iter().zip(words));
        }
    }
    tasks
}
