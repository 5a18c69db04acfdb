//! How much better than expected each action was: a value baseline and generalized advantage estimation.
//!
//! The baseline is the linear one of the MAML experiments (Duan et al. 2016; Finn et al. 2017a): it is refitted in closed form
//! for every demonstration and every step, so it can neither lag behind a fast adaptation nor leak from one
//! demonstration into another.

use serde::{Deserialize, Serialize};

use crate::basics::error::Result;
use crate::math::rows::Rows;
use crate::math::solve::ridge;
use crate::math::statistics;

/// How rewards become advantages.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdvantageEstimation {
    /// γ, the discount (§3); the value is not in the paper, 0.995 is that of GAIL's authors.
    pub discount: f64,
    /// λ of generalized advantage estimation (Schulman et al. 2016); not in the paper, 0.97 is that of GAIL's authors.
    pub lambda: f64,
}

impl Default for AdvantageEstimation {
    fn default() -> Self {
        Self { discount: 0.995, lambda: 0.97 }
    }
}

/// Ridge of the baseline's least squares (rllab's: 1e-5), per sample.
const RIDGE: f64 = 1e-5;

/// Episodes, one after the other, as the estimator sees them.
#[derive(Clone, Copy, Debug)]
pub struct Rewarded<'a> {
    /// Filtered observations on which the actions were taken, `[N, obs]`.
    pub observations: &'a Rows,
    /// Rewards of the actions, `[N]`.
    pub rewards: &'a [f32],
    /// Steps of each episode; they sum to N.
    pub lengths: &'a [usize],
}

impl Rewarded<'_> {
    fn episodes(&self) -> impl Iterator<Item = std::ops::Range<usize>> {
        self.lengths.iter().scan(0, |start, length| {
            *start += length;
            Some(*start - length..*start)
        })
    }
}

/// Advantages `[N]`, with mean 0 and standard deviation 1 over the batch; all 0 where the rewards say nothing.
///
/// Episodes are finite-horizon (§3): nothing is expected after their last step, and the baseline knows the time.
pub fn advantages(rewarded: Rewarded<'_>, estimation: &AdvantageEstimation) -> Result<Vec<f32>> {
    let size = rewarded.rewards.iter().fold(0.0, |size: f32, reward| size.max(reward.abs()));
    let rewards = beyond_the_mean(&rewarded, estimation.discount);
    let features = features(&rewarded);
    let returns: Vec<f32> = rewarded
        .episodes()
        .flat_map(|episode| discounted_sums(&rewards[episode], estimation.discount))
        .collect();
    let weights = ridge(&features, &returns, RIDGE * returns.len() as f64)?;
    let values = predict(&features, &weights);
    let mut advantages: Vec<f32> = rewarded
        .episodes()
        .flat_map(|episode| generalized_advantages(&rewards[episode.clone()], &values[episode], estimation))
        .collect();
    standardize(&mut advantages, f64::from(size));
    Ok(advantages)
}

/// rₜ − r̄: what a step pays beyond the mean of the batch.
///
/// The baseline's cubic in time cannot follow the discounted sum of a constant, and what it leaves would pass for an
/// advantage wherever rewards are nearly flat.
/// An episode that ends before the longest forgoes γ r̄ + γ² r̄ + … of the steps that it lacks, as without this shift.
fn beyond_the_mean(rewarded: &Rewarded<'_>, discount: f64) -> Vec<f32> {
    let mean = statistics::mean_of(rewarded.rewards.iter().map(|reward| f64::from(*reward)));
    let longest = rewarded.lengths.iter().copied().max().unwrap_or(0);
    let mut rewards: Vec<f32> =
        rewarded.rewards.iter().map(|reward| (f64::from(*reward) - mean) as f32).collect();
    for episode in rewarded.episodes().filter(|episode| !episode.is_empty()) {
        let forgone = (episode.len()..longest).fold(0.0, |later, _| discount * (mean + later));
        rewards[episode.end - 1] -= forgone as f32;
    }
    rewards
}

/// Rₜ = rₜ + γ Rₜ₊₁
fn discounted_sums(rewards: &[f32], discount: f64) -> Vec<f32> {
    let mut sums = vec![0.0; rewards.len()];
    let mut later = 0.0;
    for (sum, reward) in sums.iter_mut().zip(rewards).rev() {
        later = f64::from(*reward) + discount * later;
        *sum = later as f32;
    }
    sums
}

/// δₜ = rₜ + γ V(sₜ₊₁) − V(sₜ),  Âₜ = δₜ + γ λ Âₜ₊₁
fn generalized_advantages(rewards: &[f32], values: &[f64], estimation: &AdvantageEstimation) -> Vec<f32> {
    let mut advantages = vec![0.0; rewards.len()];
    let (mut next_value, mut later) = (0.0, 0.0);
    for step in (0..rewards.len()).rev() {
        let surprise = f64::from(rewards[step]) + estimation.discount * next_value - values[step];
        later = surprise + estimation.discount * estimation.lambda * later;
        next_value = values[step];
        advantages[step] = later as f32;
    }
    advantages
}

/// φ(o, t) = [o, o², t, t², t³, 1], the time in units of the longest episode.
fn features(rewarded: &Rewarded<'_>) -> Rows {
    let size = rewarded.observations.width();
    let longest = rewarded.lengths.iter().copied().max().unwrap_or(1) as f32;
    let mut features = Rows::with_capacity(2 * size + 4, rewarded.rewards.len());
    let mut row = vec![0.0; 2 * size + 4];
    for episode in rewarded.episodes() {
        for (step, index) in episode.enumerate() {
            let time = step as f32 / longest;
            for (column, value) in rewarded.observations.row(index).iter().enumerate() {
                row[column] = *value;
                row[size + column] = value * value;
            }
            row[2 * size..].copy_from_slice(&[time, time * time, time * time * time, 1.0]);
            features.push(&row);
        }
    }
    features
}

fn predict(features: &Rows, weights: &[f64]) -> Vec<f64> {
    let value =
        |row: &[f32]| row.iter().zip(weights).map(|(feature, weight)| f64::from(*feature) * weight).sum();
    features.iter().map(value).collect()
}

/// Spreads below this share of the largest reward are rounding, not advantages.
const SMALLEST_SPREAD: f64 = 1e-6;

/// A batch without spread, as when a discriminator's reward is flat, becomes zero instead of amplified noise: the
/// length of a natural gradient's step does not depend on that of the gradient.
fn standardize(advantages: &mut [f32], reward_size: f64) {
    let (mean, deviation) = statistics::mean_and_deviation(advantages.iter().map(|value| f64::from(*value)));
    if deviation <= SMALLEST_SPREAD * reward_size {
        advantages.fill(0.0);
        return;
    }
    let scale = 1.0 / deviation;
    for value in advantages {
        *value = ((f64::from(*value) - mean) * scale) as f32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HALF: AdvantageEstimation = AdvantageEstimation { discount: 0.5, lambda: 0.5 };

    #[test]
    fn discounted_sums_by_hand() {
        assert_eq!(discounted_sums(&[1.0, 2.0, 4.0], 0.5), [3.0, 4.0, 4.0]);
    }

    #[test]
    fn generalized_advantages_equal_the_sum_of_discounted_surprises() {
        let (rewards, values) = ([1.0, -2.0, 0.5, 3.0], [0.3, 0.1, -0.7, 2.0]);
        let surprise =
            |t: usize| f64::from(rewards[t]) + 0.5 * values.get(t + 1).copied().unwrap_or(0.0) - values[t];
        let found = generalized_advantages(&rewards, &values, &HALF);
        for (step, found) in found.iter().enumerate() {
            let brute: f64 =
                (step..4).map(|later| 0.25f64.powi((later - step) as i32) * surprise(later)).sum();
            assert!((brute - f64::from(*found)).abs() < 1e-6);
        }
    }

    #[test]
    fn a_baseline_that_explains_the_returns_leaves_only_what_it_cannot_know() {
        // The reward depends on the observation, which the baseline sees, and in one step on luck, which it does not.
        let mut observations = Rows::with_capacity(1, 50);
        let mut rewards = Vec::new();
        for step in 0..50 {
            observations.push(&[(step as f32 * 0.7).sin()]);
            rewards.push((step as f32 * 0.7).sin() + if step == 20 { 5.0 } else { 0.0 });
        }
        let estimation = AdvantageEstimation { discount: 0.0, lambda: 0.0 };
        let found = advantages(
            Rewarded { observations: &observations, rewards: &rewards, lengths: &[50] },
            &estimation,
        )
        .expect("finite numbers");
        let best = (0..50).max_by(|a, b| found[*a].total_cmp(&found[*b]));
        assert_eq!(best, Some(20));
        assert!(found.iter().sum::<f32>().abs() < 1e-3);
    }

    fn noise(steps: usize) -> Rows {
        let mut rng = crate::basics::seed::Seed::new(3).into_rng();
        let mut rows = Rows::with_capacity(3, steps);
        for _ in 0..steps {
            let mut row = [0.0; 3];
            crate::math::nn::gaussian::sample(&[0.0; 3], &[0.0; 3], &mut rng, &mut row);
            rows.push(&row);
        }
        rows
    }

    #[test]
    fn a_reward_that_is_the_same_for_everything_teaches_nothing() {
        let (observations, rewards) = (noise(400), [2.0f32.ln(); 400]);
        let rewarded = Rewarded { observations: &observations, rewards: &rewards, lengths: &[100; 4] };
        let found = advantages(rewarded, &AdvantageEstimation::default()).expect("finite numbers");
        assert!(found.iter().all(|advantage| *advantage == 0.0), "{:?}", &found[..5]);
    }

    #[test]
    fn a_constant_on_top_of_the_rewards_of_equal_episodes_changes_nothing() {
        let observations = noise(400);
        let found = |constant: f32| {
            let rewards: Vec<f32> = observations.iter().map(|row| row[0] * row[1] + constant).collect();
            let rewarded = Rewarded { observations: &observations, rewards: &rewards, lengths: &[100; 4] };
            advantages(rewarded, &AdvantageEstimation::default()).expect("finite numbers")
        };
        for (without, with) in found(0.0).iter().zip(found(5.0)) {
            assert!((without - with).abs() < 1e-3, "{without} and {with}");
        }
    }

    #[test]
    fn ending_early_costs_the_rewards_of_the_steps_that_lack() {
        let (observations, rewards) = (noise(350), [1.0; 350]);
        let rewarded =
            Rewarded { observations: &observations, rewards: &rewards, lengths: &[100, 100, 50, 100] };
        let found = advantages(rewarded, &AdvantageEstimation::default()).expect("finite numbers");
        let worst = (0..350).min_by(|a, b| found[*a].total_cmp(&found[*b]));
        assert_eq!(worst, Some(249), "the last step of the short episode");
    }
}
