//! How much of a judge's opinion is the luck of its seed.

use serde::Serialize;

use super::truth::{Against, Truth, between, mean_of, spearman};
use crate::math::statistics::mean;
use crate::world::heuristic::Score;

/// Of one judge and one truth: what a seed is worth beside all seeds together.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Steadiness {
    /// The truth.
    pub truth: Against,
    /// The judge.
    pub method: String,
    /// Spearman's correlation of one seed with another, mean over all pairs.
    pub between_seeds: f64,
    /// Spearman's correlation of one seed with the truth, mean over seeds.
    pub one_seed: f64,
    /// That of the mean score over all seeds.
    pub together: f64,
    /// Finished seeds.
    pub seeds: usize,
}

/// `seeds` holds the scores of each, `[seeds][n]`; nothing is said of fewer than two.
pub(super) fn steadiness(
    truth: &Against,
    values: &Truth,
    method: &str,
    seeds: &[Vec<Score>],
) -> Option<Steadiness> {
    let with_truth = |scores: &Vec<Score>| values.agreement(&spearman, scores);
    Some(Steadiness {
        truth: truth.clone(),
        method: method.to_owned(),
        between_seeds: between(&seeds.iter().collect::<Vec<_>>())?,
        one_seed: mean(&seeds.iter().map(with_truth).collect::<Vec<_>>()),
        together: with_truth(&mean_of(seeds.iter())),
        seeds: seeds.len(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn luck_goes_when_seeds_are_taken_together_and_a_leaning_stays() {
        let truth = Truth::Known(vec![1.0, 2.0, 3.0, 4.0]);
        let of =
            |seeds: &[Vec<Score>]| steadiness(&Against::Known("stage".to_owned()), &truth, "judge", seeds);
        // Each seed errs about another pair.
        let lucky =
            of(&[vec![2.0, 1.0, 3.5, 4.5], vec![1.0, 3.0, 2.5, 4.0], vec![0.0, 2.0, 4.0, 3.5]]).unwrap();
        assert!(lucky.between_seeds < 0.7, "{lucky:?}");
        assert!((lucky.one_seed - 0.8).abs() < 1e-9 && (lucky.together - 1.0).abs() < 1e-9, "{lucky:?}");
        let leaning = of(&[vec![2.0, 1.0, 3.0, 4.0], vec![2.5, 1.0, 3.0, 5.0]]).unwrap();
        assert!((leaning.between_seeds - 1.0).abs() < 1e-9, "{leaning:?}");
        assert!(
            (leaning.one_seed - 0.8).abs() < 1e-9 && (leaning.together - 0.8).abs() < 1e-9,
            "{leaning:?}"
        );
        assert_eq!(of(&[vec![1.0, 2.0, 3.0, 4.0]]), None);
    }
}
