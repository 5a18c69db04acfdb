//! Walker2d steps, and ends, as Gymnasium's does.

use demosift::basics::seed::Seed;
use demosift::math::rows::Rows;
use demosift::world::environment::{EnvVariant, Environment, Task};
use demosift_mujoco::registry;
use serde_json::Value;

/// Two builds of one model differ in their last bits, as lengths here are written shorter: 0.2 for 0.19999999999999996. A
/// wrong number of the model would be off by far more after some steps.
const SAME: f64 = 1e-9;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

fn to_f32(values: &[f64]) -> Vec<f32> {
    values.iter().map(|value| *value as f32).collect()
}

#[track_caller]
fn assert_same(got: &[f64], wanted: &[f64], what: &str) {
    let off = got.iter().zip(wanted).map(|(a, b)| (a - b).abs() / b.abs().max(1.0)).fold(0.0, f64::max);
    assert!(got.len() == wanted.len() && off < SAME, "{what}: off by {off:e}");
}

fn to_f64(values: &[f32]) -> Vec<f64> {
    values.iter().map(|value| f64::from(*value)).collect()
}

/// The reference was made by Gymnasium with the same version of MuJoCo; see the script beside it.
#[test]
fn whole_episodes_agree_with_gymnasium_to_their_ends() {
    let reference: Value = serde_json::from_str(include_str!("references/walker2d.json")).unwrap();
    let task = registry::load("walker2d").unwrap();
    let measured = |name: &str| task.specification().measurement(name).unwrap();
    let mut environment = task.mujoco_environment().unwrap();
    let (mut observation, mut measurements) = ([0.0; 17], [0.0; 7]);
    let episodes = reference["episodes"].as_array().unwrap();
    assert_eq!(episodes.len(), 4);
    let mut clipped = 0;
    for (number, episode) in episodes.iter().enumerate() {
        environment.set_state(&numbers(&episode["qpos"]), &numbers(&episode["qvel"])).unwrap();
        environment.observe(&mut observation, &mut measurements);
        let mut rows = Rows::with_capacity(7, 0);
        rows.push(&measurements);
        let (mut x, mut true_return, mut largest) = (numbers(&episode["qpos"])[0], 0.0, 0.0_f64);
        for (at, step) in episode["steps"].as_array().unwrap().iter().enumerate() {
            let at = format!("step {at} of episode {number}");
            let action = to_f32(&numbers(&step["action"]));
            let outcome = environment.step(&action, &mut observation, &mut measurements);
            rows.push(&measurements);
            let qpos = numbers(&step["qpos"]);
            assert_same(environment.qpos(), &qpos, &format!("qpos at {at}"));
            assert_same(environment.qvel(), &numbers(&step["qvel"]), &format!("qvel at {at}"));
            clipped += numbers(&step["qvel"]).iter().filter(|velocity| velocity.abs() > 10.0).count();
            let wanted = to_f64(&to_f32(&numbers(&step["observation"])));
            for (got, wanted) in to_f64(&observation).iter().zip(&wanted) {
                assert!((got - wanted).abs() < 1e-5, "observation at {at}: {got} {wanted}");
            }
            let reward = step["reward"].as_f64().unwrap();
            assert!((f64::from(outcome.task_reward) - reward).abs() < 1e-5, "reward at {at}");
            assert_eq!(outcome.terminated, step["terminated"], "{at}");
            // What of Gymnasium's reward changes where actions count as clipped.
            let squares =
                |most: f64| action.iter().map(|a| f64::from(*a).clamp(-most, most).powi(2)).sum::<f64>();
            true_return += reward + 0.001 * (squares(f64::INFINITY) - squares(1.0));
            largest = action.iter().fold(largest, |largest, value| largest.max(f64::from(value.abs())));
            let speed = (qpos[0] - x) / 0.008;
            x = qpos[0];
            assert!((f64::from(measurements[measured("speed")]) - speed).abs() < 1e-5, "speed at {at}");
            assert!(
                (f64::from(measurements[measured("effort")]) - squares(1.0)).abs() < 1e-5,
                "effort at {at}"
            );
            assert_eq!(measurements[measured("alive")], f32::from(u8::from(!outcome.terminated)), "{at}");
        }
        let found = task.true_return(&rows).unwrap();
        assert!((found - true_return).abs() < 1e-4, "episode {number}: {found} {true_return}");
        let first = numbers(&episode["qpos"])[0];
        assert!((task.heuristic().score(&rows) - (x - first)).abs() < 1e-5);
        assert!(number > 0 || largest > 1.0, "some actions are beyond the range");
    }
    assert!(clipped > 0, "a velocity is clipped");
}

#[test]
fn sizes_are_as_declared() {
    let task = registry::load("walker2d").unwrap();
    let specification = task.specification();
    assert_eq!((specification.observation_size, specification.action_size), (17, 6));
    assert_eq!((specification.horizon, task.frame_skip()), (1000, 4));
    assert!((specification.control_step_secs - 0.008).abs() < 1e-15);
    assert!(task.may_end_early() && !registry::load("half_cheetah").unwrap().may_end_early());
    let parts =
        specification.observation_parts.iter().filter(|(name, _)| name.ends_with("clipped to [-10, 10]"));
    assert_eq!(parts.count(), 9);
}

/// Gymnasium: qpos and qvel evenly within ±0.005 of the initial pose, whose height is 1.25 m.
#[test]
fn reset_noise_is_that_of_gymnasium() {
    let task = registry::load("walker2d").unwrap();
    let mut environment = task.mujoco_environment().unwrap();
    let mut numbers = Vec::new();
    for episode in 0..1000 {
        environment.reset(EnvVariant(0), Seed::new(3).at(episode), &mut [0.0; 17], &mut [0.0; 7]);
        let mut qpos = environment.qpos().to_vec();
        qpos[1] -= 1.25;
        numbers.extend(qpos);
        numbers.extend_from_slice(environment.qvel());
    }
    let mean = numbers.iter().sum::<f64>() / numbers.len() as f64;
    let deviation = (numbers.iter().map(|value| value * value).sum::<f64>() / numbers.len() as f64).sqrt();
    assert!(numbers.iter().all(|value| value.abs() <= 0.005));
    assert!(mean.abs() < 1e-4 && (deviation - 0.005 / 3_f64.sqrt()).abs() < 1e-4, "{mean} {deviation}");
}
