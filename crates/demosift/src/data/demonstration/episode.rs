//! Demonstrations as the file of some tool holds them, not yet checked for what cannot be learned from: what a reader of a
//! format passes on.
//!
//! Nobody reads rewards, returns or scores.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::data::demonstration::conversion::Conversion;
use crate::data::demonstration::named::shortened;
use crate::data::demonstration::{DemoId, Demonstration, DemonstrationSet, check_sizes};
use crate::math::rows::Rows;

/// The file of a folder that `demosift record` made.
pub const RECORDED: &str = "demonstrations.hdf5";
/// The file of a Minari data set in HDF5.
pub const MINARI_HDF5: &str = "main_data.hdf5";

/// A tool's way to store demonstrations; `docs/formats.md` tells each apart from the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(into = "String", try_from = "String")]
pub enum Format {
    /// Flat tables in HDF5; see [`d4rl`](super::d4rl).
    D4rl,
    /// A folder of parquet files, `codebase_version` v3.0; see [`lerobot`](super::lerobot).
    LeRobotV3,
    /// A folder with a parquet file an episode, `codebase_version` v2.0 or v2.1; see [`lerobot`](super::lerobot).
    LeRobotV2,
    /// A folder with `main_data.hdf5`, or that file; see [`minari`](super::minari).
    MinariHdf5,
    /// A folder with a folder of parquet an episode; see [`minari`](super::minari).
    MinariParquet,
    /// A group an episode below `data` in HDF5; see [`robomimic`](super::robomimic).
    Robomimic,
    /// `obs`, `acs` in a npz file.
    BaselinesNpz,
    /// `obs`, `acts`, `indices` in a npz file.
    ImitationNpz,
    /// `obs`, `actions`, `episode_starts` in a npz file.
    StableBaselinesNpz,
    /// A group `traj_<i>` an episode in HDF5; see [`minari`](super::minari), which it is like.
    ManiSkill,
    /// A folder with a HDF5 file `episode_<i>.hdf5` an episode; see [`aloha`](super::aloha).
    Aloha,
}

impl Format {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::D4rl,
        Self::LeRobotV3,
        Self::LeRobotV2,
        Self::MinariHdf5,
        Self::MinariParquet,
        Self::Robomimic,
        Self::BaselinesNpz,
        Self::ImitationNpz,
        Self::StableBaselinesNpz,
        Self::ManiSkill,
        Self::Aloha,
    ];

    /// Whether it keeps its files in a folder `data`.
    pub(super) fn is_minari(self) -> bool {
        matches!(self, Self::MinariHdf5 | Self::MinariParquet)
    }

    /// The name by which a user asks for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::D4rl => "d4rl",
            Self::LeRobotV3 => "lerobot-v3",
            Self::LeRobotV2 => "lerobot-v2",
            Self::MinariHdf5 => "minari-hdf5",
            Self::MinariParquet => "minari-parquet",
            Self::Robomimic => "robomimic",
            Self::BaselinesNpz => "baselines-npz",
            Self::ImitationNpz => "imitation-npz",
            Self::StableBaselinesNpz => "stable-baselines-npz",
            Self::ManiSkill => "maniskill",
            Self::Aloha => "aloha",
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.pad(self.name())
    }
}

impl FromStr for Format {
    type Err = Error;

    fn from_str(typed: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|format| format.name() == typed).ok_or_else(|| {
            let known: Vec<&str> = Self::ALL.into_iter().map(Self::name).collect();
            Error::bad_input(format!("there is no format '{typed}'; there are: {}", known.join(", ")))
        })
    }
}

impl TryFrom<String> for Format {
    type Error = Error;

    fn try_from(name: String) -> Result<Self> {
        name.parse()
    }
}

impl From<Format> for String {
    fn from(format: Format) -> Self {
        format.name().to_owned()
    }
}

/// Which columns make up an observation and an action, each list in its order; an empty list means what is usual in the format.
///
/// A column is named as the file names it, with `/` between a group and what is in it: `observation.state`, `obs/gripper`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Columns {
    /// Parts of an observation.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub observations: Vec<String>,
    /// Parts of an action.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub actions: Vec<String>,
}

impl Columns {
    /// Whether all is as it is usual in the format.
    pub fn are_usual(&self) -> bool {
        *self == Self::default()
    }

    /// The columns with this format's usual ones in place of none.
    pub(super) fn or(&self, observation: &str, action: &str) -> Self {
        let filled = |named: &[String], usual: &str| {
            if named.is_empty() { vec![usual.to_owned()] } else { named.to_vec() }
        };
        Self { observations: filled(&self.observations, observation), actions: filled(&self.actions, action) }
    }
}

/// An episode as it was stored.
#[derive(Clone, Debug, PartialEq)]
pub struct Episode {
    /// What the file calls it: its number, or the name of its group.
    pub label: String,
    /// The observations on which the actions were taken, `[T, obs]`.
    pub observations: Rows,
    /// `[T, act]`.
    pub actions: Rows,
    /// The observation `[obs]` after the last action, where the format keeps it; no demonstration holds it.
    pub last_observation: Option<Vec<f32>>,
    /// When each step was recorded, s, `[T]`; empty where the format does not say.
    pub timestamps_secs: Vec<f64>,
    /// Why it could not be read, where the others could; it then holds no step.
    pub unreadable: Option<String>,
}

impl Episode {
    pub(super) fn new(
        label: String,
        observations: Rows,
        actions: Rows,
        last_observation: Option<Vec<f32>>,
    ) -> Self {
        Self { label, observations, actions, last_observation, timestamps_secs: Vec::new(), unreadable: None }
    }

    /// Each episode that could be read, and in place of each other one why it could not; if none could, the first reason.
    ///
    /// # Errors
    /// As the reading of the first, if all failed.
    pub(super) fn all_or_some(read: Vec<(String, Result<Self>)>) -> Result<Vec<Self>> {
        if read.iter().all(|(_, result)| result.is_err()) {
            return read.into_iter().map(|(_, result)| result).collect();
        }
        let episode = |(label, result): (String, Result<Self>)| match result {
            // What the disk cannot do is no fault of an episode.
            Err(error) if !error.is_bad_input() => Err(error),
            Err(error) => Ok(Self {
                unreadable: Some(error.to_string()),
                ..Self::new(label, Rows::default(), Rows::default(), None)
            }),
            read => read,
        };
        read.into_iter().map(episode).collect()
    }

    /// Numbers in an observation and in an action.
    pub(super) fn sizes(&self) -> (usize, usize) {
        (self.observations.width(), self.actions.width())
    }

    /// Why it is no demonstration; `None` if it is one.
    pub fn fault(&self) -> Option<String> {
        if self.actions.is_empty() && self.unreadable.is_none() {
            return Some("it is empty, not a single step".to_owned());
        }
        let checked = || Demonstration::check(&self.observations, &self.actions).err();
        self.unreadable.clone().or_else(|| checked().map(|error| error.to_string()))
    }

    /// The episode whose table of observations `[T+1, obs]` goes one row beyond its actions `[T, act]`.
    ///
    /// # Errors
    /// `is_bad_input` if it does not.
    pub(super) fn with_last(label: String, observations: &Rows, actions: Rows) -> Result<Self> {
        let (found, steps) = (observations.len(), actions.len());
        if (found, steps) == (0, 0) {
            return Ok(Self::new(label, observations.clone(), actions, None));
        }
        if found != steps + 1 {
            return Err(Error::bad_input(format!(
                "episode {label} has {found} observations and {steps} actions; wanted one observation more than actions"
            )));
        }
        let last_observation = Some(observations.row(steps).to_vec());
        Ok(Self::new(label, observations.head(steps), actions, last_observation))
    }
}

/// What a file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// How it is stored.
    pub format: Format,
    /// The columns that were read, all of them named.
    pub columns: Columns,
    /// The position in the file of each episode, ascending.
    pub ids: Vec<DemoId>,
    /// In file order.
    pub episodes: Vec<Episode>,
    /// Steps after the last complete episode, which were left out.
    pub dropped_steps: usize,
    /// Episodes that were not chosen, with the reason.
    pub left_out: Vec<LeftOut>,
    /// What else the file holds that was not read although it looks like an episode, in words.
    pub not_read: Vec<String>,
    /// What the set says of its numbers.
    pub says: Says,
    /// How the numbers of the episodes, which are as they were recorded, become those of a task.
    pub conversion: Conversion,
}

/// What a set says of its numbers, beside them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Says {
    /// Steps a second.
    pub steps_per_sec: Option<f64>,
    /// Where actions lie, `[act]`: the least and the greatest of each number.
    pub action_bounds: Option<Vec<[f64; 2]>>,
    /// The file that says it.
    pub file: &'static str,
}

/// An episode that was not chosen.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LeftOut {
    /// What the file calls it.
    pub label: String,
    /// The reason.
    pub why: String,
}

impl Source {
    /// All that a file holds, in its order.
    pub(super) fn new(format: Format, columns: Columns, episodes: Vec<Episode>) -> Self {
        let ids = (0..episodes.len()).map(DemoId).collect();
        Self {
            format,
            columns,
            ids,
            episodes,
            dropped_steps: 0,
            left_out: Vec::new(),
            not_read: Vec::new(),
            says: Says::default(),
            conversion: Conversion::default(),
        }
    }

    /// An episode by its position in the file, if it was chosen.
    pub fn episode(&self, id: DemoId) -> Option<&Episode> {
        self.ids.binary_search(&id).ok().map(|place| &self.episodes[place])
    }

    /// The demonstrations, checked.
    ///
    /// # Errors
    /// `is_bad_input` if there are fewer than two, they do not fit each other, or one holds a number that is not finite.
    pub fn set(&self) -> Result<DemonstrationSet> {
        let set = self.set_of_any_size()?;
        set.check_several()?;
        Ok(set)
    }

    /// The same where one demonstration is enough, as it is for a prior that has been made.
    ///
    /// # Errors
    /// `is_bad_input` if there is none, they do not fit each other, or one holds a number that is not finite.
    pub fn set_of_any_size(&self) -> Result<DemonstrationSet> {
        DemonstrationSet::chosen(self.ids.clone(), self.demonstrations()?)
    }

    /// The same with episodes in the numbers of the task; those of another size than most stay as they are.
    #[must_use]
    pub fn converted(&self) -> Self {
        let mut converted = self.clone();
        if self.conversion.is_none() {
            return converted;
        }
        let usual = self.episodes.iter().map(Episode::sizes).find(|(_, acted)| *acted > 0);
        for episode in converted.episodes.iter_mut().filter(|episode| Some(episode.sizes()) == usual) {
            episode.observations = self.conversion.observations(&episode.observations);
            episode.actions = self.conversion.actions(&episode.actions);
        }
        converted.conversion = Conversion::default();
        converted
    }

    /// Whether these are demonstrations that fit each other, of which one is enough: what other tools want of a file.
    ///
    /// # Errors
    /// `is_bad_input` if they do not fit each other, or one holds a number that is not finite.
    pub fn check(&self) -> Result<()> {
        check_sizes(&self.ids, &self.recorded()?)
    }

    /// Each episode as a demonstration, however many there are, in the numbers of the task.
    ///
    /// # Errors
    /// `is_bad_input` if one is empty or holds a number that is not finite, or they differ in size and are to be converted.
    pub fn demonstrations(&self) -> Result<Vec<Demonstration>> {
        let recorded = self.recorded()?;
        if self.conversion.is_none() {
            return Ok(recorded);
        }
        check_sizes(&self.ids, &recorded)?;
        let converted = recorded.iter().map(|one| {
            let observations = self.conversion.observations(one.observations());
            Demonstration::new(observations, self.conversion.actions(one.actions()))
        });
        converted.collect()
    }

    /// The same in the numbers of the set.
    ///
    /// # Errors
    /// `is_bad_input` if one is empty or holds a number that is not finite.
    pub fn recorded(&self) -> Result<Vec<Demonstration>> {
        let bad: Vec<(String, String)> = self
            .episodes
            .iter()
            .filter_map(|episode| Some((episode.label.clone(), episode.fault()?)))
            .collect();
        if !bad.is_empty() {
            let words = bad.iter().map(|(label, fault)| format!("episode {label}: {fault}"));
            let words = shortened(words.collect(), "; ");
            let numbers = bad.iter().filter_map(|(label, _)| trailing_number(label));
            let numbers = numbers.map(|number| number.to_string()).collect::<Vec<_>>().join(",");
            return Err(Error::bad_input(words)
                .with_hint(format!("leave them out by --skip-bad, or by name: --without {numbers}")));
        }
        let demonstrations = self
            .episodes
            .iter()
            .map(|episode| Demonstration::new(episode.observations.clone(), episode.actions.clone()));
        demonstrations.collect()
    }
}

/// Tables side by side: one row of each makes a row.
///
/// # Errors
/// `is_bad_input` if one has another number of rows; names it.
pub(super) fn side_by_side(mut tables: Vec<(&str, Rows)>) -> Result<Rows> {
    let (first_name, first) = tables.first().ok_or_else(|| Error::bad_input("no column to read"))?;
    for (name, table) in &tables {
        if table.len() != first.len() {
            return Err(Error::bad_input(format!(
                "'{first_name}' has {} rows but '{name}' has {}; both must have one row a step",
                first.len(),
                table.len()
            )));
        }
    }
    let steps = first.len();
    if tables.len() == 1 {
        return Ok(tables.remove(0).1);
    }
    let width = tables.iter().map(|(_, table)| table.width()).sum();
    let mut joined = Vec::with_capacity(width * steps);
    for step in 0..steps {
        tables.iter().for_each(|(_, table)| joined.extend_from_slice(table.row(step)));
    }
    Rows::from_flat(joined, width)
}

/// The number at the end of a name, by which episodes are sorted: `demo_10` comes after `demo_9`.
pub(super) fn trailing_number(name: &str) -> Option<u64> {
    let digits = name.len() - name.bytes().rev().take_while(u8::is_ascii_digit).count();
    name[digits..].parse().ok()
}
