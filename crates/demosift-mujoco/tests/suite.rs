//! What every task promises: one suite over the registry, passed by being in it.
//!
//! A promise is tried on every task before it is called broken, so one run tells all that a new task lacks.
//!
//! The numbers of HalfCheetah and Walker2d are Gymnasium's, so that returns can be compared. Their control steps and episodes
//! are therefore not those of the sports, and a test of its own holds each to its reference.

use std::panic::{AssertUnwindSafe, catch_unwind};

use demosift::basics::seed::{Rng, Seed};
use demosift::data::trajectory::{Ended, Parts, Trajectory};
use demosift::math::rows::Rows;
use demosift::world::environment::{EnvVariant, Environment, Specification, Task};
use demosift_mujoco::environment::MujocoEnvironment;
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::registry;
use rand::RngExt;

/// Numbers in an observation and in an action, as Table 2 has them (and `docs/paper.md` corrects them).
const SIZES: [(&str, usize, usize); 8] = [
    ("free_throw", 55, 21),
    ("free_throw_taller", 55, 21),
    ("free_throw_without_ball", 42, 21),
    ("penalty_save", 91, 8),
    ("handstand", 55, 21),
    ("martial_arts", 55, 21),
    ("half_cheetah", 17, 6),
    ("walker2d", 17, 6),
];
/// The tasks whose numbers are somebody else's.
const GYMNASIUMS: [&str; 2] = ["half_cheetah", "walker2d"];
/// How far random actions go: some must be out of range.
const LARGEST_ACTION: f32 = 1.2;

/// Tries a promise on every task of the registry, and tells all tasks that break it.
#[track_caller]
fn each(promise: fn(&MujocoTask)) {
    let broken: Vec<&str> = registry::names()
        .into_iter()
        .filter(|name| {
            let task = registry::load(name).unwrap();
            catch_unwind(AssertUnwindSafe(|| promise(&task))).is_err()
        })
        .collect();
    assert!(broken.is_empty(), "broken by: {}", broken.join(", "));
}

fn random_action(specification: &Specification, rng: &mut Rng) -> Vec<f32> {
    let draw = |_| rng.random_range(-LARGEST_ACTION..LARGEST_ACTION);
    (0..specification.action_size).map(draw).collect()
}

fn buffers(specification: &Specification) -> (Vec<f32>, Vec<f32>) {
    (vec![0.0; specification.observation_size], vec![0.0; specification.measurements.len()])
}

/// Random episodes of ten thousand steps together: enough that a contact which is rare happens too.
fn many(task: &MujocoTask, mut see: impl FnMut(&MujocoEnvironment, Trajectory)) {
    let mut environment = task.mujoco_environment().unwrap();
    let (mut steps, mut number) = (0, 0);
    while steps < 10_000 {
        let trajectory = episode(task, &mut environment, number);
        steps += trajectory.steps();
        number += 1;
        see(&environment, trajectory);
    }
}

/// A whole episode of random actions; the variants take turns.
fn episode(task: &MujocoTask, environment: &mut dyn Environment, number: usize) -> Trajectory {
    episode_of(task, environment, number, task.specification().horizon)
}

fn episode_of(
    task: &MujocoTask,
    environment: &mut dyn Environment,
    number: usize,
    steps: usize,
) -> Trajectory {
    let specification = task.specification();
    let (mut observation, mut measurements) = buffers(specification);
    let mut rng = Seed::new(11).of("actions").at(number).into_rng();
    let variant = EnvVariant(number % specification.variants.len());
    environment.reset(variant, Seed::new(11).at(number), &mut observation, &mut measurements);
    let mut parts = Parts {
        observations: Rows::with_capacity(observation.len(), steps + 1),
        actions: Rows::with_capacity(specification.action_size, steps),
        measurements: Rows::with_capacity(measurements.len(), steps + 1),
        task_rewards: Vec::new(),
        ended: Ended::Horizon,
    };
    parts.observations.push(&observation);
    parts.measurements.push(&measurements);
    for _ in 0..steps {
        let action = random_action(specification, &mut rng);
        let outcome = environment.step(&action, &mut observation, &mut measurements);
        parts.observations.push(&observation);
        parts.actions.push(&action);
        parts.measurements.push(&measurements);
        parts.task_rewards.push(outcome.task_reward);
        if outcome.terminated {
            parts.ended = Ended::Terminated;
            break;
        }
    }
    // Refuses what is not finite.
    Trajectory::new(parts).unwrap()
}

/// The state in which an episode starts.
fn start(task: &MujocoTask, environment: &mut MujocoEnvironment, variant: usize) -> (Vec<f64>, Vec<f64>) {
    let (mut observation, mut measurements) = buffers(task.specification());
    environment.reset(EnvVariant(variant), Seed::new(3), &mut observation, &mut measurements);
    (environment.qpos().to_vec(), environment.qvel().to_vec())
}

#[test]
fn sizes_are_as_declared() {
    each(|task| {
        let specification = task.specification();
        let name = specification.name.as_str();
        let found = SIZES.iter().find(|(known, ..)| *known == name);
        let (_, observation, action) = found.unwrap_or_else(|| panic!("declare the sizes of {name} here"));
        assert_eq!((specification.observation_size, specification.action_size), (*observation, *action));
        let parts = specification.observation_parts.iter().map(|(_, width)| width);
        assert_eq!(parts.sum::<usize>(), *observation, "{:?}", specification.observation_parts);
        assert_eq!(specification.control_ranges.len(), *action);
    });
}

#[test]
fn a_task_is_registered_under_its_own_name() {
    for name in registry::names() {
        assert_eq!(registry::load(name).unwrap().specification().name, name);
    }
}

#[test]
fn the_same_seed_gives_the_same_bits_whichever_instance_and_thread() {
    each(|task| {
        let mut other = task.mujoco_environment().unwrap();
        let first = episode_of(task, &mut task.mujoco_environment().unwrap(), 0, 150);
        assert_eq!(first, episode_of(task, &mut other, 0, 150));
        assert_ne!(first, episode_of(task, &mut other, 1, 150), "another seed, another episode");
        let elsewhere = std::thread::scope(|scope| {
            let worker = scope.spawn(|| episode_of(task, &mut task.mujoco_environment().unwrap(), 0, 150));
            worker.join().unwrap()
        });
        assert_eq!(first, elsewhere);
    });
}

#[test]
fn reset_leaves_no_trace_of_what_went_before() {
    each(|task| {
        let fresh = episode_of(task, &mut task.mujoco_environment().unwrap(), 1, 150);
        let mut used = task.mujoco_environment().unwrap();
        episode_of(task, &mut used, 0, 77);
        assert_eq!(fresh, episode_of(task, &mut used, 1, 150));
        // Not even of a simulation that blew up.
        let (mut observation, mut measurements) = buffers(task.specification());
        used.step(&vec![f32::NAN; task.specification().action_size], &mut observation, &mut measurements);
        assert!(used.is_unstable());
        assert_eq!(fresh, episode_of(task, &mut used, 1, 150));
        assert!(!used.is_unstable());
    });
}

/// Everything is finite, or there would be no trajectory.
#[test]
fn ten_thousand_random_steps_give_no_warning_and_finite_scores_and_end_early_only_where_the_task_says_so() {
    each(|task| {
        let specification = task.specification();
        let mut ended = 0;
        many(task, |environment, trajectory| {
            assert_eq!(environment.warnings(), 0, "{}", specification.name);
            assert!(task.heuristic().score(trajectory.measurements()).is_finite());
            assert!(task.true_return(trajectory.measurements()).is_none_or(f64::is_finite));
            assert!(trajectory.terminated() || trajectory.steps() == specification.horizon);
            ended += usize::from(trajectory.terminated());
        });
        assert_eq!(ended > 0, task.may_end_early(), "{}: {ended}", specification.name);
    });
}

#[test]
fn no_observation_is_constant() {
    each(|task| {
        let specification = task.specification();
        let mut changes = vec![false; specification.observation_size];
        let mut first: Option<Vec<f32>> = None;
        many(task, |_, trajectory| {
            for row in trajectory.observations().iter() {
                let first = first.get_or_insert_with(|| row.to_vec());
                let columns = changes.iter_mut().zip(row.iter().zip(first));
                columns.for_each(|(changes, (now, then))| *changes |= *now != *then);
            }
        });
        let constant: Vec<usize> = (0..changes.len()).filter(|column| !changes[*column]).collect();
        assert!(constant.is_empty(), "observations {constant:?} of {} are constant", specification.name);
    });
}

#[test]
fn everything_has_a_name_and_can_be_seen_from_two_sides() {
    each(|task| {
        let name = &task.specification().name;
        assert!(task.model().nameless().is_empty(), "{name}: {:?}", task.model().nameless());
        let cameras = task.model().cameras();
        assert!(cameras.len() >= 2, "{name} has the cameras {cameras:?}");
        assert!(cameras.iter().any(|camera| Some(camera.as_str()) == task.camera()), "{name}");
    });
}

#[test]
fn a_control_step_takes_the_time_of_its_physics_and_that_of_a_sport_is_short() {
    each(|task| {
        let specification = task.specification();
        let step_secs = task.model().timestep_secs() * f64::from(task.frame_skip());
        assert!((specification.control_step_secs - step_secs).abs() < 1e-12);
        if GYMNASIUMS.contains(&specification.name.as_str()) {
            return;
        }
        let episode_secs = step_secs * specification.horizon as f64;
        let within = |value: f64, least: f64, most: f64| value >= least - 1e-9 && value <= most + 1e-9;
        assert!(within(step_secs, 0.02, 0.03), "{}: a step of {step_secs} s", specification.name);
        assert!(within(episode_secs, 1.5, 4.0), "{}: an episode of {episode_secs} s", specification.name);
    });
}

#[test]
fn each_variant_starts_differently() {
    each(|task| {
        let mut environment = task.mujoco_environment().unwrap();
        let names = &task.specification().variants;
        let starts: Vec<_> = (0..names.len()).map(|variant| start(task, &mut environment, variant)).collect();
        for (variant, state) in starts.iter().enumerate() {
            assert_eq!(*state, start(task, &mut environment, variant), "the same seed starts the same way");
            let same: Vec<_> = (0..variant).filter(|other| starts[*other] == *state).collect();
            assert!(same.is_empty(), "variants {same:?} and {variant} of {}", task.specification().name);
        }
    });
}

#[test]
fn a_state_that_is_restored_leads_to_the_same_bits() {
    each(|task| {
        let specification = task.specification();
        let [mut one, mut other] = [(); 2].map(|()| task.mujoco_environment().unwrap());
        let play = |environment: &mut MujocoEnvironment| {
            let (mut observation, mut measurements) = buffers(specification);
            let mut rng = Seed::new(8).into_rng();
            let mut seen = Vec::new();
            for _ in 0..30 {
                let action = random_action(specification, &mut rng);
                environment.step(&action, &mut observation, &mut measurements);
                seen.push((observation.clone(), measurements.clone()));
            }
            (seen, environment.qpos().to_vec(), environment.qvel().to_vec())
        };
        for variant in 0..specification.variants.len() {
            let (qpos, qvel) = start(task, &mut one, variant);
            let wanted = play(&mut one);
            // Into an instance with a past, and one after another.
            for _ in 0..2 {
                other.set_state(&qpos, &qvel).unwrap();
                assert_eq!(play(&mut other), wanted, "{} {variant}", specification.name);
            }
            // From the middle of an episode as well.
            other.set_state(&wanted.1, &wanted.2).unwrap();
            let middle = play(&mut other);
            one.set_state(&wanted.1, &wanted.2).unwrap();
            assert_eq!(play(&mut one), middle, "{} {variant}", specification.name);
        }
    });
}

/// Of middle + half range in f64; MuJoCo cuts a control off at its range whatever it is given.
const ROUNDING: f64 = 1e-12;

#[test]
fn no_control_leaves_its_range_and_the_ends_are_reached() {
    each(|task| {
        let specification = task.specification();
        let (mut observation, mut measurements) = buffers(specification);
        let mut environment = task.mujoco_environment().unwrap();
        start(task, &mut environment, 0);
        let ranges = task.model().mujoco().actuator_ctrlrange().to_vec();
        let mut rng = Seed::new(6).into_rng();
        for _ in 0..50 {
            let action = random_action(specification, &mut rng);
            environment.step(&action, &mut observation, &mut measurements);
            for (control, [low, high]) in environment.controls().iter().zip(&ranges) {
                assert!((low - ROUNDING..=high + ROUNDING).contains(control), "{control} of {low} to {high}");
            }
        }
        for (action, end) in [(-1.0, 0), (1.0, 1), (9.0, 1)] {
            start(task, &mut environment, 0);
            environment.step(&vec![action; ranges.len()], &mut observation, &mut measurements);
            let pairs = environment.controls().iter().zip(&ranges);
            let furthest = pairs.map(|(control, range)| (control - range[end]).abs()).fold(0.0, f64::max);
            assert!(furthest <= ROUNDING, "{}: {furthest}", specification.name);
        }
    });
}
