//! HalfCheetah steps as Gymnasium's does.

use demosift::basics::seed::Seed;
use demosift::math::rows::Rows;
use demosift::world::environment::{EnvVariant, Environment, Task};
use demosift_mujoco::registry;
use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

fn to_f32(values: &[f64]) -> Vec<f32> {
    values.iter().map(|value| *value as f32).collect()
}

/// The reference was made by Gymnasium with the same version of MuJoCo (see the script beside it), so the
/// f64 states agree to the last bit, and so do observation and reward once rounded to f32.
#[test]
fn two_hundred_steps_agree_with_gymnasium_to_the_last_bit() {
    let reference: Value = serde_json::from_str(include_str!("references/half_cheetah.json")).unwrap();
    let task = registry::load("half_cheetah").unwrap();
    let mut environment = task.mujoco_environment().unwrap();
    environment.set_state(&numbers(&reference["qpos"]), &numbers(&reference["qvel"])).unwrap();
    let (mut observation, mut measurements) = ([0.0; 17], [0.0; 4]);
    let steps = reference["steps"].as_array().unwrap();
    assert_eq!(steps.len(), 200);
    let (mut before, mut within) = (numbers(&reference["qpos"])[0], 0);
    for (at, step) in steps.iter().enumerate() {
        let action = to_f32(&numbers(&step["action"]));
        let outcome = environment.step(&action, &mut observation, &mut measurements);
        assert_eq!(environment.qpos(), numbers(&step["qpos"]), "qpos at step {at}");
        assert_eq!(environment.qvel(), numbers(&step["qvel"]), "qvel at step {at}");
        assert_eq!(&observation[..], to_f32(&numbers(&step["observation"])), "observation at step {at}");
        let [effort, reward, speed, x] = measurements;
        assert_eq!(x, numbers(&step["qpos"])[0] as f32, "x at step {at}");
        let squares = action.iter().map(|a| f64::from(a.clamp(-1.0, 1.0)).powi(2));
        assert!((f64::from(effort) - squares.sum::<f64>()).abs() < 1e-6, "effort at step {at}");
        assert!(
            (f64::from(speed) - (numbers(&step["qpos"])[0] - before) / 0.05).abs() < 1e-6,
            "speed at step {at}"
        );
        before = numbers(&step["qpos"])[0];
        // Gymnasium counts actions as given, and the measurement as clipped; four of five are within the range.
        if action.iter().all(|value| value.abs() <= 1.0) {
            assert!(
                (f64::from(reward) - step["reward"].as_f64().unwrap()).abs() < 1e-6,
                "reward at step {at}"
            );
            within += 1;
        }
        assert_eq!(outcome.task_reward, step["reward"].as_f64().unwrap() as f32, "reward at step {at}");
        assert!(!outcome.terminated);
    }
    assert!(within >= 160, "{within}");
}

#[test]
fn sizes_and_heuristic_are_as_declared() {
    let task = registry::load("half_cheetah").unwrap();
    let specification = task.specification();
    assert_eq!((specification.observation_size, specification.action_size), (17, 6));
    assert_eq!(
        (specification.horizon, specification.measurements.join(" ").as_str()),
        (1000, "effort reward speed x")
    );
    assert_eq!(specification.control_step_secs, 0.05);
    assert_eq!(specification.variants, ["default"]);
    let rows = [[9.0, 9.0, 9.0, 1.0], [0.5, 0.25, 0.0, 7.0], [0.5, -1.0, 0.0, 3.5]].concat();
    let rows = Rows::from_flat(rows, 4).unwrap();
    assert_eq!(task.true_return(&rows), Some(-0.75), "of the steps, not of the reset");
    assert_eq!((task.heuristic().score(&rows), task.heuristic().unit()), (2.5, "m"));
    assert_eq!(task.succeeded(&rows), None);
}

/// Gymnasium: qpos evenly within ±0.1 of the initial pose, qvel normal with deviation 0.1.
#[test]
fn reset_noise_is_that_of_gymnasium() {
    let task = registry::load("half_cheetah").unwrap();
    let mut environment = task.mujoco_environment().unwrap();
    let (mut positions, mut velocities) = (Vec::new(), Vec::new());
    for episode in 0..2000 {
        environment.reset(EnvVariant(0), Seed::new(3).at(episode), &mut [0.0; 17], &mut [0.0; 4]);
        positions.extend_from_slice(environment.qpos());
        velocities.extend_from_slice(environment.qvel());
    }
    let spread = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (mean, (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt())
    };
    let (mean, deviation) = spread(&positions);
    assert!(positions.iter().all(|value| value.abs() <= 0.1));
    assert!(mean.abs() < 0.002 && (deviation - 0.1 / 3_f64.sqrt()).abs() < 0.001, "{mean} {deviation}");
    let (mean, deviation) = spread(&velocities);
    assert!(mean.abs() < 0.003 && (deviation - 0.1).abs() < 0.002, "{mean} {deviation}");
}

/// A public set recorded with another engine, years ago: from each recorded state, the recorded action leads close to the
/// recorded next state. Another order of observations or actions, or another frame skip, would be off by several.
#[test]
fn recorded_episodes_replay_up_to_the_differences_of_the_old_engine() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../shared/data/half_cheetah_noisy/half_cheetah_noisy.hdf5"
    );
    let Ok(file) = hdf5_pure::File::open(path) else { return eprintln!("skipped: {path} is not here") };
    let read = |name: &str| file.dataset(name).unwrap().read_f64().unwrap();
    let (observations, actions) = (read("observations"), read("actions"));
    let task = registry::load("half_cheetah").unwrap();
    let mut environment = task.mujoco_environment().unwrap();
    for episode in 0..10 {
        let (mut positions, mut velocities) = (Vec::new(), Vec::new());
        for row in episode * 1000..episode * 1000 + 200 {
            let (now, next) = observations[row * 17..(row + 2) * 17].split_at(17);
            let qpos: Vec<f64> = [0.0].into_iter().chain(now[..8].iter().copied()).collect();
            environment.set_state(&qpos, &now[8..]).unwrap();
            let mut observation = [0.0; 17];
            environment.step(&to_f32(&actions[row * 6..row * 6 + 6]), &mut observation, &mut [0.0; 4]);
            let off: Vec<f64> =
                observation.iter().zip(next).map(|(a, b)| (f64::from(*a) - b).abs()).collect();
            positions.push(off[..8].iter().copied().fold(0.0, f64::max));
            velocities.push(off[8..].iter().copied().fold(0.0, f64::max));
        }
        let median = |values: &mut Vec<f64>| {
            values.sort_by(f64::total_cmp);
            values[values.len() / 2]
        };
        let (positions, velocities) = (median(&mut positions), median(&mut velocities));
        eprintln!(
            "episode {episode}: median over steps of the largest deviation: {positions:.4} rad or m, {velocities:.3} a second"
        );
        assert!(positions < 0.02 && velocities < 0.5, "episode {episode}: {positions} {velocities}");
    }
}
