//! How many demonstrations, and which, as a study file writes it.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::stages::select::quarter;

/// A number of demonstrations, written as a number, `half` or `quarter`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
            Self::Quarter => quarter(demonstrations),
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

/// What of a judging is kept: its top K, what weights select, or everything.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(into = "Written", try_from = "Written")]
pub enum Kept {
    /// The first K.
    Top(TopK),
    /// What Algorithm 3 selects.
    Weights,
    /// The whole set.
    All,
}

/// A number, a word or a list, as files hold them.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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

impl From<Kept> for Written {
    fn from(kept: Kept) -> Self {
        match kept {
            Kept::Top(k) => k.into(),
            word => Self::Word(word.to_string()),
        }
    }
}

impl fmt::Display for Kept {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Top(k) => k.fmt(out),
            Self::Weights => "weights".fmt(out),
            Self::All => "all".fmt(out),
        }
    }
}

impl TryFrom<Written> for Kept {
    type Error = Error;

    fn try_from(written: Written) -> Result<Self> {
        match written {
            Written::Word(word) if word == "weights" => Ok(Self::Weights),
            Written::Word(word) if word == "all" => Ok(Self::All),
            other => TopK::try_from(other).map(Self::Top),
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
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
