//! Who imitates for the referee, and how often.

use serde::{Deserialize, Serialize};

use super::DECISIVE;
use crate::basics::error::{Error, Result};
use crate::learning::adapt::Rule;

/// Who imitates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Imitator {
    /// Behavioral cloning.
    BehavioralCloning,
    /// GAIL.
    Gail,
    /// Somebody else's trainer.
    Trainer,
}

/// All imitators, ours before others', and the cheapest first.
pub const IMITATORS: [Imitator; 3] = [Imitator::BehavioralCloning, Imitator::Gail, Imitator::Trainer];

impl Imitator {
    /// The rule by which it learns, where it is one of ours.
    pub fn rule(self) -> Option<Rule> {
        match self {
            Self::BehavioralCloning => Some(Rule::BehavioralCloning),
            Self::Gail => Some(Rule::Gail),
            Self::Trainer => None,
        }
    }

    /// In words; a trainer has a name of its own besides.
    pub fn name(self) -> &'static str {
        match self {
            Self::BehavioralCloning => "cloning",
            Self::Gail => "GAIL",
            Self::Trainer => "trainer",
        }
    }
}

impl From<Rule> for Imitator {
    fn from(rule: Rule) -> Self {
        match rule {
            Rule::BehavioralCloning => Self::BehavioralCloning,
            Rule::Gail => Self::Gail,
        }
    }
}

/// How often each candidate is imitated from scratch, written `none`, or such as `cloning=10,gail=3`; not in the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Refereeing {
    /// Trainings by behavioral cloning.
    pub cloning: usize,
    /// Trainings by GAIL.
    pub gail: usize,
    /// Trainings by somebody else's trainer.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub trainer: usize,
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl Refereeing {
    /// What may be written, for errors.
    pub const WORDS: &str = "none, or numbers of trainings such as cloning=10,gail=3 or cloning=10,trainer=5";

    /// Trainings of a pair by this imitator.
    pub fn trainings(&self, imitator: Imitator) -> usize {
        match imitator {
            Imitator::BehavioralCloning => self.cloning,
            Imitator::Gail => self.gail,
            Imitator::Trainer => self.trainer,
        }
    }

    /// Trainings of a pair by the imitator that has most.
    pub fn most(&self) -> usize {
        self.cloning.max(self.gail).max(self.trainer)
    }

    /// How often a trainer trains where nobody says: as often as GAIL, and often enough to decide.
    pub fn usual_by_trainer(gail: usize) -> usize {
        gail.max(DECISIVE)
    }
}

impl std::fmt::Display for Refereeing {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { cloning, gail, trainer } = *self;
        let all = [("cloning", cloning), ("gail", gail), ("trainer", trainer)];
        let asked: Vec<String> = all
            .iter()
            .filter(|(_, count)| *count > 0)
            .map(|(name, count)| format!("{name}={count}"))
            .collect();
        if asked.is_empty() { "none".fmt(out) } else { asked.join(",").fmt(out) }
    }
}

impl std::str::FromStr for Refereeing {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = || Error::bad_config(format!("referee = {text}, and must be {}", Self::WORDS));
        let (mut cloning, mut gail, mut trainer) = (None, None, None);
        for part in text.split(',').filter(|_| text != "none") {
            let (name, number) = part.split_once('=').ok_or_else(wrong)?;
            let place = match name.trim() {
                "cloning" => &mut cloning,
                "gail" => &mut gail,
                "trainer" => &mut trainer,
                _ => return Err(wrong()),
            };
            let number = number.trim().parse().map_err(|_| wrong())?;
            if place.replace(number).is_some() {
                return Err(wrong());
            }
        }
        let count = |count: Option<usize>| count.unwrap_or(0);
        Ok(Self { cloning: count(cloning), gail: count(gail), trainer: count(trainer) })
    }
}
