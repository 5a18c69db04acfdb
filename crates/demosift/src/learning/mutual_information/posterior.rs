//! Q: from what a policy did before and after an update to the encoding of the demonstration that it imitated (Table 3).
//!
//! One LSTM reads a trajectory before and one after the update, with the same weights (siamese).
//! The difference of the two last hidden states goes through two fully connected layers to one number, the predicted
//! encoding μ; log Q is the logarithm of a Gaussian density around it.
//!
//! Why the difference and not both states side by side: Δπ is a difference, and no change is always predicted alike.
//!
//! Why each trajectory is seen from the middle of its pair, in units of the scales: the LSTM would have to
//! find a hundredth of a unit on top of whole trajectories, and does not in the few steps that it is given.
//!
//! Why the spread of the Gaussian is found and not set: given μ, the spread that makes log Q the largest is the root of the
//! mean squared error on the pairs that Q was fitted to, so that no constant has to be chosen, and E[log Q] is
//! as tight a bound as μ allows (Eq. 4).

use serde::{Deserialize, Serialize};

use super::Change;
use super::sequences::Sequences;
use crate::basics::seed::Seed;
use crate::math::nn::Real;
use crate::math::nn::lstm::{Lstm, LstmTape};
use crate::math::nn::mlp::{Mlp, Tape};

/// No spread below this is believed, in units of the encodings' own spread: a handful of demonstrations can be told for
/// certain, and a density without bounds would make the reward one of outliers.
const SMALLEST_STD: f64 = 0.1;

/// What lies farther from the middle of its pair than this, in units of the scales, was not seen in the fit, and is not to
/// rule what is paid.
const FARTHEST: f32 = 5.0;

/// No scale is below this, in units of the observation filter.
const SMALLEST_SCALE: f64 = 1e-4;

/// Q(v | Δπ), a Gaussian density of the standardized encoding.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Posterior {
    lstm: Lstm,
    head: Mlp,
    /// The LSTM's parameters, then the head's.
    parameters: Vec<f32>,
    /// How far the paid trajectories lie from the mean of the other side, reading by reading, `[readings, obs]`.
    scales: Vec<f32>,
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

impl Posterior {
    /// A posterior that predicts the mean of all encodings, 0, with their own spread, 1: its last layer is zero.
    pub fn untrained(observation_size: usize, lstm: usize, dense: usize, seed: Seed) -> Self {
        let (lstm, head) = (Lstm::new(observation_size, lstm), Mlp::new(&[lstm, dense, 1]));
        let mut parameters = lstm.initial_parameters(seed.of("lstm"));
        parameters.extend(head.initial_parameters(0.0, seed.of("head")));
        Self { lstm, head, parameters, scales: Vec::new(), std: 1.0 }
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

    /// The same with the scales of these pairs: the root mean square of what differs within them.
    #[must_use]
    pub(super) fn scaled_to(self, changes: &[Change<'_>]) -> Self {
        let (mut squares, mut count) = (Vec::new(), 0);
        for Change { before, after, .. } in changes {
            for (before, after) in pairs(before, after) {
                squares.resize(before.len(), 0.0);
                for (sum, (before, after)) in squares.iter_mut().zip(before.iter().zip(after)) {
                    *sum += f64::from(after - before).powi(2);
                }
                count += 1;
            }
        }
        let rms = squares.iter().map(|sum| (sum / f64::from(count)).sqrt());
        Self { scales: rms.map(|rms| rms.max(SMALLEST_SCALE) as f32).collect(), ..self }
    }

    /// A pair as the LSTM reads it: each of the two from the middle between them, in units of the scales; `[readings, obs]`.
    pub(super) fn seen(&self, before: &[f32], after: &[f32]) -> [Vec<f32>; 2] {
        let half = before.iter().zip(after).enumerate().map(|(at, (before, after))| {
            let half = 0.5 * (after - before) / self.scales.get(at).copied().unwrap_or(1.0);
            half.clamp(-FARTHEST, FARTHEST)
        });
        let after: Vec<f32> = half.collect();
        [after.iter().map(|half| -half).collect(), after]
    }

    /// μ of each pair, `[pairs]`.
    pub fn predict(&self, before: &Sequences, after: &Sequences) -> Vec<f32> {
        const AT_ONCE: usize = 32;
        let (lstm_weights, head_weights) = self.parameters.split_at(self.lstm.parameter_count());
        let (mut inputs, mut tape, mut head_tape) = (Vec::new(), LstmTape::default(), Tape::default());
        let seen: Vec<[Vec<f32>; 2]> =
            pairs(before, after).map(|(before, after)| self.seen(before, after)).collect();
        let mut predicted = Vec::with_capacity(seen.len());
        for some in seen.chunks(AT_ONCE) {
            time_major(&side_by_side(some), self.lstm.input_width(), &mut inputs);
            let states = self.lstm.forward(lstm_weights, &inputs, 2 * some.len(), &mut tape);
            let (before, after) = states.split_at(states.len() / 2);
            let differences: Vec<f32> =
                after.iter().zip(before).map(|(after, before)| after - before).collect();
            predicted.extend_from_slice(self.head.forward(head_weights, &differences, &mut head_tape));
        }
        predicted
    }

    /// Σ (μ − c)² over pairs whose readings `workspace.inputs` holds, `[steps, 2 pairs, obs]`, first all before and
    /// then all after; adds its gradient times `share` to `gradient`, `[P]`.
    pub(super) fn squared_error_and_gradient<T: Real>(
        lstm: &Lstm,
        head: &Mlp,
        parameters: &[T],
        encodings: &[T],
        workspace: &mut Workspace<T>,
        share: T,
        gradient: &mut [T],
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
        head.vjp_through(
            head_weights,
            differences,
            head_tape,
            cotangents,
            head_gradient,
            difference_cotangents,
        );
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

/// One after the other; a side of one trajectory stands opposite all of the other side.
pub(super) fn pairs<'a>(
    before: &'a Sequences,
    after: &'a Sequences,
) -> impl Iterator<Item = (&'a [f32], &'a [f32])> {
    (0..before.len().max(after.len())).map(move |index| pair(before, after, index))
}

/// The pair of this number.
pub(super) fn pair<'a>(before: &'a Sequences, after: &'a Sequences, index: usize) -> (&'a [f32], &'a [f32]) {
    let of = |side: &'a Sequences| side.get(index.min(side.len() - 1));
    (of(before), of(after))
}

/// First all before and then all after.
pub(super) fn side_by_side(seen: &[[Vec<f32>; 2]]) -> Vec<&[f32]> {
    let side = |side: usize| seen.iter().map(move |pair| pair[side].as_slice());
    side(0).chain(side(1)).collect()
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
