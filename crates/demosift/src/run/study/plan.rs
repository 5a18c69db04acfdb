//! What a study compares, on what and how often, and whether that fits together.

use serde::{Deserialize, Serialize};

use super::Work;
use super::choice::{Choice, TopK};
use super::drawn::Drawn;
use super::file_name;
use super::parts::{Known, Pool, Seeds, Set};
use super::refereed::Refereed;
use crate::basics::error::{Error, Result};
use crate::learning::adapt;

/// A study, without its files and configurations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// Its name.
    pub name: String,
    /// What is judged.
    pub sets: Vec<Set>,
    /// What judges; the first is what the others are compared with.
    pub methods: Vec<Judge>,
    /// By which imitators the oracle learns.
    pub oracle: Vec<adapt::Rule>,
    /// K of the hit rates.
    pub hits_at: Vec<TopK>,
    /// Regret, where it is asked for.
    pub regret: Option<Regret>,
    /// Trainings for their own sake.
    pub pools: Vec<Pool>,
    /// What the referee says of trainings that are drawn again.
    #[serde(default)]
    pub referees: Vec<Refereed>,
    /// What is drawn, and what is claimed of it.
    #[serde(default, skip_serializing_if = "Drawn::is_nothing")]
    pub drawn: Drawn,
}

/// A method of judging.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Judge {
    /// Its name in the study.
    pub name: String,
    /// Whether it judges by cloning, so that an oracle by cloning is no truth for it.
    pub clones: bool,
    /// Whether it learns its prior on each set itself, also where the set names another.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub own_prior: bool,
    /// What it is made of, if it has no cells of its own.
    pub combination: Option<Combination>,
}

/// A method that combines what others found with the same seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Combination {
    /// How.
    pub rule: Rule,
    /// Which others.
    pub of: Vec<String>,
}

/// How the scores of several methods become one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// The mean of the ranks, ties sharing theirs.
    Ranks,
    /// The mean of the scores, each method's standardized over the set.
    Scores,
    /// The mean of the scores of those that have a vote, as in a run of both judges; those of the first, if none has.
    Votes,
}

/// How much worse the policy from a method's top K is than that from the truly best K.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Regret {
    /// Each K.
    pub at: Vec<TopK>,
    /// Who learns from the top K.
    pub imitators: Vec<adapt::Rule>,
    /// Trainings on each subset, with the same seeds for all.
    pub trainings: Seeds,
}

/// Which part of a study's work is to be done; what is not named is all.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Only {
    /// Names of sets.
    pub sets: Option<Vec<String>>,
    /// Names of methods, and [`Only::ORACLE`], [`Only::REGRET`], [`Only::POOLS`], [`Only::WEIGHTS`] and [`Only::CURVES`].
    pub methods: Option<Vec<String>>,
}

impl Only {
    /// The oracle's trainings, where methods are named.
    pub const ORACLE: &str = "oracle";
    /// The trainings on the top K of the methods that are named.
    pub const REGRET: &str = "regret";
    /// The trainings of pools, the referee's among them.
    pub const POOLS: &str = "pools";
    /// The selections by weights of the methods that are named.
    pub const WEIGHTS: &str = "weights";
    /// The trainings on what the methods that are named keep, and on the whole set.
    pub const CURVES: &str = "curves";
    const KINDS: [&str; 5] = [Self::ORACLE, Self::REGRET, Self::POOLS, Self::WEIGHTS, Self::CURVES];

    /// Whether a method or a kind of trainings is to be done.
    pub(super) fn names(&self, name: &str) -> bool {
        self.methods.as_ref().is_none_or(|named| named.iter().any(|other| other == name))
    }

    /// Whether a set is to be judged.
    pub(super) fn is_about(&self, set: &str) -> bool {
        self.sets.as_ref().is_none_or(|named| named.iter().any(|other| other == set))
    }
}

impl Study {
    /// The set of this name.
    pub fn set(&self, name: &str) -> Option<&Set> {
        self.sets.iter().find(|set| set.name == name)
    }

    /// The method of this name.
    pub fn method(&self, name: &str) -> Option<&Judge> {
        self.methods.iter().find(|method| method.name == name)
    }

    /// Whether a method, or what it is made of, may be held against an oracle by this imitator: what clones is not held against
    /// cloning.
    pub(super) fn may_be_held_against(&self, method: &Judge, oracle: adapt::Rule) -> bool {
        let is_made_of = |name: &String| self.method(name).is_some_and(|part| part.clones);
        let clones =
            method.clones || method.combination.as_ref().is_some_and(|of| of.of.iter().any(is_made_of));
        !(clones && oracle == adapt::Rule::BehavioralCloning)
    }

    /// The set on which the prior of some work is learned, where that is not the set that is judged.
    pub fn lender(&self, work: &Work) -> Option<&str> {
        let (Work::Judging { method, .. } | Work::Weighing { method, .. }) = work else { return None };
        let learns_its_own = self.method(method).is_some_and(|method| method.own_prior);
        self.set(work.set())?.prior.as_deref().filter(|_| !learns_its_own)
    }

    /// Whether the parts of the study fit each other.
    ///
    /// # Errors
    /// `is_bad_config`; says what is wrong and what would be right.
    pub fn check(&self) -> Result<()> {
        check_names("set", self.sets.iter().map(|set| set.name.as_str()))?;
        check_names("method", self.methods.iter().map(|method| method.name.as_str()))?;
        if let Some(method) = self.methods.iter().find(|method| Only::KINDS.contains(&method.name.as_str())) {
            return Err(Error::bad_config(format!(
                "a method is called '{}', which names trainings; call it something else",
                method.name
            )));
        }
        for method in &self.methods {
            self.check_combination(method)?;
        }
        for set in &self.sets {
            for Known { kind, values } in &set.known {
                if values.len() != set.demonstrations || values.iter().any(|value| !value.is_finite()) {
                    return Err(Error::bad_config(format!(
                        "the set '{}' has {} demonstrations, and its {kind} {} finite numbers; there must be one each",
                        set.name,
                        set.demonstrations,
                        values.len()
                    )));
                }
            }
        }
        self.sets.iter().try_for_each(|set| self.check_prior(set))?;
        self.check_drawn()?;
        self.pools.iter().try_for_each(|pool| self.check_pool(pool))?;
        self.referees.iter().try_for_each(|refereed| {
            refereed.check()?;
            refereed.pools(None).iter().try_for_each(|pool| self.check_pool(pool))
        })
    }

    /// All pools: those that are asked for, and those that the referee draws from.
    pub(super) fn all_pools(&self) -> Vec<Pool> {
        let of_referee = |refereed: &Refereed| refereed.pools(self.set(&refereed.set));
        self.pools.iter().cloned().chain(self.referees.iter().flat_map(of_referee)).collect()
    }

    /// Whether the prior that a set is judged from can be learned on the set that it names.
    fn check_prior(&self, set: &Set) -> Result<()> {
        let Some(name) = &set.prior else { return Ok(()) };
        let of = self.set(name).ok_or_else(|| unknown("set", name, self.set_names()))?;
        let wrong = |what: String| Err(Error::bad_config(format!("the set '{}': {what}", set.name)));
        if of.name == set.name || of.prior.is_some() {
            return wrong(format!("its prior = \"{name}\" must be another set, which has no prior itself"));
        }
        match (&of.task, &of.variant) == (&set.task, &set.variant) {
            true => Ok(()),
            false => wrong(format!("its prior is learned on '{name}', which is of another task or variant")),
        }
    }

    pub(super) fn check_methods(&self, named: &[String], besides: &[&str]) -> Result<()> {
        check_known("method", named, self.method_names().into_iter().chain(besides.iter().copied()).collect())
    }

    pub(super) fn check_sets(&self, named: &[String]) -> Result<()> {
        check_known("set", named, self.set_names())
    }

    fn check_combination(&self, method: &Judge) -> Result<()> {
        let Some(combination) = &method.combination else { return Ok(()) };
        let direct: Vec<&str> =
            self.methods.iter().filter(|of| of.combination.is_none()).map(|of| of.name.as_str()).collect();
        match combination.of.iter().find(|name| !direct.contains(&name.as_str())) {
            Some(name) => Err(Error::bad_config(format!(
                "the method '{}' combines '{name}', and can combine: {}",
                method.name,
                direct.join(", ")
            ))),
            None if combination.of.is_empty() => {
                Err(Error::bad_config(format!("the method '{}' combines nothing", method.name)))
            }
            None => Ok(()),
        }
    }

    fn check_pool(&self, pool: &Pool) -> Result<()> {
        let set = self.set(&pool.set).ok_or_else(|| unknown("set", &pool.set, self.set_names()))?;
        let count = set.demonstrations;
        for choice in &pool.subsets {
            let wrong = |what: String| Err(Error::bad_config(format!("the pool of '{}': {what}", pool.set)));
            match choice {
                Choice::KeptBy { method, .. } if self.method(method).is_none() => {
                    return Err(unknown("method", method, self.method_names()));
                }
                Choice::KeptBy { seed: Some(seed), .. } if !set.seeds.each().any(|known| known == *seed) => {
                    return wrong(format!("the set is not judged with seed {seed}"));
                }
                Choice::KeptBy { k, .. } | Choice::Random(k) if k.of(count).is_none() => {
                    return wrong(format!(
                        "K = {k} of {count} demonstrations; it must leave some and take some"
                    ));
                }
                Choice::Ids(ids) if ids.is_empty() || ids.iter().any(|id| *id >= count) => {
                    return wrong(format!("the ids {ids:?}; there are 0 to {}", count - 1));
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn set_names(&self) -> Vec<&str> {
        self.sets.iter().map(|set| set.name.as_str()).collect()
    }

    fn method_names(&self) -> Vec<&str> {
        self.methods.iter().map(|method| method.name.as_str()).collect()
    }

    /// The part of the study that is about these sets.
    pub fn about(&self, sets: &[String]) -> Self {
        let mut part = self.clone();
        part.sets.retain(|set| sets.contains(&set.name));
        part.pools.retain(|pool| sets.contains(&pool.set));
        part.referees.retain(|refereed| sets.contains(&refereed.set));
        part
    }

    /// Whether the names are those of the study.
    ///
    /// # Errors
    /// `is_bad_config`; says which there are.
    pub fn check_only(&self, only: &Only) -> Result<()> {
        check_known("set", only.sets.as_deref().unwrap_or_default(), self.set_names())?;
        let known = self.method_names().into_iter().chain(Only::KINDS).collect();
        check_known("method", only.methods.as_deref().unwrap_or_default(), known)
    }

    /// Whether judging by a method is to be done: it is named, or what is named is made of it or keeps by it.
    pub(super) fn needs(&self, only: &Only, judge: &Judge) -> bool {
        let pools = if only.names(Only::POOLS) { self.all_pools() } else { Vec::new() };
        let keeps_by = |method: &str| {
            let mut choices = pools.iter().flat_map(|pool| &pool.subsets);
            choices.any(|choice| matches!(choice, Choice::KeptBy { method: keeper, .. } if keeper == method))
        };
        let is_wanted = |method: &Judge| only.names(&method.name) || keeps_by(&method.name);
        let is_made_of =
            |other: &Judge| other.combination.as_ref().is_some_and(|of| of.of.contains(&judge.name));
        is_wanted(judge) || self.methods.iter().any(|other| is_made_of(other) && is_wanted(other))
    }
}

/// Each name once, and files can tell them apart.
fn check_names<'a>(what: &str, names: impl Iterator<Item = &'a str>) -> Result<()> {
    let mut seen = std::collections::BTreeMap::new();
    for name in names {
        let other = seen.insert(file_name(name), name);
        match other {
            Some(other) if other == name => {
                return Err(Error::bad_config(format!("there are two {what}s called '{name}'")));
            }
            Some(other) => {
                return Err(Error::bad_config(format!(
                    "the {what}s '{other}' and '{name}' would have the same files; one needs other letters or digits"
                )));
            }
            None => {}
        }
    }
    match seen.is_empty() {
        true => Err(Error::bad_config(format!("the study has no {what}"))),
        false => Ok(()),
    }
}

fn check_known(what: &str, named: &[String], known: Vec<&str>) -> Result<()> {
    match named.iter().find(|name| !known.contains(&name.as_str())) {
        Some(name) => Err(unknown(what, name, known)),
        None => Ok(()),
    }
}

fn unknown(what: &str, name: &str, known: Vec<&str>) -> Error {
    Error::bad_config(format!("the study has no {what} '{name}'; it has: {}", known.join(", ")))
}
