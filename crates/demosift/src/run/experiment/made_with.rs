//! What the stages of a run are made with: the flow hands it to the stage, and the forecast counts what that will play.
//!
//! So nothing of a configuration is read in two places: how many rounds, updates, repeats and episodes there are is said here
//! and in the stages alone.

use std::borrow::Cow;

use super::{Config, Run, near_cut, sparing};
use crate::basics::error::Result;
use crate::basics::seed::Seed;
use crate::data::demonstration::{DemonstrationSet, Extent};
use crate::data::likeness::TrainedOn;
use crate::learning::adapt::{InnerUpdate, Rule};
use crate::results::artifact::Artifact as _;
use crate::results::panel::Judge;
use crate::results::report;
use crate::stages::judge::{self, Judging};
use crate::stages::meta_train::{Learning, MetaTraining, MutualInformation};
use crate::stages::method::{self, Asked, Budget, Method};
use crate::stages::pre_train::PreTraining;
use crate::stages::subset_selection::{self, Means};
use crate::world::environment::Specification;
use crate::world::rollout::Playground;

/// How the run's method spends its budget.
pub fn budget(run: &Run<'_>) -> Budget {
    let Run { set, playground, config, .. } = run;
    method::budget(config.method, set, playground, &asked(config, set), &learning_seed(config))
}

/// Whether the budget of the run's method pays for any learning; the error says what would.
pub fn check_budget(set: &DemonstrationSet, playground: &Playground<'_>, config: &Config) -> Result<()> {
    method::check_budget(config.method, set, playground, &asked(config, set), &learning_seed(config))
}

fn asked<'a>(config: &'a Config, set: &DemonstrationSet) -> Asked<'a> {
    let Config { meta_train: training, inner, mutual_information, judge: judging, .. } = config;
    let learning = Learning { training, inner, information: Some(mutual_information) };
    Asked { learning, judging, judged: near_cut::how_many(config, set, Judge::Paper) }
}

pub(crate) fn learning_seed(config: &Config) -> Seed {
    Seed::new(config.seed).of("meta_train")
}

/// Mutual information, where the method has any.
pub(crate) fn information(config: &Config) -> Option<&MutualInformation> {
    (config.method == Method::MamlMi).then_some(&config.mutual_information)
}

/// How the prior is made, by the run's method.
pub(crate) enum Preparation<'a> {
    /// Algorithm 1, with as many rounds as the budget pays for.
    MetaTraining(MetaTraining),
    /// Imitation of the entire set (§5, Avg Fine-Tune).
    PreTraining(PreTraining<'a>),
    /// Nothing is learned before judging.
    Nothing,
}

pub(crate) fn preparation<'a>(run: &Run<'a>) -> Preparation<'a> {
    let config = run.config;
    match config.method {
        Method::Maml | Method::MamlMi => {
            let rounds = budget(run).updates;
            Preparation::MetaTraining(MetaTraining { rounds, ..config.meta_train.clone() })
        }
        Method::AvgFineTune => Preparation::PreTraining(PreTraining {
            updates: budget(run).updates,
            inner: &config.inner,
            checkpoint_every: config.meta_train.checkpoint_every,
        }),
        Method::FromScratch => Preparation::Nothing,
    }
}

/// What the run's method learns with in a training.
pub(crate) fn learning_by<'a>(config: &'a Config, training: &'a MetaTraining) -> Learning<'a> {
    Learning { training, inner: &config.inner, information: information(config) }
}

/// How one judge judges the set.
pub(crate) struct JudgedBy<'a> {
    /// How many demonstrations.
    pub(crate) demonstrations: usize,
    /// How long, how often and on what it is evaluated.
    pub(crate) judging: Judging,
    /// How an adaptation updates; `None` where somebody else's trainer imitates.
    pub(crate) inner: Option<Cow<'a, InnerUpdate>>,
    /// Whether each repeat starts from an untrained policy of its own, and not all from the prior.
    pub(crate) starts_anew: bool,
}

/// How large the set is beside which scores are to stand: that of the prior's first run, where a prior was given, so that new
/// demonstrations are imitated as long and as often as those; else the set itself, which the prior is then of.
fn extent_beside(run: &Run<'_>) -> Extent {
    // What is wrong with the file is told by those who cannot do without it.
    let of_prior = TrainedOn::recall(run.ledger, "").ok().flatten();
    of_prior.map_or_else(|| run.set.extent(), |trained_on| trained_on.extent())
}

/// That of the paper makes as many updates as its method's budget pays for.
pub(crate) fn judged_by<'a>(run: &Run<'a>, judge: Judge) -> JudgedBy<'a> {
    let config = run.config;
    let demonstrations = near_cut::how_many(config, run.set, judge);
    match judge {
        Judge::Cloning => JudgedBy {
            demonstrations,
            judging: sparing::judging(&config.cloning_judge, extent_beside(run)),
            inner: Some(Cow::Owned(cloning_update(config))),
            starts_anew: true,
        },
        Judge::Paper => JudgedBy {
            demonstrations,
            judging: Judging { iterations: budget(run).iterations, ..config.judge.clone() },
            inner: Some(Cow::Borrowed(&config.inner)),
            starts_anew: false,
        },
        Judge::Trainer => JudgedBy {
            demonstrations,
            judging: config.trainer_judge.judging(),
            inner: None,
            starts_anew: true,
        },
    }
}

impl JudgedBy<'_> {
    /// What judging the set of a run takes at most.
    pub(crate) fn effort(&self, run: &Run<'_>) -> judge::Effort {
        let task = run.playground.specification();
        let all = self.demonstrations;
        let inner = self.inner.as_deref();
        let effort = judge::Effort::of(all, task, &self.judging, inner, self.starts_anew);
        match inner {
            Some(inner) if !judge::is_kept_whole(all) => {
                effort.and_looking_at(most_looked_at(all, task), task, &self.judging, inner)
            }
            _ => effort,
        }
    }
}

/// How many of those that were judged are looked at afterward where the set is large, at most: over all goals and under each of
/// them.
fn most_looked_at(judged: usize, task: &Specification) -> usize {
    let rankings = match task.variants.len() {
        1 => 1,
        variants => 1 + variants,
    };
    judged.min(rankings * report::MOST_WORTH_A_LOOK)
}

/// The inner update of the judge by behavioral cloning.
pub(crate) fn cloning_update(config: &Config) -> InnerUpdate {
    InnerUpdate {
        imitation: Rule::BehavioralCloning,
        alphas: vec![1.0],
        cloning: config.cloning_judge.cloning.clone(),
        ..config.inner.clone()
    }
}

/// A selection by weights: with what, and with which random numbers.
pub(crate) struct WeighedBy<'a> {
    pub(crate) means: Means<'a>,
    pub(crate) seed: Seed,
}

pub(crate) fn weighed_by(config: &Config) -> WeighedBy<'_> {
    let means = Means {
        selection: &config.subset_selection,
        learning: learning_by(config, &config.meta_train),
        judging: &config.judge,
    };
    WeighedBy { means, seed: Seed::new(config.seed).of(subset_selection::STAGE) }
}

impl WeighedBy<'_> {
    /// What it takes at most.
    pub(crate) fn effort(&self, run: &Run<'_>) -> subset_selection::Effort {
        subset_selection::Effort::of(run.set, run.playground, &self.means, &self.seed)
    }
}
