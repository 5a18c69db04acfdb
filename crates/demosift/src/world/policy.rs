//! π_θ: a tanh network with a diagonal Gaussian on top (Table 3).

use serde::{Deserialize, Serialize};

use crate::basics::seed::{Rng, Seed};
use crate::data::observation_filter::ObservationFilter;
use crate::math::nn::gaussian;
pub use crate::math::nn::mlp::Mlp;
use crate::math::nn::mlp::Tape;
use crate::math::rows::Rows;

/// Gain of the last layer at the start: small, so that first actions are noise around zero.
const FIRST_ACTION_GAIN: f64 = 0.01;

/// How a policy acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Acting {
    /// Draws from the Gaussian.
    Sampled,
    /// Takes the mean.
    Mean,
}

/// The shape of a policy.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PolicyShape {
    /// Widths of the hidden layers (Table 3: 32, 32; Handstand 64, 64).
    pub hidden: Vec<usize>,
    /// Standard deviation of the actions at the start; not in the paper.
    pub initial_std: f64,
}

/// θ with the observation filter it was made for; immutable, an update makes a new one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Policy {
    network: Mlp,
    /// The network's parameters, then the logarithms of the standard deviations, `[P + act]`.
    parameters: Vec<f32>,
    filter: ObservationFilter,
}

impl Policy {
    /// A policy that knows nothing.
    pub fn untrained(shape: &PolicyShape, filter: ObservationFilter, action_size: usize, seed: Seed) -> Self {
        let mut widths = vec![filter.observation_size()];
        widths.extend(&shape.hidden);
        widths.push(action_size);
        let network = Mlp::new(&widths);
        let mut parameters = network.initial_parameters(FIRST_ACTION_GAIN, seed);
        parameters.extend(std::iter::repeat_n(shape.initial_std.ln() as f32, action_size));
        Self { network, parameters, filter }
    }

    /// A policy from its parts: the network, its parameters followed by `[act]` log-standard-deviations, and its filter.
    ///
    /// # Panics
    /// If the number of parameters does not fit the network: a bug of the caller.
    pub fn from_parts(network: Mlp, parameters: Vec<f32>, filter: ObservationFilter) -> Self {
        assert_eq!(parameters.len(), network.parameter_count() + network.output_width(), "parameters");
        assert_eq!(network.input_width(), filter.observation_size(), "observation size");
        Self { network, parameters, filter }
    }

    /// The network that maps a filtered observation to the mean action.
    pub fn network(&self) -> &Mlp {
        &self.network
    }

    /// θ: the network's parameters, then the log-standard-deviations, `[P + act]`.
    pub fn parameters(&self) -> &[f32] {
        &self.parameters
    }

    /// The parameters of the network alone, `[P]`.
    pub fn network_parameters(&self) -> &[f32] {
        &self.parameters[..self.network.parameter_count()]
    }

    /// Logarithms of the standard deviations, `[act]`.
    pub fn log_std(&self) -> &[f32] {
        &self.parameters[self.network.parameter_count()..]
    }

    /// The frozen observation filter.
    pub fn filter(&self) -> &ObservationFilter {
        &self.filter
    }

    /// Numbers in an action.
    pub fn action_size(&self) -> usize {
        self.network.output_width()
    }

    /// The policy at θ + `displacement`, `[P + act]`.
    #[must_use]
    pub fn moved(&self, displacement: &[f32]) -> Self {
        let parameters = self.parameters.iter().zip(displacement).map(|(here, by)| here + by).collect();
        Self::from_parts(self.network.clone(), parameters, self.filter.clone())
    }

    /// The policy with `share` times the spread of its actions.
    #[must_use]
    pub fn with_spread(&self, share: f64) -> Self {
        let mut parameters = self.parameters.clone();
        let by = share.ln() as f32;
        parameters[self.network.parameter_count()..].iter_mut().for_each(|log_std| *log_std += by);
        Self::from_parts(self.network.clone(), parameters, self.filter.clone())
    }

    /// The same network behind another filter, which changes what it does.
    #[must_use]
    pub fn with_filter(&self, filter: ObservationFilter) -> Self {
        Self::from_parts(self.network.clone(), self.parameters.clone(), filter)
    }

    /// Mean actions `[len, act]` on filtered observations `[len, obs]`.
    pub fn means(&self, filtered: &Rows) -> Rows {
        let mut tape = Tape::default();
        let means = self.network.forward(self.network_parameters(), filtered.flat(), &mut tape).to_vec();
        Rows::from_flat(means, self.action_size()).expect("the network's outputs are whole rows")
    }
}

/// A policy at play: keeps the work space between steps.
#[derive(Debug)]
pub struct Player<'p> {
    policy: &'p Policy,
    filtered: Vec<f32>,
    tape: Tape<f32>,
}

impl<'p> Player<'p> {
    /// Prepares a policy for playing.
    pub fn new(policy: &'p Policy) -> Self {
        Self { policy, filtered: vec![0.0; policy.filter.observation_size()], tape: Tape::default() }
    }

    /// Fills the mean action `[act]` on an observation `[obs]`.
    pub fn mean(&mut self, observation: &[f32], action: &mut [f32]) {
        self.policy.filter.apply(observation, &mut self.filtered);
        let parameters = self.policy.network_parameters();
        action.copy_from_slice(self.policy.network.forward(parameters, &self.filtered, &mut self.tape));
    }

    /// Draws an action `[act]` on an observation `[obs]`.
    pub fn sample(&mut self, observation: &[f32], rng: &mut Rng, action: &mut [f32]) {
        self.policy.filter.apply(observation, &mut self.filtered);
        let parameters = self.policy.network_parameters();
        let mean = self.policy.network.forward(parameters, &self.filtered, &mut self.tape);
        gaussian::sample(mean, self.policy.log_std(), rng, action);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_3_policy_has_two_layers_of_thirty_two_and_a_free_spread() {
        let shape = PolicyShape { hidden: vec![32, 32], initial_std: 0.5 };
        let policy = Policy::untrained(&shape, ObservationFilter::identity(55), 21, Seed::new(0));
        let weights = 55 * 32 + 32 * 32 + 32 * 21;
        assert_eq!(policy.network_parameters().len(), weights + 32 + 32 + 21);
        assert_eq!(policy.log_std(), [0.5f32.ln(); 21]);
        assert_eq!(policy.parameters().len(), policy.network_parameters().len() + 21);
    }

    /// By hand: mean = w₂ tanh(w₁ (o − m)/s + b₁) + b₂.
    #[test]
    fn a_player_filters_what_it_sees_and_takes_the_mean() {
        let filter = ObservationFilter::new(vec![1.0], vec![2.0]);
        let parameters = vec![0.7, 0.1, 1.5, -0.2, 0.3f32.ln()];
        let policy = Policy::from_parts(Mlp::new(&[1, 1, 1]), parameters, filter);
        let mut action = [0.0];
        Player::new(&policy).mean(&[4.0], &mut action);
        let wanted = 1.5 * (0.7 * 1.5 + 0.1f64).tanh() - 0.2;
        assert!((f64::from(action[0]) - wanted).abs() < 1e-5, "{action:?}, wanted {wanted}");
        let mut rng = Seed::new(1).into_rng();
        let mut player = Player::new(&policy);
        let drawn: Vec<f64> = (0..2000)
            .map(|_| {
                player.sample(&[4.0], &mut rng, &mut action);
                f64::from(action[0]) - wanted
            })
            .collect();
        let std = (drawn.iter().map(|value| value * value).sum::<f64>() / 2000.0).sqrt();
        assert!((std - 0.3).abs() < 0.02, "standard deviation {std}");
    }
}
