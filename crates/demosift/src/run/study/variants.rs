//! Whether a method ranks a set otherwise under another variant, or under another seed as much (Eq. 9).

use serde::Serialize;

use super::Finished;
use super::parts::Set;
use super::plan::{Judge, Study};
use super::truth::spearman;
use crate::math::statistics;
use crate::world::heuristic::Score;

/// How alike a method ranks the same demonstrations under one variant and under others.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct VariantLine {
    /// The task.
    pub task: String,
    /// By which method.
    pub method: String,
    /// The variant.
    pub variant: String,
    /// Spearman's correlation of two seeds under this variant, mean over all pairs.
    pub same: f64,
    /// That of a seed under this variant and another under another one.
    pub others: Vec<Alike>,
    /// The fewest seeds under any variant.
    pub seeds: usize,
}

/// How alike rankings under another variant are.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Alike {
    /// The other one.
    pub variant: String,
    /// Spearman's correlation of two seeds, mean over all pairs.
    pub spearman: f64,
}

/// Of each method and each set that is judged under several variants, where each has two seeds.
pub(super) fn compared(study: &Study, finished: &Finished) -> Vec<VariantLine> {
    let mut families: Vec<Vec<&Set>> = Vec::new();
    for set in study.sets.iter().filter(|set| set.variant.is_some() && set.seeds.count > 1) {
        match families.iter_mut().find(|family| belongs(set, family, finished)) {
            Some(family) => family.push(set),
            None => families.push(vec![set]),
        }
    }
    let of = |family: &Vec<&Set>| {
        let methods = study.methods.iter();
        methods.filter_map(|method| lines(study, family, method, finished)).flatten().collect::<Vec<_>>()
    };
    families.iter().filter(|family| family.len() > 1).flat_map(of).collect()
}

/// Whether a set holds the same demonstrations as those of a family, judged under another variant than all of them.
fn belongs(set: &Set, family: &[&Set], finished: &Finished) -> bool {
    let hash = |set: &Set| finished.demonstrations_of(&set.name);
    let is_the_same = family[0].task == set.task && hash(set).is_some() && hash(set) == hash(family[0]);
    is_the_same && family.iter().all(|other| other.variant != set.variant)
}

/// A line for each variant, where each has seeds to compare.
fn lines(study: &Study, family: &[&Set], method: &Judge, finished: &Finished) -> Option<Vec<VariantLine>> {
    let judged: Vec<Judged<'_>> = family.iter().map(|set| Judged::of(study, set, method, finished)).collect();
    let seeds = judged.iter().map(|of| of.scores.len()).min().unwrap_or(0);
    let line = |of: &Judged<'_>| {
        let others = judged.iter().filter(|other| other.variant != of.variant);
        let others =
            others.map(|other| Some(Alike { variant: other.variant.to_owned(), spearman: of.alike(other)? }));
        Some(VariantLine {
            task: family[0].task.clone(),
            method: method.name.clone(),
            variant: of.variant.to_owned(),
            same: of.alike(of)?,
            others: others.collect::<Option<_>>()?,
            seeds,
        })
    };
    judged.iter().map(line).collect()
}

/// What a method found under one variant, seed by seed.
struct Judged<'s> {
    variant: &'s str,
    scores: Vec<(u64, Vec<Score>)>,
}

impl<'s> Judged<'s> {
    fn of(study: &Study, set: &'s Set, method: &Judge, finished: &Finished) -> Self {
        let scores = set
            .seeds
            .each()
            .filter_map(|seed| Some((seed, study.scores(set, method, seed, finished)?)))
            .collect();
        Self { variant: set.variant.as_deref().unwrap_or_default(), scores }
    }

    /// `None` without two seeds; a seed is never held against itself, whose random numbers are the same under all variants.
    fn alike(&self, other: &Self) -> Option<f64> {
        let pairs = self.scores.iter().flat_map(|one| other.scores.iter().map(move |other| (one, other)));
        let pairs = pairs.filter(|((seed, _), (other, _))| seed != other);
        let found: Vec<f64> = pairs.map(|((_, one), (_, other))| spearman(one, other)).collect();
        (!found.is_empty()).then(|| statistics::mean(&found))
    }
}
