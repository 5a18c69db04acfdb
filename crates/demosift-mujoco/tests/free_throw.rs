//! Free Throw can be thrown, by physics alone, and tells throws apart.

use crate::support::Episode;
use demosift::basics::seed::Seed;
use demosift::world::environment::{EnvVariant, Specification, Task};
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::registry;
use mujoco_rs::prelude::MjModel;
use rand::RngExt;

/// The throwers, the taller one second.
const BODIES: [&str; 2] = ["free_throw", "free_throw_taller"];
const HORIZON: usize = 60;
const ACTIONS: usize = 21;

/// Torques of shoulder (flexion, sideways), elbow and back in four control steps each; found by search in this model.
const THROW: [[f32; 4]; 3] = [[1.0, -0.43, 1.0, 0.55], [1.0, 0.28, 0.77, 0.0], [-0.4, -0.2, 1.0, -0.83]];

fn play(task: &MujocoTask, seed: u64, mut act: impl FnMut(usize, &mut [f32])) -> Episode {
    crate::support::play(task, EnvVariant(0), seed, |_, step, action| act(step, action))
}

/// The scripted throw with all its torques times `strength`.
fn throw(task: &MujocoTask, seed: u64, strength: f32) -> Episode {
    let joints = ["right_shoulder_y", "right_shoulder_x", "right_elbow", "abdomen_y"];
    let actuators = joints.map(|name| actuator(task, name));
    play(task, seed, |step, action| {
        if let Some(torques) = THROW.get(step / 4) {
            actuators.iter().zip(torques).for_each(|(at, torque)| action[*at] = strength * torque);
        }
    })
}

fn actuator(task: &MujocoTask, name: &str) -> usize {
    task.model().mujoco().actuator(name).unwrap().id
}

#[test]
fn free_throw_has_the_sizes_of_table_2() {
    let task = registry::load("free_throw").unwrap();
    let specification = task.specification();
    assert_eq!((specification.observation_size, specification.action_size), (55, ACTIONS));
    assert_eq!(specification.horizon, HORIZON);
    assert!((specification.control_step_secs - 0.025).abs() < 1e-12);
}

#[test]
fn a_scripted_throw_scores_from_most_starts_and_a_weaker_one_from_none() {
    let task = registry::load("free_throw").unwrap();
    let good: Vec<Episode> = (0..40).map(|seed| throw(&task, seed, 1.0)).collect();
    let weak: Vec<Episode> = (0..40).map(|seed| throw(&task, seed, 0.7)).collect();
    let scored = good.iter().filter(|episode| episode.succeeded).count();
    assert!(scored >= 34, "{scored} of 40 throws scored");
    assert!(weak.iter().all(|episode| !episode.succeeded));
    let worst = |episodes: &[Episode]| episodes.iter().map(|episode| episode.score).fold(0.0, f64::min);
    let best = |episodes: &[Episode]| episodes.iter().map(|episode| episode.score).fold(f64::MIN, f64::max);
    assert!(worst(&good) > best(&weak), "{} against {}", worst(&good), best(&weak));
}

#[test]
fn free_throw_pays_a_score_its_hundred_once_and_a_throw_while_it_flies() {
    let task = registry::load("free_throw").unwrap();
    let episode = (0..40).map(|seed| throw(&task, seed, 1.0)).find(|episode| episode.succeeded).unwrap();
    assert_eq!(episode.rewards.iter().filter(|reward| **reward > 99.0).count(), 1);
    let flying: f32 = episode.rewards[10..25].iter().sum();
    let holding: f32 = play(&task, 1, |_, _| ()).rewards[10..25].iter().sum();
    assert!(flying > 4.0 * holding, "{flying} against {holding}");
}

/// A.1: the minimum distance between ball and basket, negated, over the whole episode.
#[test]
fn free_throw_is_judged_by_the_least_distance_of_ball_and_basket() {
    let task = registry::load("free_throw").unwrap();
    let distance = task.specification().measurement("distance").unwrap();
    for (seed, strength) in [(0, 1.0), (1, 0.7), (2, 0.0)] {
        let episode = throw(&task, seed, strength);
        let distances = episode.measurements.iter().map(|row| f64::from(row[distance]));
        let least = distances.fold(f64::INFINITY, f64::min);
        assert!((episode.score + least).abs() < 1e-6, "{} and {least}", episode.score);
    }
}

#[test]
fn the_ball_stays_in_the_hand_while_no_torque_is_applied() {
    for task in BODIES.map(|name| registry::load(name).unwrap()) {
        let height = task.specification().measurement("above_rim").unwrap();
        for seed in 0..10 {
            let episode = play(&task, seed, |_, _| ());
            let (first, last) =
                (episode.measurements.row(0)[height], episode.measurements.row(HORIZON)[height]);
            assert!((first - last).abs() < 0.08, "the ball moved from {first} to {last}");
            assert!(!episode.succeeded);
        }
    }
}

#[test]
fn ten_thousand_random_control_steps_never_warn_and_hardly_ever_score() {
    for task in BODIES.map(|name| registry::load(name).unwrap()) {
        let (mut rng, mut scored) = (Seed::new(5).into_rng(), 0);
        for seed in 0..167 {
            let episode = play(&task, seed, |_, action| action.fill_with(|| rng.random_range(-1.0..=1.0)));
            scored += usize::from(episode.succeeded);
        }
        // The taller thrower's hand is near the rim, where luck reaches.
        assert!(scored <= 1, "{scored} of 167 random episodes of {} scored", task.specification().name);
    }
}

#[test]
fn the_taller_thrower_differs_in_its_body_alone() {
    let [task, taller] = BODIES.map(|name| registry::load(name).unwrap());
    let specification = Specification { name: "free_throw".to_owned(), ..taller.specification().clone() };
    assert_eq!(specification, *task.specification());
    assert_eq!(taller.heuristic().unit(), task.heuristic().unit());
    let [model, grown] = [&task, &taller].map(|task| task.model().mujoco().clone());
    let place = |model: &MjModel, name: &str| model.body_pos()[model.body(name).unwrap().id];
    assert_eq!(place(&model, "hoop"), place(&grown, "hoop"));
    assert_eq!(place(&model, "pelvis")[0], place(&grown, "pelvis")[0], "both stand at the line");
    for (index, (from, to)) in model.geom_size().iter().zip(grown.geom_size()).enumerate() {
        assert!(to[0] == from[0] || (to[0] - 1.2 * from[0]).abs() < 1e-9, "geom {index}");
    }
}

/// The taller thrower needs all its strength, and another motion.
#[test]
fn the_scripted_throw_of_the_thrower_is_too_feeble_for_the_taller_one() {
    let taller = registry::load("free_throw_taller").unwrap();
    for seed in 0..40 {
        let episode = throw(&taller, seed, 1.0);
        assert!(!episode.succeeded, "seed {seed} scores {}", episode.score);
    }
}
