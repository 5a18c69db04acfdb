//! What judging finds: S of each demonstration under each variant, with all that it was made of.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::data::demonstration::DemoId;
use crate::learning::adapt::UpdateReport;
use crate::math::statistics::{mean_of, mean_or_zero};
use crate::world::environment::EnvVariant;
use crate::world::heuristic::Score;
use crate::world::policy::Policy;
use crate::world::trainer::TrainerIdentity;

/// S_{v|e} with everything that it was made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Suitability {
    /// v_i.
    pub demo: DemoId,
    /// e_j.
    pub variant: EnvVariant,
    /// K before imitating: of the meta-parameters, `[1][M]`; of the policies that know nothing, one per repeat, `[repeats][M]`.
    pub before: Vec<Vec<Score>>,
    /// K after adapting, for each repeat, `[repeats][M]`: one per evaluation episode, or the mean of each batch of the last
    /// updates, whose random numbers are those of the batches before imitating.
    pub after: Vec<Vec<Score>>,
    /// How far the adapted agent's evaluation episodes are from v_i (Table 1), one per repeat, `[repeats]`.
    pub distances: Vec<f64>,
    /// The adaptation curves, `[repeats][iterations]`; in a set of more than 200 demonstrations that of the first repeat of those
    /// worth a look alone, and nothing for the others.
    pub curves: Vec<Vec<UpdateReport>>,
    /// The evaluation episodes of the first repeat, to be looked at, where batches are what scores.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub evaluated: Option<Evaluated>,
}

/// K of evaluation episodes that score nothing, one per evaluation seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Evaluated {
    /// Of the agent before imitating.
    pub before: Vec<Score>,
    /// Of what imitating led to.
    pub after: Vec<Score>,
}

/// θ_ij: the result of imitating a demonstration under a variant, to be looked at.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AdaptedPolicy {
    /// v_i.
    pub demo: DemoId,
    /// e_j.
    pub variant: EnvVariant,
    /// That of the first repeat, as it was evaluated.
    pub policy: Policy,
}

/// What judging finds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Judged {
    /// S of all.
    pub scores: ScoreTable,
    /// One per suitability, in the same order; in a set of more than 200 demonstrations of those worth a look alone.
    pub adapted: Vec<AdaptedPolicy>,
}

impl Judged {
    /// What was found under one variant, for a task of that variant alone, where it is number 0.
    pub fn under(&self, variant: EnvVariant) -> Self {
        let adapted = self.adapted.iter().filter(|adapted| adapted.variant == variant);
        let mut under = Self { scores: self.scores.under(variant), adapted: adapted.cloned().collect() };
        under.scores.suitabilities.iter_mut().for_each(|of| of.variant = EnvVariant(0));
        under.adapted.iter_mut().for_each(|adapted| adapted.variant = EnvVariant(0));
        under
    }
}

impl Suitability {
    /// S_{v|e} = K(τ after) − K(τ before), means over seeds and repeats (Eq. 8).
    pub fn gain(&self) -> Score {
        self.mean_after() - self.mean_before()
    }

    /// K of the evaluation episodes before the first repeat, which can be played again.
    pub fn evaluated_before(&self) -> &[Score] {
        self.evaluated.as_ref().map_or_else(|| first(&self.before), |evaluated| &evaluated.before)
    }

    /// K of the evaluation episodes after the first repeat, which can be played again.
    pub fn evaluated_after(&self) -> &[Score] {
        self.evaluated.as_ref().map_or_else(|| first(&self.after), |evaluated| &evaluated.after)
    }

    /// Mean K before imitating.
    pub fn mean_before(&self) -> Score {
        mean_of_means(&self.before)
    }

    /// Mean K after adapting.
    pub fn mean_after(&self) -> Score {
        mean_of_means(&self.after)
    }
}

fn first(repeats: &[Vec<Score>]) -> &[Score] {
    repeats.first().map_or(&[], Vec::as_slice)
}

fn mean_of_means(scores: &[Vec<Score>]) -> Score {
    mean_or_zero(&scores.iter().map(|scores| mean_or_zero(scores)).collect::<Vec<_>>())
}

/// All suitabilities of a set: variants in order, demonstrations in order within each.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ScoreTable {
    /// One per adaptation target.
    pub suitabilities: Vec<Suitability>,
    /// Who imitated, where that was somebody else's trainer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trainer: Option<TrainerIdentity>,
}

impl ScoreTable {
    /// What imitations by ours scored.
    pub fn new(suitabilities: Vec<Suitability>) -> Self {
        Self { suitabilities, trainer: None }
    }

    /// The adapted behaviors distance over the entire set (Table 1), the lower the better: how far from what was
    /// demonstrated the adapted agents are, in the units of observations and actions; NaN of an empty table.
    pub fn adapted_behaviors_distance(&self) -> f64 {
        mean_of(self.suitabilities.iter().map(|of| mean_or_zero(&of.distances)))
    }

    /// What was found under one variant (Eq. 9 is taken per variant).
    pub fn under(&self, variant: EnvVariant) -> Self {
        Self { suitabilities: self.of_variant(variant).cloned().collect(), trainer: self.trainer.clone() }
    }

    /// All under one variant, in the order of the set.
    pub fn of_variant(&self, variant: EnvVariant) -> impl Iterator<Item = &Suitability> {
        self.suitabilities.iter().filter(move |of| of.variant == variant)
    }

    /// All of one demonstration, in the order of the variants.
    pub fn of_demo(&self, demo: DemoId) -> impl Iterator<Item = &Suitability> {
        self.suitabilities.iter().filter(move |of| of.demo == demo)
    }

    /// The demonstrations that were judged, in order, each once.
    pub fn demos(&self) -> Vec<DemoId> {
        sorted(self.suitabilities.iter().map(|of| of.demo))
    }

    /// The variants that were judged under, in order, each once.
    pub fn variants(&self) -> Vec<EnvVariant> {
        sorted(self.suitabilities.iter().map(|of| of.variant))
    }

    /// How many adaptations all demonstrations have under all variants; some have more where repeats were added.
    pub fn repeats(&self) -> usize {
        self.suitabilities.iter().map(|of| of.after.len()).min().unwrap_or(0)
    }
}

/// In order, each once.
fn sorted<T: Ord>(all: impl Iterator<Item = T>) -> Vec<T> {
    all.collect::<BTreeSet<T>>().into_iter().collect()
}
