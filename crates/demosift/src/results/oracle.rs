//! The oracle: what each demonstration teaches alone, with the full budget, and how a ranking and a subset stand beside it.
//!
//! A demonstration is scored by the policy at the end of its curve, which no luck chose.

use serde::Serialize;

use crate::data::demonstration::DemoId;
use crate::math::{agreement, statistics};
use crate::results::gain::{self, AgainstRandom};
use crate::stages::imitate::LearningCurve;
use crate::stages::select::Ranking;
use crate::world::heuristic::Score;

/// What the oracle says of a set.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Oracle {
    /// Each demonstration alone, in the order of the set.
    pub alone: Vec<Alone>,
    /// How well the ranking agrees with it, where there is a ranking.
    #[serde(flatten)]
    pub agreement: Option<Agreement>,
    /// The policy from the kept demonstrations beside it, where there is one.
    pub kept: Option<Worth>,
}

/// What one demonstration teaches alone.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Alone {
    /// v_i.
    pub demo: DemoId,
    /// Heuristic of the policy at the end of learning, `[repeats]`.
    pub scores: Vec<Score>,
    /// Their mean.
    pub mean: Score,
}

/// How well the gains of a ranking agree with what the demonstrations teach alone.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Agreement {
    /// Spearman's rank correlation.
    pub spearman: f64,
    /// Kendall's.
    pub kendall: f64,
    /// At K of 2 and of half of the set, as far as these are less than all.
    pub hit_rates: Vec<HitRate>,
}

/// Which share of the ranking's top K are among the top K alone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct HitRate {
    /// K.
    pub k: usize,
    /// The share.
    pub rate: f64,
}

/// What the policy from the kept demonstrations is worth beside others.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Worth {
    /// Its heuristic at the end of learning.
    pub score: Score,
    /// The demonstration that teaches best alone, the first of equals.
    pub best_alone: DemoId,
    /// How much of the way to the mean of the best one's policies it went, if that one taught anything; see
    /// [`gain::share_of_best`].
    pub share_of_best: Option<f64>,
    /// The same heuristic from random subsets of as many demonstrations.
    pub random: Vec<Score>,
    /// It beside these, if there are any.
    pub against_random: Option<AgainstRandom>,
}

/// What a demonstration teaches, by one training for each repeat.
pub fn alone(demo: DemoId, curves: &[LearningCurve]) -> Alone {
    let scores: Vec<Score> = curves.iter().map(|curve| curve.end.score).collect();
    Alone { demo, mean: statistics::mean(&scores), scores }
}

/// Compares a ranking with what the demonstrations teach alone.
pub fn agreement(ranking: &Ranking, alone: &[Alone]) -> Agreement {
    let taught = |demo: DemoId| alone.iter().find(|alone| alone.demo == demo).map(|alone| alone.mean);
    let both = ranking.entries.iter().filter_map(|entry| Some((entry.gain, taught(entry.demo)?)));
    let (judged, taught): (Vec<Score>, Vec<Score>) = both.unzip();
    let mut tops = vec![2, judged.len() / 2];
    tops.retain(|k| (1..judged.len()).contains(k));
    tops.sort_unstable();
    tops.dedup();
    let hit_rate = |k| HitRate { k, rate: agreement::hit_rate(&judged, &taught, k) };
    Agreement {
        spearman: agreement::spearman(&judged, &taught),
        kendall: agreement::kendall(&judged, &taught),
        hit_rates: tops.into_iter().map(hit_rate).collect(),
    }
}

/// Which of them teaches best, the first of equals; `None` of nothing.
pub fn best(alone: &[Alone]) -> Option<DemoId> {
    alone.iter().rev().max_by(|a, b| a.mean.total_cmp(&b.mean)).map(|best| best.demo)
}

/// Compares the policy from the kept demonstrations with those from the best one alone and from random subsets.
pub fn worth(kept: &LearningCurve, best: DemoId, its_curves: &[LearningCurve], random: Vec<Score>) -> Worth {
    let score = kept.end.score;
    Worth {
        score,
        best_alone: best,
        share_of_best: gain::share_of_best(kept, its_curves),
        against_random: (!random.is_empty()).then(|| gain::against_random(score, &random)),
        random,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::select::Ranked;

    fn taught(means: &[Score]) -> Vec<Alone> {
        let alone =
            |(demo, mean): (usize, &Score)| Alone { demo: DemoId(demo), scores: vec![*mean], mean: *mean };
        means.iter().enumerate().map(alone).collect()
    }

    fn ranking(order: &[usize]) -> Ranking {
        let ranked = |(place, demo): (usize, &usize)| {
            let gain = -(place as f64);
            Ranked { demo: DemoId(*demo), before: 0.0, after: gain, gain }
        };
        Ranking { entries: order.iter().enumerate().map(ranked).collect() }
    }

    #[test]
    fn a_ranking_in_the_order_of_what_is_taught_agrees_wholly_and_a_turned_one_not_at_all() {
        let alone = taught(&[0.1, 0.9, 0.5, 0.7]);
        let same = agreement(&ranking(&[1, 3, 2, 0]), &alone);
        assert_eq!((same.spearman, same.kendall), (1.0, 1.0));
        assert_eq!(same.hit_rates, [HitRate { k: 2, rate: 1.0 }], "half of four is two");
        let turned = agreement(&ranking(&[0, 2, 3, 1]), &alone);
        assert_eq!((turned.spearman, turned.kendall), (-1.0, -1.0));
        assert_eq!(turned.hit_rates[0].rate, 0.0);
    }

    #[test]
    fn the_best_is_the_first_of_equals() {
        assert_eq!(best(&taught(&[0.5, 0.9, 0.9])), Some(DemoId(1)));
        assert_eq!(best(&[]), None);
    }
}
