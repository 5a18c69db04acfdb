use super::*;
use crate::math::nn::check::{dot, gradient_error, normal};

const INPUTS: usize = 5;
const HIDDEN: usize = 7;

/// A network, parameters with biases that are not zero, and inputs.
fn example(steps: usize, batch: usize) -> (Lstm, Vec<f64>, Vec<f64>) {
    let lstm = Lstm::new(INPUTS, HIDDEN);
    let parameters = normal(lstm.parameter_count(), "parameters").iter().map(|p| 0.5 * p).collect();
    (lstm, parameters, normal(steps * batch * INPUTS, "inputs"))
}

/// The last hidden state of one sequence by the definition, one number at a time.
fn plain(lstm: &Lstm, parameters: &[f64], sequence: &[&[f64]]) -> Vec<f64> {
    let (LstmLayout { input_weight, hidden_weight, bias }, width) = (lstm.layout(), lstm.hidden_width());
    let (mut hidden, mut cell) = (vec![0.0; width], vec![0.0; width]);
    for row in sequence {
        let sum = |gate: usize, unit: usize| -> f64 {
            let column = gate * width + unit;
            let from = |start: usize, values: &[f64]| -> f64 {
                values.iter().enumerate().map(|(k, x)| x * parameters[start + k * 4 * width + column]).sum()
            };
            from(input_weight.start, row)
                + from(hidden_weight.start, &hidden)
                + parameters[bias.start + column]
        };
        let sigmoid = |x: f64| 1.0 / (1.0 + (-x).exp());
        let next: Vec<(f64, f64)> = (0..width)
            .map(|unit| {
                let (i, f, o) = (sigmoid(sum(0, unit)), sigmoid(sum(1, unit)), sigmoid(sum(3, unit)));
                let cell = f * cell[unit] + i * sum(2, unit).tanh();
                (cell, o * cell.tanh())
            })
            .collect();
        (cell, hidden) = next.into_iter().unzip();
    }
    hidden
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn forward_equals_the_definition_whatever_the_tape_held_before() {
    let mut tape = LstmTape::default();
    for (steps, batch) in [(9, 4), (1, 1), (3, 17), (12, 2)] {
        let (lstm, parameters, inputs) = example(steps, batch);
        let found = lstm.forward(&parameters, &inputs, batch, &mut tape);
        for sequence in 0..batch {
            let rows: Vec<&[f64]> =
                (0..steps).map(|step| &inputs[(step * batch + sequence) * INPUTS..][..INPUTS]).collect();
            let wanted = plain(&lstm, &parameters, &rows);
            assert!(largest_difference(&found[sequence * HIDDEN..][..HIDDEN], &wanted) < 1e-13);
        }
    }
}

/// From `tests/references/lstm.py`: PyTorch 2.15 on sines.
#[test]
fn states_and_gradient_equal_those_of_pytorch() {
    const LAST_HIDDEN: [f64; 8] = [
        0.148555558332,
        0.094856343060,
        0.101267457514,
        0.079658511462,
        0.117100096978,
        0.005511879350,
        -0.059760104490,
        0.059381388597,
    ];
    const EVERY_ELEVENTH: [f64; 12] = [
        0.048013795655,
        0.085630773107,
        -0.042355173441,
        0.092022195311,
        -0.168496612015,
        -0.002293450884,
        -0.009722842123,
        0.015793051179,
        -0.023817281755,
        -0.003538620760,
        0.002000451961,
        -0.200842866581,
    ];
    let sines = |count: usize, step: f64, scale: f64| -> Vec<f64> {
        (1..=count).map(|index| scale * (step * index as f64).sin()).collect()
    };
    let (lstm, steps, batch) = (Lstm::new(3, 4), 6, 2);
    let parameters = sines(lstm.parameter_count(), 0.7, 0.9);
    let inputs = sines(steps * batch * 3, 1.3, 1.5);
    let (mut tape, mut gradient) = (LstmTape::default(), vec![0.0; parameters.len()]);
    let hidden = lstm.forward(&parameters, &inputs, batch, &mut tape);
    assert!(largest_difference(hidden, &LAST_HIDDEN) < 1e-11, "{hidden:?}");
    lstm.vjp(&parameters, &inputs, &mut tape, &sines(batch * 4, 0.9, 1.0), &mut gradient);
    let some: Vec<f64> = gradient.iter().step_by(11).copied().collect();
    assert!(largest_difference(&some, &EVERY_ELEVENTH) < 1e-11, "{some:?}");
    assert!((dot(&gradient, &gradient).sqrt() - 0.947032047160).abs() < 1e-11);
}

#[test]
fn vjp_passes_finite_differences() {
    for (steps, batch) in [(9, 4), (1, 3), (25, 1)] {
        let (lstm, parameters, inputs) = example(steps, batch);
        let cotangents = normal(batch * HIDDEN, "cotangents");
        let (mut gradient, mut tape) = (vec![0.0; parameters.len()], LstmTape::default());
        lstm.forward(&parameters, &inputs, batch, &mut tape);
        lstm.vjp(&parameters, &inputs, &mut tape, &cotangents, &mut gradient);
        let weighted = |p: &[f64]| dot(&cotangents, lstm.forward(p, &inputs, batch, &mut tape));
        let error = gradient_error(weighted, &parameters, &gradient);
        assert!(error < 4e-10, "{steps} steps: {error:e}");
    }
}

#[test]
fn vjp_adds_to_the_gradient_and_sequences_do_not_see_each_other() {
    let (steps, batch) = (6, 5);
    let (lstm, parameters, inputs) = example(steps, batch);
    let cotangents = normal(batch * HIDDEN, "cotangents");
    let mut tape = LstmTape::default();
    let mut whole = vec![0.0; parameters.len()];
    lstm.forward(&parameters, &inputs, batch, &mut tape);
    lstm.vjp(&parameters, &inputs, &mut tape, &cotangents, &mut whole);
    let mut pieces = vec![0.0; parameters.len()];
    for (sequence, cotangents) in cotangents.chunks(HIDDEN).enumerate() {
        let alone: Vec<f64> = (0..steps)
            .flat_map(|step| inputs[(step * batch + sequence) * INPUTS..][..INPUTS].to_vec())
            .collect();
        lstm.forward(&parameters, &alone, 1, &mut tape);
        lstm.vjp(&parameters, &alone, &mut tape, cotangents, &mut pieces);
    }
    assert!(largest_difference(&whole, &pieces) < 1e-12);
}

#[test]
#[should_panic(expected = "a forward pass before each backward one")]
fn a_tape_serves_one_backward_pass() {
    let (lstm, parameters, inputs) = example(2, 1);
    let (mut gradient, mut tape) = (vec![0.0; parameters.len()], LstmTape::default());
    lstm.forward(&parameters, &inputs, 1, &mut tape);
    lstm.vjp(&parameters, &inputs, &mut tape, &[1.0; HIDDEN], &mut gradient);
    lstm.vjp(&parameters, &inputs, &mut tape, &[1.0; HIDDEN], &mut gradient);
}

#[test]
fn f32_agrees_with_f64() {
    let narrow = |values: &[f64]| values.iter().map(|value| *value as f32).collect::<Vec<f32>>();
    let widen = |values: &[f32]| values.iter().map(|value| f64::from(*value)).collect::<Vec<f64>>();
    let (lstm, steps, batch) = (Lstm::new(55, 128), 60, 20);
    let parameters = lstm.initial_parameters(Seed::new(1));
    let inputs = normal(steps * batch * 55, "inputs");
    let cotangents = normal(batch * 128, "cotangents");
    let (mut tape, mut tape_32) = (LstmTape::default(), LstmTape::default());
    let (mut gradient, mut gradient_32) = (vec![0.0; parameters.len()], vec![0.0; parameters.len()]);
    let wide = widen(&parameters);
    let states = lstm.forward(&wide, &inputs, batch, &mut tape);
    let states_32 = lstm.forward(&parameters, &narrow(&inputs), batch, &mut tape_32);
    assert!(largest_difference(states, &widen(states_32)) < 1e-5);
    lstm.vjp(&wide, &inputs, &mut tape, &cotangents, &mut gradient);
    lstm.vjp(&parameters, &narrow(&inputs), &mut tape_32, &narrow(&cotangents), &mut gradient_32);
    let scale = gradient.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    assert!(largest_difference(&gradient, &widen(&gradient_32)) < 1e-5 * scale);
}

#[test]
fn layout_covers_the_parameters_and_the_forget_gate_starts_open() {
    let lstm = Lstm::new(55, 128);
    let LstmLayout { input_weight, hidden_weight, bias } = lstm.layout();
    assert_eq!((input_weight.len(), hidden_weight.len(), bias.len()), (55 * 512, 128 * 512, 512));
    assert_eq!((input_weight.start, input_weight.end), (0, hidden_weight.start));
    assert_eq!((hidden_weight.end, bias.end), (bias.start, lstm.parameter_count()));
    let parameters = lstm.initial_parameters(Seed::new(2));
    assert_ne!(parameters, lstm.initial_parameters(Seed::new(3)));
    let weights = &parameters[..bias.start];
    let variance = weights.iter().map(|w| f64::from(*w).powi(2)).sum::<f64>() / weights.len() as f64;
    assert!((variance * 183.0 - 1.0).abs() < 0.02, "{variance}");
    let bias = &parameters[bias];
    assert!(bias.iter().enumerate().all(|(at, b)| *b == if (128..256).contains(&at) { 1.0 } else { 0.0 }));
}

#[test]
fn nan_comes_out_as_nan() {
    let (lstm, parameters, mut inputs) = example(4, 2);
    inputs[INPUTS + 2] = f64::NAN;
    let mut tape = LstmTape::default();
    let states = lstm.forward(&parameters, &inputs, 2, &mut tape);
    assert!(states[..HIDDEN].iter().all(|h| h.is_finite()) && states[HIDDEN..].iter().all(|h| h.is_nan()));
}
