//! What the referee is asked about a set: from which pools its trainings are drawn, and with how many it decides.

use serde::{Deserialize, Serialize};

use super::choice::{Choice, TopK};
use super::parts::{Pool, Seeds, Set};
use crate::basics::error::{Error, Result};
use crate::learning::adapt::Rule;
use crate::stages::referee::{DECISIVE, IMITATORS, Imitator, Refereeing};

/// What the referee is asked about a set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Refereed {
    /// Which set.
    pub set: String,
    /// What is kept of it, each by itself.
    pub kept: Vec<Choice>,
    /// Trainings in each pool, by imitator.
    pub pools: Refereeing,
    /// With how many trainings the referee decides.
    pub with: Vec<Refereeing>,
    /// The seed of the first training of each pool.
    pub first: u64,
}

impl Refereed {
    /// Whether the pools can serve the referees.
    ///
    /// # Errors
    /// `is_bad_config`; says what would be right.
    pub(super) fn check(&self) -> Result<()> {
        let wrong = |what: String| Err(Error::bad_config(format!("the referee of '{}': {what}", self.set)));
        if self.kept.contains(&Choice::All) {
            return wrong("the kept are \"all\", which leaves nothing to compare".to_owned());
        }
        if self.pools.trainer > 0 {
            return wrong(format!("pools of {}; a study has no trainer", self.pools));
        }
        let decides = |with: &Refereeing| IMITATORS.iter().any(|rule| with.trainings(*rule) >= DECISIVE);
        if let Some(with) = self.with.iter().find(|with| !decides(with)) {
            return wrong(format!(
                "{with} decides nothing; one imitator needs at least {DECISIVE} trainings"
            ));
        }
        let empty = |with: &&Refereeing| {
            IMITATORS.iter().any(|rule| with.trainings(*rule) > 0 && self.pools.trainings(*rule) == 0)
        };
        match self.with.iter().find(empty) {
            Some(with) => wrong(format!("{with} draws from pools of {}, which lack an imitator", self.pools)),
            None => Ok(()),
        }
    }

    /// The pools to draw from; the controls have sizes only where the set is known.
    pub(super) fn pools(&self, set: Option<&Set>) -> Vec<Pool> {
        let mut subsets = vec![Choice::All];
        for kept in &self.kept {
            let control = set.and_then(|set| size(kept, set)).map(|k| Choice::Random(TopK::Count(k)));
            for choice in [Some(named(kept, set)), control].into_iter().flatten() {
                if !subsets.contains(&choice) {
                    subsets.push(choice);
                }
            }
        }
        let count = |rule: Rule| self.pools.trainings(rule.into());
        let of = |imitator| Pool {
            set: self.set.clone(),
            subsets: subsets.clone(),
            imitator,
            trainings: Seeds { first: self.first, count: count(imitator) },
        };
        let rules = IMITATORS.into_iter().filter_map(Imitator::rule);
        rules.filter(|rule| count(*rule) > 0).map(of).collect()
    }
}

/// A random choice by its number, so that it is the same pool as the control of its size.
pub(super) fn named(kept: &Choice, set: Option<&Set>) -> Choice {
    match (kept, set.and_then(|set| size(kept, set))) {
        (Choice::Random(_), Some(k)) => Choice::Random(TopK::Count(k)),
        _ => kept.clone(),
    }
}

/// How many demonstrations a choice has; `None` where it is none.
pub(super) fn size(kept: &Choice, set: &Set) -> Option<usize> {
    match kept {
        Choice::All => None,
        Choice::Random(k) | Choice::KeptBy { k, .. } => k.of(set.demonstrations),
        Choice::Ids(ids) => Some(ids.len()),
    }
}
