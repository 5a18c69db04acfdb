//! Lines 18 and 19 of Algorithm 1 by GAIL: θ and D_meta move so that the adapted policies would have imitated better.
//!
//! | Algorithm 1 | here |
//! |---|---|
//! | 18: meta-update θ as (2) | [`meta_update_policy`] |
//! | 19: meta-update D_meta as (3) | [`meta_update_discriminator`] |

use rayon::prelude::*;

use super::{Learning, MetaState, Outcome, PlayedRound, cloning, total_weight};
use crate::basics::error::{Error, Result};
use crate::learning::adapt::Rule;
use crate::learning::gail;
use crate::learning::trpo::{self, Step};
use crate::math::rows::Rows;
use crate::world::policy::Policy;

/// Lines 18 and 19; gives numbers to report.
pub(super) fn meta_update(
    state: &mut MetaState,
    demonstrated: &[Rows],
    played: &PlayedRound,
    learning: &Learning<'_>,
) -> Result<Vec<(&'static str, f64)>> {
    match learning.inner.imitation {
        Rule::Gail => {
            let step = meta_update_policy(&mut state.prior.policy, played, learning)?;
            meta_update_discriminator(state, demonstrated, &played.outcomes, learning)?;
            Ok(vec![("meta_kl", step.kl), ("meta_improvement", step.improvement)])
        }
        Rule::BehavioralCloning => cloning::meta_update(state, demonstrated, &played.outcomes, learning),
    }
}

/// Line 18, Eq. 2: θ moves so that all adapted θ'_i imitate better, each by its weight c_i (§4.4); they move together with
/// it, as in a gradient of first order.
///
/// The weights share out the trust region too, so that what counts for nothing does not hold θ back.
pub(super) fn meta_update_policy(
    policy: &mut Policy,
    PlayedRound { outcomes, .. }: &PlayedRound,
    learning: &Learning<'_>,
) -> Result<Step> {
    let Learning { training, inner, .. } = *learning;
    let advantages: Vec<Vec<f32>> = outcomes
        .par_iter()
        .map(|outcome| {
            let rewards = gail::imitation_rewards(&outcome.adapted.discriminator, &outcome.after.pairs);
            outcome.after.advantages(&rewards, &inner.advantage)
        })
        .collect::<Result<_>>()?;
    let total = total_weight(outcomes);
    let experiences = outcomes.iter().zip(&advantages).map(|(outcome, advantages)| {
        outcome.after.experiences(&outcome.adapted.policy, advantages, outcome.weight / total)
    });
    let step = trpo::step(&experiences.flatten().collect::<Vec<_>>(), &training.trust_region, 1.0)?;
    *policy = policy.moved(&step.displacement);
    Ok(step)
}

/// Line 19, Eq. 3: D_meta ← D_meta − β Σ_i c_i·(Ê_τi[∇ −log D'_i] + Ê_vi[∇ −log(1 − D'_i)]).
///
/// Adam takes the step, to which the mean over i is what the sum is.
pub(super) fn meta_update_discriminator(
    state: &mut MetaState,
    demonstrated: &[Rows],
    outcomes: &[Outcome],
    learning: &Learning<'_>,
) -> Result<()> {
    let Learning { training, inner, .. } = *learning;
    let entropy = inner.discriminator.entropy;
    let gradients: Vec<Vec<f32>> = outcomes
        .par_iter()
        .map(|Outcome { target, adapted, after, .. }| {
            let demonstrated = &[&demonstrated[target.demo.0]];
            gail::loss_and_gradient(&adapted.discriminator, &[&after.pairs], demonstrated, entropy).1
        })
        .collect();
    let mut gradient = vec![0.0; state.prior.discriminator.parameters().len()];
    let total = total_weight(outcomes) as f32;
    let noise =
        outcomes.iter().map(|of| of.weight as f32 * of.adapted.discriminator.noise()).sum::<f32>() / total;
    for (part, outcome) in gradients.iter().zip(outcomes) {
        let weight = outcome.weight as f32;
        gradient.iter_mut().zip(part).for_each(|(sum, value)| *sum += value * weight / total);
    }
    if gradient.iter().any(|value| !value.is_finite()) {
        return Err(Error::diverged("the gradient of the meta-discriminator is not a finite number"));
    }
    let mut parameters = state.prior.discriminator.parameters().to_vec();
    state.discriminator_adam.descend(training.discriminator_learning_rate as f32, &gradient, &mut parameters);
    state.prior.discriminator = state.prior.discriminator.with_parameters(parameters).with_noise(noise);
    Ok(())
}
