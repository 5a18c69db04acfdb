//! What a viewer is told of a task, against what the state itself says.

use demosift::basics::seed::Seed;
use demosift::data::trajectory::StateLog;
use demosift::world::environment::{EnvVariant, Environment as _, Task as _};
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::pictures::scene::{self, Motion, POSE_BYTES};
use demosift_mujoco::registry;

fn first_state(task: &MujocoTask) -> StateLog {
    let specification = task.specification();
    let mut environment = task.mujoco_environment().unwrap();
    let mut observation = vec![0.0; specification.observation_size];
    let mut now = vec![0.0; specification.measurements.len()];
    environment.reset(EnvVariant(0), Seed::new(1), &mut observation, &mut now);
    StateLog { qpos: environment.qpos().to_vec(), qvel: environment.qvel().to_vec() }
}

/// Position and quaternion of a body, as a viewer reads them.
fn pose(motion: &Motion, bodies: usize, frame: usize, body: usize) -> ([f64; 3], [f64; 4]) {
    let start = (frame * bodies + body) * POSE_BYTES;
    let number = |index: usize| {
        let at = start + 2 * index;
        f64::from(i16::from_le_bytes([motion.poses[at], motion.poses[at + 1]])) / 32767.0
    };
    let axis =
        |axis: usize| motion.low[axis] + (number(axis) + 1.0) / 2.0 * (motion.high[axis] - motion.low[axis]);
    (std::array::from_fn(axis), std::array::from_fn(|index| number(3 + index)))
}

#[test]
fn every_task_can_be_drawn() {
    for name in registry::names() {
        let task = registry::load(name).unwrap();
        let scene = scene::scene(&task).unwrap();
        assert!(scene.camera.is_some() && scene.left_out == 0, "{name}");
        assert!(scene.shapes.iter().any(|shape| shape.kind == "plane"), "{name} has a ground");
        for body in 0..scene.bodies {
            assert!(
                scene.shapes.iter().any(|shape| shape.body == Some(body)),
                "{name}: nothing on body {body}"
            );
        }
        for shape in &scene.shapes {
            let length: f64 = shape.quaternion.iter().map(|value| value * value).sum();
            assert!((length - 1.0).abs() < 1e-9 && shape.size[0] > 0.0, "{name}: {shape:?}");
        }
    }
}

/// The ball of Free Throw has a free joint, the last seven of its positions, so its pose stands in the state itself.
#[test]
fn a_free_ball_is_where_the_state_says() {
    let task = registry::load("free_throw").unwrap();
    let bodies = scene::scene(&task).unwrap().bodies;
    let still = first_state(&task);
    let mut states = StateLog::default();
    let path = [[0.5, -1.25, 2.0], [0.6, -1.5, 2.5], [0.7, 3.0, 0.4]];
    let turn = [0.5_f64.sqrt(), 0.0, 0.5_f64.sqrt(), 0.0];
    for place in path {
        let mut qpos = still.qpos.clone();
        let ball = qpos.len() - 7;
        qpos[ball..ball + 3].copy_from_slice(&place);
        qpos[ball + 3..].copy_from_slice(&turn);
        states.qpos.extend(qpos);
        states.qvel.extend(&still.qvel);
    }
    let motion = scene::motion(&task, &states, 3, 1).unwrap();
    let moved: Vec<usize> = (0..bodies)
        .filter(|body| {
            let [first, last] = [0, 2].map(|frame| pose(&motion, bodies, frame, *body).0);
            first.iter().zip(&last).any(|(a, b)| (a - b).abs() > 1e-3)
        })
        .collect();
    let [ball] = moved[..] else { panic!("bodies {moved:?} moved, and the ball alone should have") };
    for (frame, place) in path.iter().enumerate() {
        let (position, quaternion) = pose(&motion, bodies, frame, ball);
        assert!(
            position.iter().zip(place).all(|(found, wanted)| (found - wanted).abs() < 1e-3),
            "{position:?}"
        );
        assert!(
            quaternion.iter().zip(&turn).all(|(found, wanted)| (found - wanted).abs() < 1e-4),
            "{quaternion:?}"
        );
    }
}

#[test]
fn a_stride_leaves_steps_out_but_never_the_last() {
    let task = registry::load("half_cheetah").unwrap();
    let scene = scene::scene(&task).unwrap();
    let still = first_state(&task);
    let steps = 8;
    let states = StateLog { qpos: still.qpos.repeat(steps), qvel: still.qvel.repeat(steps) };
    for (stride, frames) in [(1, 8), (3, 4), (7, 2), (20, 2)] {
        let motion = scene::motion(&task, &states, steps, stride).unwrap();
        assert_eq!((motion.frames, motion.poses.len()), (frames, frames * scene.bodies * POSE_BYTES));
    }
    let all = steps * scene.bodies * POSE_BYTES;
    assert_eq!([all, all - 1, all / 4].map(|most| scene::stride(&scene, steps, most)), [1, 2, 4]);
    assert!(scene::motion(&task, &states, steps + 1, 1).unwrap_err().is_bad_input());
}
