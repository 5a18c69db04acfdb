//! Line 18 of Algorithm 1 by behavioral cloning: θ ← θ − β∇_θ Σ_i c_i·L_vi(f_θ'_i), Eq. 2 with the loss of §4.1.1.
//!
//! The loss after adaptation is on the demonstration that was adapted to, as Eq. 2 has it.
//! Its gradient is exact through all plain steps of the inner update ([`Order::Second`]), or taken at θ'_i and applied at
//! θ ([`Order::First`]); what mutual information added to θ'_i is held fixed.
//! Adam takes the step, to which the mean over i is what the sum is.

use rayon::prelude::*;

use super::{Learning, MetaState, Order, Outcome, total_weight};
use crate::basics::error::{Error, Result};
use crate::learning::behavioral_cloning::{Shown, descend, loss_and_gradient, pulled_back};
use crate::math::nn::mlp::Tape;
use crate::math::rows::Rows;
use crate::world::policy::Policy;

/// Line 18; gives numbers to report.
pub(super) fn meta_update(
    state: &mut MetaState,
    demonstrated: &[Rows],
    outcomes: &[Outcome],
    learning: &Learning<'_>,
) -> Result<Vec<(&'static str, f64)>> {
    let prior = &state.prior.policy;
    let parts: Vec<(f64, Vec<f32>)> = outcomes
        .par_iter()
        .map(|outcome| meta_gradient(prior, outcome, &demonstrated[outcome.target.demo.0], learning))
        .collect();
    let total = total_weight(outcomes);
    let (mut gradient, mut loss) = (vec![0.0; prior.network_parameters().len()], 0.0);
    for ((part_loss, part), outcome) in parts.iter().zip(outcomes) {
        let weight = outcome.weight / total;
        gradient.iter_mut().zip(part).for_each(|(sum, value)| *sum += weight as f32 * value);
        loss += weight * part_loss;
    }
    if gradient.iter().any(|value| !value.is_finite()) {
        return Err(Error::diverged("the meta-gradient of the cloned policy is not a finite number"));
    }
    let mut parameters = prior.network_parameters().to_vec();
    state.policy_adam.descend(learning.training.policy_learning_rate as f32, &gradient, &mut parameters);
    parameters.extend_from_slice(prior.log_std());
    state.prior.policy = Policy::from_parts(prior.network().clone(), parameters, prior.filter().clone());
    let norm = gradient.iter().map(|value| f64::from(*value).powi(2)).sum::<f64>().sqrt();
    Ok(vec![("meta_loss", loss), ("meta_gradient_norm", norm)])
}

/// L_vi(f_θ'_i) and its gradient with respect to the parameters of θ's mean, `[P]`.
fn meta_gradient(
    prior: &Policy,
    outcome: &Outcome,
    demonstrated: &Rows,
    learning: &Learning<'_>,
) -> (f64, Vec<f32>) {
    let (network, adapted) = (prior.network(), outcome.adapted.policy.network_parameters());
    let shown = Shown::new(&[demonstrated], network.input_width());
    let (loss, gradient) = loss_and_gradient(network, adapted, &shown, &mut Tape::default());
    match learning.training.order {
        Order::First => (loss, gradient),
        Order::Second => {
            let inner = learning.inner;
            let rate = inner.cloning.learning_rate * inner.alpha(0);
            let iterates = descend(network, prior.network_parameters(), &shown, rate, inner.cloning.steps);
            (loss, pulled_back(network, &iterates, &shown, rate, gradient))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{MetaTraining, Round};
    use super::*;
    use crate::basics::seed::Seed;
    use crate::data::demonstration::DemonstrationSet;
    use crate::data::weights::Weights;
    use crate::learning::adapt::{InnerUpdate, Rule, Target};
    use crate::learning::behavioral_cloning::Cloning;
    use crate::math::nn::check::derivative;
    use crate::run::preset::Preset;
    use crate::world::environment::EnvVariant;
    use crate::world::point_mass::{PointMass, planted_set};
    use crate::world::policy::PolicyShape;
    use crate::world::rollout::Playground;

    fn inner() -> InnerUpdate {
        let inner = Preset::Quick.config().inner;
        let cloning = Cloning { learning_rate: 0.2, steps: 3, ..inner.cloning };
        InnerUpdate { imitation: Rule::BehavioralCloning, cloning, ..inner }
    }

    fn doubles(values: &[f32]) -> Vec<f64> {
        values.iter().map(|value| f64::from(*value)).collect()
    }

    /// A state with a θ that is not at its start, and a round from it.
    fn scene(set: &DemonstrationSet) -> (MetaState, Vec<Rows>, Vec<Outcome>) {
        let (inner, seed, task) = (inner(), Seed::new(2), PointMass::new());
        let shape = PolicyShape { hidden: vec![6], initial_std: 0.5 };
        let mut state = MetaState::start(set, &shape, &[8], None, &Seed::new(1));
        let count = state.prior.policy.parameters().len();
        let shift: Vec<f32> =
            crate::math::nn::check::normal(count, "shift").iter().map(|value| 0.3 * *value as f32).collect();
        state.prior.policy = state.prior.policy.moved(&shift);
        let demonstrated = state.prior.demonstrated_pairs(set);
        let targets: Vec<_> =
            set.ids().into_iter().map(|demo| Target { demo, variant: EnvVariant(0) }).collect();
        let playground = &Playground::new(&task);
        let (prior, weights) = (&state.prior, &Weights::ones(set));
        let round = Round { prior, targets: &targets, weights, playground, inner: &inner, seed: &seed };
        let played = round.play(&demonstrated, None).expect("finite numbers");
        assert_eq!((played.environment_steps, playground.steps_taken()), (0, 0), "cloning plays nothing");
        assert_eq!(played.behavior_spread, None);
        (state, demonstrated, played.outcomes)
    }

    /// The mean loss after three plain steps, by finite differences in f64 at θ; Adam's first step goes against its sign.
    #[test]
    fn eq_2_the_meta_step_of_cloning_goes_down_the_loss_after_adaptation() {
        let set = planted_set(&[0.0, 120.0, 240.0], Seed::new(1)).expect("a valid set");
        let (state, demonstrated, outcomes) = scene(&set);
        let inner = inner();
        let network = state.prior.policy.network().clone();
        let shown: Vec<Shown<f64>> = demonstrated
            .iter()
            .map(|rows| Shown::new(&[rows], 4))
            .map(|shown| Shown {
                observations: doubles(&shown.observations),
                actions: doubles(&shown.actions),
            })
            .collect();
        let mut loss = |at: &[f64]| -> f64 {
            let after = |shown: &Shown<f64>| {
                let adapted = descend(&network, at, shown, 0.2, 3).pop().expect("the start");
                loss_and_gradient(&network, &adapted, shown, &mut Tape::default()).0
            };
            shown.iter().map(after).sum::<f64>() / shown.len() as f64
        };
        let before = doubles(state.prior.policy.network_parameters());
        let wrong_signs = |order: Order, loss: &mut dyn FnMut(&[f64]) -> f64| {
            let training = MetaTraining { order, ..Preset::Quick.config().meta_train };
            let mut state = state.clone();
            let learning = Learning { training: &training, inner: &inner, information: None };
            meta_update(&mut state, &demonstrated, &outcomes, &learning).expect("finite numbers");
            let (mut wrong, mut checked) = (0, 0);
            for (index, after) in state.prior.policy.network_parameters().iter().enumerate() {
                let mut direction = vec![0.0; before.len()];
                direction[index] = 1.0;
                let slope = derivative(&mut |at: &[f64]| loss(at), &before, &direction);
                if slope.abs() > 1e-3 {
                    checked += 1;
                    let moved = f64::from(*after) - before[index];
                    wrong += usize::from((moved + slope.signum() * 1e-3).abs() > 2e-5);
                }
            }
            assert!(checked > 30, "only {checked} slopes were large enough");
            wrong
        };
        assert_eq!(wrong_signs(Order::Second, &mut loss), 0);
        assert!(wrong_signs(Order::First, &mut loss) > 0, "first order goes elsewhere");
    }

    #[test]
    fn cloning_moves_neither_the_spread_of_actions_nor_the_discriminator() {
        let set = planted_set(&[0.0, 120.0], Seed::new(1)).expect("a valid set");
        let (mut state, demonstrated, outcomes) = scene(&set);
        let before = state.prior.clone();
        let training = Preset::Quick.config().meta_train;
        let learning = Learning { training: &training, inner: &inner(), information: None };
        meta_update(&mut state, &demonstrated, &outcomes, &learning).expect("finite numbers");
        assert_ne!(state.prior.policy.network_parameters(), before.policy.network_parameters());
        assert_eq!(state.prior.policy.log_std(), before.policy.log_std());
        assert_eq!(state.prior.discriminator, before.discriminator);
        assert!(outcomes.iter().all(|outcome| outcome.adapted.discriminator == before.discriminator));
    }
}
