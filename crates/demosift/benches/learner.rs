//! What a learner's update costs, beside the bare matrix products in it, measured in the same run.
//!
//! `cargo bench -p demosift --bench learner`

#![allow(missing_docs, clippy::print_stdout, clippy::unwrap_used)]

use demosift::basics::seed::Seed;
use demosift::data::observation_filter::ObservationFilter;
use demosift::learning::advantage::{AdvantageEstimation, Rewarded, advantages};
use demosift::learning::gail::{self, Discriminator, Fitting};
use demosift::learning::trpo::{self, Experience, StepEnd, TrustRegion};
use demosift::math::nn::{Adam, Lstm, LstmTape, Mlp, Tape, gaussian, sigmoid_in_place};
use demosift::math::rows::Rows;
use demosift::math::solve;
use demosift::world::policy::Policy;
use gemm::Parallelism;
use std::hint::black_box;
use std::time::Instant;

const BATCH: usize = 2000;
const BLOCK: usize = 250;
const POLICY: [usize; 4] = [55, 64, 64, 21];
const DISCRIMINATOR: [usize; 4] = [76, 100, 100, 1];
const PAIRS: usize = 4000;

fn main() {
    // The learner works in parallel where it can: one thread, to be compared with the bare products of one thread.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(all);
}

fn all() {
    println!(
        "ms, f32, one thread; known: measured for the same work in plain code, the goal is 1.5 times that;"
    );
    println!("products: the bare matrix products in it; ratios: of the least times");
    println!(
        "{:44} {:>9} {:>9} {:>9} {:>8} {:>9} {:>8}",
        "", "median", "least", "known", "/ known", "products", "/ prod."
    );
    peak();
    policy_gradient();
    fisher_vector_product();
    trpo_step();
    discriminator_step();
    whole_discriminator_step();
    discriminator_fit(60);
    discriminator_fit(1000);
    siamese_lstm(128, 16.0);
    siamese_lstm(256, 50.0);
    advantage_estimation();
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

fn report(what: &str, known_ms: f64, times: &[f64], products: &[f64]) {
    let (median, least) = (times[times.len() / 2], times[0]);
    let bare = products.first().copied().unwrap_or(f64::NAN);
    // What is not known, or has no products, is left out.
    let number = |value: f64, digits: usize| match value.is_finite() {
        true => format!("{value:.digits$}"),
        false => String::new(),
    };
    println!(
        "{what:44} {median:>9.4} {least:>9.4} {:>9} {:>8} {:>9} {:>8}",
        number(known_ms, 4),
        number(least / known_ms, 2),
        number(bare, 4),
        number(least / bare, 2)
    );
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
    bare_in_turn(widths, batch, &[passes])
}

/// The same for several passes, one after the other over the whole batch.
fn bare_in_turn(widths: &[usize], batch: usize, passes: &[[bool; 3]]) -> Vec<f64> {
    let blocks: Vec<usize> = (0..batch).step_by(BLOCK).map(|start| BLOCK.min(batch - start)).collect();
    let shapes: Vec<Shape> = passes
        .iter()
        .flat_map(|passes| blocks.iter().flat_map(|rows| shapes(widths, *rows, *passes)))
        .collect();
    let values = vec![0.01_f32; BLOCK * 128];
    let mut out = vec![0.0_f32; BLOCK * 128];
    measure(|| {
        shapes.iter().for_each(|shape| multiply(shape, &values, &mut out));
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

/// `trpo::step` as a learner calls it: 2000 rows in experiences of 1000.
fn trpo_step() {
    let identity = ObservationFilter::identity(POLICY[0]);
    let mlp = Mlp::new(&POLICY);
    let log_std = [-0.5_f32; POLICY[3]];
    let parameters: Vec<f32> = mlp.initial_parameters(1.0, Seed::new(0)).into_iter().chain(log_std).collect();
    let policy = Policy::from_parts(mlp, parameters, identity);
    let observations = Rows::from_flat(numbers(BATCH * POLICY[0], "observations"), POLICY[0]).unwrap();
    let mut actions = policy.means(&observations);
    let noise = numbers(BATCH * POLICY[3], "noise");
    actions.flat_mut().iter_mut().zip(noise).for_each(|(action, noise)| *action += 0.6 * noise);
    let advantages = numbers(BATCH, "advantages");
    let experiences: Vec<Experience<'_>> = (0..BATCH)
        .step_by(1000)
        .map(|start| Experience {
            policy: &policy,
            observations: &observations.flat()[start * POLICY[0]..(start + 1000) * POLICY[0]],
            actions: &actions.flat()[start * POLICY[3]..(start + 1000) * POLICY[3]],
            advantages: &advantages[start..start + 1000],
            weight: 1000.0 / BATCH as f64,
        })
        .collect();
    let region = TrustRegion::default();
    let step = || trpo::step(&experiences, &region, 1.0).unwrap();
    let found = step();
    assert_eq!(found.end, StepEnd::Moved);
    // A step that was halved has a quarter of the divergence.
    let trials = 1 + (region.max_kl / found.kl).log(4.0).round() as usize;
    let times = measure(|| {
        black_box(step());
    });
    let (forward, backward, product) = ([true, false, false], [false, true, false], [false, true, true]);
    let mut passes = vec![forward, backward];
    passes.extend(vec![product; region.conjugate_gradient_iterations + 1]);
    passes.extend(vec![forward; trials]);
    report("trpo::step, the same", 11.9, &times, &bare_in_turn(&POLICY, BATCH, &passes));
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

fn pairs(count: usize, name: &str) -> Rows {
    Rows::from_flat(numbers(count * DISCRIMINATOR[0], name), DISCRIMINATOR[0]).unwrap()
}

/// The step as a fit makes it, on all pairs.
fn whole_discriminator_step() {
    let start = Discriminator::undecided(&DISCRIMINATOR[1..3], DISCRIMINATOR[0], Seed::new(0));
    let (generated, demonstrated) = (pairs(PAIRS / 2, "generated"), pairs(PAIRS / 2, "demonstrated"));
    let mut adam = Adam::new(start.parameters().len());
    let mut parameters = start.parameters().to_vec();
    let times = measure(|| {
        let (_, gradient) = gail::loss_and_gradient(&start, &[&generated], &[&demonstrated], 0.3);
        adam.descend(1e-4, &gradient, &mut parameters);
        black_box(&parameters);
    });
    let products = bare(&DISCRIMINATOR, PAIRS, [true, true, false]);
    report("gail::loss_and_gradient and Adam, the same", 2.35, &times, &products);
}

/// A fit as an adaptation makes it: 20 steps on 500 pairs of each kind, drawn with replacement.
fn discriminator_fit(demonstrated: usize) {
    const AGENT: usize = 1200;
    let fitting = Fitting { learning_rate: 3e-3, steps: 20, batch: 500, entropy: 0.3, most_told: 1.0 };
    let start = Discriminator::undecided(&DISCRIMINATOR[1..3], DISCRIMINATOR[0], Seed::new(0));
    let (agent, shown) = (pairs(AGENT, "agent"), pairs(demonstrated, "demonstrated"));
    let times = measure(|| {
        let mut adam = Adam::new(start.parameters().len());
        black_box(gail::fit(&start, &[&agent], &[&shown], &fitting, &mut adam, Seed::new(2)).unwrap());
    });
    let passes = vec![[true, true, false]; fitting.steps];
    let products = bare_in_turn(&DISCRIMINATOR, 2 * fitting.batch, &passes);
    report(&format!("gail::fit, 20 x (500 of {AGENT} + 500 of {demonstrated})"), f64::NAN, &times, &products);
}

/// One training step of the posterior's recurrent part: 20 sequences of 200 observations, read and learned from.
fn siamese_lstm(hidden: usize, known_ms: f64) {
    const STEPS: usize = 200;
    const SEQUENCES: usize = 20;
    let lstm = Lstm::new(POLICY[0], hidden);
    let mut parameters = lstm.initial_parameters(Seed::new(0));
    let inputs = numbers(STEPS * SEQUENCES * POLICY[0], "observations");
    let cotangents = numbers(SEQUENCES * hidden, "cotangents");
    let (mut tape, mut adam) = (LstmTape::default(), Adam::new(parameters.len()));
    let mut gradient = vec![0.0_f32; parameters.len()];
    let times = measure(|| {
        gradient.fill(0.0);
        lstm.forward(&parameters, &inputs, SEQUENCES, &mut tape);
        lstm.vjp(&parameters, &inputs, &mut tape, &cotangents, &mut gradient);
        adam.descend(1e-4, &gradient, &mut parameters);
        black_box(&parameters);
    });
    let shape = |m, n, k, left_transposed| Shape { m, n, k, left_transposed, right_transposed: false };
    let all = STEPS * SEQUENCES;
    let mut shapes = vec![
        shape(all, 4 * hidden, POLICY[0], false),
        shape(POLICY[0], 4 * hidden, all, true),
        shape(hidden, 4 * hidden, all - SEQUENCES, true),
    ];
    for _ in 1..STEPS {
        shapes.push(shape(SEQUENCES, 4 * hidden, hidden, false));
        shapes.push(shape(SEQUENCES, hidden, 4 * hidden, false));
    }
    let (values, mut out) = (vec![0.01_f32; all * 4 * hidden], vec![0.0_f32; all * 4 * hidden]);
    let products = measure(|| {
        shapes.iter().for_each(|shape| multiply(shape, &values, &mut out));
        black_box(&out);
    });
    report(
        &format!("LSTM {hidden}, T = {STEPS}, {SEQUENCES} sequences, one step"),
        known_ms,
        &times,
        &products,
    );
}

fn advantage_estimation() {
    let observations = Rows::from_flat(numbers(BATCH * POLICY[0], "observations"), POLICY[0]).unwrap();
    let rewards = numbers(BATCH, "rewards");
    let rewarded = Rewarded { observations: &observations, rewards: &rewards, lengths: &[200; BATCH / 200] };
    let times = measure(|| {
        black_box(advantages(rewarded, &AdvantageEstimation::default()).unwrap());
    });
    report("advantages, 2000 rows of 55", f64::NAN, &times, &[]);
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
