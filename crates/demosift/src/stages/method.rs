//! The paper's methods of judging (§5, §5.4) under one interface, and the budget that is the same for all of them.
//!
//! A method is a way to make the parameters that judging adapts to each demonstration.
//! All may spend the environment steps that meta-training and judging by plain MAML spend, the *quota* of §5.4; this file
//! is the one place that says how each spends them.
//!
//! | method | makes the prior by | spends the quota on |
//! |---|---|---|
//! | `maml` | Algorithm 1 without its lines 10 to 14 | the configuration's rounds and judging: that is the quota |
//! | `maml-mi` | Algorithm 1 | the same judging, and as many whole rounds as the rest pays for: lines 10 and 12 play too |
//! | `avg-fine-tune` | imitating the entire set | the same judging, and as many updates as the rest pays for |
//! | `from-scratch` | nothing: an untrained policy | judging alone, with as many iterations of every adaptation as it pays for |
//!
//! What a method cannot spend is less than one of its own steps: a round, an update, or an iteration of every adaptation.
//! All counts take episodes to last to the horizon. Where they end early, what learns by GAIL fills its batches with more of them,
//! and lines 10 and 12 do not, so `maml-mi` plays fewer steps than it may.
//! By behavioral cloning, which plays nothing to learn, the quota is counted in inner updates instead, and what mutual
//! information plays comes on top; an update toward the entire set goes over more pairs than one toward a demonstration.
//! The policies learned from subsets afterwards are no part of the quota; they have a budget of their own.
//!
//! Where we differ: the paper counts the quota in iterations, which cost different things in meta-training and judging;
//! environment steps cost the same everywhere.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::basics::seed::Seed;
use crate::data::demonstration::DemonstrationSet;
use crate::learning::adapt::Rule;
use crate::math::arithmetic::Arithmetic;
use crate::stages::judge::{Effort, Judging};
use crate::stages::meta_train::{self, Learning};
use crate::stages::pre_train;
use crate::world::rollout::Playground;

/// How the parameters are made that judging adapts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Meta-imitation-learning (§4.1).
    Maml,
    /// Meta-imitation-learning, regularized by mutual information (§4.2).
    MamlMi,
    /// Pre-training on the entire set, then fine-tuning (§5).
    AvgFineTune,
    /// Nothing: each demonstration is imitated by an untrained policy (§5.4).
    FromScratch,
}

impl Method {
    /// All methods by name, in the order of the table above.
    pub const ALL: [(&'static str, Self); 4] = [
        ("maml", Self::Maml),
        ("maml-mi", Self::MamlMi),
        ("avg-fine-tune", Self::AvgFineTune),
        ("from-scratch", Self::FromScratch),
    ];

    /// Name of the stage that makes the prior, if there is one.
    pub fn stage(self) -> Option<&'static str> {
        match self {
            Self::Maml | Self::MamlMi => Some(meta_train::STAGE),
            Self::AvgFineTune => Some(pre_train::STAGE),
            Self::FromScratch => None,
        }
    }
}

impl std::fmt::Display for Method {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (name, _) = Self::ALL.iter().find(|(_, method)| method == self).expect("all methods have a name");
        name.fmt(out)
    }
}

/// What a configuration asks of meta-training and judging.
#[derive(Clone, Copy, Debug)]
pub struct Asked<'a> {
    /// Meta-training, with the mutual information that `maml-mi` uses.
    pub learning: Learning<'a>,
    /// Judging.
    pub judging: &'a Judging,
    /// How many demonstrations of the set are judged.
    pub judged: usize,
}

/// How a method spends the quota.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Budget {
    /// Environment steps that it may spend.
    pub quota: u64,
    /// Rounds of meta-training, or updates of pre-training.
    pub updates: usize,
    /// Inner updates of each adaptation in judging.
    pub iterations: usize,
}

/// How a method spends the quota; `seed` is that of meta-training.
pub fn budget(
    method: Method,
    set: &DemonstrationSet,
    playground: &Playground<'_>,
    asked: &Asked<'_>,
    seed: &Seed,
) -> Budget {
    match asked.learning.inner.imitation {
        Rule::Gail => budget_by_steps(method, set, playground, asked, seed),
        Rule::BehavioralCloning => budget_by_updates(method, set, playground, asked, seed),
    }
}

/// The quota in environment steps.
fn budget_by_steps(
    method: Method,
    set: &DemonstrationSet,
    playground: &Playground<'_>,
    asked: &Asked<'_>,
    seed: &Seed,
) -> Budget {
    let Asked { learning, judging, judged } = *asked;
    let Learning { training, inner, .. } = learning;
    let plainly = learning.plain();
    let judged_by =
        |judging| Effort::of(judged, playground.specification(), judging, Some(inner), false).steps();
    let judged = judged_by(judging);
    let rounds = |how| meta_train::steps_by_round(set, playground, how, seed);
    let learned: u64 = rounds(&plainly).take(training.rounds).sum();
    let plain = Budget { quota: learned + judged, updates: training.rounds, iterations: judging.iterations };
    match method {
        Method::Maml => plain,
        Method::MamlMi => Budget { updates: affordable(rounds(&learning), learned), ..plain },
        Method::AvgFineTune => {
            let update = pre_train::steps_of_update(inner, playground.specification().horizon);
            Budget { updates: (learned / update) as usize, ..plain }
        }
        Method::FromScratch => {
            let longer = Judging { iterations: judging.iterations + 1, ..judging.clone() };
            let iteration = judged_by(&longer) - judged;
            let iterations = judging.iterations + (learned / iteration) as usize;
            Budget { updates: 0, iterations, ..plain }
        }
    }
}

/// The quota in inner updates; what a method then plays is what it may.
fn budget_by_updates(
    method: Method,
    set: &DemonstrationSet,
    playground: &Playground<'_>,
    asked: &Asked<'_>,
    seed: &Seed,
) -> Budget {
    let Asked { learning, judging, judged } = *asked;
    let Learning { training, inner, .. } = learning;
    let task = playground.specification();
    let learned = training.rounds * training.meta_batch.min(set.len());
    let (updates, iterations) = match method {
        Method::Maml | Method::MamlMi => (training.rounds, judging.iterations),
        Method::AvgFineTune => (learned, judging.iterations),
        Method::FromScratch => {
            let at_once = judged * judging.repeats * task.variants.len();
            (0, judging.iterations + learned / at_once)
        }
    };
    let learned: u64 = match method {
        Method::AvgFineTune => pre_train::steps_of_update(inner, task.horizon) * updates as u64,
        _ => {
            let learning = if method == Method::MamlMi { learning } else { learning.plain() };
            meta_train::steps_by_round(set, playground, &learning, seed).take(updates).sum()
        }
    };
    let judging = Judging { iterations, ..judging.clone() };
    let judged = Effort::of(judged, task, &judging, Some(inner), false).steps();
    Budget { quota: learned + judged, updates, iterations }
}

/// Whether the budget pays for any learning, where some is asked for.
///
/// # Errors
/// `is_bad_config` if it does not; says what would be enough.
pub fn check_budget(
    method: Method,
    set: &DemonstrationSet,
    playground: &Playground<'_>,
    asked: &Asked<'_>,
    seed: &Seed,
) -> Result<()> {
    let learning = asked.learning;
    let Learning { training, inner, .. } = learning;
    let plainly = learning.plain();
    let learns = method.stage().is_some() && training.rounds > 0;
    if !learns || budget(method, set, playground, asked, seed).updates > 0 {
        return Ok(());
    }
    let rounds = |how| meta_train::steps_by_round(set, playground, how, seed);
    let price = match method {
        Method::AvgFineTune => pre_train::steps_of_update(inner, playground.specification().horizon),
        _ => rounds(&learning).next().unwrap_or(0),
    };
    let budget: u64 = rounds(&plainly).take(training.rounds).sum();
    // As many as the first is affordable after, and one more if that is not exactly its price.
    let enough = 1 + affordable(rounds(&plainly), price.saturating_sub(1));
    Err(Error::bad_config(format!(
        "meta_train.rounds = {} gives learning a budget of {budget} environment steps, and the first step of {method} \
         takes {price}; meta_train.rounds must be at least {enough}",
        training.rounds
    )))
}

/// How many things in a row can be paid for.
fn affordable(prices: impl Iterator<Item = u64>, budget: u64) -> usize {
    let sums = prices.scan(0, |sum, price| {
        *sum += price;
        Some(*sum)
    });
    sums.take_while(|sum| *sum <= budget).count()
}

/// What a stage of a run really took, and what it was computed with.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Spent {
    /// Environment steps in all, evaluations among them.
    pub environment_steps: u64,
    /// The arithmetic of each process that worked on it; of several, the same seed need not give the same bits elsewhere.
    pub arithmetic: BTreeSet<Arithmetic>,
}

/// What the stages of a run cost, beside what they may.
#[derive(Clone, Debug, PartialEq)]
pub struct Costs {
    /// Of this method.
    pub method: Method,
    /// Its budget.
    pub budget: Budget,
    /// Name of the stage in which the method's agent was judged.
    pub judging: String,
    /// Each finished stage by name, in the order of the flow.
    pub spent: Vec<(String, Spent)>,
    /// Demonstrations of the set.
    pub demonstrations: usize,
}

/// What judging by the method costs, in environment steps: a set that grows pays the first once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Account {
    /// For the prior; nothing where there is none.
    pub once: u64,
    /// For each demonstration, the mean.
    pub each: u64,
}

impl Costs {
    /// What was paid once and what for each demonstration, as soon as both are known.
    pub fn account(&self) -> Option<Account> {
        let once = match self.method.stage() {
            Some(stage) => self.of_stage(stage)?,
            None => 0,
        };
        self.account_beside(once)
    }

    /// The same where the prior was paid for elsewhere, by an earlier run.
    pub fn account_beside(&self, once: u64) -> Option<Account> {
        Some(Account { once, each: self.of_stage(&self.judging)? / self.demonstrations.max(1) as u64 })
    }

    /// The arithmetic of all stages.
    pub fn arithmetic(&self) -> BTreeSet<Arithmetic> {
        self.spent.iter().flat_map(|(_, spent)| spent.arithmetic.iter().copied()).collect()
    }

    fn of_stage(&self, stage: &str) -> Option<u64> {
        self.spent.iter().find(|(name, _)| name == stage).map(|(_, spent)| spent.environment_steps)
    }

    /// Environment steps spent of the quota: those of making the prior and of judging.
    pub fn of_quota(&self) -> u64 {
        let counts = |stage: &str| Some(stage) == self.method.stage() || stage == self.judging;
        let spent = self.spent.iter().filter(|(stage, _)| counts(stage));
        spent.map(|(_, spent)| spent.environment_steps).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn affordable_is_what_a_purse_pays_for_one_by_one() {
        assert_eq!(affordable([3, 1, 4, 1].into_iter(), 8), 3);
        assert_eq!(affordable([3, 1, 4, 1].into_iter(), 7), 2);
        assert_eq!(affordable(std::iter::repeat(5), 4), 0);
    }

    #[test]
    fn methods_are_written_as_they_are_read() {
        for (name, method) in Method::ALL {
            assert_eq!(method.to_string(), name);
            assert_eq!(serde_json::to_value(method).expect("plain data"), name);
        }
    }
}
