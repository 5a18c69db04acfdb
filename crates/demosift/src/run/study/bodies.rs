//! Demonstrations that another body made: how many of them a method keeps, and what they teach (for Fig. 6).
//!
//! Whose a demonstration is was drawn once, and seeds draw only how it is judged, so no interval over seeds says whether a method
//! avoids a body.
//! Shares are told beside those of the whole set, of its demonstrations that succeeded, and of the oracle, and nothing is decided.

use serde::Serialize;

use super::Finished;
use super::choice::{Kept, TopK};
use super::estimate::Spread;
use super::parts::Set;
use super::plan::Study;
use super::truth::Truth;
use super::work::top;
use crate::learning::adapt::Rule;
use crate::math::statistics;

/// How many demonstrations of another body are among the best K.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BodyLine {
    /// Of which set.
    pub set: String,
    /// By which method.
    pub method: Option<String>,
    /// By which oracle, where no method judged.
    pub oracle: Option<Rule>,
    /// K.
    pub kept: usize,
    /// The share of another body's among the best K.
    pub share: Spread,
    /// The same of the whole set.
    pub of_set: f64,
    /// The same of those that reached the goal where they were recorded, where that is known of any.
    pub of_successful: Option<f64>,
}

/// What a policy learns from one demonstration alone, of those of a body that succeeded or failed.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TaughtLine {
    /// Of which set.
    pub set: String,
    /// Of the heuristic.
    pub unit: String,
    /// Who learned.
    pub imitator: Rule,
    /// Whether another body than the agent's made them.
    pub by_other: bool,
    /// Whether they reached the goal where they were recorded, where that is known.
    pub succeeded: Option<bool>,
    /// How many they are.
    pub demonstrations: usize,
    /// The mean of their scores, each the mean over the oracle's seeds.
    pub mean: f64,
    /// The least of these.
    pub least: f64,
    /// The highest of these.
    pub most: f64,
    /// The oracle's seeds.
    pub seeds: usize,
}

/// The share of another body's demonstrations among some.
struct Shares {
    others: Vec<bool>,
}

impl Shares {
    fn of(&self, demos: impl Iterator<Item = usize>) -> f64 {
        let chosen: Vec<f64> = demos.map(|demo| f64::from(u8::from(self.others[demo]))).collect();
        statistics::mean_or_zero(&chosen)
    }
}

/// Who is among the best K, of each method and of each oracle; nothing where bodies are not known.
pub(super) fn kept(study: &Study, set: &Set, finished: &Finished) -> Vec<BodyLine> {
    let shares = Shares { others: set.by_others() };
    if shares.others.is_empty() {
        return Vec::new();
    }
    let successful = || (0..set.demonstrations).filter(|demo| set.succeeded.get(*demo) == Some(&true));
    let line = |kept, method, oracle, of: &[f64]| {
        Spread::of(of).map(|share| BodyLine {
            set: set.name.clone(),
            method,
            oracle,
            kept,
            share,
            of_set: shares.of(0..set.demonstrations),
            of_successful: successful().next().map(|_| shares.of(successful())),
        })
    };
    let at = study.drawn.curves.as_ref().map_or(&[][..], |curves| &curves.at);
    let mut lines = Vec::new();
    for count in TopK::all_of(at, set.demonstrations) {
        for imitator in &study.oracle {
            if let Some(Truth::Oracle(seeds)) = Truth::oracle(study, set, *imitator, finished) {
                let of_seed = |scores: &Vec<f64>| shares.of(top(scores, count).iter().map(|demo| demo.0));
                let of: Vec<f64> = seeds.iter().map(of_seed).collect();
                lines.extend(line(count, None, Some(*imitator), &of));
            }
        }
        for method in &study.methods {
            let of_seed = |seed| {
                let demos = study.kept(set, &method.name, Kept::Top(TopK::Count(count)), seed, finished)?;
                Some(shares.of(demos.iter().map(|demo| demo.0)))
            };
            let of: Vec<f64> = set.seeds.each().filter_map(of_seed).collect();
            lines.extend(line(count, Some(method.name.clone()), None, &of));
        }
    }
    lines
}

/// What each kind of demonstrations teaches by itself, by each oracle; nothing where bodies are not known.
pub(super) fn taught(study: &Study, set: &Set, finished: &Finished) -> Vec<TaughtLine> {
    let others = set.by_others();
    let mut lines = Vec::new();
    for imitator in &study.oracle {
        let oracle = Truth::oracle(study, set, *imitator, finished).filter(|_| !others.is_empty());
        let Some(Truth::Oracle(seeds)) = &oracle else { continue };
        let alone = oracle.as_ref().map(Truth::values).unwrap_or_default();
        let kinds = [false, true].into_iter().flat_map(|by_other| {
            [Some(true), Some(false), None].into_iter().map(move |succeeded| (by_other, succeeded))
        });
        for (by_other, succeeded) in kinds {
            let is_meant =
                |demo: &usize| others[*demo] == by_other && set.succeeded.get(*demo).copied() == succeeded;
            let scores: Vec<f64> = (0..set.demonstrations).filter(is_meant).map(|demo| alone[demo]).collect();
            if scores.is_empty() {
                continue;
            }
            lines.push(TaughtLine {
                set: set.name.clone(),
                unit: set.unit.clone(),
                imitator: *imitator,
                by_other,
                succeeded,
                demonstrations: scores.len(),
                mean: statistics::mean(&scores),
                least: scores.iter().copied().fold(f64::INFINITY, f64::min),
                most: scores.iter().copied().fold(f64::NEG_INFINITY, f64::max),
                seeds: seeds.len(),
            });
        }
    }
    lines
}
