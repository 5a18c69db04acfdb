//! Behavioral cloning (§4.1.1): supervised learning of the demonstrated actions.
//!
//! The policy's mean action is moved toward what was demonstrated, by plain gradient or by Adam.
//! Learning plays nothing, so it needs no environment steps; only being scored does.
//!
//! | paper | here |
//! |---|---|
//! | §4.1.1: L_v = 1/T Σ_t ‖f_θ(s_t) − â_t‖ | [`loss_and_gradient`] |
//! | Eq. 1: θ' = θ − α∇L_v(f_θ) | [`descend`], and [`clone`] for a whole policy |
//! | Eq. 2: ∇_θ L_v(f_θ'), through Eq. 1 | [`pulled_back`] |
//!
//! What the paper leaves open: it writes ‖·‖₂ and says mean squared error, and we take the latter, so that the norm is
//! squared, summed over the action's dimensions and averaged over time.
//! f_θ is the mean of π_θ.
//! The logarithms of the standard deviations are not in this loss; they stay where they are, the same for every
//! demonstration, and nothing but a policy gradient (that of mutual information) moves them.
//! Demonstrated actions are clipped to [−1, 1], as the environment does with them.

use rand::seq::SliceRandom;
use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::basics::seed::Seed;
use crate::math::nn::Real;
use crate::math::nn::adam::Adam;
use crate::math::nn::mlp::{Mlp, Tape};
use crate::math::rows::Rows;
use crate::world::policy::Policy;

/// How a policy is cloned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cloning {
    /// How each step is taken.
    pub descent: Descent,
    /// Size of a step where α is 1. The paper's α = 1.0 was set for TRPO (A.2.1); as the size of a plain step it diverges.
    pub learning_rate: f64,
    /// Steps an update (Eq. 1: one).
    pub steps: usize,
    /// Pairs that a step of Adam draws, or all if there are fewer; a plain step takes all; not in the paper.
    pub batch: usize,
    /// Episodes played before each update, so that the adaptation has a curve of scores; 0 plays none. Not in the paper.
    pub curve_episodes: usize,
}

/// How a step of cloning is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Descent {
    /// −α∇L over all pairs (Eq. 1): what adapts, since the exact meta-gradient goes through it.
    Gradient,
    /// Adam on batches of shuffled pairs: what learns from scratch, where nothing is differentiated through.
    Adam,
}

/// What an update did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cloned {
    /// L_v before the update.
    pub loss_before: f64,
    /// L_v after it.
    pub loss_after: f64,
}

/// Demonstrated pairs side by side: filtered observations `[T, obs]` and actions `[T, act]`, flat.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown<T> {
    /// Filtered observations, `[T, obs]`.
    pub observations: Vec<T>,
    /// Actions clipped to [−1, 1], `[T, act]`.
    pub actions: Vec<T>,
}

impl Shown<f32> {
    /// Splits tables of pairs `[len, obs + act]`, of which all pairs count alike.
    pub fn new(demonstrated: &[&Rows], observation_size: usize) -> Self {
        let (mut observations, mut actions) = (Vec::new(), Vec::new());
        for pair in demonstrated.iter().flat_map(|rows| rows.iter()) {
            let (observation, action) = pair.split_at(observation_size);
            observations.extend_from_slice(observation);
            actions.extend_from_slice(action);
        }
        Self { observations, actions }
    }

    /// Takes the pairs of these numbers from `all` in place of what was here.
    fn choose(&mut self, all: &Self, rows: &[usize], network: &Mlp) {
        let pick = |into: &mut Vec<f32>, from: &[f32], width: usize| {
            into.clear();
            rows.iter().for_each(|row| into.extend_from_slice(&from[row * width..(row + 1) * width]));
        };
        pick(&mut self.observations, &all.observations, network.input_width());
        pick(&mut self.actions, &all.actions, network.output_width());
    }
}

/// One update of a policy toward demonstrated pairs `[len, obs + act]`: θ, v → θ' (Eq. 1).
///
/// `adam` has as many moments as the mean's network has parameters; a plain gradient leaves it alone.
pub fn clone(
    policy: &Policy,
    demonstrated: &[&Rows],
    cloning: &Cloning,
    alpha: f64,
    adam: &mut Adam,
    seed: Seed,
) -> Result<(Policy, Cloned)> {
    let (network, start) = (policy.network(), policy.network_parameters());
    let shown = Shown::new(demonstrated, network.input_width());
    let rate = cloning.learning_rate * alpha;
    let parameters = match cloning.descent {
        Descent::Gradient => descend(network, start, &shown, rate, cloning.steps).pop(),
        Descent::Adam => Some(descend_with_adam(network, start, &shown, cloning, rate, adam, seed)),
    };
    let parameters = parameters.unwrap_or_else(|| start.to_vec());
    let loss =
        |at: &[f32]| loss_of(&errors(network, at, &shown, &mut Tape::default()), steps(network, &shown));
    let cloned = Cloned { loss_before: loss(start), loss_after: loss(&parameters) };
    if !(cloned.loss_before.is_finite() && cloned.loss_after.is_finite()) {
        return Err(Error::diverged(format!(
            "the cloning loss went from {} to {}",
            cloned.loss_before, cloned.loss_after
        ))
        .with_hint("try a smaller inner.cloning.learning_rate, or imitate.update.cloning.learning_rate"));
    }
    let whole = parameters.into_iter().chain(policy.log_std().iter().copied()).collect();
    Ok((Policy::from_parts(network.clone(), whole, policy.filter().clone()), cloned))
}

/// L_v(θ) = 1/T Σ_t ‖μ_θ(s_t) − a_t‖², and ∇L_v(θ), `[P]`.
pub fn loss_and_gradient<T: Real>(
    network: &Mlp,
    parameters: &[T],
    shown: &Shown<T>,
    tape: &mut Tape<T>,
) -> (f64, Vec<T>) {
    let mut gradient = vec![T::ZERO; parameters.len()];
    let errors = errors(network, parameters, shown, tape);
    let loss = loss_of(&errors, steps(network, shown));
    add_gradient(network, parameters, shown, tape, errors, &mut gradient);
    (loss, gradient)
}

/// 1/T Σ of the squared errors `[T, act]`.
fn loss_of<T: Real>(errors: &[T], steps: f64) -> f64 {
    errors.iter().map(|error| error.to_f64().powi(2)).sum::<f64>() / steps
}

/// Adds ∇L_v(θ) from the errors `[T, act]` at θ, whose forward pass the tape holds.
fn add_gradient<T: Real>(
    network: &Mlp,
    parameters: &[T],
    shown: &Shown<T>,
    tape: &mut Tape<T>,
    mut errors: Vec<T>,
    gradient: &mut [T],
) {
    let scale = T::from_f64(2.0 / steps(network, shown));
    errors.iter_mut().for_each(|error| *error = scale * *error);
    network.vjp(parameters, &shown.observations, tape, &errors, gradient);
}

/// ∇²L_v(θ) · v, `[P]`.
fn hessian_product<T: Real>(
    network: &Mlp,
    [parameters, direction]: [&[T]; 2],
    shown: &Shown<T>,
    tape: &mut Tape<T>,
) -> Vec<T> {
    let scale = T::from_f64(2.0 / steps(network, shown));
    let mut cotangents = errors(network, parameters, shown, tape);
    cotangents.iter_mut().for_each(|value| *value *= scale);
    let mut tangents = network.jvp(parameters, &shown.observations, tape, direction).to_vec();
    tangents.iter_mut().for_each(|value| *value *= scale);
    let mut product = vec![T::ZERO; parameters.len()];
    let network_at = [parameters, direction];
    network.vjp_tangents(network_at, &shown.observations, tape, [&cotangents, &tangents], &mut product);
    product
}

/// θ_k+1 = θ_k − α∇L_v(θ_k): all iterates, the start first and θ' last.
pub fn descend<T: Real>(
    network: &Mlp,
    start: &[T],
    shown: &Shown<T>,
    rate: f64,
    steps: usize,
) -> Vec<Vec<T>> {
    let (mut iterates, mut tape) = (vec![start.to_vec()], Tape::default());
    for step in 0..steps {
        let gradient = loss_and_gradient(network, &iterates[step], shown, &mut tape).1;
        iterates.push(along(&iterates[step], -rate, &gradient));
    }
    iterates
}

/// (dθ'/dθ)ᵀ g = Π_k (I − α∇²L_v(θ_k)) g over the iterates of [`descend`]: the gradient at θ of what has the gradient g
/// at θ', exactly.
pub fn pulled_back<T: Real>(
    network: &Mlp,
    iterates: &[Vec<T>],
    shown: &Shown<T>,
    rate: f64,
    gradient: Vec<T>,
) -> Vec<T> {
    let mut tape = Tape::default();
    let before_the_last = iterates.iter().rev().skip(1);
    before_the_last.fold(gradient, |gradient, iterate| {
        let product = hessian_product(network, [iterate, &gradient], shown, &mut tape);
        along(&gradient, -rate, &product)
    })
}

/// Steps of Adam over shuffled epochs: each pair comes once before one comes again.
fn descend_with_adam(
    network: &Mlp,
    start: &[f32],
    shown: &Shown<f32>,
    cloning: &Cloning,
    rate: f64,
    adam: &mut Adam,
    seed: Seed,
) -> Vec<f32> {
    let mut order: Vec<usize> = (0..shown.actions.len() / network.output_width()).collect();
    let (mut parameters, mut tape, mut rng) = (start.to_vec(), Tape::default(), seed.into_rng());
    let mut batch = Shown { observations: Vec::new(), actions: Vec::new() };
    let mut gradient = vec![0.0; start.len()];
    let mut next = order.len();
    for _ in 0..cloning.steps {
        if next >= order.len() {
            order.shuffle(&mut rng);
            next = 0;
        }
        let end = order.len().min(next + cloning.batch);
        batch.choose(shown, &order[next..end], network);
        let errors = errors(network, &parameters, &batch, &mut tape);
        gradient.fill(0.0);
        add_gradient(network, &parameters, &batch, &mut tape, errors, &mut gradient);
        adam.descend(rate as f32, &gradient, &mut parameters);
        next = end;
    }
    parameters
}

/// μ_θ(s_t) − a_t, `[T, act]`; the tape then holds the forward pass.
fn errors<T: Real>(network: &Mlp, parameters: &[T], shown: &Shown<T>, tape: &mut Tape<T>) -> Vec<T> {
    let means = network.forward(parameters, &shown.observations, tape);
    means.iter().zip(&shown.actions).map(|(mean, action)| *mean - *action).collect()
}

/// T
fn steps<T>(network: &Mlp, shown: &Shown<T>) -> f64 {
    (shown.actions.len() / network.output_width()).max(1) as f64
}

/// start + scale · direction
fn along<T: Real>(start: &[T], scale: f64, direction: &[T]) -> Vec<T> {
    let scale = T::from_f64(scale);
    start.iter().zip(direction).map(|(start, by)| *start + scale * *by).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::observation_filter::ObservationFilter;
    use crate::math::nn::check::{gradient_error, normal};
    use crate::world::policy::PolicyShape;

    const RATE: f64 = 0.05;

    fn shown(name: &str) -> Shown<f64> {
        let of = |count: usize, what: &str| normal(count, &format!("{name} {what}"));
        Shown { observations: of(20 * 3, "observations"), actions: of(20 * 2, "actions") }
    }

    fn network() -> (Mlp, Vec<f64>) {
        let network = Mlp::new(&[3, 5, 4, 2]);
        let start = network.initial_parameters(1.0, Seed::new(1)).into_iter().map(f64::from);
        let shift = normal(network.parameter_count(), "shift");
        let parameters = start.zip(shift).map(|(p, n)| p + 0.2 * n).collect();
        (network, parameters)
    }

    #[test]
    fn cloning_loss_is_the_squared_error_summed_over_actions_and_averaged_over_time() {
        let ((network, parameters), shown) = (network(), shown("loss"));
        let loss = |at: &[f64]| {
            let mut tape = Tape::default();
            let means = network.forward(at, &shown.observations, &mut tape).chunks(2);
            let norm = |(mean, action): (&[f64], &[f64])| (mean[0] - action[0]).hypot(mean[1] - action[1]);
            means.zip(shown.actions.chunks(2)).map(|pair| norm(pair).powi(2)).sum::<f64>() / 20.0
        };
        let (found, gradient) = loss_and_gradient(&network, &parameters, &shown, &mut Tape::default());
        assert!((found - loss(&parameters)).abs() < 1e-12);
        assert!(gradient_error(loss, &parameters, &gradient) < 1e-9);
    }

    #[test]
    fn eq_1_a_plain_step_of_cloning_goes_down_the_gradient() {
        let ((network, parameters), shown) = (network(), shown("step"));
        let iterates = descend(&network, &parameters, &shown, RATE, 3);
        assert_eq!((iterates.len(), &iterates[0]), (4, &parameters));
        for pair in iterates.windows(2) {
            let (before, gradient) = loss_and_gradient(&network, &pair[0], &shown, &mut Tape::default());
            let after = loss_and_gradient(&network, &pair[1], &shown, &mut Tape::default()).0;
            assert!(after < before);
            for ((there, here), slope) in pair[1].iter().zip(&pair[0]).zip(gradient) {
                assert!((there - here + RATE * slope).abs() < 1e-15);
            }
        }
    }

    /// ∇_θ L(θ'(θ)) by finite differences of the loss after one and after four steps, also on other pairs than were
    /// learned from.
    #[test]
    fn eq_2_the_exact_gradient_of_cloning_goes_through_every_plain_step() {
        let ((network, parameters), learned) = (network(), shown("learned"));
        for (steps, judged) in [(1, learned.clone()), (4, learned.clone()), (4, shown("judged"))] {
            let loss = |at: &[f64]| {
                let adapted = descend(&network, at, &learned, RATE, steps).pop().expect("the start");
                loss_and_gradient(&network, &adapted, &judged, &mut Tape::default()).0
            };
            let iterates = descend(&network, &parameters, &learned, RATE, steps);
            let adapted = iterates.last().expect("the start");
            let first = loss_and_gradient(&network, adapted, &judged, &mut Tape::default()).1;
            let exact = pulled_back(&network, &iterates, &learned, RATE, first.clone());
            let error = gradient_error(loss, &parameters, &exact);
            assert!(error < 1e-9, "{steps} steps: error {error:e}");
            assert!(gradient_error(loss, &parameters, &first) > 1e-3, "first order is another gradient");
        }
    }

    /// The demonstrator acts by a linear rule; a policy without hidden layers finds it, by either descent.
    #[test]
    fn cloning_recovers_a_known_linear_policy() {
        let wanted = [[0.3, -0.2], [0.1, 0.4], [-0.25, 0.05]];
        let (observations, mut pairs) = (normal(300 * 3, "states"), Rows::with_capacity(5, 300));
        for state in observations.chunks(3) {
            let action = |d: usize| 0.1 + state.iter().zip(&wanted).map(|(s, w)| s * w[d]).sum::<f64>();
            let row = [state[0], state[1], state[2], action(0), action(1)];
            pairs.push(&row.map(|value| value as f32));
        }
        for (descent, learning_rate) in [(Descent::Gradient, 0.2), (Descent::Adam, 0.01)] {
            let shape = PolicyShape { hidden: vec![], initial_std: 0.5 };
            let filter = ObservationFilter::identity(3);
            let start = Policy::untrained(&shape, filter, 2, Seed::new(1));
            let mut adam = Adam::new(start.network_parameters().len());
            let cloning = Cloning { descent, learning_rate, steps: 400, batch: 50, curve_episodes: 0 };
            let (policy, cloned) =
                clone(&start, &[&pairs], &cloning, 1.0, &mut adam, Seed::new(2)).expect("finite numbers");
            assert!(cloned.loss_before > 0.1 && cloned.loss_after < 1e-6, "{descent:?}: {cloned:?}");
            for (found, wanted) in policy.network_parameters().iter().zip(wanted.concat()) {
                assert!((f64::from(*found) - wanted).abs() < 2e-3, "{descent:?}: {found}, wanted {wanted}");
            }
            assert_eq!(policy.log_std(), start.log_std(), "the squared error says nothing of the spread");
        }
    }

    #[test]
    fn pairs_of_several_demonstrations_are_split_and_chosen_by_number() {
        let shown = Shown { observations: (0..7).map(|i| i as f32).collect(), actions: vec![0.0; 7] };
        let mut chosen = Shown { observations: vec![9.0], actions: vec![9.0] };
        chosen.choose(&shown, &[6, 2], &Mlp::new(&[1, 1, 1, 1]));
        assert_eq!((chosen.observations, chosen.actions), (vec![6.0, 2.0], vec![0.0; 2]));
        let halves: Vec<Rows> = [&[0.0, 1.0, 2.0, 3.0][..], &[4.0, 5.0]]
            .into_iter()
            .map(|flat| Rows::from_flat(flat.to_vec(), 2).expect("whole rows"))
            .collect();
        let split = Shown::new(&halves.iter().collect::<Vec<_>>(), 1);
        assert_eq!(split, Shown { observations: vec![0.0, 2.0, 4.0], actions: vec![1.0, 3.0, 5.0] });
    }

    #[test]
    fn too_large_a_step_is_divergence() {
        let mut pairs = Rows::with_capacity(2, 1);
        pairs.push(&[100.0, 1.0]);
        let shape = PolicyShape { hidden: vec![], initial_std: 0.5 };
        let start = Policy::untrained(&shape, ObservationFilter::identity(1), 1, Seed::new(1));
        let cloning = Cloning {
            descent: Descent::Gradient,
            learning_rate: 1.0,
            steps: 50,
            batch: 1,
            curve_episodes: 0,
        };
        let error = clone(&start, &[&pairs], &cloning, 1.0, &mut Adam::new(2), Seed::new(1))
            .expect_err("a step of 2·100² times the error");
        assert!(error.is_diverged(), "{error}");
    }
}
