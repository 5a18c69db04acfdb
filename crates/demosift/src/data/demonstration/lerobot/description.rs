//! What a LeRobot data set keeps of a recording beside its steps: rate, robot, names and tasks, which are passed on.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use super::videos::{self, Videos};
use super::{Info, read_info};
use crate::basics::counting::counted;
use crate::basics::error::{Error, Result};
use crate::basics::files;
use crate::data::demonstration::episode::{Format, Source};
use crate::data::demonstration::named::json_in_words;
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
    /// In words, what of the sentences cannot be passed on.
    pub untold: Vec<String>,
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
    let Sentences { of_episodes, unread } = sentences(path);
    let mut untold: Vec<String> = unread.into_iter().collect();
    let sentence = |label: &String| of_episodes.get(&label.parse().ok()?);
    let labels = source.episodes.iter().map(|episode| &episode.label);
    let without: Vec<&String> = labels.clone().filter(|label| sentence(label).is_none()).collect();
    let tasks = match without[..] {
        _ if without.len() == source.episodes.len() => Vec::new(),
        [] => labels.filter_map(sentence).cloned().collect(),
        [first, ..] => {
            untold.push(format!(
                "{} without a sentence in the list of episodes, such as episode {first}: an empty one is written",
                counted(without.len(), "episode")
            ));
            labels.map(|label| sentence(label).cloned().unwrap_or_default()).collect()
        }
    };
    Ok(Described {
        steps_per_sec: rate.filter(|rate| *rate >= 0.5 && *rate < 1e6).map_or(0, |rate| rate.round() as u32),
        robot_type,
        observation_names: names(&source.columns.observations, sizes.0),
        action_names: names(&source.columns.actions, sizes.1),
        tasks,
        untold,
        videos,
    })
}

/// What the list of episodes says that was done.
#[derive(Default)]
struct Sentences {
    /// The first of each episode that has one.
    of_episodes: BTreeMap<i64, String>,
    /// In words, the first thing that cannot be read of the list.
    unread: Option<String>,
}

/// Looks into the list of episodes; nobody learns from it, so what cannot be read of it is told and refuses nothing.
fn sentences(path: &Path) -> Sentences {
    let mut found = Sentences::default();
    let lines = path.join("meta/episodes.jsonl");
    if lines.exists() {
        match files::read_text(&lines, "the list of episodes") {
            // A line that is damaged takes no other with it.
            Ok(text) => sentences_of_lines(&text).for_each(|read| found.take_in(path, &lines, read)),
            Err(error) => found.take_in(path, &lines, Err(error)),
        }
    }
    let tables = path.join("meta/episodes");
    if tables.exists() {
        match parquet_table::files_below(&tables) {
            Ok(files) => files.iter().for_each(|file| found.take_in(path, file, sentences_of_table(file))),
            Err(error) => found.take_in(path, &tables, Err(error)),
        }
    }
    found
}

impl Sentences {
    /// Takes in what a file says of episodes, or why it says nothing.
    fn take_in(&mut self, set: &Path, file: &Path, read: Result<Vec<Sentence>>) {
        match read {
            Ok(found) => {
                self.of_episodes.extend(found.into_iter().filter_map(|(of, first)| Some((of, first?))))
            }
            Err(error) => {
                let shown = file.strip_prefix(set).unwrap_or(file).display();
                let why = error.message();
                self.unread.get_or_insert_with(|| {
                    format!("sentences of the episodes are not passed on, as {shown} cannot be read: {why}")
                });
            }
        }
    }
}

/// The number of an episode with its first sentence, if it has one.
type Sentence = (i64, Option<String>);

/// A line an episode, as versions 2.0 and 2.1 have it.
fn sentences_of_lines(text: &str) -> impl Iterator<Item = Result<Vec<Sentence>>> {
    #[derive(Deserialize)]
    struct Line {
        episode_index: i64,
        tasks: Vec<String>,
    }
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    lines.map(|(number, line)| {
        let Line { episode_index, tasks } = serde_json::from_str(line)
            .map_err(|error| Error::bad_input(format!("line {}: {}", number + 1, json_in_words(&error))))?;
        Ok(vec![(episode_index, tasks.into_iter().next())])
    })
}

/// A row an episode, as version 3.0 has it.
fn sentences_of_table(file: &Path) -> Result<Vec<Sentence>> {
    let table = Table::open(file)?;
    Ok(table.integers("episode_index")?.into_iter().zip(table.words("tasks")?).collect())
}
