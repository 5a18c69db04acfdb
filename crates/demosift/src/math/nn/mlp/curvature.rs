//! The R-operator (Pearlmutter 1994): how the gradient changes as the parameters move along a direction.
//!
//! It is the forward pass and the backward pass of a perceptron, each differentiated once along the direction, and so
//! gives a product with a Hessian for about the price of two gradients, and exactly.

use super::{Mlp, Tape, blocks, of_rows};
use crate::math::nn::Real;
use crate::math::nn::elementwise::{add_to, vectorized};
use crate::math::nn::product::{Matrix, Target, product};
use std::ops::Range;

/// Work space of one block: ḣ of each hidden layer, and the cotangents with their tangents on the way down.
#[derive(Default)]
struct Work<T> {
    hidden_tangents: Vec<Vec<T>>,
    delta: Vec<T>,
    delta_tangents: Vec<T>,
    next: Vec<T>,
    next_tangents: Vec<T>,
}

impl Mlp {
    /// Adds ∂/∂ε J(θ + εv)ᵀ (c + εċ) at ε = 0 to `gradient_tangents` `[parameter_count]`: with c the gradient of a loss
    /// with respect to the outputs and ċ how it changes along v, this is the loss's Hessian times v.
    ///
    /// θ and v are `[parameter_count]`; c and ċ are `[batch, out]`, and what ċ needs to know of the outputs is what
    /// [`Mlp::jvp`] says.
    /// `forward` must have run on this tape with these parameters and inputs.
    ///
    /// # Panics
    /// If a length does not fit: a bug of the caller.
    pub fn vjp_tangents<T: Real>(
        &self,
        [parameters, direction]: [&[T]; 2],
        inputs: &[T],
        tape: &mut Tape<T>,
        [cotangents, cotangent_tangents]: [&[T]; 2],
        gradient_tangents: &mut [T],
    ) {
        let batch = self.check_tape(parameters, inputs, tape);
        let outputs = batch * self.output_width();
        assert_eq!(direction.len(), parameters.len(), "length of the direction");
        assert_eq!(cotangents.len(), outputs, "cotangents of the outputs");
        assert_eq!(cotangent_tangents.len(), outputs, "tangents of the cotangents");
        assert_eq!(gradient_tangents.len(), parameters.len(), "length of the gradient's tangents");
        let mut work =
            Work { hidden_tangents: vec![Vec::new(); self.layers().saturating_sub(1)], ..Work::default() };
        for rows in blocks(batch) {
            for (index, kept) in work.hidden_tangents.iter_mut().enumerate() {
                self.layer_tangents(index, &rows, [parameters, direction], inputs, tape);
                kept.clone_from(&tape.current);
            }
            for (target, source) in
                [(&mut work.delta, cotangents), (&mut work.delta_tangents, cotangent_tangents)]
            {
                target.clear();
                target.extend_from_slice(of_rows(source, &rows, self.output_width()));
            }
            for index in (0..self.layers()).rev() {
                let input = match index {
                    0 => of_rows(inputs, &rows, self.input_width()),
                    _ => {
                        let start = self.activation_start(index - 1, batch);
                        of_rows(&tape.activations[start..], &rows, self.layer(index).inputs)
                    }
                };
                let network = [parameters, direction];
                self.layer_backward_tangents(index, &rows, input, network, &mut work, gradient_tangents);
            }
        }
    }

    /// One block of one layer, backward, with δ and its tangents δ̇ in the work space:
    /// ∂Ẇ += ḣ₋₁ᵀ δ + h₋₁ᵀ δ̇, ∂ḃ += Σ δ̇, and with e = δ Wᵀ and ė = δ̇ Wᵀ + δ Ẇᵀ below:
    /// δ₋₁ = e (1 − h₋₁²), δ̇₋₁ = ė (1 − h₋₁²) − 2 e h₋₁ ḣ₋₁.
    fn layer_backward_tangents<T: Real>(
        &self,
        index: usize,
        rows: &Range<usize>,
        input: &[T],
        [parameters, direction]: [&[T]; 2],
        work: &mut Work<T>,
        gradient_tangents: &mut [T],
    ) {
        let layer = self.layer(index);
        let Work { hidden_tangents, delta, delta_tangents, next, next_tangents } = work;
        let delta_matrix = Matrix::new(delta, rows.len(), layer.outputs);
        let tangent_matrix = Matrix::new(delta_tangents, rows.len(), layer.outputs);
        let transposed = |values| Matrix::new(values, rows.len(), layer.inputs).transposed();
        let weight_tangents = &mut gradient_tangents[layer.weight.clone()];
        product(transposed(input), tangent_matrix, weight_tangents, Target::Add);
        if index > 0 {
            product(transposed(&hidden_tangents[index - 1]), delta_matrix, weight_tangents, Target::Add);
        }
        let bias_tangents = &mut gradient_tangents[layer.bias];
        vectorized(
            #[inline(always)]
            || delta_tangents.chunks_exact(bias_tangents.len()).for_each(|row| add_to(bias_tangents, row)),
        );
        if index == 0 {
            return;
        }
        let weight = |values| Matrix::new(values, layer.inputs, layer.outputs).transposed();
        next.resize(rows.len() * layer.inputs, T::ZERO);
        next_tangents.resize(rows.len() * layer.inputs, T::ZERO);
        product(delta_matrix, weight(&parameters[layer.weight.clone()]), next, Target::Overwrite);
        product(tangent_matrix, weight(&parameters[layer.weight.clone()]), next_tangents, Target::Overwrite);
        product(delta_matrix, weight(&direction[layer.weight]), next_tangents, Target::Add);
        let tangents = &hidden_tangents[index - 1];
        vectorized(
            #[inline(always)]
            || {
                let values = next.iter_mut().zip(next_tangents.iter_mut());
                for ((e, e_tangent), (h, h_tangent)) in values.zip(input.iter().zip(tangents)) {
                    let slope = T::ONE - *h * *h;
                    *e_tangent = *e_tangent * slope - (*e + *e) * *h * *h_tangent;
                    *e *= slope;
                }
            },
        );
        std::mem::swap(delta, next);
        std::mem::swap(delta_tangents, next_tangents);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basics::seed::Seed;
    use crate::math::nn::check::{dot, gradient_error, normal};

    /// For the loss Σ cotangent · output³ / 3: uᵀHv is the derivative along u of the gradient's part along v.
    #[test]
    fn hessian_products_pass_finite_differences() {
        for (widths, batch) in [(&[5, 9, 7, 3][..], 11), (&[4, 3], 7), (&[3, 6, 1], 260)] {
            let mlp = Mlp::new(widths);
            let parameters: Vec<f64> =
                mlp.initial_parameters(1.0, Seed::new(1)).into_iter().map(f64::from).collect();
            let parameters: Vec<f64> =
                parameters.iter().zip(normal(parameters.len(), "shift")).map(|(p, n)| p + 0.2 * n).collect();
            let (inputs, outputs) = (normal(batch * widths[0], "inputs"), batch * mlp.output_width());
            let (by, direction) = (normal(outputs, "by"), normal(parameters.len(), "direction"));
            let mut tape = Tape::default();
            let slope_along = |at: &[f64], tape: &mut Tape<f64>| {
                let found = mlp.forward(at, &inputs, tape).to_vec();
                let cotangents: Vec<f64> = found.iter().zip(&by).map(|(y, by)| by * y * y).collect();
                let mut gradient = vec![0.0; at.len()];
                mlp.vjp(at, &inputs, tape, &cotangents, &mut gradient);
                (dot(&gradient, &direction), found, cotangents)
            };
            let (_, found, cotangents) = slope_along(&parameters, &mut tape);
            let tangents = mlp.jvp(&parameters, &inputs, &mut tape, &direction).to_vec();
            let changes: Vec<f64> =
                found.iter().zip(&tangents).zip(&by).map(|((y, t), by)| 2.0 * by * y * t).collect();
            let mut product = vec![0.0; parameters.len()];
            mlp.vjp_tangents(
                [&parameters, &direction],
                &inputs,
                &mut tape,
                [&cotangents, &changes],
                &mut product,
            );
            let mut tape = Tape::default();
            let error = gradient_error(|at| slope_along(at, &mut tape).0, &parameters, &product);
            assert!(error < 1e-8, "{widths:?}: {error:e}");
        }
    }
}
