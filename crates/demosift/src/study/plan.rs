//! What a study compares, on what and how often; and which work that is, as far as it can be known yet.
//!
//! The work on subsets depends on what judging found, so it is asked for again when more is [`Finished`].

use std::fmt;
use std::str::FromStr;

use rand::seq::IndexedRandom as _;
use serde::{Deserialize, Serialize};

use super::{Finished, Known, Work, file_name};
use crate::adapt;
use crate::demonstration::DemoId;
use crate::error::{Error, Result};
use crate::heuristic::Score;
use crate::seed::Seed;

/// A study, without its files and configurations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
}

/// Consecutive seeds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Seeds {
    /// The first.
    pub first: u64,
    /// How many.
    pub count: usize,
}

impl Seeds {
    /// Each of them.
    pub fn each(self) -> impl Iterator<Item = u64> + Clone {
        (0..self.count as u64).map(move |index| self.first + index)
    }
}

/// A set with what is known of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Set {
    /// Its name in the study.
    pub name: String,
    /// The task in which it is judged.
    pub task: String,
    /// The one variant of the task, where it has several.
    pub variant: Option<String>,
    /// Of the heuristic.
    pub unit: String,
    /// Which episodes of its file it consists of; all, if it does not say. Its own ids count from 0.
    pub episodes: Option<Vec<usize>>,
    /// How many demonstrations it has.
    pub demonstrations: usize,
    /// With which seeds it is judged.
    pub seeds: Seeds,
    /// With which seeds the oracle learns; none, if there is no oracle.
    pub oracle_seeds: Seeds,
    /// Whether regret is asked for.
    pub regret: bool,
    /// What is known to be true of each demonstration, beside the oracle.
    pub known: Vec<Known>,
}

/// A method of judging.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Judge {
    /// Its name in the study.
    pub name: String,
    /// Whether it judges by cloning, so that an oracle by cloning is no truth for it.
    pub clones: bool,
    /// What it is made of, if it has no cells of its own.
    pub combination: Option<Combination>,
}

/// A method that combines what others found with the same seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Combination {
    /// How.
    pub rule: Rule,
    /// Which others.
    pub of: Vec<String>,
}

/// How the scores of several methods become one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// The mean of the ranks, ties sharing theirs.
    Ranks,
    /// The mean of the scores, each method's standardized over the set.
    Scores,
}

/// How much worse the policy from a method's top K is than that from the truly best K.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Regret {
    /// Each K.
    pub at: Vec<TopK>,
    /// Who learns from the top K.
    pub imitators: Vec<adapt::Rule>,
    /// Trainings on each subset, with the same seeds for all.
    pub trainings: Seeds,
}

/// Trainings on subsets, for their own sake.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pool {
    /// Of which set.
    pub set: String,
    /// On which of its subsets.
    pub subsets: Vec<Choice>,
    /// Who learns.
    pub imitator: adapt::Rule,
    /// How often, with the same seeds for each subset.
    pub trainings: Seeds,
}

/// A number of demonstrations, written as a number, `half` or `quarter`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "Written", try_from = "Written")]
pub enum TopK {
    /// So many.
    Count(usize),
    /// Half of the set, rounded down.
    Half,
    /// A quarter of the set, rounded up.
    Quarter,
}

impl TopK {
    /// K for a set of so many demonstrations; `None` where it would not be a choice.
    pub fn of(self, demonstrations: usize) -> Option<usize> {
        let k = match self {
            Self::Count(count) => count,
            Self::Half => demonstrations / 2,
            Self::Quarter => demonstrations.div_ceil(4),
        };
        (1..demonstrations).contains(&k).then_some(k)
    }

    /// Each K that is a choice, once and in order.
    pub fn all_of(these: &[Self], demonstrations: usize) -> Vec<usize> {
        let mut all: Vec<usize> = these.iter().filter_map(|k| k.of(demonstrations)).collect();
        all.sort_unstable();
        all.dedup();
        all
    }
}

/// A number, a word or a list, as files hold them.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(untagged)]
enum Written {
    Number(usize),
    Word(String),
    Ids(Vec<usize>),
}

impl fmt::Display for TopK {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count(count) => count.fmt(out),
            Self::Half => "half".fmt(out),
            Self::Quarter => "quarter".fmt(out),
        }
    }
}

impl FromStr for TopK {
    type Err = Error;

    fn from_str(word: &str) -> Result<Self> {
        match (word, word.parse()) {
            ("half", _) => Ok(Self::Half),
            ("quarter", _) => Ok(Self::Quarter),
            (_, Ok(count)) if count > 0 => Ok(Self::Count(count)),
            _ => Err(Error::bad_config(format!("K = {word}, and must be half, quarter or a number from 1"))),
        }
    }
}

impl From<TopK> for Written {
    fn from(k: TopK) -> Self {
        match k {
            TopK::Count(count) => Self::Number(count),
            word => Self::Word(word.to_string()),
        }
    }
}

impl TryFrom<Written> for TopK {
    type Error = Error;

    fn try_from(written: Written) -> Result<Self> {
        match written {
            Written::Number(count) => count.to_string().parse(),
            Written::Word(word) => word.parse(),
            Written::Ids(ids) => {
                Err(Error::bad_config(format!("K = {ids:?}, and must be half, quarter or a number")))
            }
        }
    }
}

/// A subset of a pool: `all`, `random K`, `kept-by METHOD K`, `kept-by METHOD K seed N`, or a list of ids.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "Written", try_from = "Written")]
pub enum Choice {
    /// The whole set.
    All,
    /// K at random, others for each seed.
    Random(TopK),
    /// The top K of one judging by a method: that with the seed that is named, or else with the first.
    KeptBy {
        /// Which method.
        method: String,
        /// How many.
        k: TopK,
        /// Which seed.
        seed: Option<u64>,
    },
    /// These.
    Ids(Vec<usize>),
}

const CHOICES: &str =
    "\"all\", \"random K\", \"kept-by METHOD K\", \"kept-by METHOD K seed N\" or a list of ids";

impl fmt::Display for Choice {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => write!(out, "all"),
            Self::Random(k) => write!(out, "random {k}"),
            Self::KeptBy { method, k, seed: None } => write!(out, "kept-by {method} {k}"),
            Self::KeptBy { method, k, seed: Some(seed) } => write!(out, "kept-by {method} {k} seed {seed}"),
            Self::Ids(ids) => {
                let ids: Vec<String> = ids.iter().map(ToString::to_string).collect();
                write!(out, "{}", ids.join(", "))
            }
        }
    }
}

impl FromStr for Choice {
    type Err = Error;

    fn from_str(words: &str) -> Result<Self> {
        let wrong = || Error::bad_config(format!("the subset '{words}' is none; it must be {CHOICES}"));
        if words == "all" {
            return Ok(Self::All);
        }
        if let Some(k) = words.strip_prefix("random ") {
            return Ok(Self::Random(k.parse()?));
        }
        let rest = words.strip_prefix("kept-by ").ok_or_else(wrong)?;
        let (rest, seed) = match rest.rsplit_once(" seed ") {
            Some((rest, seed)) => (rest, Some(seed.parse().map_err(|_| wrong())?)),
            None => (rest, None),
        };
        let (method, k) = rest.rsplit_once(' ').ok_or_else(wrong)?;
        Ok(Self::KeptBy { method: method.to_owned(), k: k.parse()?, seed })
    }
}

impl From<Choice> for Written {
    fn from(choice: Choice) -> Self {
        match choice {
            Choice::Ids(ids) => Self::Ids(ids),
            words => Self::Word(words.to_string()),
        }
    }
}

impl TryFrom<Written> for Choice {
    type Error = Error;

    fn try_from(written: Written) -> Result<Self> {
        match written {
            Written::Word(words) => words.parse(),
            Written::Ids(mut ids) => {
                ids.sort_unstable();
                ids.dedup();
                Ok(Self::Ids(ids))
            }
            Written::Number(id) => Ok(Self::Ids(vec![id])),
        }
    }
}

/// Which part of a study's work is to be done; what is not named is all.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Only {
    /// Names of sets.
    pub sets: Option<Vec<String>>,
    /// Names of methods, and [`Only::ORACLE`], [`Only::REGRET`] and [`Only::POOLS`].
    pub methods: Option<Vec<String>>,
}

impl Only {
    /// The oracle's trainings, where methods are named.
    pub const ORACLE: &str = "oracle";
    /// The trainings on the top K of the methods that are named.
    pub const REGRET: &str = "regret";
    /// The trainings of pools.
    pub const POOLS: &str = "pools";
    const KINDS: [&str; 3] = [Self::ORACLE, Self::REGRET, Self::POOLS];

    fn names(&self, kind: &str) -> bool {
        self.methods.as_ref().is_none_or(|named| named.iter().any(|name| name == kind))
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
        self.pools.iter().try_for_each(|pool| self.check_pool(pool))
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
        part
    }

    /// The part of the study whose work is to be done; a combination needs what it is made of.
    ///
    /// # Errors
    /// `is_bad_config` if a name is unknown; says which there are.
    pub fn only(&self, only: &Only) -> Result<Self> {
        let mut part = match &only.sets {
            Some(sets) => {
                check_known("set", sets, self.set_names())?;
                self.about(sets)
            }
            None => self.clone(),
        };
        let Some(methods) = &only.methods else { return Ok(part) };
        check_known("method", methods, self.method_names().into_iter().chain(Only::KINDS).collect())?;
        if !only.names(Only::POOLS) {
            part.pools.clear();
        }
        let kept_by = |judge: &Judge| {
            let choices = part.pools.iter().flat_map(|pool| &pool.subsets);
            choices
                .into_iter()
                .any(|choice| matches!(choice, Choice::KeptBy { method, .. } if *method == judge.name))
        };
        let wanted: Vec<&Judge> =
            self.methods.iter().filter(|judge| methods.contains(&judge.name) || kept_by(judge)).collect();
        let is_needed = |judge: &Judge| {
            let made_of =
                |other: &Judge| other.combination.as_ref().is_some_and(|of| of.of.contains(&judge.name));
            wanted.iter().any(|other| other.name == judge.name || made_of(other))
        };
        part.methods = self.methods.iter().filter(|judge| is_needed(judge)).cloned().collect();
        if !only.names(Only::ORACLE) {
            part.oracle.clear();
        }
        if !only.names(Only::REGRET) {
            part.regret = None;
        }
        Ok(part)
    }

    /// All work that can be named by now, the cheapest kind first: judging by cloning, other judging, trainings.
    pub fn work(&self, finished: &Finished) -> Vec<Work> {
        let mut work = Vec::new();
        let mut methods: Vec<&Judge> =
            self.methods.iter().filter(|method| method.combination.is_none()).collect();
        methods.sort_by_key(|method| !method.clones);
        for method in methods {
            for set in &self.sets {
                let (name, judge) = (&set.name, &method.name);
                work.extend(set.seeds.each().map(|seed| Work::Judging {
                    set: name.clone(),
                    method: judge.clone(),
                    seed,
                }));
            }
        }
        let mut trainings = Vec::new();
        for imitator in [adapt::Rule::BehavioralCloning, adapt::Rule::Gail] {
            for set in &self.sets {
                let before = trainings.len();
                self.oracle_work(set, imitator, &mut trainings);
                self.regret_work(set, imitator, finished, &mut trainings);
                self.pool_work(set, imitator, finished, &mut trainings);
                // The same subset may be asked for several times.
                let mut seen = std::collections::BTreeSet::new();
                let kept: Vec<Work> =
                    trainings.split_off(before).into_iter().filter(|work| seen.insert(work.name())).collect();
                trainings.extend(kept);
            }
        }
        work.extend(trainings);
        work
    }

    fn oracle_work(&self, set: &Set, imitator: adapt::Rule, work: &mut Vec<Work>) {
        if self.oracle.contains(&imitator) {
            for demo in 0..set.demonstrations {
                let of = |seed| training(set, &[DemoId(demo)], imitator, seed);
                work.extend(set.oracle_seeds.each().map(of));
            }
        }
    }

    fn regret_work(&self, set: &Set, imitator: adapt::Rule, finished: &Finished, work: &mut Vec<Work>) {
        let Some(regret) = self.regret_of(set).filter(|regret| regret.imitators.contains(&imitator)) else {
            return;
        };
        for k in TopK::all_of(&regret.at, set.demonstrations) {
            let best = self.truly_best(set, imitator, k, finished);
            let tops = self.methods.iter().flat_map(|method| {
                set.seeds.each().filter_map(|seed| Some(top(&self.scores(set, method, seed, finished)?, k)))
            });
            for demos in best.into_iter().chain(tops) {
                work.extend(regret.trainings.each().map(|seed| training(set, &demos, imitator, seed)));
            }
        }
    }

    fn pool_work(&self, set: &Set, imitator: adapt::Rule, finished: &Finished, work: &mut Vec<Work>) {
        for pool in self.pools.iter().filter(|pool| pool.set == set.name && pool.imitator == imitator) {
            for choice in &pool.subsets {
                let of =
                    |seed| Some(training(set, &self.chosen(set, choice, seed, finished)?, imitator, seed));
                work.extend(pool.trainings.each().filter_map(of));
            }
        }
    }

    /// Regret, where the set has some.
    pub(super) fn regret_of(&self, set: &Set) -> Option<&Regret> {
        self.regret.as_ref().filter(|_| set.regret)
    }

    /// How many trainings there may be at most besides those that [`Study::work`] can name by now.
    pub fn most_unknown_trainings(&self, finished: &Finished) -> usize {
        let named = self.work(finished).iter().filter(|work| matches!(work, Work::Training { .. })).count();
        let mut most = 0;
        for set in &self.sets {
            let imitations = self.oracle.len() * set.demonstrations * set.oracle_seeds.count;
            let subsets = self.methods.len() * set.seeds.count + 1;
            let regret = self.regret_of(set).map_or(0, |regret| {
                let ks = TopK::all_of(&regret.at, set.demonstrations).len();
                regret.imitators.len() * ks * subsets * regret.trainings.count
            });
            let pools = self.pools.iter().filter(|pool| pool.set == set.name);
            most += imitations
                + regret
                + pools.map(|pool| pool.subsets.len() * pool.trainings.count).sum::<usize>();
        }
        most.saturating_sub(named)
    }

    /// Scores of all demonstrations by a method, made of others' where it is a combination; `None` until it is finished.
    pub fn scores(&self, set: &Set, method: &Judge, seed: u64, finished: &Finished) -> Option<Vec<Score>> {
        let direct = |name: &str| Some(finished.judging(&set.name, name, seed)?.scores());
        match &method.combination {
            None => direct(&method.name),
            Some(Combination { rule, of }) => {
                let parts: Vec<Vec<Score>> = of.iter().map(|name| direct(name)).collect::<Option<_>>()?;
                Some(combined(*rule, &parts))
            }
        }
    }

    /// The demonstrations of a choice with a seed; `None` until they are known.
    pub(super) fn chosen(
        &self,
        set: &Set,
        choice: &Choice,
        seed: u64,
        finished: &Finished,
    ) -> Option<Vec<DemoId>> {
        let all: Vec<DemoId> = (0..set.demonstrations).map(DemoId).collect();
        match choice {
            Choice::All => Some(all),
            Choice::Ids(ids) => Some(ids.iter().copied().map(DemoId).collect()),
            Choice::Random(k) => {
                let k = k.of(set.demonstrations)?;
                let mut rng = Seed::new(seed).of("study").of("random").at(k).into_rng();
                let mut drawn: Vec<DemoId> = all.sample(&mut rng, k).copied().collect();
                drawn.sort_unstable();
                Some(drawn)
            }
            Choice::KeptBy { method, k, seed } => {
                let judged = seed.unwrap_or(set.seeds.first);
                let scores = self.scores(set, self.method(method)?, judged, finished)?;
                Some(top(&scores, k.of(set.demonstrations)?))
            }
        }
    }
}

fn training(set: &Set, demos: &[DemoId], imitator: adapt::Rule, seed: u64) -> Work {
    Work::Training { set: set.name.clone(), demos: demos.to_vec(), imitator, seed }
}

/// The K highest, ties by id, in the order of the set.
pub(super) fn top(scores: &[Score], k: usize) -> Vec<DemoId> {
    let mut demos: Vec<DemoId> = (0..scores.len()).map(DemoId).collect();
    demos.sort_by(|a, b| scores[b.0].total_cmp(&scores[a.0]).then(a.cmp(b)));
    demos.truncate(k);
    demos.sort_unstable();
    demos
}

/// The scores of several methods as one.
fn combined(rule: Rule, parts: &[Vec<Score>]) -> Vec<Score> {
    let alike: Vec<Vec<f64>> = parts
        .iter()
        .map(|scores| match rule {
            Rule::Ranks => crate::metrics::ranks(scores),
            Rule::Scores => standardized(scores),
        })
        .collect();
    (0..parts[0].len())
        .map(|demo| alike.iter().map(|scores| scores[demo]).sum::<f64>() / alike.len() as f64)
        .collect()
}

/// With mean 0 and standard deviation 1; equal scores say nothing, and become 0.
fn standardized(scores: &[Score]) -> Vec<f64> {
    let center = crate::metrics::mean(scores);
    let spread =
        (scores.iter().map(|score| (score - center).powi(2)).sum::<f64>() / scores.len() as f64).sqrt();
    scores.iter().map(|score| if spread > 0.0 { (score - center) / spread } else { 0.0 }).collect()
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
