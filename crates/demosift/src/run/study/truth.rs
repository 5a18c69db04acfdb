//! What methods are held against, and how well they agree with it.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::estimate::{Difference, difference_beside_drawn, paired_difference};
use super::parts::Set;
use super::plan::Study;
use super::work::top;
use super::{Finished, imitator_name};
use crate::data::demonstration::DemoId;
use crate::learning::adapt::Rule;
use crate::math::agreement;
use crate::math::statistics::mean;
use crate::world::heuristic::Score;

/// A truth by name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Against {
    /// What policies learned from each demonstration alone.
    Oracle(Rule),
    /// What is known.
    Known(String),
}

impl fmt::Display for Against {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Oracle(imitator) => write!(out, "oracle by {}", imitator_name(*imitator)),
            Self::Known(kind) => kind.fmt(out),
        }
    }
}

/// A truth.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Truth {
    /// The end scores of all demonstrations, for each finished seed, `[seeds][n]`.
    Oracle(Vec<Vec<Score>>),
    /// Values, `[n]`.
    Known(Vec<f64>),
}

/// How well two lists of values agree.
pub(super) type Measure<'m> = &'m dyn Fn(&[f64], &[f64]) -> f64;

/// Spearman's rank correlation.
pub(super) fn spearman(one: &[f64], other: &[f64]) -> f64 {
    or_nothing(agreement::spearman(one, other))
}

/// Spearman's correlation of two of them, the mean over all pairs; `None` of a single one.
pub(super) fn between(seeds: &[&Vec<f64>]) -> Option<f64> {
    let others = |place: usize| seeds[..place].iter();
    let pairs = seeds.iter().enumerate();
    let pairs = pairs.flat_map(|(place, one)| others(place).map(move |other| spearman(one, other)));
    let found: Vec<f64> = pairs.collect();
    (!found.is_empty()).then(|| mean(&found))
}

/// An opinion that is the same of all demonstrations agrees with nothing and contradicts nothing.
pub(super) fn or_nothing(correlation: f64) -> f64 {
    if correlation.is_nan() { 0.0 } else { correlation }
}

impl Truth {
    /// The oracle by an imitator, of the seeds with which all demonstrations are finished; `None` if there is none yet.
    pub(super) fn oracle(study: &Study, set: &Set, imitator: Rule, finished: &Finished) -> Option<Self> {
        if !study.oracle.contains(&imitator) {
            return None;
        }
        let of_seed = |seed| {
            let alone = |demo| finished.training(&set.name, &[DemoId(demo)], imitator, seed);
            (0..set.demonstrations).map(|demo| Some(alone(demo)?.end.score)).collect::<Option<Vec<Score>>>()
        };
        let seeds: Vec<Vec<Score>> = set.oracle_seeds.each().filter_map(of_seed).collect();
        (!seeds.is_empty()).then_some(Self::Oracle(seeds))
    }

    /// All that there is of a set by now.
    pub(super) fn all(study: &Study, set: &Set, finished: &Finished) -> Vec<(Against, Self)> {
        let known = set
            .known
            .iter()
            .map(|known| (Against::Known(known.kind.clone()), Self::Known(known.values.clone())));
        let oracle = study.oracle.iter().filter_map(|imitator| {
            Some((Against::Oracle(*imitator), Self::oracle(study, set, *imitator, finished)?))
        });
        known.chain(oracle).collect()
    }

    /// One value a demonstration.
    pub(super) fn values(&self) -> Vec<f64> {
        match self {
            Self::Known(values) => values.clone(),
            Self::Oracle(seeds) => mean_of(seeds.iter()),
        }
    }

    /// How well scores agree with it: for an oracle of several seeds the mean over all ways to leave one out, as for the ceiling.
    pub(super) fn agreement(&self, measure: Measure<'_>, scores: &[Score]) -> f64 {
        match self {
            Self::Known(values) => measure(scores, values),
            Self::Oracle(seeds) if seeds.len() == 1 => measure(scores, &seeds[0]),
            Self::Oracle(seeds) => {
                let each: Vec<f64> =
                    (0..seeds.len()).map(|left| measure(scores, &without(seeds, left))).collect();
                mean(&each)
            }
        }
    }

    /// By how much better the first of each pair of scores ranks. The luck with which an oracle was drawn counts as well.
    pub(super) fn compared(&self, pairs: &[[Vec<Score>; 2]]) -> Option<Difference> {
        let difference =
            |truth: &[f64], [one, other]: &[Vec<Score>; 2]| spearman(one, truth) - spearman(other, truth);
        let beside =
            |truth: Vec<f64>| pairs.iter().map(|pair| difference(&truth, pair)).collect::<Vec<f64>>();
        match self {
            Self::Known(values) => {
                let pairs: Vec<(f64, f64)> = beside(values.clone()).into_iter().map(|of| (of, 0.0)).collect();
                paired_difference(&pairs)
            }
            Self::Oracle(seeds) if seeds.len() == 1 => difference_beside_drawn(&[beside(seeds[0].clone())]),
            Self::Oracle(seeds) => {
                let each: Vec<Vec<f64>> = (0..seeds.len()).map(|left| beside(without(seeds, left))).collect();
                difference_beside_drawn(&each)
            }
        }
    }

    /// How well each seed of an oracle agrees with the mean of the others; nothing where there is one seed, or no oracle.
    pub(super) fn ceiling(&self, measure: Measure<'_>) -> Vec<f64> {
        match self {
            Self::Oracle(seeds) if seeds.len() > 1 => {
                (0..seeds.len()).map(|left| measure(&seeds[left], &without(seeds, left))).collect()
            }
            _ => Vec::new(),
        }
    }
}

/// The mean of all seeds but one.
fn without(seeds: &[Vec<Score>], left: usize) -> Vec<Score> {
    mean_of(seeds.iter().enumerate().filter(|(index, _)| *index != left).map(|(_, scores)| scores))
}

/// For each demonstration the mean over seeds.
pub(super) fn mean_of<'s>(seeds: impl Iterator<Item = &'s Vec<Score>> + Clone) -> Vec<Score> {
    let size = seeds.clone().next().map_or(0, Vec::len);
    let of_demo = |demo: usize| seeds.clone().map(|scores| scores[demo]).collect::<Vec<_>>();
    (0..size).map(|demo| mean(&of_demo(demo))).collect()
}

impl Study {
    /// The same, where one training of theirs is to say what they are worth: a single demonstration is then chosen by the others, or
    /// the luck by which it was chosen would count as worth. Trainings on several are none of the oracle's.
    pub(super) fn truly_best_without(
        &self,
        seed: u64,
        set: &Set,
        imitator: Rule,
        k: usize,
        finished: &Finished,
    ) -> Option<Vec<DemoId>> {
        let best = self.truly_best(set, imitator, k, finished)?;
        match (k, Truth::oracle(self, set, imitator, finished)) {
            (1, Some(Truth::Oracle(seeds))) => {
                // Those of which a training failed are none of the oracle's.
                let is_whole = |of: &u64| {
                    (0..set.demonstrations)
                        .all(|demo| finished.training(&set.name, &[DemoId(demo)], imitator, *of).is_some())
                };
                let left = set.oracle_seeds.each().filter(is_whole).position(|of| of == seed);
                match left {
                    // No other training says which one is the best.
                    Some(_) if seeds.len() == 1 => None,
                    Some(left) => Some(top(&without(&seeds, left), k)),
                    None => Some(best),
                }
            }
            _ => Some(best),
        }
    }

    /// The K best demonstrations for an imitator: by its own oracle once all of that is finished, or where it has none by the
    /// first thing that is known.
    pub(super) fn truly_best(
        &self,
        set: &Set,
        imitator: Rule,
        k: usize,
        finished: &Finished,
    ) -> Option<Vec<DemoId>> {
        let has_oracle = self.oracle.contains(&imitator) && set.oracle_seeds.count > 0;
        let values = match has_oracle {
            true => {
                let oracle = Truth::oracle(self, set, imitator, finished)?;
                // A failed training leaves its seed out for good; one that is not finished yet may still change the answer.
                let waits = set.oracle_seeds.each().any(|seed| {
                    (0..set.demonstrations).any(|demo| {
                        let demos = vec![DemoId(demo)];
                        let work = super::Work::Training { set: set.name.clone(), demos, imitator, seed };
                        !finished.holds(&work)
                    })
                });
                if waits {
                    return None;
                }
                oracle.values()
            }
            false => set.known.first()?.values.clone(),
        };
        Some(top(&values, k))
    }
}
