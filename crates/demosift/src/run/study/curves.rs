//! Courses over seeds: of learning on what methods keep, of adaptations, and of weights.

use serde::Serialize;

use super::choice::Kept;
use super::parts::Set;
use super::plan::Study;
use super::{Curve, Finished, TrainingResult};
use crate::learning::adapt::Rule;
use crate::math::statistics;

/// A training that learned from what was kept with the same seed.
#[derive(Clone, Copy, Debug)]
pub struct Trained<'f> {
    /// The seed of both.
    pub seed: u64,
    /// Its result.
    pub result: &'f TrainingResult,
}

/// The trainings on what a method keeps that are finished, by seed; of the whole set the method does not matter.
pub fn trained<'f>(
    study: &Study,
    set: &Set,
    method: &str,
    kept: Kept,
    imitator: Rule,
    finished: &'f Finished,
) -> Vec<Trained<'f>> {
    let of = |seed| {
        let demos = study.kept(set, method, kept, seed, finished)?;
        Some(Trained { seed, result: finished.training(&set.name, &demos, imitator, seed)? })
    };
    set.seeds.each().filter_map(of).collect()
}

/// A course over seeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Course {
    /// Where on the way, `[points]`.
    pub at: Vec<f64>,
    /// The mean over the seeds, `[points]`.
    pub mean: Vec<f64>,
    /// One standard deviation over the seeds, `[points]`; 0 of a single seed.
    pub deviation: Vec<f64>,
    /// Seeds.
    pub seeds: usize,
}

/// One seed's part of a course.
struct Run {
    at: Vec<f64>,
    value: Vec<f64>,
}

impl Course {
    /// Of several runs, as far as all of them go; `None` of nothing.
    fn of(runs: &[Run]) -> Option<Self> {
        let points =
            runs.iter().map(|run| run.value.len().min(run.at.len())).min().filter(|points| *points > 0)?;
        let across = |value: fn(&Run) -> &[f64], point: usize| -> Vec<f64> {
            runs.iter().map(|run| value(run)[point]).collect()
        };
        let values: Vec<Vec<f64>> = (0..points).map(|point| across(|run| &run.value, point)).collect();
        Some(Self {
            at: (0..points).map(|point| statistics::mean(&across(|run| &run.at, point))).collect(),
            mean: values.iter().map(|values| statistics::mean(values)).collect(),
            deviation: values.iter().map(|values| deviation(values)).collect(),
            seeds: runs.len(),
        })
    }
}

/// The standard deviation of a sample; 0 of a single value.
pub fn deviation(values: &[f64]) -> f64 {
    match values.len() {
        0 | 1 => 0.0,
        count => (statistics::squared_deviations(values) / (count - 1) as f64).sqrt(),
    }
}

/// The heuristic in the course of trainings, by environment steps, or by updates of cloning, which plays nothing to learn.
pub fn of_trainings(trained: &[Trained<'_>], imitator: Rule) -> Option<Course> {
    let whole = |count: &usize| *count as f64;
    let at = |curve: &Curve| -> Vec<f64> {
        match imitator {
            Rule::Gail => curve.environment_steps.iter().map(whole).collect(),
            Rule::BehavioralCloning => curve.updates.iter().map(whole).collect(),
        }
    };
    let of = |of: &Trained<'_>| Run { at: at(&of.result.curve), value: of.result.curve.score.clone() };
    let runs: Vec<Run> = trained.iter().filter(|of| !of.result.curve.is_empty()).map(of).collect();
    Course::of(&runs)
}

/// A demonstration in the course of something.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Followed {
    /// Which.
    pub demo: usize,
    /// Its course.
    pub course: Course,
    /// What it is sorted by: its mean score, or its last weight.
    pub worth: f64,
}

/// How a method adapted to each demonstration, the best by its mean score first.
pub fn of_adaptations(set: &Set, method: &str, finished: &Finished) -> Vec<Followed> {
    let judged: Vec<_> =
        set.seeds.each().filter_map(|seed| finished.judging(&set.name, method, seed)).collect();
    let of_demo = |demo: usize| {
        let run = |adaptation: &super::Adaptation| {
            let at = adaptation.updates.iter().map(|count| *count as f64).collect();
            Some(Run { at, value: adaptation.score.get(demo)?.clone() })
        };
        let runs: Vec<Run> = judged.iter().filter_map(|of| run(of.adaptation.as_ref()?)).collect();
        let scores: Vec<f64> =
            judged.iter().filter_map(|of| Some(of.demonstrations.get(demo)?.score)).collect();
        Some(Followed { demo, course: Course::of(&runs)?, worth: statistics::mean_or_zero(&scores) })
    };
    best_first((0..set.demonstrations).filter_map(of_demo).collect())
}

/// How each demonstration's weight went, the last heaviest first; a selection that ended stays where it ended.
pub fn of_weights(set: &Set, method: &str, finished: &Finished) -> Vec<Followed> {
    let weighed: Vec<&Vec<Vec<f64>>> = set
        .seeds
        .each()
        .filter_map(|seed| Some(&finished.weighing(&set.name, method, seed)?.weights))
        .filter(|weights| !weights.is_empty())
        .collect();
    let rounds = weighed.iter().map(|weights| weights.len()).max().unwrap_or(0);
    let of_demo = |demo: usize| {
        let run = |weights: &&Vec<Vec<f64>>| {
            let after = |round: usize| match round {
                0 => Some(1.0),
                _ => weights.get(round - 1).or(weights.last())?.get(demo).copied(),
            };
            let value: Vec<f64> = (0..=rounds).map(after).collect::<Option<_>>()?;
            Some(Run { at: (0..=rounds).map(|round| round as f64).collect(), value })
        };
        let runs: Vec<Run> = weighed.iter().filter_map(run).collect();
        let course = Course::of(&runs)?;
        let worth = course.mean.last().copied()?;
        Some(Followed { demo, course, worth })
    };
    best_first((0..set.demonstrations).filter_map(of_demo).collect())
}

fn best_first(mut all: Vec<Followed>) -> Vec<Followed> {
    all.sort_by(|a, b| b.worth.total_cmp(&a.worth).then(a.demo.cmp(&b.demo)));
    all
}

/// The best three and the worst three of those in order, as the paper shows them; all where there are no more than six.
pub fn both_ends(mut all: Vec<Followed>) -> Vec<Followed> {
    const EACH: usize = 3;
    if all.len() > 2 * EACH {
        all.drain(EACH..all.len() - EACH);
    }
    all
}
