//! Whether a method ranks a set otherwise under another variant, or under another seed as much (Eq. 9).

use serde::Serialize;

use super::Finished;
use super::parts::Set;
use super::plan::{Judge, Study};
use super::truth::spearman;
use crate::math::statistics;
use crate::world::heuristic::Score;

/// How alike two rankings of the same demonstrations are.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct VariantLine {
    /// The task.
    pub task: String,
    /// By which method.
    pub method: String,
    /// Variants under which the set is judged.
    pub variants: usize,
    /// Spearman's correlation of two seeds under the same variant, mean over all pairs and then over the variants.
    pub within: f64,
    /// That of two seeds under two variants, mean over all pairs and then over the pairs of variants.
    pub across: f64,
    /// The fewest seeds under any of them.
    pub seeds: usize,
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
        methods.filter_map(|method| line(study, family, method, finished)).collect::<Vec<_>>()
    };
    families.iter().filter(|family| family.len() > 1).flat_map(of).collect()
}

/// Whether a set holds the same demonstrations as those of a family, judged under another variant than all of them.
fn belongs(set: &Set, family: &[&Set], finished: &Finished) -> bool {
    let hash = |set: &Set| finished.demonstrations_of(&set.name);
    let is_the_same = family[0].task == set.task && hash(set).is_some() && hash(set) == hash(family[0]);
    is_the_same && family.iter().all(|other| other.variant != set.variant)
}

fn line(study: &Study, family: &[&Set], method: &Judge, finished: &Finished) -> Option<VariantLine> {
    let of_set = |set: &&Set| -> Vec<(u64, Vec<Score>)> {
        let seeds = set.seeds.each();
        seeds.filter_map(|seed| Some((seed, study.scores(set, method, seed, finished)?))).collect()
    };
    let judged: Vec<Vec<(u64, Vec<Score>)>> = family.iter().map(of_set).collect();
    // Seeds of which both draw the same random numbers would be alike for that.
    let alike = |one: &Vec<(u64, Vec<Score>)>, other: &Vec<(u64, Vec<Score>)>| {
        let pairs = one.iter().flat_map(|one| other.iter().map(move |other| (one, other)));
        let pairs = pairs.filter(|((seed, _), (other, _))| seed != other);
        let found: Vec<f64> = pairs.map(|((_, one), (_, other))| spearman(one, other)).collect();
        (!found.is_empty()).then(|| statistics::mean(&found))
    };
    let within: Vec<f64> = judged.iter().map(|of| alike(of, of)).collect::<Option<_>>()?;
    let pairs = judged.iter().enumerate();
    let across: Vec<f64> = pairs
        .flat_map(|(place, one)| judged[place + 1..].iter().map(move |other| alike(one, other)))
        .collect::<Option<_>>()?;
    Some(VariantLine {
        task: family[0].task.clone(),
        method: method.name.clone(),
        variants: family.len(),
        within: statistics::mean(&within),
        across: statistics::mean(&across),
        seeds: judged.iter().map(Vec::len).min().unwrap_or(0),
    })
}
