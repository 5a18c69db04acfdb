//! A handstand can be kept, by feedback and not by standing still, and the heuristic tells how long it was.

use crate::support::Episode;
use demosift::math::rows::Rows;
use demosift::world::environment::{EnvVariant, Task};
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::registry;

const HORIZON: usize = 120;
const EPISODES: u64 = 20;

/// Linear feedback of shoulders and elbows, from the linear-quadratic regulator of this model at its balanced pose, of which
/// the small gains were left out. Per rad: tilt of the pelvis over the back, abdomen_y, shoulder_y, elbow, hip_y; per rad/s:
/// rate of the tilt; per m/s: velocity of the pelvis.
const SHOULDER_GAINS: [f64; 7] = [0.77, 0.22, -0.34, 0.66, -0.37, 0.43, 0.23];
const ELBOW_GAINS: [f64; 7] = [1.86, 1.5, -1.13, -1.34, -0.25, 0.52, 0.09];
/// Actions that hold the balanced pose: the servos yield by this much under the body's weight.
const SHOULDER_HOLDS: f64 = -0.15;
const ELBOW_HOLDS: f64 = -0.13;
/// Tilt of the pelvis and angle of the shoulders at which the center of mass is above the palms.
const BALANCED: [f64; 2] = [std::f64::consts::PI + 0.1, 3.24];

/// Plays an episode with the actions of shoulders and elbows.
fn play(task: &MujocoTask, seed: u64, mut act: impl FnMut(&[f64], &[f64]) -> [f64; 2]) -> Episode {
    let id = |name: &str| task.model().mujoco().actuator(name).unwrap().id;
    let actuators =
        ["shoulder_y", "elbow"].map(|joint| ["right", "left"].map(|side| id(&format!("{side}_{joint}"))));
    crate::support::play(task, EnvVariant(0), seed, |environment, _, action| {
        for (sides, value) in actuators.iter().zip(act(environment.qpos(), environment.qvel())) {
            sides.iter().for_each(|at| action[*at] = value as f32);
        }
    })
}

/// The feedback with all its gains times `strength`.
fn balance(task: &MujocoTask, seed: u64, strength: f64) -> Episode {
    let qpos = |name: &str| address(task, name);
    let joints = ["abdomen_y", "shoulder_y", "elbow", "hip_y"].map(|joint| match joint {
        "abdomen_y" => [qpos(joint); 2],
        _ => ["right", "left"].map(|side| qpos(&format!("{side}_{joint}"))),
    });
    play(task, seed, |qpos, qvel| {
        let [abdomen, shoulder, elbow, hip] = joints.map(|[one, other]| 0.5 * (qpos[one] + qpos[other]));
        let tilt = 2.0 * qpos[5].atan2(qpos[3]);
        let state = [tilt - BALANCED[0], abdomen, shoulder - BALANCED[1], elbow, hip, qvel[4], qvel[0]];
        let feedback =
            |gains: [f64; 7]| gains.iter().zip(state).map(|(gain, value)| gain * value).sum::<f64>();
        [SHOULDER_HOLDS - strength * feedback(SHOULDER_GAINS), ELBOW_HOLDS - strength * feedback(ELBOW_GAINS)]
    })
}

fn address(task: &MujocoTask, joint: &str) -> usize {
    let model = task.model().mujoco();
    model.jnt_qposadr()[model.joint(joint).unwrap().id] as usize
}

fn episodes(play: impl Fn(u64) -> Episode) -> Vec<Episode> {
    (0..EPISODES).map(play).collect()
}

fn successes(episodes: &[Episode]) -> usize {
    episodes.iter().filter(|episode| episode.succeeded).count()
}

fn mean_score(episodes: &[Episode]) -> f64 {
    episodes.iter().map(|episode| episode.score).sum::<f64>() / episodes.len() as f64
}

#[test]
fn handstand_has_the_sizes_of_table_2() {
    let task = registry::load("handstand").unwrap();
    let specification = task.specification();
    assert_eq!((specification.observation_size, specification.action_size), (55, 21));
    assert_eq!(specification.horizon, HORIZON);
    assert!((specification.control_step_secs - 0.025).abs() < 1e-12);
    assert!((52.0..65.0).contains(&task.model().mujoco().body_mass().iter().sum::<f64>()));
}

#[test]
fn feedback_keeps_the_balance_and_a_pose_alone_does_not() {
    let task = registry::load("handstand").unwrap();
    let balanced = episodes(|seed| balance(&task, seed, 1.0));
    let held = episodes(|seed| balance(&task, seed, 0.0));
    let passive = episodes(|seed| play(&task, seed, |_, _| [0.0; 2]));
    let perverse = episodes(|seed| balance(&task, seed, -0.5));
    assert!(successes(&balanced) >= 18, "{} of {EPISODES} were kept", successes(&balanced));
    assert!(successes(&held) <= 6, "the pose alone is stable: {} of {EPISODES}", successes(&held));
    assert_eq!(successes(&passive), 0);
    assert!(successes(&perverse) <= 2, "against the feedback: {} of {EPISODES}", successes(&perverse));
    let scores = [&balanced, &held, &passive].map(|episodes| mean_score(episodes));
    assert!(scores[0] > scores[1] + 50.0 && scores[1] > scores[2] + 30.0, "{scores:?}");
}

#[test]
fn handstand_counts_the_feet_only_while_the_hands_touch_and_stops_when_the_head_does() {
    let task = registry::load("handstand").unwrap();
    let episode = play(&task, 0, |_, _| [0.0; 2]);
    let column = |name: &str| task.specification().measurement(name).unwrap();
    let [head, left_hand, right_hand] =
        ["head_touches", "left_hand_touches", "right_hand_touches"].map(column);
    let feet = ["left_foot_height", "right_foot_height"].map(column);
    let mut wanted = 0.0;
    for row in episode.measurements.iter().take_while(|row| row[head] == 0.0) {
        if row[left_hand] == 1.0 && row[right_hand] == 1.0 {
            wanted += f64::from(row[feet[0]]) + f64::from(row[feet[1]]);
        }
    }
    assert!(wanted > 50.0 && (episode.score - wanted).abs() < 1e-3, "{} instead of {wanted}", episode.score);
}

#[test]
fn the_reward_of_success_comes_on_top_and_a_touch_of_the_head_ends_it() {
    let task = registry::load("handstand").unwrap();
    let good = balance(&task, 0, 1.0);
    assert!(good.succeeded);
    let bad = play(&task, 0, |_, _| [0.0; 2]);
    let paid = |episode: &Episode| episode.rewards.iter().sum::<f32>();
    assert!(paid(&good) > paid(&bad) + 1000.0);
    // The same episode, in one row of which the head touches, or a hand or a foot is not where it belongs.
    for (name, value) in [("head_touches", 1.0), ("left_hand_height", 0.2), ("right_foot_height", 1.0)] {
        let width = good.measurements.width();
        let mut flat: Vec<f32> = good.measurements.iter().flatten().copied().collect();
        flat[60 * width + task.specification().measurement(name).unwrap()] = value;
        assert!(!task.succeeded(&Rows::from_flat(flat, width).unwrap()).unwrap(), "{name}");
    }
    // A contact that flickers for a step does not count against it.
    let width = good.measurements.width();
    let mut flat: Vec<f32> = good.measurements.iter().flatten().copied().collect();
    flat[60 * width + task.specification().measurement("left_hand_touches").unwrap()] = 0.0;
    assert!(task.succeeded(&Rows::from_flat(flat, width).unwrap()).unwrap());
}
