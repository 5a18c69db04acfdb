use super::*;
use crate::basics::seed::Seed;
use crate::math::nn::check::{dot, gradient_error, normal};

const OBSERVATIONS: usize = 3;
const ACTIONS: usize = 2;
const ROWS: usize = 40;
const DAMPING: f64 = 0.1;
const SIZE: f64 = 0.7;

/// A small policy far from its start, what it saw and did, and what that was worth.
struct Scene {
    network: Mlp,
    parameters: Vec<f64>,
    observations: Vec<f64>,
    actions: Vec<f64>,
    row_weights: Vec<f64>,
}

impl Scene {
    fn new(name: &str) -> Self {
        let network = Mlp::new(&[OBSERVATIONS, 5, 4, ACTIONS]);
        let of = |count: usize, what: &str| normal(count, &format!("{name} {what}"));
        let start = network.initial_parameters(1.0, Seed::new(1)).into_iter().map(f64::from);
        let mut parameters: Vec<f64> =
            start.zip(of(network.parameter_count(), "parameters")).map(|(p, n)| p + 0.2 * n).collect();
        parameters.extend([-0.3, 0.2]);
        Self {
            network,
            parameters,
            observations: of(ROWS * OBSERVATIONS, "observations"),
            actions: of(ROWS * ACTIONS, "actions"),
            row_weights: of(ROWS, "advantages").iter().map(|value| value / ROWS as f64).collect(),
        }
    }

    /// log π of each action, from the definition.
    fn log_probabilities(&self, parameters: &[f64]) -> Vec<f64> {
        let (network, log_std) = parameters.split_at(self.network.parameter_count());
        let mut tape = Tape::default();
        let means = self.network.forward(network, &self.observations, &mut tape);
        let rows = means.chunks_exact(ACTIONS).zip(self.actions.chunks_exact(ACTIONS));
        let term = |((mean, action), s): ((&f64, &f64), &f64)| -((action - mean) / s.exp()).powi(2) / 2.0 - s;
        rows.map(|(mean, action)| mean.iter().zip(action).zip(log_std).map(term).sum()).collect()
    }

    /// Σ_b w_b π(a_b)/π₀(a_b), π₀ being the policy of the scene.
    fn surrogate(&self, parameters: &[f64]) -> f64 {
        let (new, old) = (self.log_probabilities(parameters), self.log_probabilities(&self.parameters));
        new.iter().zip(old).zip(&self.row_weights).map(|((new, old), w)| w * (new - old).exp()).sum()
    }

    /// g, the gradient of the surrogate.
    fn gradient(&self, parameters: &[f64]) -> Vec<f64> {
        let (new, old) = (self.log_probabilities(parameters), self.log_probabilities(&self.parameters));
        let weights: Vec<f64> =
            new.iter().zip(old).zip(&self.row_weights).map(|((new, old), w)| w * (new - old).exp()).collect();
        let count = self.network.parameter_count();
        let (network, log_std) = parameters.split_at(count);
        let (mut tape, mut cotangents) = (Tape::default(), Vec::new());
        let means = self.network.forward(network, &self.observations, &mut tape).to_vec();
        let mut gradient = vec![0.0; parameters.len()];
        let (network_gradient, log_std_gradient) = gradient.split_at_mut(count);
        gaussian::log_probability_gradient(
            &means,
            log_std,
            &self.actions,
            &weights,
            &mut cotangents,
            log_std_gradient,
        );
        self.network.vjp(network, &self.observations, &mut tape, &cotangents, network_gradient);
        gradient
    }

    /// The scene in two chunks of unlike weight, as a long batch comes.
    fn adaptation(&self, size: f64) -> Adaptation<'_, f64> {
        let chunk = |rows: std::ops::Range<usize>| Chunk {
            network: &self.network,
            parameters: &self.parameters,
            observations: &self.observations[rows.start * OBSERVATIONS..rows.end * OBSERVATIONS],
            actions: &self.actions[rows.start * ACTIONS..rows.end * ACTIONS],
            row_weights: self.row_weights[rows.clone()].to_vec(),
            weight: rows.len() as f64 / ROWS as f64,
        };
        Adaptation { chunks: vec![chunk(0..15), chunk(15..ROWS)], size, damping: DAMPING, iterations: 400 }
    }

    /// θ' = θ + η (F + λI)⁻¹ g(θ), with F that of the scene's own parameters.
    fn adapted(&self, parameters: &[f64], size: f64) -> Vec<f64> {
        let natural = self.adaptation(size).natural(&self.gradient(parameters));
        parameters.iter().zip(natural).map(|(p, s)| p + size * s).collect()
    }
}

#[test]
fn likelihood_ratio_tangents_are_those_of_the_gradient_with_the_score_of_the_action() {
    let scene = Scene::new("ratio");
    let gradient = scene.gradient(&scene.parameters);
    assert!(gradient_error(|at| scene.surrogate(at), &scene.parameters, &gradient) < 1e-9);
    let direction = normal(scene.parameters.len(), "direction");
    let product = scene.adaptation(1.0).hessian_product(&direction);
    let slope = |at: &[f64]| dot(&scene.gradient(at), &direction);
    let error = gradient_error(slope, &scene.parameters, &product);
    assert!(error < 1e-8, "error {error:e}");
}

/// ∇_θ L(θ'(θ)) with F and η held fixed, where L is a surrogate on other data.
#[test]
fn eq_2_second_order_is_the_gradient_of_the_loss_after_a_natural_step() {
    let scene = Scene::new("before");
    let other = Scene { parameters: scene.parameters.clone(), ..Scene::new("after") };
    let loss = |at: &[f64]| other.surrogate(&scene.adapted(at, SIZE));
    let at_adapted = other.gradient(&scene.adapted(&scene.parameters, SIZE));
    let exact = scene.adaptation(SIZE).pulled_back(&at_adapted);
    let error = gradient_error(loss, &scene.parameters, &exact);
    assert!(error < 1e-7, "error {error:e}");
    let error_of_first_order = gradient_error(loss, &scene.parameters, &at_adapted);
    assert!(error_of_first_order > 1e-3, "error of first order {error_of_first_order:e}");
    let unmoved = scene.adaptation(0.0);
    assert_eq!(unmoved.pulled_back(&at_adapted), at_adapted, "no step was taken");
}

#[test]
fn eq_2_an_adapted_policy_is_carried_along_as_gradients_are_pulled_back() {
    let scene = Scene::new("adjoint");
    let adaptation = scene.adaptation(SIZE);
    let (u, v) = (normal(scene.parameters.len(), "u"), normal(scene.parameters.len(), "v"));
    let (carried, pulled) = (dot(&adaptation.carried_along(&u), &v), dot(&u, &adaptation.pulled_back(&v)));
    assert!((carried - pulled).abs() < 1e-8 * carried.abs(), "{carried} {pulled}");
    let moved = |steps: &[f64]| {
        let at: Vec<f64> = scene.parameters.iter().zip(&u).map(|(p, u)| p + 0.1 * steps[0] * u).collect();
        dot(&scene.adapted(&at, SIZE), &v)
    };
    let error = gradient_error(moved, &[0.0], &[0.1 * carried]);
    assert!(error < 1e-7, "error {error:e}");
}
