//! A perceptron of several layers: tanh between them, the last one linear.
//!
//! The parameters are one flat vector that the caller owns: for each layer the weight `[in, out]`, row-major, and then
//! the bias `[out]`. All work space lives in a [`Tape`], which is reused from call to call without allocating.
//! Rows are worked on in blocks that stay in the cache.

mod curvature;

use crate::basics::seed::Seed;
use crate::math::nn::Real;
use crate::math::nn::elementwise::{add_to, vectorized};
use crate::math::nn::product::{Matrix, Target, product};
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Rows of a block: its activations stay in the second-level cache, and a product is long enough to be efficient.
const BLOCK: usize = 250;

/// Up to so many rows a plain loop over the weights beats the packing that a matrix product does first.
const FEW_ROWS: usize = 6;

/// The shape of a network; the numbers are kept apart, in a flat vector.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<usize>", into = "Vec<usize>")]
pub struct Mlp {
    widths: Vec<usize>,
}

/// Where one layer's numbers are in the flat vector.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LayerLayout {
    /// The weight, `[inputs, outputs]`, row-major.
    pub weight: Range<usize>,
    /// The bias, `[outputs]`.
    pub bias: Range<usize>,
    /// Numbers that come into the layer.
    pub inputs: usize,
    /// Numbers that come out.
    pub outputs: usize,
}

/// What a forward pass remembers for the derivatives, and the work space of all passes.
#[derive(Clone, Debug, Default)]
pub struct Tape<T> {
    batch: usize,
    /// What each layer gave, `[batch, width]`, layer after layer; the last is the network's output.
    activations: Vec<T>,
    output_start: usize,
    tangents: Vec<T>,
    /// The weights, each transposed, where they are in the parameters: the product would do it again for each block.
    transposed: Vec<T>,
    current: Vec<T>,
    next: Vec<T>,
}

impl<T: Real> Tape<T> {
    /// Outputs of the last forward pass, `[batch, out]`.
    pub fn outputs(&self) -> &[T] {
        &self.activations[self.output_start..]
    }

    /// Rows of the last forward pass.
    pub fn batch(&self) -> usize {
        self.batch
    }
}

impl TryFrom<Vec<usize>> for Mlp {
    type Error = String;

    fn try_from(widths: Vec<usize>) -> Result<Self, String> {
        if widths.len() < 2 || widths.contains(&0) {
            return Err(format!("a network needs at least two widths, each at least 1, got {widths:?}"));
        }
        Ok(Self { widths })
    }
}

impl From<Mlp> for Vec<usize> {
    fn from(mlp: Mlp) -> Self {
        mlp.widths
    }
}

impl Mlp {
    /// The network with these widths: `[in, hidden.., out]`.
    ///
    /// # Panics
    /// With fewer than two widths, or one of 0: a bug of the caller.
    pub fn new(widths: &[usize]) -> Self {
        match Self::try_from(widths.to_vec()) {
            Ok(mlp) => mlp,
            Err(message) => panic!("{message}"),
        }
    }

    /// `[in, hidden.., out]`.
    pub fn widths(&self) -> &[usize] {
        &self.widths
    }

    /// Numbers in an input row.
    pub fn input_width(&self) -> usize {
        self.widths[0]
    }

    /// Numbers in an output row.
    pub fn output_width(&self) -> usize {
        self.widths[self.layers()]
    }

    /// Length of the flat parameter vector.
    pub fn parameter_count(&self) -> usize {
        self.layer(self.layers() - 1).bias.end
    }

    /// Where each layer's weight and bias are in the flat vector, first layer first.
    pub fn layout(&self) -> Vec<LayerLayout> {
        (0..self.layers()).map(|index| self.layer(index)).collect()
    }

    /// Parameters to start from: weights normal with variance 2 / (in + out) (Glorot & Bengio, 2010, Eq. 12),
    /// those of the last layer times `last_layer_gain`, biases 0. A gain of 0 gives a network that answers 0.
    pub fn initial_parameters(&self, last_layer_gain: f64, seed: Seed) -> Vec<f32> {
        let mut rng = seed.into_rng();
        let mut parameters = vec![0.0; self.parameter_count()];
        for index in 0..self.layers() {
            let LayerLayout { weight, inputs, outputs, .. } = self.layer(index);
            let gain = if index + 1 == self.layers() { last_layer_gain } else { 1.0 };
            let spread = gain * (2.0 / (inputs + outputs) as f64).sqrt();
            for value in &mut parameters[weight] {
                let normal: f64 = StandardNormal.sample(&mut rng);
                *value = (spread * normal) as f32;
            }
        }
        parameters
    }

    /// Outputs `[batch, out]` for the inputs `[batch, in]`; the tape keeps what the derivatives need.
    ///
    /// # Panics
    /// If a length does not fit: a bug of the caller. So do the passes below.
    pub fn forward<'t, T: Real>(&self, parameters: &[T], inputs: &[T], tape: &'t mut Tape<T>) -> &'t [T] {
        let batch = self.check(parameters, inputs);
        let hidden: usize = self.widths[1..self.layers()].iter().sum();
        tape.batch = batch;
        tape.output_start = batch * hidden;
        tape.activations.resize(batch * (hidden + self.output_width()), T::ZERO);
        for rows in blocks(batch) {
            for index in 0..self.layers() {
                self.layer_forward(index, &rows, parameters, inputs, tape);
            }
        }
        tape.outputs()
    }

    /// One block of one layer: h = tanh(h₋₁ W + b), without the tanh in the last layer.
    fn layer_forward<T: Real>(
        &self,
        index: usize,
        rows: &Range<usize>,
        parameters: &[T],
        inputs: &[T],
        tape: &mut Tape<T>,
    ) {
        let layer = self.layer(index);
        let (before, after) = tape.activations.split_at_mut(self.activation_start(index, tape.batch));
        let input = match index {
            0 => of_rows(inputs, rows, layer.inputs),
            _ => of_rows(&before[self.activation_start(index - 1, tape.batch)..], rows, layer.inputs),
        };
        let output = &mut after[rows.start * layer.outputs..rows.end * layer.outputs];
        let (weight, bias) = (&parameters[layer.weight.clone()], &parameters[layer.bias.clone()]);
        let is_hidden = index + 1 < self.layers();
        if rows.len() <= FEW_ROWS {
            vectorized(
                #[inline(always)]
                || few_rows_times(input, weight, output, layer.outputs),
            );
        } else {
            let weight = Matrix::new(weight, layer.inputs, layer.outputs);
            product(Matrix::new(input, rows.len(), layer.inputs), weight, output, Target::Overwrite);
        }
        vectorized(
            #[inline(always)]
            || {
                for row in output.chunks_exact_mut(bias.len()) {
                    if is_hidden {
                        row.iter_mut().zip(bias).for_each(|(value, bias)| *value = (*value + *bias).tanh());
                    } else {
                        add_to(row, bias);
                    }
                }
            },
        );
    }

    /// Adds Jᵀ · `output_cotangents` `[batch, out]` to `gradient` `[parameter_count]`: the gradient of Σ cotangent · output.
    ///
    /// `forward` must have run on this tape with these parameters and inputs; so for `jvp`.
    pub fn vjp<T: Real>(
        &self,
        parameters: &[T],
        inputs: &[T],
        tape: &mut Tape<T>,
        output_cotangents: &[T],
        gradient: &mut [T],
    ) {
        self.backward(parameters, inputs, tape, output_cotangents, gradient, |_, _| ());
    }

    /// As [`Mlp::vjp`]; also fills the gradient with respect to the inputs, `[batch, in]`, for what stands below this network.
    pub fn vjp_through<T: Real>(
        &self,
        parameters: &[T],
        inputs: &[T],
        tape: &mut Tape<T>,
        output_cotangents: &[T],
        gradient: &mut [T],
        input_cotangents: &mut [T],
    ) {
        assert_eq!(input_cotangents.len(), inputs.len(), "cotangents of the inputs");
        let first = self.layer(0);
        let weight = Matrix::new(&parameters[first.weight], first.inputs, first.outputs).transposed();
        self.backward(parameters, inputs, tape, output_cotangents, gradient, |rows, delta| {
            let cotangents = &mut input_cotangents[rows.start * first.inputs..rows.end * first.inputs];
            product(Matrix::new(delta, rows.len(), first.outputs), weight, cotangents, Target::Overwrite);
        });
    }

    /// The backward pass; `at_the_inputs` receives each block's rows and the cotangents of its first layer's sums.
    fn backward<T: Real>(
        &self,
        parameters: &[T],
        inputs: &[T],
        tape: &mut Tape<T>,
        output_cotangents: &[T],
        gradient: &mut [T],
        mut at_the_inputs: impl FnMut(&Range<usize>, &[T]),
    ) {
        let batch = self.check_tape(parameters, inputs, tape);
        assert_eq!(output_cotangents.len(), batch * self.output_width(), "cotangents of the outputs");
        assert_eq!(gradient.len(), parameters.len(), "length of the gradient");
        self.transpose_weights(parameters, &mut tape.transposed);
        for rows in blocks(batch) {
            tape.current.clear();
            tape.current.extend_from_slice(of_rows(output_cotangents, &rows, self.output_width()));
            for index in (0..self.layers()).rev() {
                self.layer_backward(index, &rows, inputs, tape, gradient);
            }
            at_the_inputs(&rows, &tape.current);
        }
    }

    /// One block of one layer, backward. `tape.current` comes in as the cotangents of h₋₁ W + b and leaves as those of
    /// the layer before: ∂W += h₋₁ᵀ δ, ∂b += Σ δ, δ₋₁ = (δ Wᵀ) (1 − h₋₁²).
    fn layer_backward<T: Real>(
        &self,
        index: usize,
        rows: &Range<usize>,
        inputs: &[T],
        tape: &mut Tape<T>,
        gradient: &mut [T],
    ) {
        let layer = self.layer(index);
        let Tape { batch, activations, transposed, current, next, .. } = tape;
        let input = match index {
            0 => of_rows(inputs, rows, layer.inputs),
            _ => of_rows(&activations[self.activation_start(index - 1, *batch)..], rows, layer.inputs),
        };
        let delta = Matrix::new(current, rows.len(), layer.outputs);
        let input_matrix = Matrix::new(input, rows.len(), layer.inputs);
        product(input_matrix.transposed(), delta, &mut gradient[layer.weight.clone()], Target::Add);
        let bias_gradient = &mut gradient[layer.bias.clone()];
        vectorized(
            #[inline(always)]
            || current.chunks_exact(bias_gradient.len()).for_each(|row| add_to(bias_gradient, row)),
        );
        if index == 0 {
            return;
        }
        next.resize(rows.len() * layer.inputs, T::ZERO);
        let transposed = Matrix::new(&transposed[layer.weight], layer.outputs, layer.inputs);
        product(delta, transposed, next, Target::Overwrite);
        vectorized(
            #[inline(always)]
            || through_tanh(next, input),
        );
        std::mem::swap(current, next);
    }

    fn transpose_weights<T: Real>(&self, parameters: &[T], transposed: &mut Vec<T>) {
        transposed.resize(parameters.len(), T::ZERO);
        for index in 1..self.layers() {
            let LayerLayout { weight, inputs, outputs, .. } = self.layer(index);
            let targets = transposed[weight.clone()].chunks_exact_mut(inputs);
            for (column, target) in (0..outputs).zip(targets) {
                let source = parameters[weight.clone()].iter().skip(column).step_by(outputs);
                target.iter_mut().zip(source).for_each(|(target, value)| *target = *value);
            }
        }
    }

    /// J · `direction` `[batch, out]`: how fast the outputs change when the parameters move along `direction`.
    pub fn jvp<'t, T: Real>(
        &self,
        parameters: &[T],
        inputs: &[T],
        tape: &'t mut Tape<T>,
        direction: &[T],
    ) -> &'t [T] {
        let batch = self.check_tape(parameters, inputs, tape);
        assert_eq!(direction.len(), parameters.len(), "length of the direction");
        let width = self.output_width();
        tape.tangents.resize(batch * width, T::ZERO);
        for rows in blocks(batch) {
            for index in 0..self.layers() {
                self.layer_tangents(index, &rows, [parameters, direction], inputs, tape);
            }
            tape.tangents[rows.start * width..rows.end * width].copy_from_slice(&tape.current);
        }
        &tape.tangents
    }

    /// One block of one layer, tangents. `tape.current` comes in as ḣ₋₁ and leaves as
    /// ḣ = (h₋₁ Ẇ + ḣ₋₁ W + ḃ) (1 − h²), without the last factor in the last layer.
    fn layer_tangents<T: Real>(
        &self,
        index: usize,
        rows: &Range<usize>,
        [parameters, direction]: [&[T]; 2],
        inputs: &[T],
        tape: &mut Tape<T>,
    ) {
        let layer = self.layer(index);
        let Tape { batch, activations, current, next, .. } = tape;
        let input = match index {
            0 => of_rows(inputs, rows, layer.inputs),
            _ => of_rows(&activations[self.activation_start(index - 1, *batch)..], rows, layer.inputs),
        };
        let matrix = |values| Matrix::new(values, layer.inputs, layer.outputs);
        next.resize(rows.len() * layer.outputs, T::ZERO);
        let input = Matrix::new(input, rows.len(), layer.inputs);
        product(input, matrix(&direction[layer.weight.clone()]), next, Target::Overwrite);
        if index > 0 {
            let input_tangents = Matrix::new(current, rows.len(), layer.inputs);
            product(input_tangents, matrix(&parameters[layer.weight.clone()]), next, Target::Add);
        }
        let bias = &direction[layer.bias.clone()];
        let output = match index + 1 < self.layers() {
            true => Some(of_rows(&activations[self.activation_start(index, *batch)..], rows, layer.outputs)),
            false => None,
        };
        vectorized(
            #[inline(always)]
            || {
                next.chunks_exact_mut(bias.len()).for_each(|row| add_to(row, bias));
                if let Some(output) = output {
                    through_tanh(next, output);
                }
            },
        );
        std::mem::swap(current, next);
    }

    /// Layers of weights.
    fn layers(&self) -> usize {
        self.widths.len() - 1
    }

    fn layer(&self, index: usize) -> LayerLayout {
        let start: usize = self.widths.windows(2).take(index).map(|pair| (pair[0] + 1) * pair[1]).sum();
        let (inputs, outputs) = (self.widths[index], self.widths[index + 1]);
        let middle = start + inputs * outputs;
        LayerLayout { weight: start..middle, bias: middle..middle + outputs, inputs, outputs }
    }

    /// Where what a layer gave starts in the tape.
    fn activation_start(&self, index: usize, batch: usize) -> usize {
        batch * self.widths[1..=index].iter().sum::<usize>()
    }

    /// Checks the lengths and gives the number of rows.
    fn check<T>(&self, parameters: &[T], inputs: &[T]) -> usize {
        assert_eq!(parameters.len(), self.parameter_count(), "number of parameters");
        assert!(inputs.len().is_multiple_of(self.input_width()), "inputs in rows of {}", self.input_width());
        inputs.len() / self.input_width()
    }

    fn check_tape<T: Real>(&self, parameters: &[T], inputs: &[T], tape: &Tape<T>) -> usize {
        let batch = self.check(parameters, inputs);
        assert_eq!(tape.batch, batch, "rows of the forward pass on this tape");
        assert_eq!(tape.outputs().len(), batch * self.output_width(), "outputs on this tape");
        batch
    }
}

/// 0..batch in pieces of at most [`BLOCK`] rows.
fn blocks(batch: usize) -> impl Iterator<Item = Range<usize>> {
    (0..batch).step_by(BLOCK).map(move |start| start..batch.min(start + BLOCK))
}

/// The rows of a flat table with rows of `width`.
fn of_rows<'a, T>(values: &'a [T], rows: &Range<usize>, width: usize) -> &'a [T] {
    &values[rows.start * width..rows.end * width]
}

/// value · (1 − h²) for each value and the h = tanh(·) behind it: the derivative of tanh.
#[inline(always)]
fn through_tanh<T: Real>(values: &mut [T], activations: &[T]) {
    for (value, h) in values.iter_mut().zip(activations) {
        *value *= T::ONE - *h * *h;
    }
}

/// output = input · weight for a few rows, one by one.
#[inline(always)]
fn few_rows_times<T: Real>(input: &[T], weight: &[T], output: &mut [T], width: usize) {
    let inputs = weight.len() / width;
    for (input, output) in input.chunks_exact(inputs).zip(output.chunks_exact_mut(width)) {
        let mut start = 0;
        while start + 64 <= width {
            row_times_columns::<T, 64>(input, weight, output, start);
            start += 64;
        }
        while start + 16 <= width {
            row_times_columns::<T, 16>(input, weight, output, start);
            start += 16;
        }
        while start + 4 <= width {
            row_times_columns::<T, 4>(input, weight, output, start);
            start += 4;
        }
        while start < width {
            row_times_columns::<T, 1>(input, weight, output, start);
            start += 1;
        }
    }
}

/// The outputs `start..start + WIDTH` of one row, their sums held in registers.
#[inline(always)]
fn row_times_columns<T: Real, const WIDTH: usize>(input: &[T], weight: &[T], output: &mut [T], start: usize) {
    let mut sums = [T::ZERO; WIDTH];
    for (x, weights) in input.iter().zip(weight.chunks_exact(output.len())) {
        for (sum, w) in sums.iter_mut().zip(&weights[start..start + WIDTH]) {
            *sum += *x * *w;
        }
    }
    output[start..start + WIDTH].copy_from_slice(&sums);
}

#[cfg(test)]
#[path = "mlp_tests.rs"]
mod tests;
