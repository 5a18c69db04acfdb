//! A policy written as ONNX does in onnxruntime what it does here.

use demosift::basics::seed::{Rng, Seed};
use demosift::data::observation_filter::ObservationFilter;
use demosift::results::artifact::onnx;
use demosift::world::environment::{Specification, Task as _};
use demosift::world::point_mass::PointMass;
use demosift::world::policy::{Player, Policy, PolicyShape};
use rand_distr::{Distribution as _, StandardNormal};

const ROWS: usize = 600;

fn task(observation_size: usize, control_ranges: Vec<[f64; 2]>) -> Specification {
    let (action_size, point_mass) = (control_ranges.len(), PointMass::new());
    Specification { observation_size, action_size, control_ranges, ..point_mass.specification().clone() }
}

fn normal(rng: &mut Rng) -> f32 {
    StandardNormal.sample(rng)
}

/// A policy whose filter shifts and scales by much, and whose actions go beyond what is allowed; `spread` is how far its
/// parameters are from untrained ones.
fn policy(task: &Specification, hidden: &[usize], spread: f32, seed: Seed) -> Policy {
    let mut rng = seed.of("filter").into_rng();
    let mean = (0..task.observation_size).map(|_| 5.0 * normal(&mut rng)).collect();
    // Every third column is constant, so that its spread is the floor.
    let std = (0..task.observation_size).map(|at| if at % 3 == 0 { 0.0 } else { normal(&mut rng).exp() });
    let filter = ObservationFilter::new(mean, std.collect());
    let shape = PolicyShape { hidden: hidden.to_vec(), initial_std: 0.3 };
    let untrained = Policy::untrained(&shape, filter, task.action_size, seed.of("start"));
    let by: Vec<f32> = untrained.parameters().iter().map(|_| spread * normal(&mut rng)).collect();
    untrained.moved(&by)
}

/// Usual observations, some a little beyond the filter's clipping, and some absurd ones.
fn observations(policy: &Policy, seed: Seed) -> Vec<f32> {
    let mut rng = seed.into_rng();
    let filter = policy.filter();
    let columns: Vec<(f32, f32)> = filter.mean().iter().copied().zip(filter.std().iter().copied()).collect();
    let row = |number: usize, rng: &mut Rng| -> Vec<f32> {
        let spread = [1.0, 0.01, 9.0, 1e6][number % 4];
        match number {
            0 => vec![0.0; columns.len()],
            1 => vec![f32::MAX; columns.len()],
            2 => vec![f32::MIN; columns.len()],
            3 => columns.iter().map(|(mean, std)| mean + 10.0 * std).collect(),
            _ => columns.iter().map(|(mean, std)| mean + std * spread * normal(rng)).collect(),
        }
    };
    (0..ROWS).flat_map(|number| row(number, &mut rng)).collect()
}

#[test]
fn onnxruntime_plays_what_we_play() {
    let Some(packages) = crate::onnxruntime::packages() else { return };
    let uneven: Vec<[f64; 2]> = (1..=21).map(|n| [-0.1 * f64::from(n), 40.0 + f64::from(n)]).collect();
    let cases = [
        ("free_throw", task(55, uneven), vec![32, 32], 0.15),
        ("penalty_save", task(91, vec![[-1.0, 1.0]; 8]), vec![64, 64], 0.15),
        ("three_layers", task(4, vec![[-150.0, 150.0]; 2]), vec![7, 9, 5], 0.7),
        ("linear", task(3, vec![[0.0, 1.0]]), vec![], 0.3),
        // Half the range and its middle, rounded to 32 bits, lead beyond most of these.
        (
            "decimals",
            task(4, (1..=40).map(|n| [-0.1 * f64::from(n), 0.07 * f64::from(n)]).collect()),
            vec![5],
            0.7,
        ),
    ];
    for (name, task, hidden, spread) in cases {
        let policy = policy(&task, &hidden, spread, Seed::new(1).of(name));
        let observations = observations(&policy, Seed::new(2).of(name));
        let [actions, controls] =
            crate::onnxruntime::played(&packages, name, &onnx::write_policy(&policy, &task), &observations);
        let (mut worst, mut clipped, mut player) = (0.0_f32, 0, Player::new(&policy));
        let mut mean = vec![0.0; task.action_size];
        for (row, (observation, (actions, controls))) in observations
            .chunks(task.observation_size)
            .zip(actions.chunks(task.action_size).zip(controls.chunks(task.action_size)))
            .enumerate()
        {
            player.mean(observation, &mut mean);
            for (column, mean) in mean.iter().enumerate() {
                let action = mean.clamp(-1.0, 1.0);
                clipped += usize::from(action != *mean);
                worst = worst.max((action - actions[column]).abs());
                let [low, high] = task.control_ranges[column];
                let control = low + (high - low) * 0.5 * (f64::from(action) + 1.0);
                let error = (control - f64::from(controls[column])).abs() / (high - low);
                assert!(error <= 1e-5, "{name}, row {row}: control {control}, found {}", controls[column]);
                let is_within = (low..=high).contains(&f64::from(controls[column]));
                assert!(is_within, "{name}, row {row}: {} is outside [{low}, {high}]", controls[column]);
            }
        }
        eprintln!("{name}: largest difference {worst:e}; {clipped} of {} actions clipped", actions.len());
        assert!(worst <= 1e-5, "{name}: largest difference {worst:e}");
        assert_eq!(actions.len(), ROWS * task.action_size);
        assert!(clipped * 20 > actions.len() && clipped < actions.len(), "{name}: {clipped} clipped");
    }
}

/// What is written depends on the policy and the task alone.
#[test]
fn the_same_policy_is_the_same_bytes() {
    let task = task(5, vec![[-2.0, 1.0]; 3]);
    let write = || onnx::write_policy(&policy(&task, &[4], 0.3, Seed::new(1)), &task);
    assert_eq!(write(), write());
}
