//! What a study draws besides its tables: learning curves from what each method keeps, the weights of Algorithm 3, figures
//! of them, and claims that intervals decide.
//!
//! Everything is paired by seed: what a method kept in its judging with a seed is imitated with the same seed.

use serde::{Deserialize, Serialize};

use super::choice::{Kept, TopK};
use crate::learning::adapt::Rule;

/// What is drawn, and what is claimed of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Drawn {
    /// What the whole is about, such as the figure of the paper.
    pub title: Option<String>,
    /// The preset that it was made with.
    pub preset: Option<String>,
    /// What the paper says of it, in our words.
    pub paper: Option<String>,
    /// How the results are read by who has looked at them, with enough seeds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reading: Option<String>,
    /// Whether sets of it were left out, since only others were asked for or these are not there.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub in_part: bool,
    /// Policies that are trained on what methods keep.
    pub curves: Option<Curves>,
    /// Subsets that are selected by weights.
    pub weights: Option<Weights>,
    /// Pictures.
    #[serde(default)]
    pub figures: Vec<Figure>,
    /// What is to be decided.
    #[serde(default)]
    pub claims: Vec<Claim>,
}

/// Policies that are trained on the top K of each method, with the seed of its judging, and on the whole set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Curves {
    /// Each K; the whole set is always there.
    pub at: Vec<TopK>,
    /// Who learns.
    pub imitators: Vec<Rule>,
}

/// Subsets that methods select by weights (Algorithm 3), with the seeds of judging.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Weights {
    /// By which methods, each of which must meta-train.
    pub methods: Vec<String>,
    /// Of which sets; all, if it names none.
    #[serde(default)]
    pub sets: Vec<String>,
}

/// A picture: a row for each set, a column for each method.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Figure {
    /// The name of its file.
    pub name: String,
    /// The line above it.
    pub title: String,
    /// What it shows.
    pub draws: Draws,
    /// Its columns; all methods, if it names none.
    #[serde(default)]
    pub methods: Vec<String>,
    /// Its rows; all sets, if it names none.
    #[serde(default)]
    pub sets: Vec<String>,
}

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Draws {
    /// Learning curves of policies, a line for each K (Fig. 3).
    TopK,
    /// The heuristic in the course of each adaptation, a line for a demonstration (Fig. 4 and 5).
    Adaptation,
    /// Weights in the course of Algorithm 3, a line for a demonstration (Fig. 9).
    Weights,
    /// The score of each demonstration, those of another body marked (for Fig. 6).
    Bodies,
}

/// Something that is said of methods, and that the difference of pairs decides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Claim {
    /// The claim as a sentence.
    pub says: String,
    /// Who says it.
    #[serde(default)]
    pub by: By,
    /// The method that is said to be better; `all` is the whole set.
    pub better: String,
    /// Than which others.
    pub than: Vec<String>,
    /// By what.
    #[serde(default)]
    pub measure: Measure,
    /// With how many kept demonstrations.
    #[serde(default)]
    pub at: Vec<Kept>,
    /// With how many the others keep, where that differs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub than_at: Option<Kept>,
    /// Of which sets; all, if it names none.
    #[serde(default)]
    pub sets: Vec<String>,
}

/// Whose claim it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum By {
    /// The paper's: the page says whether it holds here.
    #[default]
    Paper,
    /// Our own question: the page says which is better.
    Us,
}

/// By what one is better than another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// The score of the policy at the end of its training; higher is better.
    #[default]
    Score,
    /// The score of the best policy in the course of its training, on episodes that did not choose it; higher is better.
    Best,
    /// The share of the last policy's episodes that succeed; higher is better.
    Success,
    /// The adapted behaviors distance (Table 1); lower is better, and K means nothing.
    Distance,
    /// Spearman's correlation of a ranking with the oracles; higher is better, and K means nothing.
    Agreement,
}

impl Measure {
    /// Whether it is about policies that learned from what is kept.
    pub fn is_of_policies(self) -> bool {
        matches!(self, Self::Score | Self::Best | Self::Success)
    }
}

/// The whole set, in the place of a method.
pub const WHOLE: &str = "all";

impl Drawn {
    /// Whether it is an ordinary study that draws nothing.
    pub fn is_nothing(&self) -> bool {
        *self == Self::default()
    }

    /// Whether some figure shows this.
    pub fn shows(&self, what: Draws) -> bool {
        self.figures.iter().any(|figure| figure.draws == what)
    }
}

impl Weights {
    /// Whether a set is weighed.
    pub fn is_about(&self, set: &str) -> bool {
        self.sets.is_empty() || self.sets.iter().any(|named| named == set)
    }
}
