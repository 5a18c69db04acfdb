use super::*;
use crate::math::nn::check::{dot, gradient_error, normal};

const WIDTHS: [usize; 4] = [5, 9, 7, 3];

/// A network, parameters with biases that are not zero, and inputs.
fn example(widths: &[usize], batch: usize) -> (Mlp, Vec<f64>, Vec<f64>) {
    let mlp = Mlp::new(widths);
    let mut parameters: Vec<f64> =
        mlp.initial_parameters(1.0, Seed::new(1)).into_iter().map(f64::from).collect();
    for layer in mlp.layout() {
        parameters[layer.bias].iter_mut().zip(normal(layer.outputs, "bias")).for_each(|(b, n)| *b = 0.3 * n);
    }
    let inputs = normal(batch * mlp.input_width(), "inputs");
    (mlp, parameters, inputs)
}

/// The outputs by the definition, one number at a time.
fn plain(mlp: &Mlp, parameters: &[f64], inputs: &[f64]) -> Vec<f64> {
    let layout = mlp.layout();
    let outputs = inputs.chunks_exact(mlp.input_width()).flat_map(|row| {
        layout.iter().enumerate().fold(row.to_vec(), |row, (index, layer)| {
            let unit = |j: usize| {
                let weights = parameters[layer.weight.clone()].iter().skip(j).step_by(layer.outputs);
                let sum: f64 = weights.zip(&row).map(|(w, x)| w * x).sum();
                let sum = sum + parameters[layer.bias.start + j];
                if index + 1 < layout.len() { sum.tanh() } else { sum }
            };
            (0..layer.outputs).map(unit).collect()
        })
    });
    outputs.collect()
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn forward_equals_the_definition_whatever_the_blocks() {
    let mut tape = Tape::default();
    for batch in [2000, 1, 2, 6, 7, 249, 250, 251, 0] {
        let (mlp, parameters, inputs) = example(&WIDTHS, batch);
        let outputs = mlp.forward(&parameters, &inputs, &mut tape);
        assert!(largest_difference(outputs, &plain(&mlp, &parameters, &inputs)) < 1e-13, "batch {batch}");
    }
}

#[test]
fn few_rows_equal_many_at_all_widths() {
    let mut tape = Tape::default();
    for width in [1, 3, 4, 21, 64, 100, 149] {
        let (mlp, parameters, inputs) = example(&[5, width, 2], 3);
        let outputs = mlp.forward(&parameters, &inputs, &mut tape);
        assert!(largest_difference(outputs, &plain(&mlp, &parameters, &inputs)) < 1e-13, "width {width}");
    }
}

#[test]
fn derivatives_do_not_depend_on_the_blocks() {
    let (mlp, parameters, inputs) = example(&WIDTHS, 2000);
    let cotangents = normal(2000 * 3, "cotangents");
    let direction = normal(parameters.len(), "direction");
    let (mut whole, mut tape) = (vec![0.0; parameters.len()], Tape::default());
    mlp.forward(&parameters, &inputs, &mut tape);
    mlp.vjp(&parameters, &inputs, &mut tape, &cotangents, &mut whole);
    let tangents = mlp.jvp(&parameters, &inputs, &mut tape, &direction).to_vec();
    for rows in [1, 249, 250, 251] {
        let (mut pieces, mut tape, mut row) = (vec![0.0; parameters.len()], Tape::default(), 0);
        for (inputs, cotangents) in inputs.chunks(rows * 5).zip(cotangents.chunks(rows * 3)) {
            mlp.forward(&parameters, inputs, &mut tape);
            mlp.vjp(&parameters, inputs, &mut tape, cotangents, &mut pieces);
            let piece = mlp.jvp(&parameters, inputs, &mut tape, &direction);
            assert!(largest_difference(piece, &tangents[row..row + piece.len()]) < 1e-12, "pieces of {rows}");
            row += piece.len();
        }
        assert!(largest_difference(&pieces, &whole) < 1e-10, "pieces of {rows}");
    }
}

#[test]
fn vjp_passes_finite_differences() {
    for widths in [&WIDTHS[..], &[4, 3], &[3, 6, 1]] {
        let (mlp, parameters, inputs) = example(widths, 11);
        let cotangents = normal(11 * mlp.output_width(), "cotangents");
        let (mut gradient, mut tape) = (vec![0.0; parameters.len()], Tape::default());
        mlp.forward(&parameters, &inputs, &mut tape);
        mlp.vjp(&parameters, &inputs, &mut tape, &cotangents, &mut gradient);
        let weighted = |p: &[f64]| dot(&cotangents, mlp.forward(p, &inputs, &mut tape));
        let error = gradient_error(weighted, &parameters, &gradient);
        assert!(error < 4e-10, "{widths:?}: {error:e}");
    }
}

#[test]
fn the_gradient_with_respect_to_the_inputs_passes_finite_differences() {
    for (widths, batch) in [(&WIDTHS[..], 11), (&[4, 3], 7), (&[3, 6, 1], 260)] {
        let (mlp, parameters, inputs) = example(widths, batch);
        let cotangents = normal(batch * mlp.output_width(), "cotangents");
        let (mut gradient, mut tape) = (vec![0.0; parameters.len()], Tape::default());
        let (mut plain, mut through) = (gradient.clone(), vec![f64::NAN; inputs.len()]);
        mlp.forward(&parameters, &inputs, &mut tape);
        mlp.vjp(&parameters, &inputs, &mut tape, &cotangents, &mut plain);
        mlp.vjp_through(&parameters, &inputs, &mut tape, &cotangents, &mut gradient, &mut through);
        assert_eq!(gradient, plain);
        let weighted = |x: &[f64]| dot(&cotangents, mlp.forward(&parameters, x, &mut tape));
        let error = gradient_error(weighted, &inputs, &through);
        assert!(error < 4e-10, "{widths:?}: {error:e}");
    }
}

#[test]
fn vjp_adds_to_the_gradient() {
    let (mlp, parameters, inputs) = example(&WIDTHS, 4);
    let (mut once, mut tape) = (vec![0.0; parameters.len()], Tape::default());
    mlp.forward(&parameters, &inputs, &mut tape);
    mlp.vjp(&parameters, &inputs, &mut tape, &[1.0; 12], &mut once);
    let mut twice = once.clone();
    mlp.vjp(&parameters, &inputs, &mut tape, &[1.0; 12], &mut twice);
    once.iter_mut().for_each(|value| *value *= 2.0);
    assert!(largest_difference(&once, &twice) < 1e-12);
}

#[test]
fn jvp_passes_finite_differences() {
    let (mlp, parameters, inputs) = example(&WIDTHS, 11);
    let direction = normal(parameters.len(), "direction");
    let mut tape = Tape::default();
    mlp.forward(&parameters, &inputs, &mut tape);
    let tangents = mlp.jvp(&parameters, &inputs, &mut tape, &direction).to_vec();
    // As functions of how far the parameters move along the direction.
    for (output, tangent) in tangents.iter().enumerate() {
        let moved = |s: &[f64]| {
            let point: Vec<f64> =
                parameters.iter().zip(&direction).map(|(p, d)| p + 0.1 * s[0] * d).collect();
            mlp.forward(&point, &inputs, &mut tape)[output]
        };
        let error = gradient_error(moved, &[0.0], &[0.1 * tangent]);
        assert!(error < 4e-10, "output {output}: {error:e}");
    }
}

#[test]
fn vjp_is_the_adjoint_of_jvp() {
    let (mlp, parameters, inputs) = example(&[55, 64, 64, 21], 300);
    let direction = normal(parameters.len(), "direction");
    let cotangents = normal(300 * 21, "cotangents");
    let (mut gradient, mut tape) = (vec![0.0; parameters.len()], Tape::default());
    mlp.forward(&parameters, &inputs, &mut tape);
    mlp.vjp(&parameters, &inputs, &mut tape, &cotangents, &mut gradient);
    let forward = dot(mlp.jvp(&parameters, &inputs, &mut tape, &direction), &cotangents);
    let backward = dot(&gradient, &direction);
    assert!((forward - backward).abs() < 1e-11 * forward.abs(), "{forward} {backward}");
}

#[test]
fn f32_agrees_with_f64() {
    let narrow = |values: &[f64]| values.iter().map(|value| *value as f32).collect::<Vec<f32>>();
    let widen = |values: &[f32]| values.iter().map(|value| f64::from(*value)).collect::<Vec<f64>>();
    for batch in [1, 260] {
        let (mlp, parameters, inputs) = example(&[55, 64, 64, 21], batch);
        let (parameters_32, inputs_32) = (narrow(&parameters), narrow(&inputs));
        let cotangents = normal(batch * 21, "cotangents");
        let (mut tape, mut tape_32) = (Tape::default(), Tape::default());
        let (mut gradient, mut gradient_32) = (vec![0.0; parameters.len()], vec![0.0; parameters.len()]);
        let outputs = mlp.forward(&parameters, &inputs, &mut tape);
        let outputs_32 = widen(mlp.forward(&parameters_32, &inputs_32, &mut tape_32));
        assert!(largest_difference(outputs, &outputs_32) < 2e-5);
        mlp.vjp(&parameters, &inputs, &mut tape, &cotangents, &mut gradient);
        mlp.vjp(&parameters_32, &inputs_32, &mut tape_32, &narrow(&cotangents), &mut gradient_32);
        let scale = gradient.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        assert!(largest_difference(&gradient, &widen(&gradient_32)) < 1e-5 * scale);
    }
}

#[test]
fn layout_covers_the_parameters_without_a_gap() {
    let mlp = Mlp::new(&WIDTHS);
    let mut end = 0;
    for layer in mlp.layout() {
        assert_eq!((layer.weight.start, layer.weight.end), (end, layer.bias.start));
        assert_eq!(layer.weight.len(), layer.inputs * layer.outputs);
        assert_eq!(layer.bias.len(), layer.outputs);
        end = layer.bias.end;
    }
    assert_eq!(end, mlp.parameter_count());
    assert_eq!(mlp.parameter_count(), 5 * 9 + 9 + 9 * 7 + 7 + 7 * 3 + 3);
}

#[test]
fn initial_parameters_have_the_spread_of_glorot_and_a_gain() {
    let mlp = Mlp::new(&[100, 200, 50]);
    let parameters = mlp.initial_parameters(0.01, Seed::new(2));
    assert_eq!(parameters, mlp.initial_parameters(0.01, Seed::new(2)));
    assert_ne!(parameters, mlp.initial_parameters(0.01, Seed::new(3)));
    let layout = mlp.layout();
    for (layer, gain) in layout.iter().zip([1.0, 0.01]) {
        let weights = &parameters[layer.weight.clone()];
        let variance = weights.iter().map(|w| f64::from(*w).powi(2)).sum::<f64>() / weights.len() as f64;
        let wanted = gain * gain * 2.0 / (layer.inputs + layer.outputs) as f64;
        assert!((variance / wanted - 1.0).abs() < 0.05, "{variance} {wanted}");
        assert!(parameters[layer.bias.clone()].iter().all(|b| *b == 0.0));
    }
    let silent = mlp.initial_parameters(0.0, Seed::new(2));
    assert!(mlp.forward(&silent, &[1.0; 100], &mut Tape::default()).iter().all(|y| *y == 0.0));
}

#[test]
fn nan_comes_out_as_nan() {
    let (mlp, parameters, _) = example(&WIDTHS, 1);
    let parameters: Vec<f32> = parameters.iter().map(|p| *p as f32).collect();
    for rows in [1, 20] {
        let mut tape = Tape::default();
        let outputs = mlp.forward(&parameters, &vec![f32::NAN; rows * 5], &mut tape);
        assert!(outputs.iter().all(|y| y.is_nan()));
    }
}

#[test]
fn is_written_as_its_widths_and_refuses_impossible_ones() {
    let mlp = Mlp::new(&WIDTHS);
    let text = serde_json::to_string(&mlp).unwrap();
    assert_eq!(text, "[5,9,7,3]");
    assert_eq!(serde_json::from_str::<Mlp>(&text).unwrap(), mlp);
    for text in ["[]", "[3]", "[3,0,1]"] {
        let message = serde_json::from_str::<Mlp>(text).unwrap_err().to_string();
        assert!(message.contains("at least two widths"), "{message}");
    }
}
