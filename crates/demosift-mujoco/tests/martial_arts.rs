//! Martial Arts can be won, by physics alone, and tells kicks apart.

use crate::support::Episode;
use demosift::basics::seed::Seed;
use demosift::math::rows::Rows;
use demosift::world::environment::{EnvVariant, Task};
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::registry;
use rand::RngExt;

const HORIZON: usize = 60;
const ACTIONS: usize = 21;

/// What the kick moves, and to where, for six control steps at a time; found by search in this model.
const JOINTS: [&str; 8] = [
    "right_hip_y",
    "right_knee",
    "right_ankle_y",
    "left_hip_y",
    "left_knee",
    "left_ankle_y",
    "abdomen_y",
    "right_hip_x",
];
const KICK: [[f32; 8]; 4] = [
    [0.10, 0.38, 0.04, -0.37, 0.14, -0.70, -0.25, -0.37],
    [0.97, -0.33, -0.07, -0.53, -0.59, 0.65, 0.05, -0.75],
    [0.76, -0.71, -0.65, -0.62, 0.55, -0.72, -0.15, -0.67],
    [0.10, 0.21, -0.79, -0.64, 0.25, -0.31, -0.25, 0.39],
];

fn play(task: &MujocoTask, seed: u64, mut act: impl FnMut(usize, &mut [f32])) -> Episode {
    crate::support::play(task, EnvVariant(0), seed, |_, step, action| act(step, action))
}

/// The scripted kick with all its angles times `strength`.
fn kick(task: &MujocoTask, seed: u64, strength: f32) -> Episode {
    let actuators = JOINTS.map(|name| task.model().mujoco().actuator(name).unwrap().id);
    play(task, seed, |step, action| {
        if let Some(angles) = KICK.get(step / 6) {
            actuators.iter().zip(angles).for_each(|(at, angle)| action[*at] = strength * angle);
        }
    })
}

fn column(task: &MujocoTask, name: &str) -> usize {
    task.specification().measurement(name).unwrap()
}

#[test]
fn martial_arts_has_the_sizes_of_table_2() {
    let task = registry::load("martial_arts").unwrap();
    let specification = task.specification();
    assert_eq!((specification.observation_size, specification.action_size), (55, ACTIONS));
    assert_eq!(specification.horizon, HORIZON);
    assert!((specification.control_step_secs - 0.025).abs() < 1e-12);
}

#[test]
fn a_scripted_kick_hits_from_most_starts_and_a_weaker_one_from_none() {
    let task = registry::load("martial_arts").unwrap();
    let good: Vec<Episode> = (0..40).map(|seed| kick(&task, seed, 1.0)).collect();
    let weak: Vec<Episode> = (0..40).map(|seed| kick(&task, seed, 0.6)).collect();
    let hits = good.iter().filter(|episode| episode.succeeded).count();
    assert!(hits >= 34, "{hits} of 40 kicks hit");
    assert!(weak.iter().all(|episode| !episode.succeeded));
    let worst = |episodes: &[Episode]| episodes.iter().map(|episode| episode.score).fold(0.0, f64::min);
    let best = |episodes: &[Episode]| episodes.iter().map(|episode| episode.score).fold(f64::MIN, f64::max);
    assert!(worst(&good) > best(&weak) + 0.1, "{} against {}", worst(&good), best(&weak));
}

#[test]
fn martial_arts_pays_a_hit_its_thousand_once_and_a_near_miss_more_than_standing() {
    let task = registry::load("martial_arts").unwrap();
    let hit = (0..40).map(|seed| kick(&task, seed, 1.0)).find(|episode| episode.succeeded).unwrap();
    assert_eq!(hit.rewards.iter().filter(|reward| **reward > 999.0).count(), 1);
    let best_step = |episode: &Episode| episode.rewards.iter().copied().fold(0.0, f32::max);
    let (standing, near_miss) = (play(&task, 1, |_, _| ()), kick(&task, 1, 0.8));
    assert!(!near_miss.succeeded);
    assert!(best_step(&near_miss) > 2.0 * best_step(&standing), "{}", best_step(&near_miss));
}

/// A.1: the minimum distance of right foot and target, negated, of those steps at which the head is higher than the pelvis.
#[test]
fn martial_arts_is_judged_by_the_least_distance_while_the_head_is_above_the_pelvis() {
    let task = registry::load("martial_arts").unwrap();
    let (distance, upright) = (column(&task, "distance"), column(&task, "head_above_pelvis"));
    for (seed, strength) in [(0, 1.0), (1, 0.6), (2, 0.0)] {
        let episode = kick(&task, seed, strength);
        let counted = episode.measurements.iter().filter(|row| row[upright] > 0.0);
        let least = counted.map(|row| f64::from(row[distance])).fold(f64::INFINITY, f64::min);
        assert!((episode.score + least).abs() < 1e-6, "{} and {least}", episode.score);
    }
}

/// Upside down, with the right foot in the target.
#[test]
fn a_foot_that_touches_the_target_with_the_head_below_the_pelvis_counts_for_nothing() {
    let task = registry::load("martial_arts").unwrap();
    let mut environment = task.mujoco_environment().unwrap();
    let mut qpos = vec![0.0; 28];
    let (x, y, z) = (0.6, -0.01, 0.88);
    qpos[..7].copy_from_slice(&[x, y, z, 0.0, 0.0, 1.0, 0.0]);
    environment.set_state(&qpos, &[0.0; 27]).unwrap();
    let mut observation = vec![0.0; 55];
    let mut row = vec![0.0; task.specification().measurements.len()];
    environment.observe(&mut observation, &mut row);
    assert_eq!(row[column(&task, "touches")], 1.0, "{row:?}");
    assert!(row[column(&task, "head_above_pelvis")] < -0.5);
    let measurements = Rows::from_flat(row.clone(), row.len()).unwrap();
    assert!(!task.succeeded(&measurements).unwrap());
    let farthest_kick = kick(&task, 0, 0.0).score;
    assert!(task.heuristic().score(&measurements) < farthest_kick - 1.0);
}

/// All angles are zero in the model as it is drawn: it stands upright.
#[test]
fn the_target_hangs_higher_than_the_head_of_who_stands() {
    let task = registry::load("martial_arts").unwrap();
    let model = task.model().mujoco();
    let body = |name| model.body(name).unwrap().view(model).pos[2];
    let geom =
        |name| (model.geom(name).unwrap().view(model).pos[2], model.geom(name).unwrap().view(model).size[0]);
    let (head, head_radius) = geom("head");
    let crown = body("pelvis") + body("torso") + head + head_radius;
    let (center, radius) = geom("target");
    let lowest = body("target") + center - radius;
    assert!(lowest > crown, "the ball begins at {lowest} m, the head ends at {crown} m");
}

#[test]
fn an_agent_that_does_nothing_stands_for_a_second() {
    let task = registry::load("martial_arts").unwrap();
    let upright = column(&task, "head_above_pelvis");
    for seed in 0..10 {
        let episode = play(&task, seed, |_, _| ());
        assert!(episode.measurements.row(40)[upright] > 0.5, "fell in the episode of seed {seed}");
        assert!(!episode.succeeded);
    }
}

#[test]
fn ten_thousand_random_control_steps_neither_warn_nor_hit() {
    let task = registry::load("martial_arts").unwrap();
    let mut rng = Seed::new(5).into_rng();
    for seed in 0..167 {
        let episode = play(&task, seed, |_, action| action.fill_with(|| rng.random_range(-1.0..=1.0)));
        assert!(!episode.succeeded);
    }
}
