use super::*;
use crate::math::nn::check::{gradient_error, normal};
use crate::math::nn::lstm::Lstm;
use crate::math::nn::mlp::Mlp;
use crate::math::rows::Rows;
use rand_distr::{Distribution, StandardNormal};

const STEPS: usize = 5;

fn fitting() -> PosteriorFitting {
    PosteriorFitting { lstm: 12, dense: 8, readings: STEPS, learning_rate: 1e-2, steps: 400, batch: 48 }
}

/// Trajectories of one observation that keeps to a level with some noise.
fn level(level: f32, noise: f32, count: usize, seed: Seed) -> Sequences {
    let mut rng = seed.into_rng();
    let values = (0..count)
        .flat_map(|_| {
            let drawn: f32 = StandardNormal.sample(&mut rng);
            [level + noise * drawn; STEPS]
        })
        .collect();
    Sequences::read(&Rows::from_flat(values, 1).expect("rows"), &vec![STEPS; count], STEPS, STEPS)
}

#[test]
fn gradient_of_the_posterior_passes_finite_differences() {
    let (pairs, steps, size) = (6, 7, 3);
    let (lstm, head) = (Lstm::new(size, 5), Mlp::new(&[5, 4, 1]));
    let count = lstm.parameter_count() + head.parameter_count();
    let parameters: Vec<f64> = normal(count, "parameters").iter().map(|p| 0.5 * p).collect();
    let encodings = normal(pairs, "encodings");
    let mut workspace = Workspace::default();
    workspace.inputs = normal(steps * 2 * pairs * size, "inputs");
    let mut gradient = vec![0.0; count];
    let share = 1.0 / pairs as f64;
    let mut error_of = |p: &[f64], gradient: &mut [f64]| {
        Posterior::squared_error_and_gradient(&lstm, &head, p, &encodings, &mut workspace, share, gradient)
            * share
    };
    error_of(&parameters, &mut gradient);
    let mut unused = vec![0.0; count];
    let error = gradient_error(|p| error_of(p, &mut unused), &parameters, &gradient);
    assert!(error < 4e-10, "{error:e}");
}

/// On a channel whose mutual information is known: the behavior before is at rest, the one after is moved by c and seen
/// through noise of spread s. With c of variance v no Gaussian posterior can reach more than
/// E[log Q] = −½ ln(2πe v s²/(v + s²)) on fresh pairs, and a fitted one comes close.
#[test]
fn eq_4_the_bound_is_nearly_tight_on_a_channel_that_is_known() {
    const NOISE: f32 = 1.0;
    let mut rng = Seed::new(5).into_rng();
    let encodings: Vec<f32> = (0..400).map(|_| StandardNormal.sample(&mut rng)).collect();
    let play = |name: &str| -> Vec<(Sequences, Sequences)> {
        let seed = |index| Seed::new(1).of(name).at(index);
        let of = |(index, c): (usize, &f32)| {
            (level(0.0, 0.0, 6, seed(index).of("before")), level(*c, NOISE, 6, seed(index).of("after")))
        };
        encodings.iter().enumerate().map(of).collect()
    };
    let (train, held_out) = (play("train"), play("held out"));
    let changes: Vec<Change<'_>> = encodings
        .iter()
        .zip(&train)
        .map(|(encoding, (before, after))| Change { before, after, encoding: *encoding })
        .collect();
    let posterior = Posterior::untrained(1, 12, 8, Seed::new(2));
    let fitting = PosteriorFitting { batch: 400, steps: 300, ..fitting() };
    let mut adam = Adam::new(posterior.parameters().len());
    let fitted = fit(&posterior, &changes, &fitting, &mut adam, Seed::new(3)).expect("finite numbers");
    let log_q = |posterior: &Posterior| {
        let of = |(c, (before, after)): (&f32, &(Sequences, Sequences))| {
            let rewards = information_rewards(posterior, before, after, *c);
            rewards.iter().sum::<f64>() / rewards.len() as f64
        };
        encodings.iter().zip(&held_out).map(of).sum::<f64>() / encodings.len() as f64
    };
    let variance = encodings.iter().map(|c| f64::from(*c).powi(2)).sum::<f64>() / encodings.len() as f64;
    let noise = f64::from(NOISE).powi(2);
    let left = variance * noise / (variance + noise);
    let best = -0.5 * (2.0 * std::f64::consts::PI * std::f64::consts::E * left).ln();
    let (ignorant, informed) = (log_q(&posterior), log_q(&fitted));
    assert!(ignorant < best - 0.25, "{ignorant} knows nothing, {best} is the best");
    assert!((best - 0.06..best + 0.04).contains(&informed), "{informed}, the best is {best}");
}

/// Pair by pair from the definition; and a trajectory whose change tells the demonstration better is paid more.
#[test]
fn eq_5_the_reward_is_the_log_density_of_held_out_pairs() {
    let levels = [-1.0, 0.0, 1.0];
    let before = level(0.0, 0.3, 5, Seed::new(1));
    let after: Vec<Sequences> =
        levels.iter().map(|c| level(*c, 0.3, 5, Seed::new(2).at((c + 1.0) as usize))).collect();
    let changes: Vec<Change<'_>> = levels
        .iter()
        .zip(&after)
        .map(|(encoding, after)| Change { before: &before, after, encoding: *encoding })
        .collect();
    let posterior = Posterior::untrained(1, 12, 8, Seed::new(2));
    let mut adam = Adam::new(posterior.parameters().len());
    let fitted = fit(&posterior, &changes, &fitting(), &mut adam, Seed::new(3)).expect("finite numbers");
    // What an update moves a reading by, on the root mean square over all pairs.
    let moved = |at: usize| {
        let squares = after.iter().flat_map(|after| {
            (0..5).map(|k| f64::from(after.get(k)[at] - before.get(k)[at]).powi(2)).collect::<Vec<_>>()
        });
        (squares.sum::<f64>() / 15.0).sqrt()
    };
    let rewards = information_rewards(&fitted, &before, &after[2], 1.0);
    assert_eq!(rewards.len(), 5, "those at the same place are a pair");
    let mut squared_errors = Vec::new();
    for (k, reward) in rewards.iter().enumerate() {
        let half: Vec<f32> =
            (0..STEPS).map(|at| 0.5 * (after[2].get(k)[at] - before.get(k)[at]) / moved(at) as f32).collect();
        let other: Vec<f32> = half.iter().map(|half| -half).collect();
        // The networks on this pair alone.
        let mut workspace = Workspace::default();
        time_major(&[&other, &half], 1, &mut workspace.inputs);
        let mut gradient = vec![0.0; fitted.parameters().len()];
        let (lstm, head) = fitted.networks();
        let error = Posterior::squared_error_and_gradient(
            lstm,
            head,
            fitted.parameters(),
            &[1.0],
            &mut workspace,
            1.0,
            &mut gradient,
        );
        let variance = fitted.std() * fitted.std();
        let density =
            (-f64::from(error) / (2.0 * variance)).exp() / (2.0 * std::f64::consts::PI * variance).sqrt();
        assert!((reward - density.ln()).abs() < 1e-4, "{reward}");
        squared_errors.push(f64::from(error));
    }
    let mean = squared_errors.iter().sum::<f64>() / squared_errors.len() as f64;
    assert!((mean_squared_error(&fitted, &before, &after[2], 1.0) - mean).abs() < 1e-5);
    // What changed by 1 is better explained by the demonstration with encoding 1 than by the others.
    let paid = |encoding| information_rewards(&fitted, &before, &after[2], encoding).iter().sum::<f64>();
    assert!(paid(1.0) > paid(0.0) && paid(0.0) > paid(-1.0));
}

/// Where the noise is gone, a change of a thousandth of a unit tells as much as a large one.
#[test]
fn eq_4_small_changes_are_told_apart() {
    let before = level(0.0, 1.0, 20, Seed::new(1));
    let shifted = |by: f32| {
        let values = (0..20).flat_map(|k| before.get(k).iter().map(move |value| value + by)).collect();
        Sequences::read(&Rows::from_flat(values, 1).expect("rows"), &[STEPS; 20], STEPS, STEPS)
    };
    let changed = [-1.0, 0.0, 1.0].map(|encoding| (encoding, shifted(1e-3 * encoding)));
    let changes: Vec<Change<'_>> = changed
        .iter()
        .map(|(encoding, after)| Change { before: &before, after, encoding: *encoding })
        .collect();
    let posterior = Posterior::untrained(1, 12, 8, Seed::new(2));
    let mut adam = Adam::new(posterior.parameters().len());
    let fitting = PosteriorFitting { steps: 100, ..fitting() };
    let fitted = fit(&posterior, &changes, &fitting, &mut adam, Seed::new(3)).expect("finite numbers");
    for (encoding, after) in &changed {
        let error = mean_squared_error(&fitted, &before, after, *encoding);
        assert!(error < 0.05, "{encoding}: {error}");
    }
}

/// −½ (c − μ)² / σ² is a parabola: for μ = 0 and σ = 1 by hand.
#[test]
fn eq_5_a_posterior_that_knows_nothing_pays_the_standard_normal_density() {
    let posterior = Posterior::untrained(1, 4, 3, Seed::new(1));
    let played = level(0.3, 1.0, 3, Seed::new(2));
    let rewards = information_rewards(&posterior, &played, &played, 1.5);
    assert_eq!(rewards.len(), 3);
    assert!(rewards.iter().all(|reward| (reward + 1.125 + 0.918_938_533).abs() < 1e-6), "{rewards:?}");
}

#[test]
fn eq_5_credit_goes_to_the_whole_trajectory_or_to_its_first_action() {
    let (rewards, lengths) = ([-1.0, -2.0, -6.0], [2, 3, 2]);
    let whole = advantages(&rewards, &lengths, Credit::Trajectory);
    let first = advantages(&rewards, &lengths, Credit::FirstAction);
    // Deviations 2, 1, −3 from the mean; mean square 14/3.
    let [a, b, c] = [2.0, 1.0, -3.0].map(|deviation: f64| (deviation / (14.0 / 3.0_f64).sqrt()) as f32);
    let close = |found: &[f32], wanted: &[f32]| {
        assert_eq!(found.len(), wanted.len());
        assert!(found.iter().zip(wanted).all(|(x, y)| (x - y).abs() < 1e-6), "{found:?}");
    };
    close(&whole, &[a, a, b, b, b, c, c]);
    close(&first, &[a, 0.0, b, 0.0, 0.0, c, 0.0]);
    assert_eq!(advantages(&[3.0; 3], &lengths, Credit::Trajectory), [0.0; 7]);
}

#[test]
fn appendix_a_2_the_encoding_is_the_standardized_norm_of_all_observations() {
    use crate::data::demonstration::Demonstration;
    let demo = |values: &[f32]| {
        let observations = Rows::from_flat(values.to_vec(), 2).expect("rows");
        let actions = Rows::from_flat(vec![0.0; values.len() / 2], 1).expect("rows");
        Demonstration::new(observations, actions).expect("valid")
    };
    // Norms 5, 13 and 9 (of 1, 4, 8): mean 9, standard deviation √(32/3).
    let set = DemonstrationSet::new(vec![
        demo(&[3.0, 4.0]),
        demo(&[0.0, 3.0, -12.0, 4.0]),
        demo(&[1.0, 4.0, 0.0, -8.0]),
    ])
    .expect("a valid set");
    let found = encodings(&set);
    let unit = (32.0_f64 / 3.0).sqrt();
    for (found, wanted) in found.iter().zip([-4.0 / unit, 4.0 / unit, 0.0]) {
        assert!((f64::from(*found) - wanted).abs() < 1e-6, "{found} {wanted}");
    }
    let same = DemonstrationSet::new(vec![demo(&[3.0, 4.0]), demo(&[4.0, 3.0])]).expect("a valid set");
    assert_eq!(encodings(&same), [0.0, 0.0]);
}

#[test]
fn table_3_the_posterior_is_one_lstm_of_128_and_two_layers_to_one_number() {
    let fitting = crate::learning::mutual_information::PosteriorFitting { lstm: 128, dense: 64, ..fitting() };
    let posterior = Posterior::untrained(55, fitting.lstm, fitting.dense, Seed::new(1));
    let lstm = (55 + 128 + 1) * 4 * 128;
    assert_eq!(posterior.parameters().len(), lstm + (128 + 1) * 64 + 64 + 1);
}

/// Predicting pairs one by one or many at once is the same.
#[test]
fn predictions_do_not_depend_on_who_else_is_read() {
    let mut posterior = Posterior::untrained(1, 12, 8, Seed::new(2));
    posterior.parameters_mut().iter_mut().enumerate().for_each(|(at, p)| *p += (at as f32).sin() * 0.1);
    let (before, after) = (level(0.0, 1.0, 100, Seed::new(4)), level(0.5, 1.0, 100, Seed::new(5)));
    let one_of = |sequences: &Sequences| {
        let rows = Rows::from_flat(sequences.get(77).to_vec(), 1).expect("rows");
        Sequences::read(&rows, &[STEPS], STEPS, STEPS)
    };
    let (all, alone) =
        (posterior.predict(&before, &after), posterior.predict(&one_of(&before), &one_of(&after)));
    assert_eq!((all.len(), alone.len()), (100, 1));
    assert!((all[77] - alone[0]).abs() < 1e-6 && (all[5] - alone[0]).abs() > 1e-3, "{all:?} {alone:?}");
    assert_eq!(posterior.predict(&before, &before)[3], posterior.predict(&after, &after)[9], "no change");
}
