//! Behavioral-cloning loss: a demonstration that acts as the others do in similar states is easy to learn from.
//!
//! Curators score a demonstration by how badly a cloned policy predicts its actions; "L2 loss" is one of the rivals in
//! Hejna et al. 2025 ("Robot data curation with mutual information estimators"), where the policy has seen it.
//!
//! Here it is **left out**: the policy that predicts a demonstration is cloned from all others, so none is rewarded for
//! being learned by heart. What we simplify: the policy is linear in [o, o², 1], by ridge regression, and not a network;
//! so it has no random numbers, no stopping point, and the same result in whatever order the demonstrations come.
//! With few demonstrations, one that goes where no other goes is predicted badly for that alone.

use rayon::prelude::*;

use super::{standard_actions, standard_observations};
use crate::basics::error::Result;
use crate::data::demonstration::DemonstrationSet;
use crate::math::rows::Rows;
use crate::math::solve::{NormalEquations, ridge_columns};

/// λ by the number of pairs: features and actions have unit spread, so this shrinks weights by a hundredth.
const RIDGE: f64 = 1e-2;
/// Standard deviations beyond which observations are cut, so that squares do not run away.
const CLIP: f32 = 5.0;

/// Minus the mean squared error of the actions, each in units of its standard deviation over the set, by the policy
/// cloned from the other demonstrations; nothing to say where no action or no observation varies.
pub fn cloning_loss(set: &DemonstrationSet) -> Result<Option<Vec<f64>>> {
    let (observations, actions) = (standard_observations(set), standard_actions(set));
    if actions[0].width() == 0 || observations[0].width() == 0 {
        return Ok(None);
    }
    match set.len() {
        ..=ONE_BY_ONE => left_out_one_by_one(&observations, &actions).map(Some),
        _ => taken_out_of_all(&observations, &actions).map(Some),
    }
}

/// Of so many demonstrations all others are gathered for each; of more each is taken out of what is known of all, which is the
/// same but for rounding and takes time in proportion to their number.
const ONE_BY_ONE: usize = 100;

fn left_out_one_by_one(observations: &[Rows], actions: &[Rows]) -> Result<Vec<f64>> {
    let features: Vec<Rows> = observations.iter().map(features).collect();
    (0..features.len())
        .into_par_iter()
        .map(|left_out| {
            let (others, shown) = (all_but(&features, left_out), all_but(actions, left_out));
            let weights = ridge_columns(&others, &shown, RIDGE * others.len() as f64)?;
            Ok(-squared_error(&features[left_out], &actions[left_out], &weights))
        })
        .collect()
}

/// Sums of so many parts of the set are added up, whatever the number of threads.
const PARTS: usize = 64;

fn taken_out_of_all(observations: &[Rows], actions: &[Rows]) -> Result<Vec<f64>> {
    let empty = || NormalEquations::empty(2 * observations[0].width() + 1, actions[0].width());
    let size = observations.len().div_ceil(PARTS);
    let of_part = |(observations, actions): (&[Rows], &[Rows])| {
        let mut sum = empty();
        observations.iter().zip(actions).for_each(|(of, actions)| sum.add_rows(&features(of), actions));
        sum
    };
    let parts: Vec<NormalEquations> =
        observations.par_chunks(size).zip(actions.par_chunks(size)).map(of_part).collect();
    let mut all = empty();
    parts.iter().for_each(|part| all.add(part));
    let loss = |(observations, actions): (&Rows, &Rows)| {
        let features = features(observations);
        let others = all.without(&NormalEquations::of(&features, actions));
        let weights = others.weights(RIDGE * others.rows() as f64)?;
        Ok(-squared_error(&features, actions, &weights))
    };
    observations.par_iter().zip(actions).map(loss).collect()
}

/// [o, o², 1] of each observation.
fn features(observations: &Rows) -> Rows {
    let mut features = Rows::with_capacity(2 * observations.width() + 1, observations.len());
    for row in observations.iter() {
        let cut = row.iter().map(|value| value.clamp(-CLIP, CLIP));
        let row: Vec<f32> = cut.clone().chain(cut.map(|value| value * value)).chain([1.0]).collect();
        features.push(&row);
    }
    features
}

fn all_but(tables: &[Rows], left_out: usize) -> Rows {
    let mut all = Rows::with_capacity(tables[0].width(), 0);
    tables
        .iter()
        .enumerate()
        .filter(|(index, _)| *index != left_out)
        .for_each(|(_, table)| all.append(table));
    all
}

/// Mean over steps and actions.
fn squared_error(features: &Rows, actions: &Rows, weights: &[Vec<f64>]) -> f64 {
    let error = |(features, actions): (&[f32], &[f32])| -> f64 {
        let predicted =
            |weights: &Vec<f64>| features.iter().zip(weights).map(|(x, w)| f64::from(*x) * w).sum::<f64>();
        weights
            .iter()
            .zip(actions)
            .map(|(weights, action)| (predicted(weights) - f64::from(*action)).powi(2))
            .sum()
    };
    features.iter().zip(actions.iter()).map(error).sum::<f64>() / (actions.len() * actions.width()) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basics::seed::Seed;
    use crate::data::demonstration::Demonstration;
    use crate::world::point_mass::planted_set;
    use rand_distr::{Distribution, StandardNormal};

    /// Actions that are a quadratic of the state plus noise of a known size: the loss is the variance of that noise.
    #[test]
    fn the_loss_is_the_variance_of_the_noise() {
        let noises = [0.1, 0.5, 0.1, 0.3, 0.1, 0.1_f32];
        let mut rng = Seed::new(1).into_rng();
        let mut normal = || -> f32 { StandardNormal.sample(&mut rng) };
        let mut demonstrations = Vec::new();
        for noise in noises {
            let (mut observations, mut actions) = (Rows::with_capacity(1, 0), Rows::with_capacity(1, 0));
            for _ in 0..400 {
                let state = normal();
                observations.push(&[state]);
                actions.push(&[state - 0.5 * state * state + noise * normal()]);
            }
            demonstrations.push(Demonstration::new(observations, actions).unwrap());
        }
        let all: Vec<f64> =
            demonstrations.iter().flat_map(|one| one.actions().flat()).map(|a| f64::from(*a)).collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let variance = all.iter().map(|a| (a - mean).powi(2)).sum::<f64>() / all.len() as f64;
        let found = cloning_loss(&DemonstrationSet::new(demonstrations).unwrap()).unwrap().unwrap();
        for (found, noise) in found.iter().zip(noises) {
            let exact = -f64::from(noise * noise) / variance;
            assert!((found - exact).abs() < 0.02, "{found}, exactly {exact}");
        }
    }

    #[test]
    fn taken_out_of_all_is_the_same_as_left_out_one_by_one() {
        let angles: Vec<f32> = (0..70_u8).map(|index| f32::from(index) * 5.0).collect();
        let set = planted_set(&angles, Seed::new(1)).unwrap();
        let (observations, actions) = (standard_observations(&set), standard_actions(&set));
        let one_by_one = left_out_one_by_one(&observations, &actions).unwrap();
        let taken_out = taken_out_of_all(&observations, &actions).unwrap();
        for (one, other) in one_by_one.iter().zip(&taken_out) {
            assert!((one - other).abs() < 1e-9 * one.abs(), "{one} {other}");
        }
    }

    #[test]
    fn the_one_that_acts_against_the_others_is_the_lowest() {
        let set = planted_set(&[0.0, 5.0, -5.0, 10.0, -10.0], Seed::new(1)).unwrap();
        let mut demonstrations: Vec<Demonstration> = set.iter().map(|(_, one)| one.clone()).collect();
        let opposite: Vec<f32> = demonstrations[1].actions().flat().iter().map(|action| -action).collect();
        let opposite = Rows::from_flat(opposite, 2).unwrap();
        demonstrations[1] = Demonstration::new(demonstrations[1].observations().clone(), opposite).unwrap();
        let found = cloning_loss(&DemonstrationSet::new(demonstrations).unwrap()).unwrap().unwrap();
        assert!((0..5).filter(|id| *id != 1).all(|id| found[id] > found[1]), "{found:?}");
    }
}
