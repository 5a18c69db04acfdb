//! What methods keep by weights (Algorithm 3), and whether the weights of good and bad demonstrations part (Fig. 9).

use serde::Serialize;

use super::estimate::{Difference, Spread, paired_difference};
use super::parts::Set;
use super::plan::Study;
use super::truth::{Against, Truth, between, spearman};
use super::work::top;
use super::{Finished, WeighingResult};
use crate::data::demonstration::DemoId;
use crate::math::statistics;
use crate::stages::subset_selection::WeighingEnd;

/// What a method keeps by weights.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct WeighedLine {
    /// Of which set.
    pub set: String,
    /// By which method.
    pub method: String,
    /// How many demonstrations.
    pub kept: Spread,
    /// With how many seeds each demonstration is kept, `[n]`.
    pub times: Vec<usize>,
    /// Spearman's correlation of the last weights of two seeds, the mean over all pairs; missing of a single seed.
    pub alike: Option<f64>,
    /// Rounds.
    pub rounds: Spread,
    /// With how many seeds it ended since the same subset came out several times in a row.
    pub converged: usize,
    /// Environment steps of a selection, the prior apart; methods are given as many meta-updates, and not as many steps.
    pub environment_steps: f64,
    /// Weights beside the truth: the last one that the study knows, an oracle before what is known otherwise.
    pub truth: Option<WeighedTruth>,
}

/// How the last weights go with a truth.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct WeighedTruth {
    /// Which.
    pub truth: Against,
    /// Spearman's correlation with it.
    pub spearman: Spread,
    /// The mean weight of its better half less that of the others, paired by seed; the mean of all weights is 1.
    pub parting: Difference,
}

/// Of each method that weighs.
pub(super) fn weighed(study: &Study, set: &Set, finished: &Finished) -> Vec<WeighedLine> {
    let methods = study.drawn.weights.as_ref().filter(|weights| weights.is_about(&set.name));
    let truth = Truth::all(study, set, finished).pop();
    let of = |method: &String| {
        let found: Vec<&WeighingResult> =
            set.seeds.each().filter_map(|seed| finished.weighing(&set.name, method, seed)).collect();
        let last: Vec<&Vec<f64>> = found.iter().filter_map(|of| of.weights.last()).collect();
        let spread = |value: &dyn Fn(&WeighingResult) -> f64| {
            Spread::of(&found.iter().map(|of| value(of)).collect::<Vec<f64>>())
        };
        let steps: Vec<f64> = found.iter().map(|of| of.weighing.environment_steps as f64).collect();
        Some(WeighedLine {
            set: set.name.clone(),
            method: method.clone(),
            kept: spread(&|of| of.demos.len() as f64)?,
            times: (0..set.demonstrations)
                .map(|demo| found.iter().filter(|of| of.demos.contains(&DemoId(demo))).count())
                .collect(),
            alike: between(&last),
            rounds: spread(&|of| of.weights.len() as f64)?,
            converged: found.iter().filter(|of| of.end == WeighingEnd::Converged).count(),
            environment_steps: statistics::mean_or_zero(&steps),
            truth: truth.as_ref().and_then(|(against, truth)| beside(&last, against, &truth.values())),
        })
    };
    methods.iter().flat_map(|weights| &weights.methods).filter_map(of).collect()
}

fn beside(last: &[&Vec<f64>], against: &Against, values: &[f64]) -> Option<WeighedTruth> {
    let better = top(values, values.len() / 2);
    let mean_of_half = |weights: &[f64], is_better: bool| {
        let of_half = weights.iter().enumerate();
        let of_half = of_half.filter(|(demo, _)| better.contains(&DemoId(*demo)) == is_better);
        statistics::mean_or_zero(&of_half.map(|(_, weight)| *weight).collect::<Vec<f64>>())
    };
    let halves = last.iter().map(|weights| (mean_of_half(weights, true), mean_of_half(weights, false)));
    let agreement: Vec<f64> = last.iter().map(|weights| spearman(weights, values)).collect();
    Some(WeighedTruth {
        truth: against.clone(),
        spearman: Spread::of(&agreement)?,
        parting: paired_difference(&halves.collect::<Vec<_>>())?,
    })
}
