//! What the finished cells of a study say, however many there are.
//!
//! | table | says |
//! |---|---|
//! | agreement | of each method with each truth, over its seeds, beside the ceiling |
//! | steadiness | of each method, how much of its opinion is the luck of a seed |
//! | differences | between the first method and each other, paired by seed; and the same over all sets |
//! | regret | how much worse the policy from a method's top K is than that from the truly best K |
//! | costs | of each method, once per set and for each demonstration |
//! | pools | what the policies of trainings for their own sake are worth |
//! | referees | what the referee says of trainings that are drawn again from such pools |

use serde::Serialize;

use super::choice::TopK;
use super::estimate::{self, Difference, Estimate, OverSets, estimate};
use super::parts::Set;
use super::plan::{Judge, Study};
use super::pools::{PoolSummary, pools};
use super::referee_rates::RefereedSummary;
use super::steadiness::{Steadiness, steadiness};
use super::truth::{Against, Measure, Truth, or_nothing, spearman};
use super::work::top;
use super::{Cost, Finished};
use crate::data::demonstration::DemoId;
use crate::learning::adapt::Rule;
use crate::math::agreement;
use crate::math::statistics;
use crate::world::heuristic::Score;

/// All tables.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Summary {
    /// One per set, in order.
    pub sets: Vec<SetSummary>,
    /// Differences of the first method and each other over all sets that know them, one per truth and other method.
    pub over_sets: Vec<ComparedOverSets>,
    /// One a pool and subset.
    pub pools: Vec<PoolSummary>,
    /// One a referee of a set, kept subset and number of trainings.
    pub referees: Vec<RefereedSummary>,
    /// Failed cells, each with its error.
    pub failures: Vec<(String, String)>,
    /// Cells that are there, and those that can be named by now.
    pub finished: [usize; 2],
}

/// What is said of one set.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SetSummary {
    /// Its name.
    pub set: String,
    /// Of the heuristic.
    pub unit: String,
    /// How many demonstrations it has.
    pub demonstrations: usize,
    /// K of the hit rates.
    pub hits_at: Vec<usize>,
    /// Ceilings first, then methods, for each truth in turn.
    pub agreement: Vec<Agreement>,
    /// Of each method for each truth in turn, where there are two seeds.
    pub steadiness: Vec<Steadiness>,
    /// Differences of Spearman's correlation between the first method and each other.
    pub differences: Vec<Compared>,
    /// Regret, for each imitator, K and method.
    pub regret: Vec<RegretSummary>,
    /// One per method that has finished cells.
    pub costs: Vec<Costs>,
}

/// How well a method, or the oracle itself, agrees with a truth.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Agreement {
    /// The truth.
    pub truth: Against,
    /// The method; the oracle itself, leaving one out, where there is none.
    pub method: Option<String>,
    /// Spearman's rank correlation; a constant opinion has 0.
    pub spearman: Estimate,
    /// Kendall's, τ-b.
    pub kendall: Estimate,
    /// Hit rate at each K of the set.
    pub hit_rates: Vec<Estimate>,
}

/// A method beside another.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Compared {
    /// The truth.
    pub truth: Against,
    /// The one.
    pub method: String,
    /// The other.
    pub other: String,
    /// The one less the other.
    pub difference: Difference,
    /// Whether that can be told from luck.
    pub separable: bool,
}

/// A method beside another, over all sets that know both.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ComparedOverSets {
    /// With the pairs of all these sets.
    #[serde(flatten)]
    pub compared: Compared,
    /// How many sets.
    pub sets: usize,
}

/// How much worse the policies are that a method's choice made.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RegretSummary {
    /// Who learned from the top K.
    pub imitator: Rule,
    /// K.
    pub k: usize,
    /// The method.
    pub method: String,
    /// In the unit of the heuristic, lower is better; over the seeds of judging.
    pub regret: Estimate,
    /// As a share of what the best demonstration alone is above the mean of all alone; missing where no oracle by this
    /// imitator is finished.
    pub share: Option<Estimate>,
}

/// What a method costs, means over its finished seeds; of a combination, all that it is made of.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Costs {
    /// The method.
    pub method: String,
    /// Environment steps paid once for a set.
    pub steps_once: f64,
    /// Environment steps paid for each demonstration.
    pub steps_each: f64,
    /// Processor seconds paid once.
    pub seconds_once: f64,
    /// Processor seconds paid for each demonstration.
    pub seconds_each: f64,
    /// Table 1; none of a combination.
    pub adapted_behaviors_distance: Option<f64>,
    /// Finished seeds.
    pub seeds: usize,
}

/// Says what there is to say.
pub fn summarize(study: &Study, finished: &Finished) -> Summary {
    let sets: Vec<SetSummary> = study.sets.iter().map(|set| of_set(study, set, finished)).collect();
    let work = study.work(finished);
    Summary {
        over_sets: over_sets(&sets),
        pools: pools(study, finished),
        referees: study.referees.iter().flat_map(|refereed| refereed.summarize(study, finished)).collect(),
        failures: finished.failures(),
        finished: [work.iter().filter(|work| finished.holds(work)).count(), work.len()],
        sets,
    }
}

fn of_set(study: &Study, set: &Set, finished: &Finished) -> SetSummary {
    let hits_at = TopK::all_of(&study.hits_at, set.demonstrations);
    let mut summary = SetSummary {
        set: set.name.clone(),
        unit: set.unit.clone(),
        demonstrations: set.demonstrations,
        hits_at: hits_at.clone(),
        agreement: Vec::new(),
        steadiness: Vec::new(),
        differences: Vec::new(),
        regret: regret(study, set, finished),
        costs: study.methods.iter().filter_map(|method| costs(set, method, finished)).collect(),
    };
    let judged: Vec<Judged<'_>> =
        study.methods.iter().map(|method| judged(study, set, method, finished)).collect();
    for (against, truth) in Truth::all(study, set, finished) {
        let ceiling = |measure: Measure<'_>| truth.ceiling(measure);
        summary.agreement.extend(agreement(&against, None, &hits_at, &ceiling));
        let may_judge = |of: &&Judged<'_>| match &against {
            Against::Oracle(imitator) => study.may_be_held_against(of.method, *imitator),
            Against::Known(_) => true,
        };
        let judged: Vec<&Judged<'_>> = judged.iter().filter(may_judge).collect();
        for of in &judged {
            let by_seed =
                |measure: Measure<'_>| of.scores.iter().map(|(_, s)| truth.agreement(measure, s)).collect();
            summary.agreement.extend(agreement(&against, Some(&of.method.name), &hits_at, &by_seed));
            let seeds: Vec<Vec<f64>> = of.scores.iter().map(|(_, scores)| scores.clone()).collect();
            summary.steadiness.extend(steadiness(&against, &truth, &of.method.name, &seeds));
        }
        if let Some((first, others)) = judged.split_first() {
            summary
                .differences
                .extend(others.iter().filter_map(|other| compared(&against, &truth, first, other)));
        }
    }
    summary
}

/// What a method found of a set, one per finished seed.
struct Judged<'s> {
    method: &'s Judge,
    scores: Vec<(u64, Vec<f64>)>,
}

fn judged<'s>(study: &'s Study, set: &Set, method: &'s Judge, finished: &Finished) -> Judged<'s> {
    let of = |seed| Some((seed, study.scores(set, method, seed, finished)?));
    Judged { method, scores: set.seeds.each().filter_map(of).collect() }
}

/// `values` applies a measure to each seed; `None` where there is no seed.
fn agreement(
    truth: &Against,
    method: Option<&str>,
    hits_at: &[usize],
    values: &dyn Fn(Measure<'_>) -> Vec<f64>,
) -> Option<Agreement> {
    let of = |measure: Measure<'_>| estimate(&values(measure));
    let hits = hits_at.iter().map(|k| of(&|one, other| agreement::hit_rate(one, other, *k)));
    Some(Agreement {
        truth: truth.clone(),
        method: method.map(str::to_owned),
        spearman: of(&spearman)?,
        kendall: of(&|one, other| or_nothing(agreement::kendall(one, other)))?,
        hit_rates: hits.collect::<Option<_>>()?,
    })
}

fn compared(against: &Against, truth: &Truth, one: &Judged<'_>, other: &Judged<'_>) -> Option<Compared> {
    let pairs = one.scores.iter().filter_map(|(seed, scores)| {
        let (_, others) = other.scores.iter().find(|(of, _)| of == seed)?;
        Some([scores.clone(), others.clone()])
    });
    let difference = truth.compared(&pairs.collect::<Vec<_>>())?;
    Some(Compared {
        truth: against.clone(),
        method: one.method.name.clone(),
        other: other.method.name.clone(),
        separable: difference.can_decide() && difference.is_separable(),
        difference,
    })
}

fn over_sets(sets: &[SetSummary]) -> Vec<ComparedOverSets> {
    let all = || sets.iter().flat_map(|set| &set.differences);
    let same =
        |a: &Compared, b: &Compared| (&a.truth, &a.method, &a.other) == (&b.truth, &b.method, &b.other);
    let mut kinds: Vec<&Compared> = Vec::new();
    for of in all() {
        if !kinds.iter().any(|kind| same(kind, of)) {
            kinds.push(of);
        }
    }
    let over = |kind: &&Compared| {
        let each: Vec<Difference> = all().filter(|of| same(kind, of)).map(|of| of.difference).collect();
        let OverSets { difference, sets } = estimate::over_sets(&each)?;
        let separable = difference.can_decide() && difference.is_separable();
        let compared = Compared { difference, separable, ..(*kind).clone() };
        Some(ComparedOverSets { compared, sets })
    };
    kinds.iter().filter_map(over).collect()
}

fn regret(study: &Study, set: &Set, finished: &Finished) -> Vec<RegretSummary> {
    let mut found = Vec::new();
    let Some(regret) = study.regret_of(set) else { return found };
    for imitator in &regret.imitators {
        let spread = Truth::oracle(study, set, *imitator, finished).map(|oracle| {
            let alone = oracle.values();
            alone.iter().copied().fold(f64::NEG_INFINITY, f64::max) - statistics::mean(&alone)
        });
        // End scores by seed; only whole rows are compared, so that the same seeds stand on both sides.
        let end =
            |demos: &[DemoId], seed| Some(finished.training(&set.name, demos, *imitator, seed)?.end.score);
        let trained = |demos: &[DemoId]| {
            regret.trainings.each().map(|seed| end(demos, seed)).collect::<Option<Vec<f64>>>()
        };
        for k in TopK::all_of(&regret.at, set.demonstrations) {
            let best = |seed| end(&study.truly_best_without(seed, set, *imitator, k, finished)?, seed);
            let Some(best) = regret.trainings.each().map(best).collect::<Option<Vec<f64>>>() else {
                continue;
            };
            for method in &study.methods {
                let judged = set.seeds.each().filter_map(|seed| study.scores(set, method, seed, finished));
                let lost = |scores: Vec<Score>| {
                    Some(statistics::mean(&best) - statistics::mean(&trained(&top(&scores, k))?))
                };
                // Those that chose as the oracle does are trained first, so without the rest little would seem to be lost.
                let Some(regrets) = judged.map(lost).collect::<Option<Vec<f64>>>() else { continue };
                let shares = spread
                    .filter(|spread| *spread > 0.0)
                    .map(|spread| regrets.iter().map(|regret| regret / spread).collect::<Vec<f64>>());
                found.extend(estimate(&regrets).map(|regret| RegretSummary {
                    imitator: *imitator,
                    k,
                    method: method.name.clone(),
                    regret,
                    share: shares.and_then(|shares| estimate(&shares)),
                }));
            }
        }
    }
    found
}

fn costs(set: &Set, method: &Judge, finished: &Finished) -> Option<Costs> {
    let parts = method.combination.as_ref().map_or(vec![&method.name], |of| of.of.iter().collect());
    let of_seed = |seed| {
        let parts = parts.iter().map(|part| finished.judging(&set.name, part, seed));
        parts.collect::<Option<Vec<_>>>()
    };
    let seeds: Vec<_> = set.seeds.each().filter_map(of_seed).collect();
    if seeds.is_empty() {
        return None;
    }
    let sum = |part: fn(&super::JudgingResult) -> Cost| {
        seeds.iter().flatten().map(|result| part(result)).fold(Cost::default(), |sum, cost| sum + cost)
    };
    let (once, judging, count) = (sum(|of| of.once), sum(|of| of.judging), seeds.len() as f64);
    let each = count * set.demonstrations as f64;
    let distances: Vec<f64> = seeds.iter().map(|results| results[0].adapted_behaviors_distance).collect();
    Some(Costs {
        method: method.name.clone(),
        steps_once: once.environment_steps as f64 / count,
        steps_each: judging.environment_steps as f64 / each,
        seconds_once: once.seconds / count,
        seconds_each: judging.seconds / each,
        adapted_behaviors_distance: method.combination.is_none().then(|| statistics::mean(&distances)),
        seeds: seeds.len(),
    })
}
