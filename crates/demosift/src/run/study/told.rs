//! The numbers beside the figures of a study: means and standard deviations over seeds, and what it all cost.

use serde::Serialize;

use super::choice::{Kept, TopK};
use super::curves::{self, Trained};
use super::parts::Set;
use super::plan::Study;
use super::{Cell, Cost, Finished, Found};
use crate::learning::adapt::Rule;
use crate::math::statistics;

/// A mean over seeds with one standard deviation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Spread {
    /// The mean.
    pub mean: f64,
    /// One standard deviation of the seeds; 0 of a single one.
    pub deviation: f64,
    /// How many.
    pub seeds: usize,
}

impl Spread {
    fn of(values: &[f64]) -> Option<Self> {
        let (mean, deviation) = (statistics::mean_or_zero(values), curves::deviation(values));
        (!values.is_empty()).then_some(Self { mean, deviation, seeds: values.len() })
    }
}

/// What the policies are worth that learned from what a method keeps.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PolicyLine {
    /// Of which set.
    pub set: String,
    /// Of the heuristic.
    pub unit: String,
    /// Who learned.
    pub imitator: Rule,
    /// How many were kept, in words.
    pub kept: String,
    /// By which method; nothing for the whole set.
    pub method: Option<String>,
    /// Mean heuristic of the last policy.
    pub score: Spread,
    /// Its success, where the task says.
    pub success: Option<Spread>,
}

/// How far a method's adapted agents are from what was demonstrated (Table 1).
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DistanceLine {
    /// Of which set.
    pub set: String,
    /// By which method.
    pub method: String,
    /// The lower, the better.
    pub distance: Spread,
}

/// How many demonstrations of another body a method keeps.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BodyLine {
    /// Of which set.
    pub set: String,
    /// By which method.
    pub method: String,
    /// K.
    pub kept: usize,
    /// The share of another body's among the kept.
    pub share: Spread,
    /// The same of the whole set.
    pub chance: f64,
}

/// All of them, with the price.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Told {
    /// Where policies are trained on what methods keep.
    pub policies: Vec<PolicyLine>,
    /// Of each method that judged.
    pub distances: Vec<DistanceLine>,
    /// Where a set says its bodies.
    pub bodies: Vec<BodyLine>,
    /// What all finished cells cost together.
    pub cost: Cost,
    /// Cells that are there, and those that can be named by now.
    pub finished: [usize; 2],
    /// Seeds that the study asks for, and those with which everything is finished.
    pub seeds: [usize; 2],
}

/// Says what there is to say.
pub fn tell(study: &Study, finished: &Finished) -> Told {
    let work = study.work(finished);
    let there = work.iter().filter(|work| finished.holds(work)).count();
    let judged = || study.sets.iter().filter(|set| set.seeds.count > 0);
    Told {
        policies: judged().flat_map(|set| policies(study, set, finished)).collect(),
        distances: judged().flat_map(|set| distances(study, set, finished)).collect(),
        bodies: judged().flat_map(|set| bodies(study, set, finished)).collect(),
        cost: cost(finished),
        finished: [there, work.len()],
        seeds: [judged().map(|set| set.seeds.count).max().unwrap_or(0), whole_seeds(study, finished)],
    }
}

impl Told {
    /// Whether cells are missing, or there are fewer seeds than a claim takes.
    pub fn is_partial(&self) -> bool {
        let [there, all] = self.finished;
        there < all || self.seeds[1] < super::estimate::ENOUGH_SEEDS
    }
}

/// Seeds with which each set has all that can be named.
fn whole_seeds(study: &Study, finished: &Finished) -> usize {
    let work = study.work(finished);
    let is_whole = |set: &Set, seed: u64| {
        let of_seed = |work: &&super::Work| work.set() == set.name && work.seed() == seed;
        let mut judgings = study.methods.iter().filter(|method| method.combination.is_none());
        judgings.all(|method| finished.judging(&set.name, &method.name, seed).is_some())
            && work.iter().filter(of_seed).all(|work| finished.holds(work))
    };
    let sets = study.sets.iter().filter(|set| set.seeds.count > 0);
    sets.map(|set| set.seeds.each().filter(|seed| is_whole(set, *seed)).count()).min().unwrap_or(0)
}

fn policies(study: &Study, set: &Set, finished: &Finished) -> Vec<PolicyLine> {
    let Some(drawn) = &study.drawn.curves else { return Vec::new() };
    let mut kept: Vec<Kept> =
        TopK::all_of(&drawn.at, set.demonstrations).into_iter().map(|k| Kept::Top(TopK::Count(k))).collect();
    kept.push(Kept::Weights);
    let mut lines = Vec::new();
    for imitator in &drawn.imitators {
        for kept in &kept {
            for method in &study.methods {
                let trained = curves::trained(study, set, &method.name, *kept, *imitator, finished);
                lines.extend(policy_line(set, *imitator, *kept, Some(&method.name), &trained));
            }
        }
        if let Some(method) = study.methods.first() {
            let trained = curves::trained(study, set, &method.name, Kept::All, *imitator, finished);
            lines.extend(policy_line(set, *imitator, Kept::All, None, &trained));
        }
    }
    lines
}

fn policy_line(
    set: &Set,
    imitator: Rule,
    kept: Kept,
    method: Option<&String>,
    trained: &[Trained<'_>],
) -> Option<PolicyLine> {
    let scores: Vec<f64> = trained.iter().map(|of| of.result.end.score).collect();
    let successes: Option<Vec<f64>> = trained.iter().map(|of| of.result.end.success).collect();
    let kept = match kept {
        Kept::Weights => "by weights".to_owned(),
        Kept::All => set.demonstrations.to_string(),
        Kept::Top(k) => k.to_string(),
    };
    Some(PolicyLine {
        set: set.name.clone(),
        unit: set.unit.clone(),
        imitator,
        kept,
        method: method.cloned(),
        score: Spread::of(&scores)?,
        success: successes.and_then(|successes| Spread::of(&successes)),
    })
}

fn distances(study: &Study, set: &Set, finished: &Finished) -> Vec<DistanceLine> {
    let of = |method: &super::Judge| {
        let judged = set.seeds.each().filter_map(|seed| finished.judging(&set.name, &method.name, seed));
        let distances: Vec<f64> = judged.map(|judging| judging.adapted_behaviors_distance).collect();
        let distance = Spread::of(&distances)?;
        Some(DistanceLine { set: set.name.clone(), method: method.name.clone(), distance })
    };
    study.methods.iter().filter_map(of).collect()
}

fn bodies(study: &Study, set: &Set, finished: &Finished) -> Vec<BodyLine> {
    let others = set.by_others();
    let count = |demos: &mut dyn Iterator<Item = usize>| demos.filter(|demo| others[*demo]).count() as f64;
    if others.is_empty() {
        return Vec::new();
    }
    let at = study.drawn.curves.as_ref().map_or(&[][..], |curves| &curves.at);
    let mut lines = Vec::new();
    for kept in TopK::all_of(at, set.demonstrations) {
        for method in &study.methods {
            let share = |seed| {
                let top = Kept::Top(TopK::Count(kept));
                let demos = study.kept(set, &method.name, top, seed, finished)?;
                Some(count(&mut demos.iter().map(|demo| demo.0)) / kept as f64)
            };
            let shares: Vec<f64> = set.seeds.each().filter_map(share).collect();
            lines.extend(Spread::of(&shares).map(|share| BodyLine {
                set: set.name.clone(),
                method: method.name.clone(),
                kept,
                share,
                chance: count(&mut (0..set.demonstrations)) / set.demonstrations as f64,
            }));
        }
    }
    lines
}

fn cost(finished: &Finished) -> Cost {
    finished.cells().map(cost_of).fold(Cost::default(), |sum, cost| sum + cost)
}

fn cost_of(cell: &Cell) -> Cost {
    match &cell.found {
        Found::Judging(result) => result.once + result.judging,
        Found::Weighing(result) => result.once + result.weighing,
        Found::Training(result) => result.cost,
        Found::Failed(_) => Cost::default(),
    }
}

/// Processor hours of so many environment steps at the pace of these cells; `None` where there is no pace.
pub fn hours_at_the_pace_of<'c>(
    cells: impl Iterator<Item = &'c Cell>,
    environment_steps: u64,
) -> Option<f64> {
    let spent = cells.map(cost_of).fold(Cost::default(), |sum, cost| sum + cost);
    let share = environment_steps as f64 / spent.environment_steps as f64;
    (spent.environment_steps > 0).then(|| spent.processor_hours() * share)
}
