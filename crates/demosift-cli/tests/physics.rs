//! The command on real physics: the set that the repository carries, with tiny budgets.

#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod support;

use std::path::PathBuf;

use demosift::demonstration::{DemonstrationSet, d4rl};
use demosift::environment::{EnvVariant, Environment as _, Task as _};
use demosift::recording::Origin;
use demosift::rows::Rows;
use demosift::seed::Seed;
use demosift_mujoco::registry;
use support::{Scratch, assert_same_files};

fn in_repository(path: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

#[test]
fn eight_free_throws_are_sifted_to_the_same_bytes_on_one_thread_and_two() {
    let scratch = Scratch::new("free-throw");
    let set = in_repository("data/free_throw_8");
    for threads in [1, 2] {
        let job = format!("--task free_throw --config tiny.toml --threads {threads} --out run{threads}");
        let said = scratch.succeed(&format!("sift {} {job}", set.display()));
        assert!(said.contains("gain [m]") && said.contains("all 8"), "{said}");
    }
    assert_same_files(&scratch.files("run1"), &scratch.files("run2"));
}

#[test]
fn the_free_throws_are_whole_and_their_origin_stands_apart() {
    let folder = in_repository("data/free_throw_8");
    let set = d4rl::read(&folder.join("demonstrations.hdf5")).unwrap();
    assert_eq!((set.len(), set.observation_size(), set.action_size()), (8, 55, 21));
    assert!(set.iter().all(|(_, demonstration)| demonstration.steps() == 60));
    let files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().file_name()).collect();
    assert_eq!(files, ["demonstrations.hdf5"]);
    assert!(in_repository("data/provenance/free_throw_8.json").exists());
}

#[test]
fn the_public_half_cheetah_set_is_judged() {
    let set = in_repository("../shared/data/half_cheetah_noisy/half_cheetah_noisy.hdf5");
    if !set.exists() {
        eprintln!("skipped: the public HalfCheetah set is not there");
        return;
    }
    let scratch = Scratch::new("half-cheetah");
    let tiny = "--config tiny.toml --set meta_train.rounds=1 --set judge.iterations=1 --set judge.repeats=1 \
                --set judge.evaluations=2 --set inner.batch_steps=2000";
    let said = scratch.succeed(&format!("judge {} --task half_cheetah {tiny} --out run", set.display()));
    assert!(said.contains("gain [m]"), "{said}");
    assert!(scratch.files("run").contains_key("scores.json"));
}

/// A set of free throws with where each came from.
fn throws(name: &str) -> (DemonstrationSet, Vec<Origin>) {
    let set = d4rl::read(&in_repository(&format!("data/{name}/demonstrations.hdf5"))).unwrap();
    let provenance = std::fs::read(in_repository(&format!("data/provenance/{name}.json"))).unwrap();
    let provenance: serde_json::Value = serde_json::from_slice(&provenance).unwrap();
    let origins = serde_json::from_value(provenance["demonstrations"].clone()).unwrap();
    (set, origins)
}

/// The simulator's states of a set: one row of positions, one of velocities, for each of its steps.
fn states(name: &str) -> [Vec<f64>; 2] {
    let file = hdf5_pure::File::open(in_repository(&format!("data/{name}/demonstrations.hdf5"))).unwrap();
    ["infos/qpos", "infos/qvel"].map(|table| file.dataset(table).unwrap().read_f64().unwrap())
}

/// Whoever changes a model of the throwers makes the recorded sets wrong, and is told here.
#[test]
fn each_recorded_throw_plays_again_to_the_bit_in_the_body_that_threw_it() {
    for name in ["free_throw_8", "free_throw_20"] {
        let (set, origins) = throws(name);
        let [qpos, qvel] = states(name);
        for ((id, throw), origin) in set.iter().zip(&origins) {
            let task = registry::load(&origin.task).unwrap();
            let mut environment = task.mujoco_environment().unwrap();
            let (mut observation, mut measurements) = ([0.0; 55], [0.0; 8]);
            for step in 0..throw.steps() {
                let row = id.0 * throw.steps() + step;
                let recorded = (&qpos[row * 28..][..28], &qvel[row * 27..][..27]);
                if step == 0 {
                    environment.set_state(recorded.0, recorded.1).unwrap();
                }
                assert_eq!((environment.qpos(), environment.qvel()), recorded, "{name} {id} at step {step}");
                environment.step(throw.actions().row(step), &mut observation, &mut measurements);
            }
        }
    }
}

/// The same throw, from other starts and in whatever body.
fn scores(task: &str, actions: &Rows, starts: usize) -> usize {
    let task = registry::load(task).unwrap();
    let mut environment = task.mujoco_environment().unwrap();
    let width = task.specification().measurements.len();
    let scored = |start: &usize| {
        let (mut observation, mut now) = ([0.0; 55], vec![0.0; width]);
        environment.reset(EnvVariant(0), Seed::new(*start as u64), &mut observation, &mut now);
        let mut measurements = Rows::with_capacity(width, actions.len() + 1);
        measurements.push(&now);
        for action in actions.iter() {
            environment.step(action, &mut observation, &mut now);
            measurements.push(&now);
        }
        task.succeeded(&measurements).unwrap()
    };
    (0..starts).filter(scored).count()
}

/// What makes the taller thrower a guest: no throw that scores for one body is a recipe for the other.
#[test]
fn a_throw_that_scores_for_one_body_seldom_scores_for_the_other() {
    let (set, origins) = throws("free_throw_20");
    let bodies = ["free_throw", "free_throw_taller"];
    // Of ten starts each: how often a body's successful throws score for the body, and for the other one.
    let outcomes = [(bodies[0], bodies[1]), (bodies[1], bodies[0])].map(|(own, other)| {
        let successful = |origin: &Origin| origin.task == own && origin.succeeded == Some(true);
        let throws: Vec<&Rows> = set
            .iter()
            .zip(&origins)
            .filter(|(_, origin)| successful(origin))
            .map(|((_, throw), _)| throw.actions())
            .collect();
        let count = |task: &str| throws.iter().map(|actions| scores(task, actions, 10)).sum::<usize>();
        (throws.len(), count(own), count(other))
    });
    let [(throws, in_own, in_taller), (taller_throws, in_taller_own, in_shorter)] = outcomes;
    assert!(throws >= 2 && taller_throws == 6, "{outcomes:?}");
    assert!(in_own > 5 * throws && in_taller_own > 7 * taller_throws, "{outcomes:?}");
    // The taller thrower is too weak for what the other one does.
    assert_eq!(in_taller, 0, "{outcomes:?}");
    // The other way round some go in by luck: the full strength of the one is the full strength of the other.
    assert!(in_shorter < 4 * taller_throws, "{outcomes:?}");
}
