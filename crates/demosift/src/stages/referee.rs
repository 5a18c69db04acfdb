//! The referee (ours): final policies are trained on what could be kept, several times each, and what came out decides.
//!
//! Whether selecting helped cannot be seen in one training a side: another seed moves a policy by more than most
//! selections do. So each candidate (what was kept, the whole set, and random subsets as large as the kept) is imitated
//! by each imitator (cloning, GAIL and, where there is one, somebody else's trainer) several times, and the scores of the trainings are compared, never those of
//! episodes alone.
//!
//! | step | here |
//! |---|---|
//! | candidates × imitators are *pairs*; training t of every pair has the same seeds | [`Contest`], [`Unit`] |
//! | rounds of trainings; who is surely hopeless is dropped between them | [`Contest::next_units`], [`hopeless`] |
//! | at the end as many trainings of the whole set by each imitator, if only these can still decide | [`Contest::next_units`] |
//! | Welch's t of two pairs, with a floor under the spread | `welch` |
//! | what that says | [`decide`] |
//! | how often it is wrong | [`conclusion_rates`] |
//!
//! A policy's score is its `outcome`: the curve's best policy on episodes that did not choose it.
//! All trainings with one number share the initial policy, the random numbers of play and the evaluation episodes; pairs
//! are treated as independent all the same, which is on the safe side, since sharing makes them rise and fall together.
//! `docs/design.md` says why each choice was made, and holds the error rates that were measured.

mod by_trainer;
mod contest;
mod decision;
mod imitators;
mod rates;
mod welch;
mod words;

use rand::seq::IndexedRandom;
use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::basics::seed::Seed;
use crate::data::demonstration::DemoId;
use crate::learning::adapt::{InnerUpdate, Rule};
use crate::stages::imitate::{CurvePoint, Imitation, LearningCurve};
use crate::world::heuristic::Score;
use crate::world::trainer::TrainerIdentity;

pub use by_trainer::{ByTrainer, steps_by_trainer, train_by};
pub use contest::{Contest, Meant, Unit, hopeless, meant};
pub use decision::decide;
pub use imitators::{IMITATORS, Imitator, Refereeing};
pub use rates::{ConclusionRates, conclusion_rates, upper_bound};

/// Name of the stage in events and costs.
pub const STAGE: &str = "referee";

/// The probability of a wrong *helps*, over all pairs that are compared.
pub const LEVEL: f64 = 0.05;

/// Trainings that a pair needs on either side to be compared; with fewer it is shown and decides nothing.
pub const DECISIVE: usize = 3;

/// The name of what a run kept, where there is only one such subset.
pub const KEPT: &str = "kept";

/// A subset that could be trained on, by the name of who would keep it, such as `kept` or `kept by cloning`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedSubset {
    /// Its name, which follows "the 2 demonstrations".
    pub name: String,
    /// The demonstrations, in any order.
    pub demos: Vec<DemoId>,
    /// What is added to its name in files, such as `_keep_5`, where others of this name may have been trained on before.
    pub ending: String,
}

impl NamedSubset {
    /// These demonstrations under this name.
    pub fn new(name: &str, demos: &[DemoId]) -> Self {
        Self { name: name.to_owned(), demos: demos.to_vec(), ending: String::new() }
    }

    /// The same with something added to its name in files.
    pub fn ending_in(self, ending: &str) -> Self {
        Self { ending: ending.to_owned(), ..self }
    }
}

/// On which side of the comparison a candidate stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// What was kept.
    Kept,
    /// The whole set.
    Whole,
    /// The control: a random subset as large as a kept one, another for each training.
    Random,
}

/// What could be trained on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Candidate {
    /// Its names; several where several would keep the same.
    pub names: Vec<String>,
    /// Its name in files.
    pub key: String,
    /// Its side.
    pub side: Side,
    /// How many demonstrations it has.
    pub size: usize,
    /// Which; `None` where each training has others.
    pub demos: Option<Vec<DemoId>>,
}

/// The candidates: the kept, each once, in their order; the whole set; and random subsets of each size among the kept.
///
/// What would keep the whole set is a name of the whole set.
///
/// # Errors
/// `is_bad_input` if a subset is empty.
pub fn candidates(ids: &[DemoId], kept: &[NamedSubset]) -> Result<Vec<Candidate>> {
    let mut whole = Candidate {
        names: vec!["all".to_owned()],
        key: "all".to_owned(),
        side: Side::Whole,
        size: ids.len(),
        demos: Some(ids.to_vec()),
    };
    let mut found: Vec<Candidate> = Vec::new();
    for NamedSubset { name, demos, ending } in kept {
        let mut demos = demos.clone();
        demos.sort_unstable();
        demos.dedup();
        if demos.is_empty() {
            return Err(Error::bad_input(format!("nothing to imitate: the subset '{name}' is empty")));
        }
        let demos = Some(demos);
        let same = found.iter_mut().chain([&mut whole]).find(|candidate| candidate.demos == demos);
        match same {
            Some(candidate) => candidate.names.push(name.clone()),
            None => {
                let size = demos.as_ref().map_or(0, Vec::len);
                let key = key(&format!("{name}{ending}"), &found);
                found.push(Candidate { names: vec![name.clone()], key, side: Side::Kept, size, demos });
            }
        }
    }
    let mut sizes: Vec<usize> = found.iter().map(|candidate| candidate.size).collect();
    sizes.sort_unstable();
    sizes.dedup();
    let random = |size| Candidate {
        names: vec![format!("random {size}")],
        key: format!("random_{size}"),
        side: Side::Random,
        size,
        demos: None,
    };
    found.push(whole);
    found.extend(sizes.into_iter().map(random));
    Ok(found)
}

/// A kept candidate's name as it may stand in that of a file, unlike those that are taken.
fn key(name: &str, taken: &[Candidate]) -> String {
    let plain = |letter: char| if letter.is_ascii_alphanumeric() { letter.to_ascii_lowercase() } else { '_' };
    let mut key: String = name.chars().map(plain).collect();
    if !key.starts_with("kept") {
        key = format!("kept_{key}");
    }
    let is_taken = |key: &str| taken.iter().any(|candidate| candidate.key == key);
    match is_taken(&key) {
        false => key,
        true => (2..)
            .map(|number| format!("{key}_{number}"))
            .find(|key| !is_taken(key))
            .expect("numbers do not end"),
    }
}

impl Candidate {
    /// What a training imitates, in the order of the set; `seed` is that of the training.
    pub fn demos_of(&self, ids: &[DemoId], seed: &Seed) -> Vec<DemoId> {
        self.demos.clone().unwrap_or_else(|| {
            let mut rng = seed.of("random_subset").into_rng();
            let mut demos: Vec<DemoId> = ids.sample(&mut rng, self.size).copied().collect();
            demos.sort_unstable();
            demos
        })
    }
}

/// The result of one training.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Training {
    /// The chosen policy on episodes that did not choose it: the score that decides.
    pub outcome: CurvePoint,
    /// The last policy on the same episodes.
    pub end: CurvePoint,
    /// The score that chose the policy.
    pub chosen_by: Score,
}

impl Training {
    /// What a finished learning curve says.
    pub fn of(curve: &LearningCurve) -> Self {
        let chosen_by = curve.best_point().unwrap_or(&curve.outcome).score;
        Self { outcome: curve.outcome, end: curve.end, chosen_by }
    }
}

/// A candidate by an imitator, with its trainings so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Trained {
    /// Which of the candidates.
    pub candidate: usize,
    /// By whom.
    pub imitator: Imitator,
    /// In order.
    pub trainings: Vec<Training>,
    /// Whether it was given up early, as it was surely worse than the best of its side.
    pub dropped: bool,
}

/// How a policy is imitated from scratch by this rule, no matter what the configuration asks for elsewhere.
pub fn imitation_by(imitator: Rule, imitation: &Imitation) -> Imitation {
    let update = InnerUpdate { imitation: imitator, ..imitation.update.clone() };
    Imitation { update, ..imitation.clone() }
}

/// What the referee says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Verdict {
    /// What the comparison says.
    pub conclusion: Conclusion,
    /// The same in one sentence, with what to train on.
    pub sentence: String,
    /// The best kept pair beside the best pair of the whole set, where both were compared.
    pub difference: Option<Difference>,
    /// What to train on and by which imitator: one of the pairs; `None` where nothing was trained.
    pub winner: Option<usize>,
    /// Which of the winner's trainings made the policy that is handed over: the best by the episodes that chose it.
    pub best_training: Option<usize>,
    /// How many kept pairs were compared; the level is divided by it.
    pub compared: usize,
    /// The probability of a wrong *helps*, over all of them.
    pub level: f64,
    /// How many trainings were asked for, where that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub asked: Option<Refereeing>,
    /// Who is meant by the imitator `trainer`, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trainer: Option<TrainerIdentity>,
    /// What could be trained on.
    pub candidates: Vec<Candidate>,
    /// Candidates by imitators, with their results.
    pub pairs: Vec<Pair>,
}

impl Verdict {
    /// The demonstrations to train on, in the order of the set; `None` where nothing was trained.
    pub fn recommended(&self) -> Option<&[DemoId]> {
        let pair = &self.pairs[self.winner?].trained;
        self.candidates[pair.candidate].demos.as_deref()
    }

    /// The names of what it recommends to train on, such as `kept by cloning`; `None` where nothing was trained.
    pub fn winner_names(&self) -> Option<&[String]> {
        let pair = &self.pairs[self.winner?].trained;
        Some(&self.candidates[pair.candidate].names)
    }

    /// An imitator as people call it.
    pub fn imitator_name(&self, imitator: Imitator) -> &str {
        match (imitator, &self.trainer) {
            (Imitator::Trainer, Some(trainer)) => &trainer.name,
            _ => imitator.name(),
        }
    }

    /// Who made the policies of the winner; `None` where nothing was trained.
    pub fn winning_imitator(&self) -> Option<Imitator> {
        Some(self.pairs[self.winner?].trained.imitator)
    }
}

/// What the comparison says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Conclusion {
    /// The kept beat the whole set and random subsets of their size.
    Helps,
    /// The kept beat the whole set, and not surely random subsets of their size: fewer help, no matter which.
    FewerHelps,
    /// Neither side is surely better.
    CannotTell,
    /// The whole set is surely better than all that was kept.
    DoesNotHelp,
    /// All were kept, or there were too few trainings.
    NothingToCompare,
}

/// How much better one pair is than another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Difference {
    /// The pair that is better by so much.
    pub of: usize,
    /// Than this one.
    pub over: usize,
    /// The difference of the means.
    pub by: Score,
    /// Lower limit: above 0 the first is surely better. Limits are at the level of the test, divided by the pairs compared.
    pub low: Score,
    /// Upper limit.
    pub high: Score,
}

/// A pair with its result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Pair {
    /// Which, and its trainings.
    #[serde(flatten)]
    pub trained: Trained,
    /// Mean of the outcomes.
    pub mean: Score,
    /// Lower end of the 95 % interval of that mean over trainings; `None` with a single training.
    pub low: Option<Score>,
    /// Upper end.
    pub high: Option<Score>,
    /// Mean score of the last policies.
    pub end: Score,
    /// Mean share of episodes that reached the goal, where the task says.
    pub success: Option<f64>,
    /// Whether it has trainings enough to be compared.
    pub is_compared: bool,
}

#[cfg(test)]
mod tests;
