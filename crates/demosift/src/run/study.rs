//! The measuring stick (not in the paper): which judge agrees best with the truth, over many sets and seeds, and can the
//! difference be told from luck?
//!
//! A study is a plan: sets with what is known of them, methods of judging, and trainings that tell what a demonstration or a
//! subset really teaches.
//! It falls into [`Work`], each piece of which depends on nothing but its set, its configuration and its seed; [`make`] makes
//! one, in any order and on any machine.
//! What was [`Finished`] is then [`summary::summarize`]d, however much of it there is.
//!
//! | word | means |
//! |---|---|
//! | cell | one piece of work with its result: set × method × seed, or set × subset × imitator × seed |
//! | truth | what a method is held against: the oracle, or a return or stage that is known |
//! | oracle | the trainings on each demonstration alone |
//! | ceiling | how well the oracle agrees with itself, each seed against the mean of the others |
//!
//! All of a method's numbers are paired by seed with those of the others, and so are trainings.

pub mod bodies;
mod choice;
pub mod claims;
pub mod compact;
pub mod curves;
pub mod draw;
mod drawn;
pub mod estimate;
mod fingerprint;
pub mod make;
mod names;
mod parts;
mod plan;
pub mod pools;
mod referee_rates;
mod refereed;
mod showing;
pub mod steadiness;
pub mod summary;
pub mod told;
mod truth;
pub mod variants;
pub mod weighed;
mod work;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::basics::files;
use crate::data::demonstration::DemoId;
use crate::learning::adapt::Rule;
use crate::results::panel::Vote;
use crate::stages::imitate::CurvePoint;
use crate::stages::subset_selection::WeighingEnd;
use crate::world::heuristic::Score;

pub use choice::{Choice, Kept, TopK};
pub use drawn::{By, Claim, Curves, Drawn, Draws, Figure, Measure, WHOLE, Weights};
pub use fingerprint::{Fingerprint, hash_of_entering};
pub use names::names;
pub use parts::{Known, Pool, Seeds, Set};
pub use plan::{Combination, Judge, Only, Regret, Rule as CombinationRule, Study};
pub use referee_rates::RefereedSummary;
pub use refereed::Refereed;
pub use truth::Against;

/// What a cell is to find out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Work {
    /// A method judges a set.
    Judging {
        /// Of which set.
        set: String,
        /// By which method.
        method: String,
        /// The root of all its random numbers.
        seed: u64,
    },
    /// A method selects a subset by weights (Algorithm 3).
    Weighing {
        /// Of which set.
        set: String,
        /// From the prior of which method.
        method: String,
        /// The root of all its random numbers.
        seed: u64,
    },
    /// A policy is trained on some demonstrations of a set.
    Training {
        /// Of which set.
        set: String,
        /// On which demonstrations, in the order of the set.
        demos: Vec<DemoId>,
        /// By which rule.
        imitator: Rule,
        /// The root of all its random numbers, which are the same for whatever is imitated.
        seed: u64,
    },
}

impl Work {
    /// The set that it is about.
    pub fn set(&self) -> &str {
        match self {
            Self::Judging { set, .. } | Self::Weighing { set, .. } | Self::Training { set, .. } => set,
        }
    }

    /// The root of its random numbers.
    pub fn seed(&self) -> u64 {
        match self {
            Self::Judging { seed, .. } | Self::Weighing { seed, .. } | Self::Training { seed, .. } => *seed,
        }
    }

    /// A name that no other work of the study has, fit for a file.
    pub fn name(&self) -> String {
        match self {
            Self::Judging { set, method, seed } => {
                format!("judging_{}_{}_{seed}", file_name(set), file_name(method))
            }
            Self::Weighing { set, method, seed } => {
                format!("weighing_{}_{}_{seed}", file_name(set), file_name(method))
            }
            Self::Training { set, demos, imitator, seed } => {
                format!(
                    "training_{}_{}_{}_{seed}",
                    file_name(set),
                    imitator_name(*imitator),
                    subset_name(demos)
                )
            }
        }
    }
}

/// An imitator as files and tables call it.
pub fn imitator_name(imitator: Rule) -> &'static str {
    match imitator {
        Rule::Gail => "gail",
        Rule::BehavioralCloning => "cloning",
    }
}

/// Letters, digits and dashes of a name.
fn file_name(name: &str) -> String {
    name.chars().map(|letter| if letter.is_ascii_alphanumeric() { letter } else { '-' }).collect()
}

/// The ids, or of many their number and a hash.
fn subset_name(demos: &[DemoId]) -> String {
    const LISTED: usize = 16;
    let ids: Vec<String> = demos.iter().map(ToString::to_string).collect();
    let ids = ids.join("-");
    match demos.len() {
        0..=LISTED => ids,
        count => format!("{count}-of-{}", &files::sha256_of(ids.as_bytes())[..12]),
    }
}

/// What a part of a cell cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Cost {
    /// Environment steps.
    pub environment_steps: u64,
    /// Seconds by the clock that was passed in: of a processor, where the command measures.
    pub seconds: f64,
}

impl Cost {
    /// The seconds in hours.
    pub fn processor_hours(&self) -> f64 {
        self.seconds / 3600.0
    }
}

impl std::ops::Add for Cost {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            environment_steps: self.environment_steps + other.environment_steps,
            seconds: self.seconds + other.seconds,
        }
    }
}

/// What a method found of one demonstration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JudgedDemonstration {
    /// S (Eq. 8).
    pub score: Score,
    /// Mean K after imitating it.
    pub after: Score,
    /// The same of each repeat.
    pub repeats: Vec<Score>,
}

/// The result of judging a set once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JudgingResult {
    /// In the order of the set.
    pub demonstrations: Vec<JudgedDemonstration>,
    /// Table 1.
    pub adapted_behaviors_distance: f64,
    /// What is paid once for a set: making the prior.
    pub once: Cost,
    /// What judging all demonstrations cost on top.
    pub judging: Cost,
    /// Whether the judge would have a vote in a run; older cells do not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vote: Option<Vote>,
    /// How the adaptations went, where episodes were played on the way; a compact file has it where a figure shows it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adaptation: Option<Adaptation>,
    /// What the prior learned, where it is meta-learned; older cells do not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<PriorLearned>,
}

/// What is to be known of a meta-learned prior.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PriorLearned {
    /// Meta-updates that its share of the budget paid for.
    pub meta_updates: usize,
    /// The share of the spread of the encodings that the posterior explains on trajectories that it was not trained on, the mean
    /// over the last half of the updates; missing without mutual information. At 0 or below Q tells nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub explained: Option<f64>,
}

/// The heuristic in the course of imitating each demonstration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Adaptation {
    /// Inner updates made until then, `[points]`.
    pub updates: Vec<usize>,
    /// Mean K of the episodes that the next update learned from, over the repeats, `[n][points]`.
    pub score: Vec<Vec<Score>>,
}

/// What came of selecting a subset by weights once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WeighingResult {
    /// The weights after each round, `[rounds][n]`.
    pub weights: Vec<Vec<f64>>,
    /// Why there were no more rounds.
    pub end: WeighingEnd,
    /// What is kept, in the order of the set.
    pub demos: Vec<DemoId>,
    /// What is paid once for a set: making the prior.
    pub once: Cost,
    /// What the rounds cost on top.
    pub weighing: Cost,
}

impl JudgingResult {
    /// S of all demonstrations.
    pub fn scores(&self) -> Vec<Score> {
        self.demonstrations.iter().map(|demonstration| demonstration.score).collect()
    }
}

/// How good a policy is, by episodes of its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Outcome {
    /// Mean heuristic.
    pub score: Score,
    /// Share of episodes that succeeded, where the task says.
    pub success: Option<f64>,
    /// Mean true return of the episodes, where the task knows one.
    pub true_return: Option<f64>,
    /// Standard error of `score` over the episodes; 0 in files from before it was kept.
    #[serde(default)]
    pub standard_error: f64,
}

/// Evaluations in the course of a training, `[points]` each.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Curve {
    /// Updates made until then.
    pub updates: Vec<usize>,
    /// Environment steps learned from until then.
    pub environment_steps: Vec<usize>,
    /// Mean heuristic.
    pub score: Vec<Score>,
    /// Share of episodes that succeeded; empty where the task does not say.
    pub success: Vec<f64>,
}

impl Curve {
    /// Of these evaluations.
    pub fn of(points: &[CurvePoint]) -> Self {
        Self {
            updates: points.iter().map(|point| point.updates).collect(),
            environment_steps: points.iter().map(|point| point.environment_steps).collect(),
            score: points.iter().map(|point| point.score).collect(),
            success: points.iter().filter_map(|point| point.success).collect(),
        }
    }

    /// Whether it was not kept.
    pub fn is_empty(&self) -> bool {
        self.score.is_empty()
    }
}

/// The result of training once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct TrainingResult {
    /// The last policy; the truth is taken from it, since no choice flatters it.
    pub end: Outcome,
    /// The best policy on the way, on episodes that did not choose it.
    pub chosen: Outcome,
    /// What it cost.
    pub cost: Cost,
    /// How it went; empty in a compact file, and of trainings from before it was kept.
    #[serde(default, skip_serializing_if = "Curve::is_empty")]
    pub curve: Curve,
}

/// The result of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Found {
    /// Of judging.
    Judging(JudgingResult),
    /// Of weighing.
    Weighing(WeighingResult),
    /// Of training.
    Training(TrainingResult),
    /// Learning diverged, or the simulator did; it would again.
    Failed(String),
}

/// Work with its result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cell {
    /// What was to be found out.
    pub work: Work,
    /// What was found.
    pub found: Found,
    /// What it was made with.
    #[serde(rename = "of")]
    pub fingerprint: Fingerprint,
}

/// All cells that are there, by the name of their work.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Finished(BTreeMap<String, Cell>);

impl Finished {
    /// Adds a cell.
    pub fn add(&mut self, cell: Cell) {
        self.0.insert(cell.work.name(), cell);
    }

    /// Takes a cell out.
    pub fn forget(&mut self, work: &Work) {
        self.0.remove(&work.name());
    }

    /// The result of some work, be it a failure.
    pub fn cell(&self, work: &Work) -> Option<&Cell> {
        self.0.get(&work.name()).filter(|cell| cell.work == *work)
    }

    /// Whether there is a result of some work, be it a failure.
    pub fn holds(&self, work: &Work) -> bool {
        self.0.contains_key(&work.name())
    }

    /// All cells, by name.
    pub fn cells(&self) -> impl Iterator<Item = &Cell> {
        self.0.values()
    }

    /// The failed ones, each with its error.
    pub fn failures(&self) -> Vec<(String, String)> {
        let failed = |cell: &Cell| match &cell.found {
            Found::Failed(error) => Some((cell.work.name(), error.clone())),
            _ => None,
        };
        self.cells().filter_map(failed).collect()
    }

    /// Hash of the demonstrations of a set, and which episodes of them, once it was judged.
    fn demonstrations_of(&self, set: &str) -> Option<&str> {
        let judges = |cell: &&Cell| matches!(&cell.work, Work::Judging { set: of, .. } if of == set);
        self.cells().find(judges).map(|cell| cell.fingerprint.set.as_str())
    }

    /// What judging found, if it is finished and did not fail.
    pub fn judging(&self, set: &str, method: &str, seed: u64) -> Option<&JudgingResult> {
        let work = Work::Judging { set: set.to_owned(), method: method.to_owned(), seed };
        match &self.0.get(&work.name())?.found {
            Found::Judging(result) => Some(result),
            _ => None,
        }
    }

    /// What weighing found, if it is finished and did not fail.
    pub fn weighing(&self, set: &str, method: &str, seed: u64) -> Option<&WeighingResult> {
        let work = Work::Weighing { set: set.to_owned(), method: method.to_owned(), seed };
        match &self.0.get(&work.name())?.found {
            Found::Weighing(result) => Some(result),
            _ => None,
        }
    }

    /// What training found, if it is finished and did not fail.
    pub fn training(
        &self,
        set: &str,
        demos: &[DemoId],
        imitator: Rule,
        seed: u64,
    ) -> Option<&TrainingResult> {
        let work = Work::Training { set: set.to_owned(), demos: demos.to_vec(), imitator, seed };
        match &self.0.get(&work.name())?.found {
            Found::Training(result) => Some(result),
            _ => None,
        }
    }
}

impl FromIterator<Cell> for Finished {
    fn from_iter<I: IntoIterator<Item = Cell>>(cells: I) -> Self {
        let mut finished = Self::default();
        cells.into_iter().for_each(|cell| finished.add(cell));
        finished
    }
}

#[cfg(test)]
mod tests;
