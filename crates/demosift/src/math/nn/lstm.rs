//! A recurrent network of one layer with long short-term memory (Hochreiter & Schmidhuber 1997; forget gate by Gers et al. 2000).
//!
//! It reads a batch of equally long sequences and answers with the hidden state after the last step.
//! The parameters are one flat vector that the caller owns: the weight of the inputs `[in, 4 hidden]`, the weight of the
//! hidden state `[hidden, 4 hidden]`, both row-major, and the bias `[4 hidden]`.
//! The four blocks of columns are the gates input i, forget f, candidate g and output o, in this order.
//!
//! Products with the inputs do not wait for each other and are one product for all steps; only those with the hidden
//! state go step by step, for all sequences at once. All work space lives in an [`LstmTape`].

use crate::basics::seed::Seed;
use crate::math::nn::Real;
use crate::math::nn::elementwise::{add_to, vectorized};
use crate::math::nn::product::{Matrix, Target, product};
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// i, f, g, o.
const GATES: usize = 4;

/// The shape of a network; the numbers are kept apart, in a flat vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Lstm {
    inputs: usize,
    hidden: usize,
}

/// Where the weights and the bias are in the flat vector.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LstmLayout {
    /// The weight of the inputs, `[in, 4 hidden]`.
    pub input_weight: Range<usize>,
    /// The weight of the hidden state, `[hidden, 4 hidden]`.
    pub hidden_weight: Range<usize>,
    /// The bias, `[4 hidden]`.
    pub bias: Range<usize>,
}

/// What a forward pass remembers for the derivative, and the work space of both passes.
#[derive(Clone, Debug, Default)]
pub struct LstmTape<T> {
    batch: usize,
    steps: usize,
    /// Whether the gates are those of a forward pass; `vjp` overwrites them by their cotangents.
    is_fresh: bool,
    /// i, f, g, o of each step, `[steps, batch, 4 hidden]`.
    gates: Vec<T>,
    /// The cells before the first step and after each, `[steps + 1, batch, hidden]`.
    cells: Vec<T>,
    /// The hidden states, likewise.
    hidden: Vec<T>,
    /// The weight of the hidden state, transposed: the product would do it again for each step.
    transposed: Vec<T>,
    cell_cotangents: Vec<T>,
    hidden_cotangents: Vec<T>,
}

impl Lstm {
    /// The network from rows of `inputs` numbers to a state of `hidden` numbers.
    ///
    /// # Panics
    /// If a width is 0: a bug of the caller.
    pub fn new(inputs: usize, hidden: usize) -> Self {
        assert!(inputs > 0 && hidden > 0, "widths of at least 1, got {inputs} and {hidden}");
        Self { inputs, hidden }
    }

    /// Numbers in an input row.
    pub fn input_width(&self) -> usize {
        self.inputs
    }

    /// Numbers in the hidden state.
    pub fn hidden_width(&self) -> usize {
        self.hidden
    }

    /// Length of the flat parameter vector.
    pub fn parameter_count(&self) -> usize {
        self.layout().bias.end
    }

    /// Where the weights and the bias are in the flat vector.
    pub fn layout(&self) -> LstmLayout {
        let input = self.inputs * self.columns();
        let hidden = input + self.hidden * self.columns();
        LstmLayout {
            input_weight: 0..input,
            hidden_weight: input..hidden,
            bias: hidden..hidden + self.columns(),
        }
    }

    /// Parameters to start from: weights normal with variance 1 / (in + hidden), so that a gate's sum has unit spread on
    /// inputs of unit spread, and biases 0 but for the forget gate's, which are 1: at first nothing is forgotten
    /// (Jozefowicz et al. 2015).
    pub fn initial_parameters(&self, seed: Seed) -> Vec<f32> {
        let mut rng = seed.into_rng();
        let mut parameters = vec![0.0; self.parameter_count()];
        let LstmLayout { bias, .. } = self.layout();
        let spread = (1.0 / (self.inputs + self.hidden) as f64).sqrt();
        for value in &mut parameters[..bias.start] {
            let normal: f64 = StandardNormal.sample(&mut rng);
            *value = (spread * normal) as f32;
        }
        parameters[bias][self.hidden..2 * self.hidden].fill(1.0);
        parameters
    }

    /// The hidden states `[batch, hidden]` after reading the sequences, inputs `[steps, batch, in]`, all steps alike long;
    /// the tape keeps what the derivative needs.
    ///
    /// # Panics
    /// If a length does not fit, or there is no step: a bug of the caller. So does `vjp`.
    pub fn forward<'t, T: Real>(
        &self,
        parameters: &[T],
        inputs: &[T],
        batch: usize,
        tape: &'t mut LstmTape<T>,
    ) -> &'t [T] {
        assert_eq!(parameters.len(), self.parameter_count(), "number of parameters");
        assert!(batch > 0 && !inputs.is_empty(), "at least one sequence of at least one step");
        assert!(inputs.len().is_multiple_of(batch * self.inputs), "inputs of {batch} whole sequences");
        let steps = inputs.len() / (batch * self.inputs);
        self.prepare(steps, batch, tape);
        let LstmLayout { input_weight, hidden_weight, bias } = self.layout();
        let input_weight = Matrix::new(&parameters[input_weight], self.inputs, self.columns());
        let rows = Matrix::new(inputs, steps * batch, self.inputs);
        product(rows, input_weight, &mut tape.gates, Target::Overwrite);
        let hidden_weight = Matrix::new(&parameters[hidden_weight], self.hidden, self.columns());
        let size = batch * self.hidden;
        for step in 0..steps {
            let (before, after) = tape.hidden.split_at_mut((step + 1) * size);
            let before = Matrix::new(&before[step * size..], batch, self.hidden);
            let gates = &mut tape.gates[step * batch * self.columns()..(step + 1) * batch * self.columns()];
            if step > 0 {
                product(before, hidden_weight, gates, Target::Add);
            }
            let (cells_before, cells) = tape.cells.split_at_mut((step + 1) * size);
            let (cells_before, cells) = (&cells_before[step * size..], &mut cells[..size]);
            let hidden = &mut after[..size];
            step_forward(gates, &parameters[bias.clone()], cells_before, cells, hidden, self.hidden);
        }
        &tape.hidden[steps * size..]
    }

    /// Adds Jᵀ · `cotangents` `[batch, hidden]` to `gradient` `[parameter_count]`, backward through time: the gradient of
    /// Σ cotangent · last hidden state.
    ///
    /// `forward` must have run on this tape with these parameters and inputs, once before each call.
    pub fn vjp<T: Real>(
        &self,
        parameters: &[T],
        inputs: &[T],
        tape: &mut LstmTape<T>,
        cotangents: &[T],
        gradient: &mut [T],
    ) {
        assert!(std::mem::take(&mut tape.is_fresh), "a forward pass before each backward one");
        let (steps, batch, size) = (tape.steps, tape.batch, tape.batch * self.hidden);
        assert_eq!(inputs.len(), steps * batch * self.inputs, "inputs of the forward pass");
        assert_eq!(cotangents.len(), size, "cotangents of the last hidden states");
        assert_eq!(gradient.len(), parameters.len(), "length of the gradient");
        let LstmLayout { input_weight, hidden_weight, bias } = self.layout();
        transpose(&parameters[hidden_weight.clone()], self.columns(), &mut tape.transposed);
        let transposed = Matrix::new(&tape.transposed, self.columns(), self.hidden);
        tape.hidden_cotangents.copy_from_slice(cotangents);
        tape.cell_cotangents.fill(T::ZERO);
        let columns = self.columns();
        for step in (0..steps).rev() {
            let gates = &mut tape.gates[step * batch * columns..(step + 1) * batch * columns];
            let (before, cells) = tape.cells[step * size..].split_at(size);
            let (of_hidden, of_cells) = (&tape.hidden_cotangents, &mut tape.cell_cotangents);
            step_backward(gates, before, &cells[..size], of_hidden, of_cells, self.hidden);
            if step > 0 {
                let gates = Matrix::new(gates, batch, columns);
                product(gates, transposed, &mut tape.hidden_cotangents, Target::Overwrite);
            }
        }
        let all = Matrix::new(&tape.gates, steps * batch, columns);
        let rows = Matrix::new(inputs, steps * batch, self.inputs).transposed();
        product(rows, all, &mut gradient[input_weight], Target::Add);
        // The state before the first step is 0.
        let later = Matrix::new(&tape.gates[batch * columns..], (steps - 1) * batch, columns);
        let states = Matrix::new(&tape.hidden[size..steps * size], (steps - 1) * batch, self.hidden);
        product(states.transposed(), later, &mut gradient[hidden_weight], Target::Add);
        let bias = &mut gradient[bias];
        vectorized(
            #[inline(always)]
            || tape.gates.chunks_exact(columns).for_each(|row| add_to(bias, row)),
        );
    }

    /// Makes room in the tape, and the states before the first step 0.
    fn prepare<T: Real>(&self, steps: usize, batch: usize, tape: &mut LstmTape<T>) {
        let size = batch * self.hidden;
        (tape.steps, tape.batch, tape.is_fresh) = (steps, batch, true);
        tape.gates.resize(steps * batch * self.columns(), T::ZERO);
        for states in [&mut tape.cells, &mut tape.hidden] {
            states.resize((steps + 1) * size, T::ZERO);
            states[..size].fill(T::ZERO);
        }
        tape.cell_cotangents.resize(size, T::ZERO);
        tape.hidden_cotangents.resize(size, T::ZERO);
    }

    /// Numbers in a row of gates.
    fn columns(&self) -> usize {
        GATES * self.hidden
    }
}

/// σ(x) = (1 + tanh(x/2)) / 2
#[inline(always)]
fn sigmoid<T: Real>(x: T, half: T) -> T {
    half + half * (half * x).tanh()
}

/// c = σ(f) c₋₁ + σ(i) tanh(g),  h = σ(o) tanh(c), with i, f, g, o the sums in `gates` plus the bias; the gates stay in
/// their place. All are `[batch, hidden]`, the gates `[batch, 4 hidden]`.
fn step_forward<T: Real>(
    gates: &mut [T],
    bias: &[T],
    cells_before: &[T],
    cells: &mut [T],
    hidden: &mut [T],
    width: usize,
) {
    let half = T::from_f64(0.5);
    vectorized(
        #[inline(always)]
        || {
            let states = cells.chunks_exact_mut(width).zip(hidden.chunks_exact_mut(width));
            let rows = gates.chunks_exact_mut(GATES * width).zip(cells_before.chunks_exact(width));
            for ((gates, before), (cell, hidden)) in rows.zip(states) {
                gates.iter_mut().zip(bias).for_each(|(sum, bias)| *sum += *bias);
                let (sigmoids, rest) = gates.split_at_mut(2 * width);
                sigmoids.iter_mut().for_each(|x| *x = sigmoid(*x, half));
                let (candidate, output) = rest.split_at_mut(width);
                candidate.iter_mut().for_each(|x| *x = x.tanh());
                output.iter_mut().for_each(|x| *x = sigmoid(*x, half));
                let (input, forget) = sigmoids.split_at(width);
                let kept = forget.iter().zip(before).zip(input.iter().zip(candidate.iter()));
                for (cell, ((f, before), (i, g))) in cell.iter_mut().zip(kept) {
                    *cell = *f * *before + *i * *g;
                }
                for ((hidden, cell), o) in hidden.iter_mut().zip(cell.iter()).zip(output.iter()) {
                    *hidden = *o * cell.tanh();
                }
            }
        },
    );
}

/// From the cotangents of h and c after a step to those of the gates' sums, which take the gates' place, and of c before:
/// δo = δh tanh(c) o(1−o),  δc += δh o (1 − tanh²c),  δi = δc g i(1−i),  δf = δc c₋₁ f(1−f),  δg = δc i (1−g²),  δc₋₁ = δc f.
fn step_backward<T: Real>(
    gates: &mut [T],
    cells_before: &[T],
    cells: &[T],
    hidden_cotangents: &[T],
    cell_cotangents: &mut [T],
    width: usize,
) {
    vectorized(
        #[inline(always)]
        || {
            let cells = cells_before.chunks_exact(width).zip(cells.chunks_exact(width));
            let cotangents =
                hidden_cotangents.chunks_exact(width).zip(cell_cotangents.chunks_exact_mut(width));
            for ((gates, (before, cell)), (dh, dc)) in
                gates.chunks_exact_mut(GATES * width).zip(cells).zip(cotangents)
            {
                let (input, rest) = gates.split_at_mut(width);
                let (forget, rest) = rest.split_at_mut(width);
                let (candidate, output) = rest.split_at_mut(width);
                let (output, before, cell) = (&mut output[..width], &before[..width], &cell[..width]);
                let (dh, dc) = (&dh[..width], &mut dc[..width]);
                for at in 0..width {
                    let (i, f, g, o) = (input[at], forget[at], candidate[at], output[at]);
                    let tanh = cell[at].tanh();
                    let through = dc[at] + dh[at] * o * (T::ONE - tanh * tanh);
                    output[at] = dh[at] * tanh * o * (T::ONE - o);
                    input[at] = through * g * i * (T::ONE - i);
                    forget[at] = through * before[at] * f * (T::ONE - f);
                    candidate[at] = through * i * (T::ONE - g * g);
                    dc[at] = through * f;
                }
            }
        },
    );
}

/// The transpose of row-major `values` with rows of `width`.
fn transpose<T: Real>(values: &[T], width: usize, transposed: &mut Vec<T>) {
    let rows = values.len() / width;
    transposed.resize(values.len(), T::ZERO);
    for (column, target) in transposed.chunks_exact_mut(rows).enumerate() {
        let source = values.iter().skip(column).step_by(width);
        target.iter_mut().zip(source).for_each(|(target, value)| *target = *value);
    }
}

#[cfg(test)]
#[path = "lstm_tests.rs"]
mod tests;
