//! Penalty Save can be played, by physics alone, and tells saves from goals.

use crate::support::Episode;
use demosift::basics::seed::Seed;
use demosift::world::environment::{EnvVariant, Environment, Task};
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::registry;
use rand::RngExt;

const HORIZON: usize = 60;
const ACTIONS: usize = 8;

fn play(task: &MujocoTask, shot: &str, seed: u64, mut act: impl FnMut(usize, &mut [f32])) -> Episode {
    let shot = task.specification().variants.iter().position(|name| name == shot).unwrap();
    crate::support::play(task, EnvVariant(shot), seed, |_, step, action| act(step, action))
}

/// The torques of hip and knee of the two legs on each side, for ten control steps from `start` on.
fn push(task: &MujocoTask, shot: &str, seed: u64, start: usize, [left, right]: [[f32; 2]; 2]) -> Episode {
    let legs = [("front_left", left), ("back_left", left), ("front_right", right), ("back_right", right)];
    let torques: Vec<(usize, f32)> = legs
        .into_iter()
        .flat_map(|(leg, [hip, knee])| [(format!("{leg}_hip"), hip), (format!("{leg}_knee"), knee)])
        .map(|(name, torque)| (task.model().mujoco().actuator(&name).unwrap().id, torque))
        .collect();
    play(task, shot, seed, |step, action| {
        if (start..start + 10).contains(&step) {
            torques.iter().for_each(|(at, torque)| action[*at] = *torque);
        }
    })
}

/// The right legs push off; found by search in this model.
fn dive_to_the_left(task: &MujocoTask, shot: &str, seed: u64) -> Episode {
    push(task, shot, seed, 6, [[0.3, -0.4], [-1.0, 0.3]])
}

fn jump(task: &MujocoTask, shot: &str, seed: u64) -> Episode {
    push(task, shot, seed, 15, [[-1.0, -0.5]; 2])
}

fn stand(task: &MujocoTask, shot: &str, seed: u64) -> Episode {
    play(task, shot, seed, |_, _| ())
}

/// Episodes of twenty seeds, and how many of them were saved.
fn twenty(of: impl Fn(u64) -> Episode) -> (Vec<Episode>, usize) {
    let episodes: Vec<Episode> = (0..20).map(of).collect();
    let saved = episodes.iter().filter(|episode| episode.succeeded).count();
    (episodes, saved)
}

fn mean_score(episodes: &[Episode]) -> f64 {
    episodes.iter().map(|episode| episode.score).sum::<f64>() / episodes.len() as f64
}

#[test]
fn penalty_save_has_the_sizes_of_table_2_and_several_goals() {
    let task = registry::load("penalty_save").unwrap();
    let specification = task.specification();
    assert_eq!((specification.observation_size, specification.action_size), (91, ACTIONS));
    assert_eq!(specification.horizon, HORIZON);
    assert!((specification.control_step_secs - 0.025).abs() < 1e-12);
    assert_eq!(specification.variants.len(), 5);
    assert!(task.model().cameras().len() >= 2);
}

#[test]
fn a_scripted_dive_saves_what_standing_still_lets_in() {
    let task = registry::load("penalty_save").unwrap();
    let (dives, saved) = twenty(|seed| dive_to_the_left(&task, "low_left", seed));
    assert!(saved >= 14, "{saved} of 20 saved by a dive to the left");
    let (stands, saved) = twenty(|seed| stand(&task, "low_left", seed));
    assert_eq!(saved, 0, "saved by standing still");
    let (wrong, saved) = twenty(|seed| dive_to_the_left(&task, "low_right", seed));
    assert_eq!(saved, 0, "saved on the right by a dive to the left");
    let [good, none, bad] = [&dives, &stands, &wrong].map(|episodes| mean_score(episodes));
    assert!(good > none + 0.4 && none > bad + 0.3, "{good}, {none}, {bad}");
}

#[test]
fn a_jump_in_time_saves_the_shot_over_the_keeper_and_one_too_early_does_not() {
    let task = registry::load("penalty_save").unwrap();
    let (_, saved) = twenty(|seed| jump(&task, "over", seed));
    assert!(saved >= 17, "{saved} of 20 saved by a jump");
    let (_, saved) = twenty(|seed| push(&task, "over", seed, 3, [[-1.0, -0.5]; 2]));
    assert!(saved <= 10, "{saved} of 20 saved by a jump too early");
}

#[test]
fn no_shot_is_saved_by_standing_still() {
    let task = registry::load("penalty_save").unwrap();
    for shot in &task.specification().variants {
        let (_, saved) = twenty(|seed| stand(&task, shot, seed));
        assert!(saved <= 1, "{shot}: {saved} of 20 saved");
    }
}

/// Nor does it come through the net, from either side.
#[test]
fn success_is_that_the_ball_is_never_behind_the_line_between_the_posts() {
    let task = registry::load("penalty_save").unwrap();
    let [x, y, z] =
        ["ball_x", "ball_y", "ball_z"].map(|name| task.specification().measurement(name).unwrap());
    for shot in &task.specification().variants {
        for seed in 0..20 {
            for episode in [stand(&task, shot, seed), dive_to_the_left(&task, shot, seed)] {
                let inside = |row: &[f32]| row[x] < -0.15 && row[y].abs() < 1.5 && row[z] < 1.4;
                let goal = episode.measurements.iter().any(inside);
                assert_eq!(episode.succeeded, !goal, "{shot}, seed {seed}");
                assert!(
                    episode.measurements.iter().all(|row| row[x] > -1.05),
                    "through the net: {shot}, {seed}"
                );
            }
        }
    }
}

#[test]
fn a_save_is_worth_its_twenty_and_a_goal_nothing() {
    let task = registry::load("penalty_save").unwrap();
    let total = |episode: &Episode| episode.rewards.iter().sum::<f32>();
    let (dives, _) = twenty(|seed| dive_to_the_left(&task, "low_left", seed));
    let (stands, _) = twenty(|seed| stand(&task, "low_left", seed));
    let saved: Vec<&Episode> = dives.iter().filter(|episode| episode.succeeded).collect();
    let worst = saved.iter().map(|episode| total(episode)).fold(f32::INFINITY, f32::min);
    let best = stands.iter().map(total).fold(f32::NEG_INFINITY, f32::max);
    assert!((worst - best - 20.0).abs() < 2.0, "{worst} against {best}");
    // It is paid when the ball turns, not when the episode ends.
    assert!(saved.iter().all(|episode| episode.rewards[HORIZON - 1].abs() < 1.0));
}

/// A.1: the minimum distance between the agent and the incoming shot, negated, over the whole episode.
#[test]
fn penalty_save_is_judged_by_the_least_distance_of_agent_and_ball() {
    let task = registry::load("penalty_save").unwrap();
    let distance = task.specification().measurement("distance").unwrap();
    for shot in &task.specification().variants {
        let episode = dive_to_the_left(&task, shot, 1);
        let distances = episode.measurements.iter().map(|row| f64::from(row[distance]));
        let least = distances.fold(f64::INFINITY, f64::min);
        assert!((episode.score + least).abs() < 1e-6, "{} and {least}", episode.score);
    }
}

/// Observation: 15 + 14 of the ant, 13 of the ball, 48 wrenches, the phase. Each of them says something.
#[test]
fn no_number_of_the_observation_is_constant_and_random_actions_do_not_warn() {
    let task = registry::load("penalty_save").unwrap();
    let specification = task.specification();
    let mut rng = Seed::new(5).into_rng();
    let mut environment = task.mujoco_environment().unwrap();
    let mut now = vec![0.0; specification.measurements.len()];
    let mut observation = vec![0.0; specification.observation_size];
    let (mut low, mut high) = (vec![f32::INFINITY; 91], vec![f32::NEG_INFINITY; 91]);
    for seed in 0..167 {
        let variant = EnvVariant(seed % specification.variants.len());
        environment.reset(variant, Seed::new(seed as u64), &mut observation, &mut now);
        for _ in 0..HORIZON {
            let action: [f32; ACTIONS] = std::array::from_fn(|_| rng.random_range(-1.0..=1.0));
            environment.step(&action, &mut observation, &mut now);
            for ((low, high), value) in low.iter_mut().zip(&mut high).zip(&observation) {
                *low = low.min(*value);
                *high = high.max(*value);
            }
        }
        assert_eq!(environment.warnings(), 0, "MuJoCo warned in the episode of seed {seed}");
    }
    let constant: Vec<usize> = (0..91).filter(|at| high[*at] - low[*at] < 1e-3).collect();
    assert!(constant.is_empty(), "constant: {constant:?}");
}
