//! What a check of a task finds: mistakes that are planted one by one in an arm that is right, and in recordings of it.

use demosift::basics::seed::Seed;
use demosift::data::demonstration::{Demonstration, DemonstrationSet};
use demosift::data::trajectory::StateLog;
use demosift::math::rows::Rows;
use demosift::world::environment::{EnvVariant, Environment as _, Task as _};
use demosift_mujoco::check::{self, Finding, Recorded, Severity, StatesFrom};
use demosift_mujoco::mujoco_task::MujocoTask;
use rand::RngExt as _;

const MODEL: &str = r#"
<mujoco>
  <option timestep="0.01" gravity="0 0 0"/>
  <default><joint type="hinge" axis="0 0 1" damping="0.05" armature="0.01"/><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <camera name="above" pos="0 0 1"/>
    <site name="target" pos="0 0.2 0"/>
    <body name="upper"><joint name="shoulder"/><geom name="upper" type="capsule" size="0.02" fromto="0 0 0 0.1 0 0"/>
      <body name="fore" pos="0.1 0 0"><joint name="elbow"/>
        <geom name="fore" type="capsule" size="0.02" fromto="0 0 0 0.1 0 0"/><site name="hand" pos="0.1 0 0"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="push" joint="shoulder" gear="0.2" ctrlrange="-1 1"/>
    <motor name="bend" joint="elbow" gear="0.1" ctrlrange="-2 2"/>
  </actuator>
</mujoco>"#;

const TASK: &str = r#"
name = "arm"
model = "arm.xml"
frame_skip = 4
horizon = 40
observation = [{ qpos = "all" }, { qvel = "all" }, { position = ["hand"] }, "phase"]
reward = [{ measurement = "reach", weight = -1.0 }]
[reset]
qpos_noise = { uniform = 0.1 }
qvel_noise = { uniform = 0.1 }
[measurements]
reach = { distance = ["hand", "target"] }
[heuristic]
fold = "mean"
of = "reach"
negate = true
unit = "m"
[success]
fold = "last"
of = "reach"
below = 0.02
"#;

fn load(task: &str, model: &str) -> MujocoTask {
    MujocoTask::from_texts(task, &[("arm.xml", model)], None).unwrap()
}

/// Everything that is found without demonstrations, in the task and model after a replacement in one of them.
fn found(old: &str, new: &str) -> Vec<Finding> {
    assert!(TASK.contains(old) != MODEL.contains(old), "{old}");
    let task = load(&TASK.replace(old, new), &MODEL.replace(old, new));
    let (_, mut findings) = check::look(&task);
    findings.extend(check::play(&task, &Seed::new(0)).unwrap().1);
    findings
}

#[track_caller]
fn assert_found(findings: &[Finding], severity: Severity, part: &str) {
    let has = findings.iter().any(|one| {
        let words = format!("{}: {}", one.message, one.advice.as_deref().unwrap_or_default());
        one.severity == severity && words.contains(part)
    });
    assert!(has, "wanted: {severity:?} {part}\ngot: {findings:#?}");
}

#[track_caller]
fn assert_fine(findings: &[Finding]) {
    assert!(findings.iter().all(|one| one.severity == Severity::Fine), "{findings:#?}");
}

#[test]
fn an_arm_that_is_right_is_described_and_found_fine() {
    let task = load(TASK, MODEL);
    let (seen, findings) = check::look(&task);
    assert_fine(&findings);
    assert_eq!((seen.positions, seen.velocities, seen.observation_size), (2, 2, 8));
    assert_eq!((seen.control_step_secs, seen.episode_secs), (0.04, 1.6));
    let columns: Vec<&str> =
        seen.observation.iter().flat_map(|part| &part.columns).map(String::as_str).collect();
    let wanted = "qpos shoulder|qpos elbow|qvel shoulder|qvel elbow|position hand x|position hand y|position hand z|phase";
    assert_eq!(columns.join("|"), wanted);
    assert_eq!(seen.observation.iter().map(|part| part.first).collect::<Vec<_>>(), [0, 2, 4, 7]);
    assert_eq!(
        (seen.actuators[1].name.as_str(), seen.actuators[1].low, seen.actuators[1].high),
        ("bend", -2.0, 2.0)
    );
    assert_eq!(seen.heuristic, "the mean of reach over the steps, negated");
    assert_eq!(seen.success.as_deref(), Some("the last reach is below 0.02"));
    assert_eq!(seen.measurements[0].what, "distance of hand and target, m");
    let (played, findings) = check::play(&task, &Seed::new(0)).unwrap();
    // The hand stays in its plane, so its z never changes, and nothing else is wrong.
    assert!(played.repeats && played.unstable == 0 && played.warnings.is_empty());
    assert_eq!((played.episodes, played.steps), (125, 5000));
    assert!(played.observation.iter().filter(|range| range.is_constant()).count() == 1, "{played:?}");
    assert_found(
        &findings,
        Severity::Warning,
        "1 of the 8 numbers of an observation never changed: position hand z",
    );
    assert_eq!(check::count(&findings, Severity::Warning), 1, "{findings:#?}");
    // What is found depends on the seed alone.
    assert_eq!(check::play(&task, &Seed::new(0)).unwrap().0, played);
    assert_ne!(check::play(&task, &Seed::new(1)).unwrap().0, played);
}

#[test]
fn each_mistake_in_a_task_is_found() {
    use Severity::{Error, Warning};
    for (old, new, severity, part) in [
        (
            "negate = true",
            "",
            Warning,
            "the higher the larger the distance `reach`: if near is good, add `negate",
        ),
        (
            "fold = \"mean\"\nof = \"reach\"\nnegate = true",
            "fold = \"last_minus_first\"\nof = \"reach\"",
            Warning,
            "the higher the larger the distance `reach`",
        ),
        (
            "reward = [{ measurement = \"reach\", weight = -1.0 }]",
            "",
            Warning,
            "`demosift record` has nothing",
        ),
        ("<camera name=\"above\" pos=\"0 0 1\"/>", "", Warning, "no camera"),
        ("frame_skip = 4", "frame_skip = 40", Warning, "a control step of 0.4000 s is unusual"),
        ("horizon = 40", "horizon = 4", Warning, "an episode of 4 control steps (0.16 s) is unusual"),
        ("joint=\"elbow\" gear=\"0.1\"", "joint=\"elbow\" gear=\"0\"", Warning, "observed or measured: bend"),
        (
            "qpos_noise = { uniform = 0.1 }\nqvel_noise = { uniform = 0.1 }",
            "",
            Warning,
            "starts in the same state",
        ),
        (
            "of = \"reach\"\nbelow = 0.02",
            "of = \"reach\"\nabove = 0",
            Warning,
            "every random episode is a success",
        ),
        (
            "[\"hand\", \"target\"]",
            "[\"body:upper\", \"target\"]",
            Error,
            "in all random episodes, whatever was done",
        ),
        (
            "[\"hand\", \"target\"]",
            "[\"body:upper\", \"target\"]",
            Warning,
            "measurements that never changed: reach",
        ),
        (
            "armature=\"0.01\"",
            "armature=\"0.01\" stiffness=\"-900\"",
            Error,
            "the simulation became unstable in",
        ),
        (" contype=\"0\" conaffinity=\"0\"", "", Warning, "inside each other"),
    ] {
        let findings = if old.contains("contype") {
            // Bodies that are parent and child do not collide, so something else is put in the way.
            let model = MODEL.replace(old, new).replace(
                "<site name=\"target\" pos=\"0 0.2 0\"/>",
                "<site name=\"target\" pos=\"0 0.2 0\"/><body name=\"box\" pos=\"0.2 0 0\"><geom name=\"box\" type=\"box\" size=\"0.05 0.05 0.05\"/></body>",
            );
            check::play(&load(TASK, &model), &Seed::new(0)).unwrap().1
        } else {
            found(old, new)
        };
        assert_found(&findings, severity, part);
    }
}

/// Three episodes of random actions with their states, as `task` plays them.
fn record(task: &MujocoTask) -> (Vec<Demonstration>, Vec<StateLog>) {
    let specification = task.specification();
    let mut environment = task.mujoco_environment().unwrap();
    let mut observation = vec![0.0; specification.observation_size];
    let mut now = vec![0.0; specification.measurements.len()];
    let (mut demonstrations, mut logs) = (Vec::new(), Vec::new());
    for number in 0..3 {
        let mut rng = Seed::new(4).at(number).into_rng();
        environment.reset(EnvVariant(0), Seed::new(5).at(number), &mut observation, &mut now);
        let mut observations = Rows::with_capacity(observation.len(), specification.horizon);
        let mut actions = Rows::with_capacity(specification.action_size, specification.horizon);
        let mut log = StateLog::default();
        for _ in 0..specification.horizon {
            observations.push(&observation);
            log.qpos.extend(environment.qpos());
            log.qvel.extend(environment.qvel());
            let action: Vec<f32> =
                (0..specification.action_size).map(|_| rng.random_range(-1.0..1.0)).collect();
            let outcome = environment.step(&action, &mut observation, &mut now);
            actions.push(&action);
            if outcome.terminated {
                break;
            }
        }
        demonstrations.push(Demonstration::new(observations, actions).unwrap());
        logs.push(log);
    }
    (demonstrations, logs)
}

fn all(set: &DemonstrationSet) -> Vec<Demonstration> {
    set.iter().map(|(_, one)| one.clone()).collect()
}

/// The set with other observations and actions, made row by row of the old ones.
fn changed(
    set: &[Demonstration],
    observe: impl Fn(&[f32]) -> Vec<f32>,
    act: impl Fn(&Rows, usize) -> Vec<f32>,
) -> Vec<Demonstration> {
    let demonstrations = set.iter().map(|one| {
        let observations: Vec<Vec<f32>> = one.observations().iter().map(&observe).collect();
        let actions: Vec<Vec<f32>> = (0..one.steps()).map(|step| act(one.actions(), step)).collect();
        let rows = |rows: &[Vec<f32>]| rows.iter().map(Vec::as_slice).collect::<Rows>();
        Demonstration::new(rows(&observations), rows(&actions)).unwrap()
    });
    demonstrations.collect()
}

fn same(actions: &Rows, step: usize) -> Vec<f32> {
    actions.row(step).to_vec()
}

fn compared(task: &MujocoTask, set: &[Demonstration], states: &[StateLog]) -> (Recorded, Vec<Finding>) {
    check::compare(task, set, Some(states)).unwrap()
}

#[test]
fn a_recording_of_the_task_itself_is_found_fine() {
    let task = load(TASK, MODEL);
    let (set, states) = record(&task);
    let (recorded, findings) = compared(&task, &set, &states);
    assert_fine(&findings);
    assert_eq!(recorded.states, StatesFrom::Recording);
    for one in &recorded.demonstrations {
        let drift = one.drift.unwrap();
        assert!(drift.greatest < 1e-9 && drift.left_at.is_none() && one.missed.unwrap() < 1e-9, "{one:?}");
        assert!(one.score.unwrap() < 0.0 && one.outside == 0, "{one:?}");
    }
}

#[test]
fn observations_in_another_order_or_unit_are_found_and_named() {
    let task = load(TASK, MODEL);
    let (set, states) = record(&task);
    let swapped = |row: &[f32]| [&row[2..4], &row[..2], &row[4..]].concat();
    let (_, findings) = compared(&task, &changed(&set, swapped, same), &states);
    assert_found(&findings, Severity::Error, "4 of the 8 numbers of the recorded observations are not");
    assert_found(
        &findings,
        Severity::Error,
        "number 0 is qvel shoulder, number 1 is qvel elbow, number 2 is qpos shoulder",
    );
    let degrees = |row: &[f32]| [&[row[0], row[1].to_degrees()], &row[2..]].concat();
    let (_, findings) = compared(&task, &changed(&set, degrees, same), &states);
    assert_found(
        &findings,
        Severity::Error,
        "number 1 should be qpos elbow: in the recording number 1 is in degrees, qpos elbow",
    );
    let fewer = |row: &[f32]| vec![row[0].cos(), row[0].sin(), row[3]];
    let (_, findings) = compared(&task, &changed(&set, fewer, same), &states);
    assert_found(&findings, Severity::Error, "a recorded observation has 3 numbers, and the task observes 8");
    assert_found(
        &findings,
        Severity::Error,
        "number 0 is the cosine of qpos shoulder, number 1 is the sine of qpos shoulder, number 2 is qvel elbow",
    );
    let strange = |row: &[f32]| [&[row[0] * row[1]], &row[1..]].concat();
    let (_, findings) = compared(&task, &changed(&set, strange, same), &states);
    assert_found(&findings, Severity::Error, "number 0 should be qpos shoulder: none of them is a position");
}

#[test]
fn observations_of_the_next_step_are_found() {
    let task = load(TASK, MODEL);
    let (set, states) = record(&task);
    let demonstrations = set.iter().map(|one| {
        let rows: Rows =
            (0..one.steps()).map(|step| one.observations().row((step + 1).min(one.steps() - 1))).collect();
        Demonstration::new(rows, one.actions().clone()).unwrap()
    });
    let late: Vec<Demonstration> = demonstrations.collect();
    let (_, findings) = compared(&task, &late, &states);
    assert_found(&findings, Severity::Error, "seem to be those after the action");
}

#[test]
fn actions_that_lead_elsewhere_are_found_and_explained() {
    let task = load(TASK, MODEL);
    let (set, states) = record(&task);
    let observe = |row: &[f32]| row.to_vec();
    for (words, act) in [
        (
            "each action one step late",
            (|actions, step| actions.row(step.saturating_sub(1)).to_vec()) as fn(&Rows, usize) -> Vec<f32>,
        ),
        ("each action one step early", |actions, step| {
            actions.row((step + 1).min(actions.len() - 1)).to_vec()
        }),
        ("controls in the units of ctrlrange", |actions, step| {
            vec![actions.row(step)[0], 2.0 * actions.row(step)[1]]
        }),
    ] {
        let (recorded, findings) = compared(&task, &changed(&set, observe, act), &states);
        assert_found(&findings, Severity::Error, words);
        assert!(recorded.demonstrations.iter().all(|one| one.drift.unwrap().left_at.is_some()));
    }
    let (_, findings) =
        compared(&load(&TASK.replace("frame_skip = 4", "frame_skip = 2"), MODEL), &set, &states);
    assert_found(
        &findings,
        Severity::Error,
        "it was recorded with frame_skip = 4, a control step of 0.0400 s",
    );
    let other = MODEL.replace("damping=\"0.05\" armature=\"0.01\"", "damping=\"0.5\" armature=\"0.5\"");
    let (_, findings) = compared(&load(TASK, &other), &set, &states);
    assert_found(&findings, Severity::Error, "the model is another one");
}

#[test]
fn a_demonstration_by_another_body_is_told_from_the_others() {
    let task = load(TASK, MODEL);
    let heavier = load(TASK, &MODEL.replace("armature=\"0.01\"", "armature=\"0.03\""));
    let ((own, mut states), (others, other_states)) = (record(&task), record(&heavier));
    let demonstrations = own.iter().zip(others.iter()).enumerate();
    let mixed = demonstrations.map(|(at, (own, other))| if at == 1 { other } else { own }.clone());
    let mixed: Vec<Demonstration> = mixed.collect();
    states[1] = other_states[1].clone();
    let (recorded, findings) = compared(&task, &mixed, &states);
    assert_found(&findings, Severity::Warning, "the actions of 1 of 3 demonstrations (1) do not lead");
    assert_found(&findings, Severity::Warning, "another model or body than the others");
    let missed: Vec<bool> =
        recorded.demonstrations.iter().map(|one| one.typically_missed.unwrap() > 0.2).collect();
    assert_eq!(missed, [false, true, false]);
}

#[test]
fn what_does_not_fit_is_said_with_sizes() {
    let task = load(TASK, MODEL);
    let (set, states) = record(&task);
    let three = changed(&set, |row| row.to_vec(), |actions, step| [actions.row(step), &[0.0]].concat());
    let (recorded, findings) = compared(&task, &three, &states);
    assert_found(&findings, Severity::Error, "an action of the set has 3 numbers, and one of the task 2");
    assert!(recorded.demonstrations.iter().all(|one| one.drift.is_none()));
    let wild = changed(&set, |row| row.to_vec(), |actions, step| vec![3.0, actions.row(step)[1]]);
    let (_, findings) = compared(&task, &wild, &states);
    assert_found(
        &findings,
        Severity::Warning,
        "50.0 % of the numbers of actions are outside [-1, 1], up to 3.00",
    );
    let (_, findings) = check::compare(&task, &changed(&set, |row| row[..5].to_vec(), same), None).unwrap();
    assert_found(
        &findings,
        Severity::Error,
        "an observation of the set has 5 numbers, and one of the task 8: change `observation` (qpos 2, qvel 2, position 3, phase 1)",
    );
    let short: Vec<StateLog> =
        states.iter().map(|log| StateLog { qpos: log.qpos[1..].to_vec(), ..log.clone() }).collect();
    let (_, findings) = compared(&task, &set, &short);
    assert_found(&findings, Severity::Error, "demonstration 0: 79 numbers of qpos in 40 steps do not fit");
    let other = changed(&set, |row| row[..5].to_vec(), same);
    let (_, findings) = compared(&task, &other, &short);
    assert_found(&findings, Severity::Error, "an observation of the set has 5 numbers");
    let (_, findings) = compared(&load(&TASK.replace("horizon = 40", "horizon = 50"), MODEL), &set, &states);
    assert_found(
        &findings,
        Severity::Warning,
        "3 of 3 demonstrations have 40 steps, and an episode of the task 50",
    );
}

#[test]
fn one_demonstration_is_enough_and_none_or_two_sizes_are_not() {
    let task = load(TASK, MODEL);
    let (set, states) = record(&task);
    let (recorded, findings) = compared(&task, &set[..1], &states[..1]);
    assert_fine(&findings);
    assert_eq!(recorded.demonstrations.len(), 1);
    let narrow = changed(&set[1..2], |row| row[..5].to_vec(), same);
    let (_, findings) = compared(&task, &[&set[..1], &narrow].concat(), &states[..2]);
    assert_found(
        &findings,
        Severity::Error,
        "demonstration 1 has 5 observed numbers and 2 actions, but demonstration 0 has 8 and 2",
    );
    assert_found(&compared(&task, &[], &[]).1, Severity::Error, "the set holds no demonstration");
}

#[test]
fn positions_or_velocities_that_were_not_recorded_are_found() {
    let task = load(TASK, MODEL);
    let (set, states) = record(&task);
    let still = states.iter().map(|log| StateLog { qpos: vec![0.0; log.qpos.len()], ..log.clone() });
    let (recorded, findings) = compared(&task, &set, &still.collect::<Vec<_>>());
    assert_found(
        &findings,
        Severity::Error,
        "positions never change in the recording of 3 of 3 demonstrations",
    );
    assert!(recorded.demonstrations.iter().all(|one| one.missed.unwrap() < 10.0), "{recorded:?}");
    assert!(findings.iter().all(|one| one.message.len() < 300), "{findings:#?}");
    let slow = states.iter().map(|log| StateLog { qvel: vec![0.0; log.qvel.len()], ..log.clone() });
    let (_, findings) = compared(&task, &set, &slow.collect::<Vec<_>>());
    assert_found(&findings, Severity::Error, "velocities are 0 all along in the recording of 3 of 3");
}

/// What is wrong after the first steps of a very large set is not seen, which is said.
#[test]
fn of_a_large_set_the_first_steps_are_looked_at() {
    let task = load(TASK, MODEL);
    let (set, states) = record(&task);
    let many: Vec<Demonstration> = set.iter().cycle().take(600).cloned().collect();
    let logs: Vec<StateLog> = states.iter().cycle().take(600).cloned().collect();
    let (_, findings) = compared(&task, &many, &logs);
    assert_fine(&findings);
    assert_found(&findings, Severity::Fine, "number by number (of the first 33 steps of each demonstration)");
    assert_found(&findings, Severity::Fine, "of its change) (of the first 33 steps of each demonstration)");
    let swapped = |row: &[f32]| [&row[2..4], &row[..2], &row[4..]].concat();
    let (_, findings) = compared(&task, &changed(&many, swapped, same), &logs);
    assert_found(
        &findings,
        Severity::Error,
        "(of the first 33 steps of each demonstration): in the recording number 0",
    );
}

#[test]
fn of_very_long_episodes_the_beginning_is_played() {
    let long = load(&TASK.replace("horizon = 40", "horizon = 10000000"), MODEL);
    let (played, findings) = check::play(&long, &Seed::new(0)).unwrap();
    assert_eq!((played.episodes, played.steps_per_episode, played.steps), (4, 50_000, 200_000));
    // Two episodes again, and two actuators either way.
    assert_eq!(played.steps_in_all, 200_000 + 2 * 50_000 + 2 * 2 * 10);
    assert_eq!((played.success, played.steps_per_sec(2.0)), (None, 150_020.0));
    assert_eq!(check::count(&findings, Severity::Error), 0, "{findings:#?}");
}

#[test]
fn a_part_without_a_name_is_called_the_same_everywhere() {
    let task = load(
        TASK,
        &MODEL
            .replace("<joint name=\"elbow\"/>", "<joint/>")
            .replace("\"bend\" joint=\"elbow\"", "\"bend\" joint=\"shoulder\""),
    );
    let (seen, _) = check::look(&task);
    assert_eq!(seen.joints, ["shoulder", "joint 1"]);
    assert_eq!(seen.observation[0].columns, ["qpos shoulder", "qpos joint 1"]);
}

#[test]
fn states_are_taken_from_observations_that_hold_all_of_them() {
    let task = load(TASK, MODEL);
    let (set, _) = record(&task);
    let (recorded, findings) = check::compare(&task, &set, None).unwrap();
    assert_eq!(recorded.states, StatesFrom::Observations);
    assert_fine(&findings);
    assert!(recorded.demonstrations.iter().all(|one| one.missed.unwrap() < 1e-4));
    let swapped = |row: &[f32]| [&row[2..4], &row[..2], &row[4..]].concat();
    let (_, findings) = check::compare(&task, &changed(&set, swapped, same), None).unwrap();
    assert_found(
        &findings,
        Severity::Error,
        "the recorded observations stand in another order: [2, 3, 0, 1, 4, 5, 6, 7]",
    );
    let blind = load(&TASK.replace("{ qvel = \"all\" }", "{ qvel = \"elbow\" }"), MODEL);
    let (set, _) = record(&blind);
    let (recorded, findings) = check::compare(&blind, &set, None).unwrap();
    assert_eq!(recorded.states, StatesFrom::Nowhere);
    assert_found(&findings, Severity::Warning, "the set holds no states");
}

/// Where a cheetah is does not matter to it, so its task does not show it, and it can be played again without.
#[test]
fn states_are_taken_from_observations_without_the_place_of_a_slide() {
    let task = demosift_mujoco::registry::load("half_cheetah").unwrap();
    let (set, _) = record(&task);
    let (recorded, findings) = check::compare(&task, &set, None).unwrap();
    assert_eq!(recorded.states, StatesFrom::Observations);
    assert_fine(&findings);
    assert_found(&findings, Severity::Fine, "every position that matters and velocity");
    // The heuristic is the place, which is not known.
    assert!(recorded.demonstrations.iter().all(|one| one.score.is_none() && one.missed.unwrap() < 0.01));
}

/// Ten runs that others recorded in Gymnasium: another program, with the same physics.
#[test]
fn a_public_set_leads_where_its_recorder_says() {
    use demosift::data::demonstration::d4rl;
    let path = "../../../shared/data/half_cheetah_noisy/half_cheetah_noisy.hdf5";
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    if !path.exists() {
        eprintln!("skipped: the public HalfCheetah set is not there");
        return;
    }
    let task = demosift_mujoco::registry::load("half_cheetah").unwrap();
    let (recorded, findings) = check::compare(&task, &all(&d4rl::read(&path).unwrap()), None).unwrap();
    assert_eq!(check::count(&findings, Severity::Error), 0, "{findings:#?}");
    let missed: Vec<f64> = recorded.demonstrations.iter().map(|one| one.missed.unwrap()).collect();
    assert!(missed.iter().all(|missed| *missed < 0.04), "{missed:?}");
}

/// The sets of the repository are of their tasks, but for the guests of one.
#[test]
fn the_sets_of_the_repository_are_of_their_tasks() {
    use demosift::data::demonstration::d4rl;
    for (task, set, others) in [
        ("free_throw", "free_throw_8", 0),
        ("free_throw", "free_throw_20", 6),
        ("penalty_save", "penalty_save_12", 0),
    ] {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data").join(set);
        let path = path.join("demonstrations.hdf5");
        let (set, states) = (all(&d4rl::read(&path).unwrap()), d4rl::read_states(&path).unwrap().unwrap());
        let task = demosift_mujoco::registry::load(task).unwrap();
        let (recorded, findings) = compared(&task, &set, &states);
        assert_eq!(check::count(&findings, Severity::Error), 0, "{findings:#?}");
        let missing = recorded.demonstrations.iter().filter(|one| one.missed.unwrap() > 0.05).count();
        assert_eq!(missing, others);
    }
}

/// The arm with ranges to keep to: its elbow may bend so far, either way.
fn ending(range: &str) -> MujocoTask {
    let task = TASK.replace(
        "[heuristic]",
        &format!("bend = {{ qpos = \"elbow\" }}\nalive = \"alive\"\n[ends]\nbend = {range}\n[return]\nmeasurement = \"alive\"\n[heuristic]"),
    );
    load(&task, MODEL)
}

#[test]
fn when_an_episode_ends_is_described_and_found() {
    let (seen, findings) = check::look(&ending("[-0.3, 0.3]"));
    assert_eq!(
        (seen.ends.join("|"), seen.true_return.as_deref()),
        ("bend leaves [-0.3, 0.3]".to_owned(), Some("alive"))
    );
    assert_found(&findings, Severity::Warning, "the heuristic is a mean over the steps that were played");
    let found = |range| check::play(&ending(range), &Seed::new(0)).unwrap();
    let (played, findings) = found("[-0.3, 0.3]");
    assert!(played.ended_early > 20 && played.ended_at_start == 0 && played.steps < 125 * 40, "{played:?}");
    let wanted = format!("{} of 125 random episodes end early, after ", played.ended_early);
    assert_found(&findings, Severity::Fine, &wanted);
    let (played, findings) = found("[0.05, 3]");
    assert!(played.ended_at_start > 20, "{played:?}");
    assert_found(&findings, Severity::Error, "start where they should end: bend leaves [0.05, 3]");
    assert_found(
        &found("[-100, 100]").1,
        Severity::Fine,
        "none of 125 random episodes leaves the ranges of [ends]",
    );
    // Where nothing ends an episode, nothing is said of it.
    let (_, findings) = check::play(&load(TASK, MODEL), &Seed::new(0)).unwrap();
    assert!(findings.iter().all(|one| !one.message.contains("[ends]")));
}

#[test]
fn a_heuristic_that_an_early_end_favors_is_found() {
    let heuristic = "fold = \"mean\"\nof = \"reach\"\nnegate = true";
    for (other, part) in [
        ("fold = \"sum\"\nof = \"reach\"\nnegate = true", Some("the sooner it ends the less it costs")),
        ("fold = \"max\"\nof = \"reach\"\nnegate = true", Some("the less can go wrong")),
        ("fold = \"sum\"\nof = \"bend\"", None),
        ("fold = \"min\"\nof = \"reach\"\nnegate = true", None),
    ] {
        let text =
            TASK.replace("[heuristic]", "bend = { qpos = \"elbow\" }\n[ends]\nbend = [-1, 1]\n[heuristic]");
        let (_, findings) = check::look(&load(&text.replace(heuristic, other), MODEL));
        match part {
            Some(part) => assert_found(&findings, Severity::Warning, part),
            None => assert_fine(&findings),
        }
    }
}

/// The episodes of a recording, each cut where this task would end it; the first step at which it does, if it does.
fn cut(set: &[Demonstration], states: &[StateLog], bound: f64) -> (Vec<Demonstration>, Vec<StateLog>) {
    let each = set.iter().zip(states).map(|(one, log)| {
        let left = log.qpos.chunks_exact(2).position(|row| row[1].abs() >= bound);
        let steps = left.unwrap_or(one.steps());
        let (observations, actions) = (one.observations().head(steps), one.actions().head(steps));
        let log = StateLog { qpos: log.qpos[..2 * steps].to_vec(), qvel: log.qvel[..2 * steps].to_vec() };
        (Demonstration::new(observations, actions).unwrap(), log)
    });
    each.unzip()
}

#[test]
fn recorded_episodes_that_end_early_are_explained_by_the_ranges_or_not() {
    let (set, states) = record(&load(TASK, MODEL));
    let bound = 0.12;
    let (short, logs) = cut(&set, &states, bound);
    assert!(short.iter().any(|one| one.steps() < 40), "some leave the range");
    let task = ending("[-0.12, 0.12]");
    // With states of the simulator, and with states from the observations.
    for (recorded, findings) in [compared(&task, &short, &logs), check::compare(&task, &short, None).unwrap()]
    {
        assert_fine(&findings);
        assert_found(
            &findings,
            Severity::Fine,
            "each of these ends where the task ends an episode (bend leaves",
        );
        assert_eq!(recorded.demonstrations.len(), 3);
    }
    let (_, findings) = compared(&ending("[-3, 3]"), &short, &logs);
    assert_found(
        &findings,
        Severity::Warning,
        "and an episode of the task 40, which [ends] does not explain",
    );
    let (_, findings) = compared(&ending("[-0.06, 0.06]"), &short, &logs);
    assert_found(
        &findings,
        Severity::Warning,
        "go on after the task would have ended them, the first at step",
    );
    let (_, findings) = compared(&load(TASK, MODEL), &short, &logs);
    assert_found(&findings, Severity::Warning, "something fell or was reached, say so in [ends]");
    let blind = load(
        &TASK
            .replace("{ qvel = \"all\" }", "{ qvel = \"elbow\" }")
            .replace("[heuristic]", "bend = { qpos = \"elbow\" }\n[ends]\nbend = [-1, 1]\n[heuristic]"),
        MODEL,
    );
    let narrow = changed(&short, |row| [&row[..2], &row[3..]].concat(), same);
    let (_, findings) = check::compare(&blind, &narrow, None).unwrap();
    assert_found(&findings, Severity::Warning, "is not known without the simulator's states");
}

/// The recording with velocities cut off at a bound that some of them pass.
fn clipped(set: &[Demonstration], bound: f32) -> Vec<Demonstration> {
    let cut = |row: &[f32]| {
        [&row[..2], &[row[2].clamp(-bound, bound), row[3].clamp(-bound, bound)], &row[4..]].concat()
    };
    changed(set, cut, same)
}

#[test]
fn velocities_that_are_clipped_are_not_compared_and_no_error() {
    let (set, states) = record(&load(TASK, MODEL));
    let cut = clipped(&set, 0.5);
    let share = |set: &[Demonstration]| {
        let rows = || set.iter().flat_map(|one| one.observations().iter());
        rows().filter(|row| row[2].abs() == 0.5 || row[3].abs() == 0.5).count() as f64 / rows().count() as f64
    };
    assert!((0.05..0.95).contains(&share(&cut)), "{}", share(&cut));
    let task = load(&TASK.replace("{ qvel = \"all\" }", "{ qvel = \"all\", clip = [-0.5, 0.5] }"), MODEL);
    let (recorded, findings) = check::compare(&task, &cut, None).unwrap();
    assert_fine(&findings);
    assert_found(
        &findings,
        Severity::Fine,
        &format!("{:.0} % of them have a clipped number", 100.0 * share(&cut)),
    );
    assert!(
        recorded.demonstrations.iter().all(|one| one.missed.is_none_or(|missed| missed < 1e-4)),
        "{recorded:?}"
    );
    assert!(recorded.demonstrations.iter().any(|one| one.missed.is_some()));
    // The same from what the simulator recorded.
    assert_fine(&compared(&task, &cut, &states).1);
    // A task that does not clip what was clipped, and one that clips what was not.
    let (recorded, findings) = check::compare(&load(TASK, MODEL), &cut, None).unwrap();
    assert_eq!(check::count(&findings, Severity::Error), 0, "{findings:#?}");
    assert_found(&findings, Severity::Warning, "recorded numbers of qvel look clipped to [-0.5, 0.5]");
    assert_found(&findings, Severity::Warning, "add clip = [-0.5, 0.5] to that part of `observation`");
    assert!(
        recorded.demonstrations.iter().all(|one| one.missed.is_none_or(|missed| missed < 1e-4)),
        "{recorded:?}"
    );
    let (_, findings) = check::compare(&task, &set, None).unwrap();
    assert_found(&findings, Severity::Error, "and the task clips them to [-0.5, 0.5]");
    let (_, findings) = compared(&load(TASK, MODEL), &cut, &states);
    assert_found(&findings, Severity::Error, "is qvel elbow clipped to [-0.5, 0.5]");
    // Numbers that nobody clipped do not look so.
    let (_, findings) = check::compare(&load(TASK, MODEL), &set, None).unwrap();
    assert_fine(&findings);
}

/// One robot under two engines: the same model, whose contacts are softer or rougher, is not another body.
#[test]
fn the_same_body_with_other_contacts_is_no_error_and_another_body_is() {
    let walker = include_str!("../tasks/walker2d/walker2d.xml");
    let text = include_str!("../tasks/walker2d/task.toml");
    let load = |model: &str| MujocoTask::from_texts(text, &[("walker2d.xml", model)], None).unwrap();
    let (set, states) = record(&load(walker));
    let judged = |model: String| {
        assert!(model != walker);
        let (recorded, findings) = compared(&load(&model), &set, &states);
        let errors: Vec<Finding> =
            findings.into_iter().filter(|one| one.severity == Severity::Error).collect();
        (recorded.demonstrations, errors)
    };
    let (softer, errors) = judged(walker.replace("density=\"1000\"", "density=\"1000\" solref=\"0.04 1\""));
    assert!(errors.is_empty(), "{errors:#?}");
    assert!(softer.iter().any(|one| one.missed.unwrap() > 0.05), "contacts matter: {softer:#?}");
    let (_, errors) = judged(walker.replace("friction=\"1.9 0.1 0.1\"", "friction=\"0.9 0.1 0.1\""));
    assert!(errors.is_empty(), "{errors:#?}");
    // One guest among many of the same body under another engine stands out.
    let other = walker.replace("gear=\"100\"", "gear=\"30\"");
    let (guests, guest_states) = record(&load(&other));
    let mixed = [&set[..2], &guests[..1]].concat();
    let mixed_states = [&states[..2], &guest_states[..1]].concat();
    let rougher = load(&walker.replace("damping=\"0.1\"", "damping=\"0.2\""));
    let (_, findings) = compared(&rougher, &mixed, &mixed_states);
    assert_found(&findings, Severity::Warning, "the actions of 1 of 3 demonstrations (2) do not lead");
    assert_found(&findings, Severity::Warning, "with another model or body than the others");
    let (_, errors) = judged(walker.replace("gear=\"100\"", "gear=\"30\""));
    assert!(
        errors.iter().any(|one| one.message.contains("do not lead to the next recorded state")),
        "{errors:#?}"
    );
}

/// Ten runs that others recorded in Gym, half of which end in a fall; their velocities are clipped, and the engine is an old one.
#[test]
fn a_public_set_of_early_ends_and_clipped_velocities_is_explained() {
    use demosift::data::demonstration::d4rl;
    let path = "../../../shared/data/walker2d_noisy/walker2d_noisy.hdf5";
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    if !path.exists() {
        eprintln!("skipped: the public Walker2d set is not there");
        return;
    }
    let set = all(&d4rl::read(&path).unwrap());
    let task = demosift_mujoco::registry::load("walker2d").unwrap();
    let (recorded, findings) = check::compare(&task, &set, None).unwrap();
    assert_eq!(check::count(&findings, Severity::Error), 0, "{findings:#?}");
    assert_found(&findings, Severity::Fine, "6 of 10 demonstrations have 267 to 447 steps");
    assert_found(&findings, Severity::Fine, "each of these ends where the task ends an episode");
    assert_found(&findings, Severity::Warning, "the same body, and imitating it makes sense");
    assert!(recorded.demonstrations.iter().all(|one| one.typically_missed.unwrap() < 0.1), "{recorded:#?}");
    let text = include_str!("../tasks/walker2d/task.toml").replace(", clip = [-10, 10]", "");
    let models = [("walker2d.xml", include_str!("../tasks/walker2d/walker2d.xml"))];
    let unclipped = MujocoTask::from_texts(&text, &models, None).unwrap();
    let (_, findings) = check::compare(&unclipped, &set, None).unwrap();
    assert_eq!(check::count(&findings, Severity::Error), 0, "{findings:#?}");
    assert_found(&findings, Severity::Warning, "add clip = [-10, 10] to that part of `observation`");
}
