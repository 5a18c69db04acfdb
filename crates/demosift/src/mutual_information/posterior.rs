//! Q: from what a policy did before and after an update to the encoding of the demonstration that it imitated (Table 3).
//!
//! One LSTM reads a trajectory before and one after the update, with the same weights (siamese).
//! The difference of the two last hidden states goes through two fully connected layers to one number, the predicted
//! encoding μ; log Q is the logarithm of a Gaussian density around it.
//!
//! Why the difference and not both states side by side: Δπ is a difference, and no change is always predicted alike.
//! And R_MI is paid to the trajectory *before*: side by side, Q would learn to read the trajectory after alone, from
//! which all else is noise, and what is paid to the one before would be that noise.
//!
//! Why the spread of the Gaussian is found and not set: given μ, the spread that makes log Q the largest is the root of the
//! mean squared error on the pairs that Q was fitted to, so that no constant has to be chosen, and E[log Q] is
//! as tight a bound as μ allows (Eq. 4).

use serde::{Deserialize, Serialize};

use super::sequences::Sequences;
use crate::nn::Real;
use crate::nn::lstm::{Lstm, LstmTape};
use crate::nn::mlp::{Mlp, Tape};
use crate::seed::Seed;

/// No spread below this is believed, in units of the encodings' own spread: a handful of demonstrations can be told for
/// certain, and a density without bounds would make the reward one of outliers.
const SMALLEST_STD: f64 = 0.1;

/// Q(v | Δπ), a Gaussian density of the standardized encoding.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Posterior {
    lstm: Lstm,
    head: Mlp,
    /// The LSTM's parameters, then the head's.
    parameters: Vec<f32>,
    std: f64,
}

/// Work space that is reused from pass to pass.
#[derive(Clone, Debug, Default)]
pub(super) struct Workspace<T> {
    pub(super) inputs: Vec<T>,
    lstm: LstmTape<T>,
    differences: Vec<T>,
    head: Tape<T>,
    cotangents: Vec<T>,
    difference_cotangents: Vec<T>,
    state_cotangents: Vec<T>,
}

/// The hidden states after reading some trajectories, `[len, hidden]`.
#[derive(Clone, Debug)]
pub struct States {
    values: Vec<f32>,
    width: usize,
}

impl Posterior {
    /// A posterior that predicts the mean of all encodings, 0, with their own spread, 1: its last layer is zero.
    pub fn untrained(observation_size: usize, lstm: usize, dense: usize, seed: Seed) -> Self {
        let (lstm, head) = (Lstm::new(observation_size, lstm), Mlp::new(&[lstm, dense, 1]));
        let mut parameters = lstm.initial_parameters(seed.of("lstm"));
        parameters.extend(head.initial_parameters(0.0, seed.of("head")));
        Self { lstm, head, parameters, std: 1.0 }
    }

    /// The parameters of the LSTM, then those of the fully connected layers, `[P]`.
    pub fn parameters(&self) -> &[f32] {
        &self.parameters
    }

    /// σ, in units of the encodings' spread.
    pub fn std(&self) -> f64 {
        self.std
    }

    pub(super) fn parameters_mut(&mut self) -> &mut [f32] {
        &mut self.parameters
    }

    /// The same μ with the spread under which errors of this mean square are the most likely.
    #[must_use]
    pub(super) fn with_squared_error(self, mean_squared_error: f64) -> Self {
        Self { std: mean_squared_error.sqrt().max(SMALLEST_STD), ..self }
    }

    /// log Q = −½ ((c − μ)/σ)² − ln σ − ½ ln 2π
    pub fn log_density(&self, encoding: f32, predicted: f32) -> f64 {
        let deviation = f64::from(encoding - predicted) / self.std;
        -0.5 * deviation * deviation - self.std.ln() - 0.5 * (2.0 * std::f64::consts::PI).ln()
    }

    /// Reads trajectories; done once for each, however many pairs it stands in.
    pub fn read(&self, sequences: &Sequences) -> States {
        const AT_ONCE: usize = 64;
        let (weights, width) = (&self.parameters[..self.lstm.parameter_count()], self.lstm.hidden_width());
        let mut values = Vec::with_capacity(sequences.len() * width);
        let (mut inputs, mut tape) = (Vec::new(), LstmTape::default());
        let all: Vec<usize> = (0..sequences.len()).collect();
        for some in all.chunks(AT_ONCE) {
            let some: Vec<&[f32]> = some.iter().map(|index| sequences.get(*index)).collect();
            time_major(&some, self.lstm.input_width(), &mut inputs);
            values.extend_from_slice(self.lstm.forward(weights, &inputs, some.len(), &mut tape));
        }
        States { values, width }
    }

    /// μ of each pair `(before, after)` of trajectories by their indices.
    pub fn predict(&self, before: &States, after: &States, pairs: &[(usize, usize)]) -> Vec<f32> {
        let mut differences = Vec::with_capacity(pairs.len() * before.width);
        for (before, after) in pairs.iter().map(|(i, k)| (before.row(*i), after.row(*k))) {
            differences.extend(after.iter().zip(before).map(|(after, before)| after - before));
        }
        let weights = &self.parameters[self.lstm.parameter_count()..];
        self.head.forward(weights, &differences, &mut Tape::default()).to_vec()
    }

    /// Σ (μ − c)² over pairs whose readings `workspace.inputs` holds, `[steps, 2 pairs, obs]`, first all before and
    /// then all after; adds its gradient times `share` to `gradient`, `[P]`.
    pub(super) fn squared_error_and_gradient<T: Real>(
        (lstm, head): (&Lstm, &Mlp),
        parameters: &[T],
        encodings: &[T],
        workspace: &mut Workspace<T>,
        (share, gradient): (T, &mut [T]),
    ) -> T {
        let Workspace {
            inputs,
            lstm: lstm_tape,
            differences,
            head: head_tape,
            cotangents,
            difference_cotangents,
            state_cotangents,
        } = workspace;
        let (lstm_weights, head_weights) = parameters.split_at(lstm.parameter_count());
        let (lstm_gradient, head_gradient) = gradient.split_at_mut(lstm.parameter_count());
        let states = lstm.forward(lstm_weights, inputs, 2 * encodings.len(), lstm_tape);
        let (before, after) = states.split_at(states.len() / 2);
        differences.clear();
        differences.extend(after.iter().zip(before).map(|(after, before)| *after - *before));
        let predicted = head.forward(head_weights, differences, head_tape);
        cotangents.clear();
        cotangents.extend(predicted.iter().zip(encodings).map(|(predicted, c)| *predicted - *c));
        let squared_error = cotangents.iter().map(|error| *error * *error).sum();
        cotangents.iter_mut().for_each(|error| *error *= (T::ONE + T::ONE) * share);
        difference_cotangents.resize(differences.len(), T::ZERO);
        let gradients = (head_gradient, &mut difference_cotangents[..]);
        head.vjp_through(head_weights, differences, head_tape, cotangents, gradients);
        state_cotangents.clear();
        state_cotangents.extend(difference_cotangents.iter().map(|cotangent| -*cotangent));
        state_cotangents.extend_from_slice(difference_cotangents);
        lstm.vjp(lstm_weights, inputs, lstm_tape, state_cotangents, lstm_gradient);
        squared_error
    }

    pub(super) fn networks(&self) -> (&Lstm, &Mlp) {
        (&self.lstm, &self.head)
    }
}

impl States {
    /// Number of trajectories.
    pub fn len(&self) -> usize {
        self.values.len() / self.width
    }

    /// Whether there is no trajectory.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    fn row(&self, index: usize) -> &[f32] {
        &self.values[index * self.width..(index + 1) * self.width]
    }
}

/// Sequences, each `[steps, obs]`, as `[steps, sequences, obs]`.
pub(super) fn time_major(sequences: &[&[f32]], width: usize, inputs: &mut Vec<f32>) {
    inputs.clear();
    let steps = sequences.first().map_or(0, |sequence| sequence.len() / width);
    for step in 0..steps {
        sequences.iter().for_each(|sequence| {
            inputs.extend_from_slice(&sequence[step * width..(step + 1) * width]);
        });
    }
}
