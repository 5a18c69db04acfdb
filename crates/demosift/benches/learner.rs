//! What a learner's update costs, beside the bare matrix products in it, measured in the same run.
//!
//! `cargo bench -p demosift --bench learner`

#![allow(missing_docs, clippy::print_stdout, clippy::unwrap_used)]

use demosift::nn::{Adam, Mlp, Tape, gaussian, sigmoid_in_place};
use demosift::rows::Rows;
use demosift::seed::Seed;
use demosift::solve;
use gemm::Parallelism;
use std::hint::black_box;
use std::time::Instant;

const BATCH: usize = 2000;
const BLOCK: usize = 250;
const POLICY: [usize; 4] = [55, 64, 64, 21];
const DISCRIMINATOR: [usize; 4] = [76, 100, 100, 1];
const PAIRS: usize = 4000;

fn main() {
    println!(
        "{:44} {:>10} {:>10} {:>10} {:>10} {:>8}",
        "f32, one thread", "median", "least", "goal", "products", "ratio"
    );
    println!("(products: least of the bare matrix products alone; ratio: least / products)");
    peak();
    policy_gradient();
    fisher_vector_product();
    discriminator_step();
    observations(1, 0.0012);
    observations(32, 0.0042);
    ridge_regression();
}

/// Milliseconds of each of many runs, sorted.
fn measure(mut run: impl FnMut()) -> Vec<f64> {
    const BUDGET_SECS: f64 = 1.0;
    let start = Instant::now();
    let mut times = Vec::new();
    while start.elapsed().as_secs_f64() < BUDGET_SECS || times.len() < 10 {
        // Short work is timed in bundles, or the clock itself would be measured.
        let bundle = if times.last().is_some_and(|ms: &f64| *ms < 0.02) { 200 } else { 1 };
        let before = Instant::now();
        (0..bundle).for_each(|_| run());
        times.push(before.elapsed().as_secs_f64() * 1e3 / f64::from(bundle));
    }
    times.sort_by(f64::total_cmp);
    times
}

fn report(what: &str, goal_ms: f64, times: &[f64], products: &[f64]) {
    let (median, least) = (times[times.len() / 2], times[0]);
    let bare = products.first().copied().unwrap_or(f64::NAN);
    println!("{what:44} {median:>10.4} {least:>10.4} {goal_ms:>10.4} {bare:>10.4} {:>8.2}", least / bare);
}

/// A product of these sizes: rows and columns of the result, inner size; whether left or right is transposed.
struct Shape {
    m: usize,
    n: usize,
    k: usize,
    left_transposed: bool,
    right_transposed: bool,
}

/// The products of one block of rows: forward, backward, tangents.
fn shapes(widths: &[usize], rows: usize, [forward, backward, tangents]: [bool; 3]) -> Vec<Shape> {
    let mut shapes = Vec::new();
    for (index, pair) in widths.windows(2).enumerate() {
        let (inputs, outputs) = (pair[0], pair[1]);
        let shape =
            |m, n, k, left_transposed, right_transposed| Shape { m, n, k, left_transposed, right_transposed };
        let straight = || shape(rows, outputs, inputs, false, false);
        shapes.extend(forward.then(straight));
        shapes.extend(tangents.then(straight));
        shapes.extend((tangents && index > 0).then(straight));
        shapes.extend(backward.then(|| shape(inputs, outputs, rows, true, false)));
        shapes.extend((backward && index > 0).then(|| shape(rows, inputs, outputs, false, true)));
    }
    shapes
}

/// Milliseconds of the bare products, block after block.
fn bare(widths: &[usize], batch: usize, passes: [bool; 3]) -> Vec<f64> {
    let blocks: Vec<usize> = (0..batch).step_by(BLOCK).map(|start| BLOCK.min(batch - start)).collect();
    let shapes = shapes(widths, blocks[0], passes);
    let values = vec![0.01_f32; BLOCK * 128];
    let mut out = vec![0.0_f32; BLOCK * 128];
    measure(|| {
        for _ in &blocks {
            shapes.iter().for_each(|shape| multiply(shape, &values, &mut out));
        }
        black_box(&out);
    })
}

#[expect(unsafe_code, reason = "the bare product is what the networks are compared with")]
fn multiply(shape: &Shape, values: &[f32], out: &mut [f32]) {
    let Shape { m, n, k, left_transposed, right_transposed } = *shape;
    assert!(m * k <= values.len() && k * n <= values.len() && m * n <= out.len());
    let strides = |rows: usize, columns: usize, transposed| {
        if transposed { (1, rows as isize) } else { (columns as isize, 1) }
    };
    let (left_row, left_column) = strides(m, k, left_transposed);
    let (right_row, right_column) = strides(k, n, right_transposed);
    // SAFETY: the lengths are asserted above, and the strides stay inside m × k, k × n and m × n.
    unsafe {
        gemm::gemm(
            m,
            n,
            k,
            out.as_mut_ptr(),
            1,
            n as isize,
            false,
            values.as_ptr(),
            left_column,
            left_row,
            values.as_ptr(),
            right_column,
            right_row,
            0.0,
            1.0,
            false,
            false,
            false,
            Parallelism::None,
        );
    }
}

/// What the processor gives now: others may be using it, and its clock varies.
fn peak() {
    const SIZE: usize = 384;
    let shape = Shape { m: SIZE, n: SIZE, k: SIZE, left_transposed: false, right_transposed: false };
    let (values, mut out) = (vec![0.01_f32; SIZE * SIZE], vec![0.0_f32; SIZE * SIZE]);
    let times = measure(|| multiply(&shape, &values, black_box(&mut out)));
    let giga = 2.0 * (SIZE as f64).powi(3) * 1e-9;
    println!(
        "a product of {SIZE} by {SIZE}: {:.0} Gflop/s median, {:.0} best",
        giga / (times[times.len() / 2] * 1e-3),
        giga / (times[0] * 1e-3)
    );
}

/// Normal numbers, as they come out of the initialization of a wide network.
fn numbers(len: usize, name: &str) -> Vec<f32> {
    let mut numbers =
        Mlp::new(&[1, len]).initial_parameters((len as f64 / 2.0).sqrt(), Seed::new(1).of(name));
    numbers.truncate(len);
    numbers
}

fn policy_gradient() {
    let mlp = Mlp::new(&POLICY);
    let parameters = mlp.initial_parameters(1.0, Seed::new(0));
    let inputs = numbers(BATCH * POLICY[0], "observations");
    let (actions, weights) = (numbers(BATCH * POLICY[3], "actions"), numbers(BATCH, "advantages"));
    let (log_std, mut log_std_gradient) = ([-0.5_f32; POLICY[3]], [0.0; POLICY[3]]);
    let (mut tape, mut cotangents) = (Tape::default(), Vec::new());
    let mut gradient = vec![0.0_f32; mlp.parameter_count()];
    let times = measure(|| {
        gradient.fill(0.0);
        let means = mlp.forward(&parameters, &inputs, &mut tape);
        gaussian::log_probability_gradient(
            means,
            &log_std,
            &actions,
            &weights,
            &mut cotangents,
            &mut log_std_gradient,
        );
        mlp.vjp(&parameters, &inputs, &mut tape, &cotangents, &mut gradient);
        black_box(&gradient);
    });
    report(
        "policy gradient, 55-64-64-21, 2000 rows",
        0.65,
        &times,
        &bare(&POLICY, BATCH, [true, true, false]),
    );
}

fn fisher_vector_product() {
    let mlp = Mlp::new(&POLICY);
    let parameters = mlp.initial_parameters(1.0, Seed::new(0));
    let inputs = numbers(BATCH * POLICY[0], "observations");
    let direction = numbers(mlp.parameter_count(), "direction");
    let log_std = [-0.5_f32; POLICY[3]];
    let (mut tape, mut cotangents) = (Tape::default(), Vec::new());
    let mut out = vec![0.0_f32; mlp.parameter_count()];
    mlp.forward(&parameters, &inputs, &mut tape);
    let times = measure(|| {
        out.fill(0.0);
        cotangents.clear();
        cotangents.extend_from_slice(mlp.jvp(&parameters, &inputs, &mut tape, &direction));
        gaussian::fisher_metric(&log_std, &mut cotangents, &mut [0.1; POLICY[3]]);
        mlp.vjp(&parameters, &inputs, &mut tape, &cotangents, &mut out);
        black_box(&out);
    });
    report("Fisher-vector product, the same", 0.72, &times, &bare(&POLICY, BATCH, [false, true, true]));
}

fn discriminator_step() {
    let mlp = Mlp::new(&DISCRIMINATOR);
    let mut parameters = mlp.initial_parameters(1.0, Seed::new(0));
    let inputs = numbers(PAIRS * DISCRIMINATOR[0], "pairs");
    let (mut tape, mut cotangents) = (Tape::default(), Vec::new());
    let mut gradient = vec![0.0_f32; mlp.parameter_count()];
    let mut adam = Adam::new(mlp.parameter_count());
    let times = measure(|| {
        gradient.fill(0.0);
        cotangents.clear();
        cotangents.extend_from_slice(mlp.forward(&parameters, &inputs, &mut tape));
        // Of the binary cross-entropy: σ(logit) − label, the mean over the rows; the first half is the agent's.
        sigmoid_in_place(&mut cotangents);
        cotangents[..PAIRS / 2].iter_mut().for_each(|value| *value -= 1.0);
        cotangents.iter_mut().for_each(|value| *value /= PAIRS as f32);
        mlp.vjp(&parameters, &inputs, &mut tape, &cotangents, &mut gradient);
        adam.descend(1e-4, &gradient, &mut parameters);
        black_box(&parameters);
    });
    report(
        "discriminator step, 76-100-100-1, 4000 rows",
        2.35,
        &times,
        &bare(&DISCRIMINATOR, PAIRS, [true, true, false]),
    );
}

fn observations(count: usize, goal_ms: f64) {
    let mlp = Mlp::new(&POLICY);
    let parameters = mlp.initial_parameters(1.0, Seed::new(0));
    let inputs = numbers(count * POLICY[0], "observations");
    let mut tape = Tape::default();
    let times = measure(|| {
        black_box(mlp.forward(&parameters, black_box(&inputs), &mut tape));
    });
    report(
        &format!("means for {count} observation(s)"),
        goal_ms,
        &times,
        &bare(&POLICY, count, [true, false, false]),
    );
}

fn ridge_regression() {
    let features = Rows::from_flat(numbers(BATCH * 115, "features"), 115).unwrap();
    let targets = numbers(BATCH, "targets");
    let times = measure(|| {
        black_box(solve::ridge(&features, &targets, 1e-5).unwrap());
    });
    report("ridge regression, 2000 rows of 115", 3.0, &times, &[]);
}
