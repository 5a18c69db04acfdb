//! The numbers beside the figures of a study: means and standard deviations over seeds, and what it all cost.

use serde::Serialize;

use super::bodies::{self, BodyLine, TaughtLine};
use super::choice::{Kept, TopK};
use super::curves::{self, Trained};
use super::estimate::{Difference, Spread, paired_difference};
use super::parts::Set;
use super::plan::Study;
use super::variants::{self, VariantLine};
use super::weighed::{self, WeighedLine};
use super::{Cell, Cost, Finished, Found, JudgingResult, TrainingResult};
use crate::learning::adapt::Rule;

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
    /// Mean heuristic of the best policy on the way, on episodes that did not choose it.
    pub best: Spread,
}

/// How much worse the policies from what a method keeps are than those from the truly best K, paired by seed.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LostLine {
    /// Of which set.
    pub set: String,
    /// Of the heuristic.
    pub unit: String,
    /// Who learned.
    pub imitator: Rule,
    /// K.
    pub kept: usize,
    /// By which method; nothing for the whole set, whatever K.
    pub method: Option<String>,
    /// At the end of the training, above 0 where the truly best teach more.
    pub lost: Difference,
    /// The same of the best policy on the way of each training.
    pub lost_by_best: Difference,
}

/// Which demonstration a method puts first (Eq. 9).
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FirstLine {
    /// Of which set.
    pub set: String,
    /// By which method.
    pub method: String,
    /// Each that is first with some seed, by how often.
    pub firsts: Vec<First>,
    /// The score of the first (Eq. 8) in the same judging, which flatters it; `None` of a combination.
    pub gain: Option<Spread>,
    /// Of the heuristic.
    pub unit: String,
    /// With how many seeds the first was recorded under the variant that is judged, where that is known.
    pub fitting: Option<usize>,
    /// How many demonstrations of the set were.
    pub fitting_in_set: Option<usize>,
    /// Seeds.
    pub seeds: usize,
}

/// A demonstration that is first with some seeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct First {
    /// Which.
    pub demo: usize,
    /// With how many.
    pub times: usize,
    /// The variant under which it was recorded, where that is known.
    pub recorded_under: Option<String>,
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

/// What a judge of the paper starts from.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PriorLine {
    /// Of which set.
    pub set: String,
    /// Of the heuristic.
    pub unit: String,
    /// By which method.
    pub method: String,
    /// Meta-updates, where it is meta-learned and cells say.
    pub meta_updates: Option<Spread>,
    /// Mean heuristic before anything is imitated.
    pub score: Spread,
    /// The share of the spread of the encodings that the posterior explains on trajectories that it was not trained on, where there
    /// is one and cells say.
    pub explained: Option<Spread>,
}

/// All of them, with the price.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Told {
    /// Where policies are trained on what methods keep.
    pub policies: Vec<PolicyLine>,
    /// Where an oracle says which demonstrations are the truly best.
    pub lost: Vec<LostLine>,
    /// Of each method that judged.
    pub firsts: Vec<FirstLine>,
    /// Of each method that judged.
    pub distances: Vec<DistanceLine>,
    /// Where a set says its bodies: who is kept.
    pub bodies: Vec<BodyLine>,
    /// Where a set says its bodies and the oracle has learned from each demonstration alone.
    pub taught: Vec<TaughtLine>,
    /// Where subsets are selected by weights.
    pub weighed: Vec<WeighedLine>,
    /// Of each method that judged by the judge of the paper.
    pub priors: Vec<PriorLine>,
    /// Where a set is judged under several variants.
    pub variants: Vec<VariantLine>,
    /// What all finished cells cost together.
    pub cost: Cost,
    /// Cells that are there, and those that can be named by now.
    pub finished: [usize; 2],
    /// Seeds that the study asks for, and those with which everything is finished.
    pub seeds: [usize; 2],
    /// Whether sets of it were left out.
    pub in_part: bool,
}

/// Says what there is to say.
pub fn tell(study: &Study, finished: &Finished) -> Told {
    let work = study.work(finished);
    let there = work.iter().filter(|work| finished.holds(work)).count();
    let judged = || study.sets.iter().filter(|set| set.seeds.count > 0);
    Told {
        policies: judged().flat_map(|set| policies(study, set, finished)).collect(),
        lost: judged().flat_map(|set| lost(study, set, finished)).collect(),
        firsts: judged().flat_map(|set| firsts(study, set, finished)).collect(),
        distances: judged().flat_map(|set| distances(study, set, finished)).collect(),
        bodies: judged().flat_map(|set| bodies::kept(study, set, finished)).collect(),
        taught: judged().flat_map(|set| bodies::taught(study, set, finished)).collect(),
        weighed: judged().flat_map(|set| weighed::weighed(study, set, finished)).collect(),
        priors: judged().flat_map(|set| priors(study, set, finished)).collect(),
        variants: variants::compared(study, finished),
        cost: cost(finished),
        finished: [there, work.len()],
        seeds: [judged().map(|set| set.seeds.count).max().unwrap_or(0), whole_seeds(study, finished)],
        in_part: study.drawn.in_part,
    }
}

impl Told {
    /// Whether sets or cells are missing, or there are fewer seeds than a claim takes.
    pub fn is_partial(&self) -> bool {
        let [there, all] = self.finished;
        self.in_part || there < all || self.seeds[1] < super::estimate::ENOUGH_SEEDS
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
    let best: Vec<f64> = trained.iter().map(|of| of.result.chosen.score).collect();
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
        best: Spread::of(&best)?,
    })
}

fn lost(study: &Study, set: &Set, finished: &Finished) -> Vec<LostLine> {
    let imitators = study.drawn.curves.as_ref().map_or(&[][..], |curves| &curves.imitators);
    let mut lines = Vec::new();
    for imitator in imitators {
        for count in study.compared_with_best(set, *imitator) {
            let best = |seed| {
                let demos = study.truly_best_without(seed, set, *imitator, count, finished)?;
                finished.training(&set.name, &demos, *imitator, seed)
            };
            let methods = study.methods.iter().map(|method| Some(method.name.clone())).chain([None]);
            lines.extend(methods.filter_map(|method| {
                let (by, kept) = match &method {
                    Some(name) => (name.as_str(), Kept::Top(TopK::Count(count))),
                    None => ("", Kept::All),
                };
                let trained = curves::trained(study, set, by, kept, *imitator, finished);
                let both: Vec<(&TrainingResult, &TrainingResult)> =
                    trained.iter().filter_map(|of| Some((best(of.seed)?, of.result))).collect();
                let by = |score: fn(&TrainingResult) -> f64| {
                    let pairs: Vec<(f64, f64)> =
                        both.iter().map(|(best, kept)| (score(best), score(kept))).collect();
                    paired_difference(&pairs)
                };
                Some(LostLine {
                    set: set.name.clone(),
                    unit: set.unit.clone(),
                    imitator: *imitator,
                    kept: count,
                    lost: by(|of| of.end.score)?,
                    lost_by_best: by(|of| of.chosen.score)?,
                    method,
                })
            }));
        }
    }
    lines
}

fn firsts(study: &Study, set: &Set, finished: &Finished) -> Vec<FirstLine> {
    let under = |demo: usize| set.recorded_under.get(demo);
    // A task of one goal has nothing that would not fit.
    let fits = |demo: &usize| set.variant.as_ref().is_none_or(|variant| under(*demo) == Some(variant));
    let of = |method: &super::Judge| {
        let first = |seed| {
            let kept = Kept::Top(TopK::Count(1));
            Some(study.kept(set, &method.name, kept, seed, finished)?.first()?.0)
        };
        let by_seed: Vec<(u64, usize)> =
            set.seeds.each().filter_map(|seed| Some((seed, first(seed)?))).collect();
        let gain = |&(seed, first): &(u64, usize)| {
            let judging = finished.judging(&set.name, &method.name, seed)?;
            Some(judging.demonstrations.get(first)?.score)
        };
        let gains: Vec<f64> = by_seed.iter().filter_map(gain).collect();
        let found: Vec<usize> = by_seed.iter().map(|(_, first)| *first).collect();
        let times = |demo: usize| found.iter().filter(|first| **first == demo).count();
        let mut firsts: Vec<First> = (0..set.demonstrations)
            .map(|demo| First { demo, times: times(demo), recorded_under: under(demo).cloned() })
            .filter(|first| first.times > 0)
            .collect();
        firsts.sort_by_key(|first| std::cmp::Reverse(first.times));
        let known = |count: usize| (!set.recorded_under.is_empty()).then_some(count);
        (!found.is_empty()).then(|| FirstLine {
            set: set.name.clone(),
            method: method.name.clone(),
            firsts,
            gain: Spread::of(&gains),
            unit: set.unit.clone(),
            fitting: known(found.iter().filter(|first| fits(first)).count()),
            fitting_in_set: known((0..set.demonstrations).filter(fits).count()),
            seeds: found.len(),
        })
    };
    study.methods.iter().filter_map(of).collect()
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

fn priors(study: &Study, set: &Set, finished: &Finished) -> Vec<PriorLine> {
    let of = |method: &super::Judge| {
        let judged: Vec<&JudgingResult> =
            set.seeds.each().filter_map(|seed| finished.judging(&set.name, &method.name, seed)).collect();
        let start = |of: &&JudgingResult| of.demonstrations.first().map(|demo| demo.after - demo.score);
        let start: Vec<f64> = judged.iter().filter_map(start).collect();
        let learned = || judged.iter().filter_map(|of| of.prior);
        let updates: Vec<f64> = learned().map(|of| of.meta_updates as f64).collect();
        let explained: Vec<f64> = learned().filter_map(|of| of.explained).collect();
        Some(PriorLine {
            set: set.name.clone(),
            unit: set.unit.clone(),
            method: method.name.clone(),
            meta_updates: Spread::of(&updates),
            score: Spread::of(&start)?,
            explained: Spread::of(&explained),
        })
    };
    let methods = study.methods.iter().filter(|method| method.combination.is_none() && !method.clones);
    methods.filter_map(of).collect()
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
