//! What playing costs over bare physics: `rollout::play` of a policy, and control steps through the `Environment` trait
//! with observation, measurements, task reward and resets, against `mj_step` on the same model with the same initial
//! states, actions and threads.
//!
//! Interleaved runs; the medians are printed. Tasks may be named: `-- martial_arts`.
#![allow(clippy::print_stdout, clippy::unwrap_used, missing_docs)]

use std::sync::{Arc, Mutex};
use std::time::Instant;

use demosift::basics::seed::Seed;
use demosift::data::observation_filter::ObservationFilter;
use demosift::data::trajectory::Trajectory;
use demosift::world::environment::{EnvVariant, Environment, Task};
use demosift::world::policy::{Policy, PolicyShape};
use demosift::world::rollout::{self, Acting, Playground};
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::registry;
use mujoco_rs::prelude::{MjData, MjModel};
use rand::RngExt;
use rayon::prelude::*;

const STEPS: usize = 1000;
const RUNS: usize = 15;
const GOAL: f64 = 1.15;

fn main() {
    println!(
        "us: wall time of a control step on one thread; steps/s: of all threads; the goal is a ratio of {GOAL} at most"
    );
    println!(
        "{:17} {:22} {:>7} {:>9} {:>9} {:>10} {:>7}",
        "task", "what", "threads", "bare us", "us", "steps/s", "ratio"
    );
    let asked: Vec<String> =
        std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    for name in registry::names() {
        if !asked.is_empty() && !asked.iter().any(|task| task == name) {
            continue;
        }
        let task = registry::load(name).unwrap();
        for threads in [1, 2] {
            compare(name, &task, threads);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            for hidden in [32, 64] {
                pool.install(|| compare_policy(name, &task, hidden, threads));
            }
        }
    }
}

fn print_row(task: &str, what: &str, threads: usize, steps: usize, bare: Vec<f64>, played: Vec<f64>) {
    let ratio = median(bare.iter().zip(&played).map(|(bare, played)| played / bare).collect());
    let (bare, played) = (median(bare), median(played));
    let micros = |secs: f64| secs * threads as f64 / steps as f64 * 1e6;
    println!(
        "{task:17} {what:22} {threads:>7} {:>9.2} {:>9.2} {:>10.0} {ratio:>7.3} {}",
        micros(bare),
        micros(played),
        steps as f64 / played,
        if ratio > GOAL { "over the goal" } else { "" }
    );
}

/// `rollout::play` beside `mj_step` with the actions that the policy took.
fn compare_policy(name: &str, task: &MujocoTask, hidden: usize, threads: usize) {
    let specification = task.specification();
    let shape = PolicyShape { hidden: vec![hidden; 2], initial_std: 0.5 };
    let filter = ObservationFilter::identity(specification.observation_size);
    let policy = Policy::untrained(&shape, filter, specification.action_size, Seed::new(0));
    let playground = Playground::new(task);
    let episodes = (4 * STEPS).div_ceil(specification.horizon).next_multiple_of(2);
    let play = || {
        let seeds = Seed::new(0).many(episodes);
        let start = Instant::now();
        let played = rollout::play(&playground, &policy, Acting::Sampled, EnvVariant(0), seeds).unwrap();
        (start.elapsed().as_secs_f64(), played)
    };
    let actions: Vec<Vec<Vec<f32>>> = play().1.iter().map(recorded_actions).collect();
    let starts = starts(task, Seed::new(0).many(episodes).iter().map(|seed| seed.of("reset")));
    let idle: Mutex<Vec<_>> =
        Mutex::new((0..threads).map(|_| MjData::new(task.model().mujoco().clone())).collect());
    let (mut bare, mut played) = (Vec::new(), Vec::new());
    for _ in 0..RUNS {
        let start = Instant::now();
        actions.par_iter().zip(&starts).for_each(|(actions, start)| {
            let mut data = idle.lock().unwrap().pop().unwrap();
            step_episode(task, &mut data, start, actions);
            idle.lock().unwrap().push(data);
        });
        bare.push(start.elapsed().as_secs_f64());
        played.push(play().0);
    }
    let what = format!("policy {hidden}-{hidden}");
    print_row(name, &what, threads, episodes * specification.horizon, bare, played);
}

fn recorded_actions(played: &Trajectory) -> Vec<Vec<f32>> {
    played
        .actions()
        .iter()
        .map(|action| action.iter().map(|value| value.clamp(-1.0, 1.0)).collect())
        .collect()
}

fn compare(name: &str, task: &MujocoTask, threads: usize) {
    let actions = actions(task);
    let (mut bare, mut played) = (Vec::new(), Vec::new());
    for _ in 0..RUNS {
        bare.push(timed(threads, || step_bare(task, &actions)));
        played.push(timed(threads, || play(task, &actions)));
    }
    print_row(name, "environment", threads, threads * STEPS, bare, played);
}

/// Actions in [−1, 1], the same for both ways.
fn actions(task: &MujocoTask) -> Vec<Vec<f32>> {
    let mut rng = Seed::new(0).of("benchmark").into_rng();
    let size = task.specification().action_size;
    (0..STEPS).map(|_| (0..size).map(|_| rng.random_range(-1.0..=1.0)).collect()).collect()
}

fn timed(threads: usize, work: impl Fn() -> f64 + Sync) -> f64 {
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(&work)).collect();
        workers.into_iter().map(|worker| worker.join().unwrap()).fold(0.0, f64::max)
    })
}

fn play(task: &MujocoTask, actions: &[Vec<f32>]) -> f64 {
    let specification = task.specification();
    let mut environment = task.mujoco_environment().unwrap();
    let mut observation = vec![0.0; specification.observation_size];
    let mut measurements = vec![0.0; specification.measurements.len()];
    let start = Instant::now();
    for (episode, actions) in actions.chunks(specification.horizon).enumerate() {
        environment.reset(EnvVariant(0), Seed::new(0).at(episode), &mut observation, &mut measurements);
        for action in actions {
            environment.step(action, &mut observation, &mut measurements);
        }
    }
    std::hint::black_box(&observation);
    start.elapsed().as_secs_f64()
}

fn step_bare(task: &MujocoTask, actions: &[Vec<f32>]) -> f64 {
    let horizon = task.specification().horizon;
    let starts = starts(task, Seed::new(0).many(actions.len().div_ceil(horizon)));
    let mut data = MjData::new(task.model().mujoco().clone());
    let start = Instant::now();
    for (actions, start) in actions.chunks(horizon).zip(&starts) {
        step_episode(task, &mut data, start, actions);
    }
    start.elapsed().as_secs_f64()
}

/// The state in which an episode starts.
struct Start {
    qpos: Vec<f64>,
    qvel: Vec<f64>,
}

fn step_episode(task: &MujocoTask, data: &mut MjData<Arc<MjModel>>, start: &Start, actions: &[Vec<f32>]) {
    let ranges = task.model().mujoco().actuator_ctrlrange();
    data.reset();
    data.qpos_mut().copy_from_slice(&start.qpos);
    data.qvel_mut().copy_from_slice(&start.qvel);
    for action in actions {
        for ((control, action), [low, high]) in data.ctrl_mut().iter_mut().zip(action).zip(ranges) {
            *control = 0.5 * (low + high) + 0.5 * (high - low) * f64::from(*action);
        }
        (0..task.frame_skip()).for_each(|_| data.step());
    }
    std::hint::black_box(data.qpos());
}

/// The initial states that the trait draws from these seeds.
fn starts(task: &MujocoTask, seeds: impl IntoIterator<Item = Seed>) -> Vec<Start> {
    let specification = task.specification();
    let mut environment = task.mujoco_environment().unwrap();
    let mut observation = vec![0.0; specification.observation_size];
    let mut measurements = vec![0.0; specification.measurements.len()];
    let state = |seed| {
        environment.reset(EnvVariant(0), seed, &mut observation, &mut measurements);
        Start { qpos: environment.qpos().to_vec(), qvel: environment.qvel().to_vec() }
    };
    seeds.into_iter().map(state).collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
