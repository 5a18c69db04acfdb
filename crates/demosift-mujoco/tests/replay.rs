//! What a replay measures is what was measured when the episode was recorded.

use std::path::{Path, PathBuf};

use demosift::basics::seed::Seed;
use demosift::data::demonstration::d4rl;
use demosift::data::observation_filter::ObservationFilter;
use demosift::data::trajectory::StateLog;
use demosift::math::agreement;
use demosift::math::rows::Rows;
use demosift::world::environment::{EnvVariant, Episode, Rollout, Task};
use demosift::world::policy::{Policy, PolicyShape};
use demosift::world::rollout::{self, Acting, Playground};
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::{registry, replay};
use serde_json::Value;

fn in_repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

/// Each set of the repository, with the task whose name its own begins with, against the scores stored at its recording.
#[test]
fn a_replayed_demonstration_has_the_score_and_the_success_that_were_stored_when_it_was_recorded() {
    let mut sets = 0;
    for folder in std::fs::read_dir(in_repository("data")).unwrap() {
        let folder = folder.unwrap().path();
        let set_file = folder.join("demonstrations.hdf5");
        let name = folder.file_name().unwrap().to_str().unwrap().to_owned();
        let task =
            registry::names().into_iter().filter(|task| name.starts_with(task)).max_by_key(|task| task.len());
        let (true, Some(task)) = (set_file.exists(), task) else { continue };
        sets += 1;
        let task = registry::load(task).unwrap();
        let provenance =
            std::fs::read_to_string(in_repository(&format!("data/provenance/{name}.json"))).unwrap();
        let provenance: Value = serde_json::from_str(&provenance).unwrap();
        let set = d4rl::read(&set_file).unwrap();
        let states = d4rl::read_states(&set_file).unwrap().unwrap();
        for ((id, demonstration), states) in set.iter().zip(&states) {
            let origin = &provenance["demonstrations"][id.0];
            let rows = replay::measurements(&task, states, demonstration.actions()).unwrap();
            let (found, stored) = (task.heuristic().score(&rows), origin["score"].as_f64().unwrap());
            eprintln!("{name} {id}: replayed {found}, stored {stored}, differ by {:e}", found - stored);
            assert!((found - stored).abs() <= 1e-6 * stored.abs().max(1.0), "{name} {id}: {found} {stored}");
            assert_eq!(task.succeeded(&rows), origin["succeeded"].as_bool(), "{name} {id}");
        }
    }
    assert!(sets >= 1);
}

fn rolled_out(task: &MujocoTask, number: usize) -> (Rows, Rows, StateLog) {
    let playground = Playground::new(task);
    let specification = task.specification();
    let shape = PolicyShape { hidden: vec![8], initial_std: 0.8 };
    let filter = ObservationFilter::identity(specification.observation_size);
    let policy = Policy::untrained(&shape, filter, specification.action_size, Seed::new(1));
    let variant = EnvVariant(number % specification.variants.len());
    let (policy, acting, seed) = (&policy, Acting::Sampled, &Seed::new(7).at(number));
    let episode = Episode { policy, acting, variant, seed, keep_states: true };
    let Rollout { trajectory, states } = rollout::play_episodes(&playground, &[episode]).unwrap().remove(0);
    (trajectory.measurements().clone(), trajectory.actions().clone(), states.unwrap())
}

#[test]
fn a_replay_measures_what_the_episode_measured_to_the_last_bit_but_for_the_last_row() {
    for task in registry::names() {
        let task = registry::load(task).unwrap();
        for number in 0..3 {
            let (measured, actions, states) = rolled_out(&task, number);
            let replayed = replay::measurements(&task, &states, &actions).unwrap();
            let (last, name) = (actions.len(), &task.specification().name);
            assert_eq!(replayed.len(), last + 1);
            assert_eq!(replayed.head(last), measured.head(last), "{name} {number}");
            for (found, wanted) in replayed.row(last).iter().zip(measured.row(last)) {
                assert!(
                    (found - wanted).abs() <= 1e-3 * wanted.abs().max(1.0),
                    "{name} {number}: {found} {wanted}"
                );
            }
        }
    }
}

/// The public set holds no states and no place of the root. Here its speed is added up to one, which with the rest of
/// the observation makes states whose heuristic can be held against the true returns in the file.
#[test]
fn the_distance_of_the_public_half_cheetah_episodes_agrees_with_their_true_returns() {
    let path = in_repository("../shared/data/half_cheetah_noisy/half_cheetah_noisy.hdf5");
    let Ok(file) = hdf5_pure::File::open(&path) else {
        return eprintln!("skipped: the public HalfCheetah set is not there");
    };
    assert_eq!(d4rl::read_states(&path).unwrap(), None, "so the column of `sift` is not there for it");
    let task = registry::load("half_cheetah").unwrap();
    let secs = task.specification().control_step_secs;
    let rewards = file.dataset("rewards").unwrap().read_f64().unwrap();
    let (mut ours, mut returns) = (Vec::new(), Vec::new());
    for (id, demonstration) in d4rl::read(&path).unwrap().iter() {
        let mut states = StateLog::default();
        let mut x = 0.0;
        for row in demonstration.observations().iter() {
            states.qpos.push(x);
            states.qpos.extend(row[..8].iter().map(|value| f64::from(*value)));
            states.qvel.extend(row[8..].iter().map(|value| f64::from(*value)));
            x += secs * f64::from(row[8]);
        }
        let rows = replay::measurements(&task, &states, demonstration.actions()).unwrap();
        ours.push(task.heuristic().score(&rows));
        let steps = demonstration.steps();
        returns.push(rewards[id.0 * steps..(id.0 + 1) * steps].iter().sum());
        eprintln!("episode {id}: {:.1} m, true return {:.0}", ours[id.0], returns[id.0]);
    }
    let agreement = agreement::spearman(&ours, &returns);
    eprintln!("Spearman {agreement:.3}");
    assert!(agreement > 0.95, "{agreement}");
}

/// The same of the public Walker2d set, whose file holds each episode's true return: 1 a step, the distance, and little effort.
/// The clipped velocities do not enter it, nor does what Gym charged for actions beyond the range.
#[test]
fn the_true_returns_of_the_public_walker2d_episodes_are_those_of_their_file() {
    let path = in_repository("../shared/data/walker2d_noisy/walker2d_noisy.hdf5");
    let Ok(file) = hdf5_pure::File::open(&path) else {
        return eprintln!("skipped: the public Walker2d set is not there");
    };
    let task = registry::load("walker2d").unwrap();
    let secs = task.specification().control_step_secs;
    let rewards = file.dataset("rewards").unwrap().read_f64().unwrap();
    let mut first = 0;
    for (id, demonstration) in d4rl::read(&path).unwrap().iter() {
        let mut states = StateLog::default();
        let mut x = 0.0;
        for row in demonstration.observations().iter() {
            states.qpos.push(x);
            states.qpos.extend(row[..8].iter().map(|value| f64::from(*value)));
            states.qvel.extend(row[8..].iter().map(|value| f64::from(*value)));
            x += secs * f64::from(row[8]);
        }
        let rows = replay::measurements(&task, &states, demonstration.actions()).unwrap();
        let steps = demonstration.steps();
        let wanted: f64 = rewards[first..first + steps].iter().sum();
        first += steps;
        let found = task.true_return(&rows).unwrap();
        eprintln!("episode {id}: {found:.0}, true return {wanted:.0}");
        assert!((found - wanted).abs() < 0.02 * wanted + 5.0, "episode {id}: {found} {wanted}");
    }
}

#[test]
fn states_and_actions_of_another_task_are_refused() {
    let cheetah = registry::load("half_cheetah").unwrap();
    let thrower = registry::load("free_throw").unwrap();
    let (_, actions, states) = rolled_out(&cheetah, 0);
    let error = replay::measurements(&thrower, &states, &actions).map(drop).unwrap_err();
    assert!(
        error.is_bad_input() && error.to_string().contains("of 6 numbers; 'free_throw' takes"),
        "{error}"
    );
    let short = StateLog { qpos: states.qpos[9..].to_vec(), ..states.clone() };
    let error = replay::measurements(&cheetah, &short, &actions).unwrap_err();
    let wanted =
        "8991 numbers of qpos in 1000 steps do not fit the model of 'half_cheetah', whose states have 9 each";
    assert_eq!(error.to_string(), wanted);
    let mut broken = states.clone();
    broken.qvel[9 * 4 + 2] = f64::NAN;
    let error = replay::measurements(&cheetah, &broken, &actions).unwrap_err();
    assert!(error.to_string().contains("step 4: qvel[2] is NaN"), "{error}");
    let mut unstable = states.clone();
    unstable.qvel[9 * 999 + 2] = 1e300;
    let error = replay::measurements(&cheetah, &unstable, &actions).map(drop).unwrap_err();
    assert!(error.is_bad_input() && error.to_string().contains("at step 1000: 'effort' is NaN"), "{error}");
}
