//! What playing costs over bare physics: control steps through the `Environment` trait, with observation, measurements,
//! task reward and resets, against `mj_step` on the same model with the same initial states, actions and threads.
//!
//! Interleaved runs; the medians are printed.
#![allow(clippy::print_stdout, clippy::unwrap_used, missing_docs)]

use std::time::Instant;

use demosift::environment::{EnvVariant, Task};
use demosift::seed::Seed;
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::registry;
use mujoco_rs::prelude::MjData;
use rand::RngExt;

const STEPS: usize = 1000;
const RUNS: usize = 31;

fn main() {
    println!("task, threads: bare and through the trait, us a control step (steps/s of all threads), ratio");
    for name in registry::names() {
        let task = registry::load(name).unwrap();
        for threads in [1, 2] {
            compare(name, &task, threads);
        }
    }
}

fn compare(name: &str, task: &MujocoTask, threads: usize) {
    let actions = actions(task);
    let (mut bare, mut played) = (Vec::new(), Vec::new());
    for _ in 0..RUNS {
        bare.push(timed(threads, || step_bare(task, &actions)));
        played.push(timed(threads, || play(task, &actions)));
    }
    let ratios = bare.iter().zip(&played).map(|(bare, played)| played / bare).collect();
    let (bare, played, ratio) = (median(bare), median(played), median(ratios));
    let speed = |secs: f64| (threads * STEPS) as f64 / secs;
    let micros = |secs: f64| secs / STEPS as f64 * 1e6;
    println!(
        "{name}, {threads}: bare {:.2} us ({:.0}/s), played {:.2} us ({:.0}/s), ratio {ratio:.3}",
        micros(bare),
        speed(bare),
        micros(played),
        speed(played),
    );
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
    let mut environment = task.environment().unwrap();
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
    let specification = task.specification();
    let model = task.model().mujoco();
    let starts = starts(task, actions.len().div_ceil(specification.horizon));
    let ranges = model.actuator_ctrlrange();
    let mut data = MjData::new(model.clone());
    let start = Instant::now();
    for (actions, (qpos, qvel)) in actions.chunks(specification.horizon).zip(&starts) {
        data.reset();
        data.qpos_mut().copy_from_slice(qpos);
        data.qvel_mut().copy_from_slice(qvel);
        for action in actions {
            for ((control, action), [low, high]) in data.ctrl_mut().iter_mut().zip(action).zip(ranges) {
                *control = 0.5 * (low + high) + 0.5 * (high - low) * f64::from(*action);
            }
            (0..task.frame_skip()).for_each(|_| data.step());
        }
    }
    std::hint::black_box(data.qpos());
    start.elapsed().as_secs_f64()
}

/// The initial states that the trait draws.
fn starts(task: &MujocoTask, episodes: usize) -> Vec<(Vec<f64>, Vec<f64>)> {
    use demosift::environment::Environment;
    let specification = task.specification();
    let mut environment = task.mujoco_environment().unwrap();
    let mut observation = vec![0.0; specification.observation_size];
    let mut measurements = vec![0.0; specification.measurements.len()];
    (0..episodes)
        .map(|episode| {
            environment.reset(EnvVariant(0), Seed::new(0).at(episode), &mut observation, &mut measurements);
            (environment.qpos().to_vec(), environment.qvel().to_vec())
        })
        .collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
