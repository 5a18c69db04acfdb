//! What a study draws besides its tables: learning curves from what each method keeps, the weights of Algorithm 3, figures
//! of them, and claims that intervals decide.
//!
//! Everything is paired by seed: what a method kept in its judging with a seed is imitated with the same seed.

use serde::{Deserialize, Serialize};

use super::choice::{Kept, TopK};
use super::plan::{Judge, Study};
use super::{Cell, Found, Work};
use crate::basics::error::{Error, Result};
use crate::learning::adapt::Rule;

/// What is drawn, and what is claimed of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drawn {
    /// What the whole is about, such as the figure of the paper.
    pub title: Option<String>,
    /// The preset that it was made with.
    pub preset: Option<String>,
    /// What the paper says of it, in our words.
    pub paper: Option<String>,
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
#[serde(deny_unknown_fields)]
pub struct Curves {
    /// Each K; the whole set is always there.
    pub at: Vec<TopK>,
    /// Who learns.
    pub imitators: Vec<Rule>,
}

/// Subsets that methods select by weights (Algorithm 3), with the seeds of judging.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// The score of the policy at the end of its training; higher is better.
    #[default]
    Score,
    /// The share of its episodes that succeed; higher is better.
    Success,
    /// The adapted behaviors distance (Table 1); lower is better, and K means nothing.
    Distance,
    /// The share of another body's demonstrations among the kept; lower is better, and the other is `chance`.
    OtherBody,
}

/// The whole set, in the place of a method.
pub const WHOLE: &str = "all";
/// Keeping at random, in the place of a method.
pub const CHANCE: &str = "chance";

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

impl Study {
    /// Whether a cell of a file of results still has all that this study shows of it: such a file has curves only where its
    /// own figures show them.
    pub fn has_all_to_show(&self, cell: &Cell) -> bool {
        match &cell.found {
            Found::Training(training) => !self.drawn.shows(Draws::TopK) || !training.curve.is_empty(),
            // A judge by cloning plays nothing on the way, so that it never has any.
            Found::Judging(judging) => {
                let is_followed = self.method_of(&cell.work).is_some_and(|method| !method.clones);
                !(is_followed && self.drawn.shows(Draws::Adaptation)) || judging.adaptation.is_some()
            }
            Found::Weighing(_) | Found::Failed(_) => true,
        }
    }

    fn method_of(&self, work: &Work) -> Option<&Judge> {
        match work {
            Work::Judging { method, .. } | Work::Weighing { method, .. } => self.method(method),
            Work::Training { .. } => None,
        }
    }

    /// Whether what is drawn is of sets and methods of the study.
    pub(super) fn check_drawn(&self) -> Result<()> {
        let Drawn { curves, weights, figures, claims, .. } = &self.drawn;
        if let Some(curves) = curves
            && curves.imitators.is_empty()
        {
            return Err(Error::bad_config("curves.imitators is empty, and must name who learns"));
        }
        if let Some(Weights { methods, sets }) = weights {
            self.check_methods(methods, &[])?;
            self.check_sets(sets)?;
            if let Some(name) = methods.iter().find(|name| !self.has_cells(name)) {
                return Err(Error::bad_config(format!("'{name}' combines others, so it has no weights")));
            }
        }
        for figure in figures {
            self.check_methods(&figure.methods, &[])?;
            self.check_sets(&figure.sets)?;
        }
        for claim in claims {
            self.check_claim(claim).map_err(|error| error.during(&format!("the claim '{}'", claim.says)))?;
        }
        Ok(())
    }

    fn check_claim(&self, claim: &Claim) -> Result<()> {
        self.check_methods(std::slice::from_ref(&claim.better), &[WHOLE])?;
        let other = match claim.measure {
            Measure::OtherBody => vec![CHANCE],
            Measure::Distance => Vec::new(),
            Measure::Score | Measure::Success => vec![WHOLE],
        };
        self.check_methods(&claim.than, &other)?;
        self.check_sets(&claim.sets)?;
        let wants_k = claim.measure != Measure::Distance;
        if claim.than.is_empty() || wants_k == claim.at.is_empty() {
            let what = if wants_k { "than and at, which may not be empty" } else { "than, and no at" };
            return Err(Error::bad_config(format!("it needs {what}")));
        }
        let weighs = claim.at.contains(&Kept::Weights) || claim.than_at == Some(Kept::Weights);
        let weighed = self.drawn.weights.as_ref();
        let is_weighed = |name: &String| weighed.is_some_and(|weights| weights.methods.contains(name));
        if weighs && !is_weighed(&claim.better) {
            return Err(Error::bad_config(format!("[weights] does not name '{}'", claim.better)));
        }
        if claim.measure == Measure::OtherBody
            && let Some(set) = self.sets.iter().find(|set| claim.sets.contains(&set.name) && set.bodies.is_empty())
        {
            return Err(Error::bad_config(format!("the set '{}' does not say its bodies", set.name)));
        }
        let trains = matches!(claim.measure, Measure::Score | Measure::Success);
        match &self.drawn.curves {
            None if trains => {
                Err(Error::bad_config("it is about policies, and the study has no [curves] to train any"))
            }
            _ => Ok(()),
        }
    }

    fn has_cells(&self, method: &str) -> bool {
        self.method(method).is_some_and(|method| method.combination.is_none())
    }
}
