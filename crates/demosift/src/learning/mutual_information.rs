//! The mutual-information regularizer (§4.2, Eq. 4 to 7): a reward for updates whose effect tells what was imitated.
//!
//! A posterior Q looks at what a policy did before and after imitating a demonstration and predicts the demonstration's
//! encoding; the better it can, the more the adapted behaviors differ by what was imitated.
//! Q is fitted to one set of (before, after) pairs of trajectories and pays log Q on another, held-out set.
//! What is paid becomes the advantages of the trajectories that are paid; stepping on them is the business of
//! [`crate::learning::trpo`], and adding that step to the adapted policy that of [`crate::stages::meta_train`].
//!
//! | paper | here |
//! |---|---|
//! | A.2: the encoding of v_i | [`encodings`] |
//! | Table 3: Q, a siamese LSTM | [`Posterior`] |
//! | Algorithm 1 line 11: update Q with τ, τ'_ij and encoded v_i | [`fit`] |
//! | line 13: R_MI with the newly sampled trajectories, as (5) | [`information_rewards`] |
//! | line 14, what TRPO needs for ∇L_MI | [`advantages`] |
//!
//! Where we differ: Eq. 5 has R_MI = −E[log Q] and Eq. 4 and the text maximize E[log Q], so the reward is +log Q.
//! Eq. 5 pays at t = 0 and would credit the first action alone; by default the whole trajectory is credited.
//! One update changes what a policy does by much less than the noise of its actions does, and from trajectories as they are
//! Q learned nothing.
//! So they are played with less noise ([`crate::stages::meta_train::MutualInformation`]), each that is paid is compared with the mean
//! of the other side, and Q sees both from the middle between them, in units of how far such trajectories lie apart at that reading.
//! Line 11 stands inside the loops over demonstrations; fitted to one of them after the other, Q would know the last
//! one best, so that it is fitted to all of a round at once.

mod posterior;
mod sequences;

use rand::RngExt;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::basics::seed::{Rng, Seed};
use crate::data::demonstration::DemonstrationSet;
use crate::math::nn::adam::Adam;
use crate::math::statistics::{self, mean_and_deviation};

pub use posterior::Posterior;
pub use sequences::Sequences;

use posterior::{Workspace, side_by_side, time_major};

/// Q's shape, and how it is fitted in a round.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PosteriorFitting {
    /// Width of the LSTM (Table 3: 128; Handstand and Martial Arts 256).
    pub lstm: usize,
    /// Width between the two fully connected layers; not in the paper.
    pub dense: usize,
    /// Observations of a trajectory that Q reads at most, evenly spread; not in the paper.
    pub readings: usize,
    /// Adam's step size; not in the paper.
    pub learning_rate: f64,
    /// Steps a round; not in the paper.
    pub steps: usize,
    /// Pairs that a step draws, from all demonstrations alike; not in the paper.
    pub batch: usize,
}

/// Which actions of a trajectory are credited with its R_MI.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Credit {
    /// All of them.
    Trajectory,
    /// The first one, as Eq. 5 reads.
    FirstAction,
}

/// Which trajectories of a pair are paid R_MI, and so which policy's gradient it is.
///
/// The paper has both: Eq. 7 takes the gradient on the old trajectories, line 14 of Algorithm 1 writes ∇L_MI(f_θ'_i).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Paid {
    /// Those before the update: ∇_θ E_τ~f_θ[log Q] (Eq. 7).
    Before,
    /// Those after the update: ∇_θ' E_τ'~f_θ'[log Q] (Algorithm 1, line 14 as written).
    After,
}

/// What was done before and after imitating one demonstration, and that demonstration's encoding.
///
/// Trajectories that stand at the same place are a pair; a side of one trajectory stands opposite all of the other side.
#[derive(Clone, Copy, Debug)]
pub struct Change<'a> {
    /// Trajectories of f_θ.
    pub before: &'a Sequences,
    /// Trajectories of f_θ'.
    pub after: &'a Sequences,
    /// The encoded v_i.
    pub encoding: f32,
}

/// The encoding of each demonstration (A.2), by its position in the file: the l2 norm of its observations over the whole episode, here with
/// mean 0 and standard deviation 1 over the set; all 0 if they do not differ.
pub fn encodings(set: &DemonstrationSet) -> Vec<f32> {
    let norm = |values: &[f32]| values.iter().map(|value| f64::from(*value).powi(2)).sum::<f64>().sqrt();
    let norms: Vec<f64> = set.iter().map(|(_, demo)| norm(demo.observations().flat())).collect();
    let (mean, std) = mean_and_deviation(norms.iter().copied());
    // What is left of equal norms is rounding.
    let scale = if std > 1e-9 * mean { 1.0 / std } else { 0.0 };
    set.by_position(0.0, norms.iter().map(|norm| (scale * (norm - mean)) as f32))
}

/// Line 11: a few steps up E[log Q] of random pairs with Adam, then the spread that their errors have.
pub fn fit(
    posterior: &Posterior,
    changes: &[Change<'_>],
    fitting: &PosteriorFitting,
    adam: &mut Adam,
    seed: Seed,
) -> Result<Posterior> {
    let mut fitted = posterior.clone().scaled_to(changes);
    let mut workspaces = Vec::new();
    let mut rng = seed.into_rng();
    for step in 0..fitting.steps {
        let pairs: Vec<Pair<'_>> = (0..fitting.batch)
            .map(|index| draw(&changes[(step * fitting.batch + index) % changes.len()], &mut rng))
            .collect();
        let gradient = gradient(&fitted, &pairs, &mut workspaces);
        if gradient.iter().any(|value| !value.is_finite()) {
            return Err(Error::diverged("the gradient of the posterior is not a finite number"));
        }
        // The gradient of −log Q is this one over 2σ², which Adam does not notice.
        adam.descend(fitting.learning_rate as f32, &gradient, fitted.parameters_mut());
    }
    let errors: Vec<f64> = changes
        .par_iter()
        .map(|Change { before, after, encoding }| mean_squared_error(&fitted, before, after, *encoding))
        .collect();
    Ok(fitted.with_squared_error(statistics::mean(&errors)))
}

/// Line 13, Eq. 5: R_MI = +log Q(v_i | Δπ) of each trajectory that is paid, `[before]` or `[after]`.
///
/// One per pair, `[pairs]`.
pub fn information_rewards(
    posterior: &Posterior,
    before: &Sequences,
    after: &Sequences,
    encoding: f32,
) -> Vec<f64> {
    let predicted = posterior.predict(before, after);
    predicted.iter().map(|mu| posterior.log_density(encoding, *mu)).collect()
}

/// E[(μ − c)²] over the pairs.
pub fn mean_squared_error(
    posterior: &Posterior,
    before: &Sequences,
    after: &Sequences,
    encoding: f32,
) -> f64 {
    let predicted = posterior.predict(before, after);
    statistics::mean_of(predicted.iter().map(|mu| f64::from(mu - encoding).powi(2)))
}

/// Advantages `[N]` of the actions in episodes of `lengths` (they sum to N) that were paid `rewards`, one each.
///
/// The baseline is the mean of the other episodes: a reward is paid to an episode as a whole, of which there are few, so
/// that a baseline of many features would recognize each episode and take all of its reward away.
/// They have standard deviation 1 over the episodes; all are 0 where the rewards say nothing.
pub fn advantages(rewards: &[f64], lengths: &[usize], credit: Credit) -> Vec<f32> {
    let (mean, std) = mean_and_deviation(rewards.iter().copied());
    let scale = if std > 1e-9 * (1.0 + mean.abs()) { 1.0 / std } else { 0.0 };
    let advantages = rewards.iter().zip(lengths).flat_map(|(reward, length)| {
        // Leaving the episode itself out of the mean multiplies all by one factor, which the scale takes away.
        let advantage = (scale * (reward - mean)) as f32;
        let credited = match credit {
            Credit::Trajectory => *length,
            Credit::FirstAction => 1,
        };
        (0..*length).map(move |step| if step < credited { advantage } else { 0.0 })
    });
    advantages.collect()
}

/// Two trajectories, before and after, `[readings, obs]` each, with the encoding of what was imitated in between.
struct Pair<'a> {
    before: &'a [f32],
    after: &'a [f32],
    encoding: f32,
}

fn draw<'a>(change: &Change<'a>, rng: &mut Rng) -> Pair<'a> {
    let Change { before, after, encoding } = *change;
    let (before, after) = posterior::pair(before, after, rng.random_range(0..before.len().max(after.len())));
    Pair { before, after, encoding }
}

/// Pairs that one worker takes at a time; fixed, so that the number of threads does not change a sum.
const CHUNK: usize = 16;

/// The gradient of the mean of (μ − c)² over the pairs, `[P]`.
fn gradient(posterior: &Posterior, pairs: &[Pair<'_>], workspaces: &mut Vec<Workspace<f32>>) -> Vec<f32> {
    let parameters = posterior.parameters();
    let (lstm, head) = posterior.networks();
    workspaces.resize_with(pairs.len().div_ceil(CHUNK), Workspace::default);
    let parts: Vec<Vec<f32>> = pairs
        .par_chunks(CHUNK)
        .zip(workspaces)
        .map(|(chunk, workspace)| {
            let seen: Vec<_> = chunk.iter().map(|pair| posterior.seen(pair.before, pair.after)).collect();
            time_major(&side_by_side(&seen), lstm.input_width(), &mut workspace.inputs);
            let encodings: Vec<f32> = chunk.iter().map(|pair| pair.encoding).collect();
            let mut gradient = vec![0.0; parameters.len()];
            let share = 1.0 / pairs.len() as f32;
            Posterior::squared_error_and_gradient(
                lstm,
                head,
                parameters,
                &encodings,
                workspace,
                share,
                &mut gradient,
            );
            gradient
        })
        .collect();
    let mut parts = parts.into_iter();
    let mut sum = parts.next().unwrap_or_default();
    for part in parts {
        sum.iter_mut().zip(&part).for_each(|(sum, value)| *sum += value);
    }
    sum
}

#[cfg(test)]
mod tests;
