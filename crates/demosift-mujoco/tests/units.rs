//! Sets whose numbers are not what the task takes: what is wrong is named, and the set.toml that is proposed mends it.

use demosift::basics::seed::Seed;
use demosift::data::demonstration::Demonstration;
use demosift::data::demonstration::d4rl;
use demosift::data::demonstration::episode::Says;
use demosift::data::demonstration::set_file::{Ranges, SetFile};
use demosift::data::demonstration::timing::{Jump, Timing};
use demosift::data::trajectory::StateLog;
use demosift::math::rows::Rows;
use demosift::world::environment::{EnvVariant, Environment as _, Specification, Task as _};
use demosift_mujoco::check::{self, Finding, Presented, Severity};
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::registry;
use rand::RngExt as _;

/// An arm whose two joints differ, so that exchanging or mirroring them is seen.
const MODEL: &str = r#"
<mujoco>
  <option timestep="0.01"/>
  <default><joint type="hinge" axis="0 1 0" damping="0.05" armature="0.01"/><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <site name="target" pos="0 0 0.2"/>
    <body name="upper"><joint name="shoulder" range="-170 170"/>
      <geom name="upper" type="capsule" size="0.02" fromto="0 0 0 0.1 0 0"/>
      <body name="fore" pos="0.1 0 0"><joint name="elbow" range="-160 160"/>
        <geom name="fore" type="capsule" size="0.02" fromto="0 0 0 0.1 0 0"/><site name="hand" pos="0.1 0 0"/>
      </body>
    </body>
  </worldbody>
  <actuator>ACTUATORS</actuator>
</mujoco>"#;
const MOTORS: &str = r#"<motor name="push" joint="shoulder" gear="0.6" ctrlrange="-1 1"/>
    <motor name="bend" joint="elbow" gear="0.3" ctrlrange="-1 1"/>"#;
const SERVOS: &str = r#"<position name="push" joint="shoulder" kp="2" ctrlrange="-2.8 2.8"/>
    <position name="bend" joint="elbow" kp="2" ctrlrange="-2.0 2.5"/>"#;
const TASK: &str = r#"
name = "arm"
model = "arm.xml"
frame_skip = 4
horizon = 60
observation = [{ qpos = "all" }, { qvel = "all" }]
[reset]
qpos_noise = { uniform = 0.5 }
qvel_noise = { uniform = 0.5 }
[measurements]
reach = { distance = ["hand", "target"] }
[heuristic]
fold = "mean"
of = "reach"
negate = true
"#;

fn arm(actuators: &str) -> MujocoTask {
    MujocoTask::from_texts(TASK, &[("arm.xml", &MODEL.replace("ACTUATORS", actuators))], None).unwrap()
}

/// A set with the simulator's states.
struct Set {
    demonstrations: Vec<Demonstration>,
    states: Vec<StateLog>,
}

/// Four episodes of actions that are held for a while, so that the arm moves far.
fn record(task: &MujocoTask) -> Set {
    let specification = task.specification();
    let mut environment = task.mujoco_environment().unwrap();
    let mut observation = vec![0.0; specification.observation_size];
    let mut now = vec![0.0; specification.measurements.len()];
    let (mut demonstrations, mut states) = (Vec::new(), Vec::new());
    for number in 0..4 {
        let mut rng = Seed::new(4).at(number).into_rng();
        environment.reset(EnvVariant(0), Seed::new(5).at(number), &mut observation, &mut now);
        let mut observations = Rows::with_capacity(observation.len(), specification.horizon);
        let mut actions = Rows::with_capacity(specification.action_size, specification.horizon);
        let mut log = StateLog::default();
        let mut action = vec![0.0; specification.action_size];
        for step in 0..specification.horizon {
            observations.push(&observation);
            log.qpos.extend(environment.qpos());
            log.qvel.extend(environment.qvel());
            if step % 5 == 0 {
                action.iter_mut().for_each(|value| *value = rng.random_range(-1.2..1.2));
            }
            environment.step(&action, &mut observation, &mut now);
            actions.push(&action);
        }
        demonstrations.push(Demonstration::new(observations, actions).unwrap());
        states.push(log);
    }
    Set { demonstrations, states }
}

/// The set with every row of observations and actions made again.
fn changed(set: &Set, observe: fn(&[f32]) -> Vec<f32>, act: fn(&[f32]) -> Vec<f32>) -> Vec<Demonstration> {
    let rows = |rows: &Rows, make: fn(&[f32]) -> Vec<f32>| {
        let made: Vec<Vec<f32>> = rows.iter().map(make).collect();
        made.iter().map(Vec::as_slice).collect::<Rows>()
    };
    let each = set.demonstrations.iter();
    each.map(|one| Demonstration::new(rows(one.observations(), observe), rows(one.actions(), act)).unwrap())
        .collect()
}

fn same(row: &[f32]) -> Vec<f32> {
    row.to_vec()
}

fn errors(findings: &[Finding]) -> Vec<&Finding> {
    findings.iter().filter(|finding| finding.severity == Severity::Error).collect()
}

/// What all findings propose, each key once.
fn proposed(findings: &[Finding]) -> SetFile {
    let mut lines: Vec<&str> = Vec::new();
    for line in findings.iter().filter_map(|finding| finding.lines.as_deref()).flat_map(str::lines) {
        let key = |line: &str| line.split(" = ").next().unwrap_or_default().to_owned();
        if lines.iter().all(|known| key(known) != key(line)) {
            lines.push(line);
        }
    }
    SetFile::parse(&lines.join("\n")).unwrap()
}

/// The set as a set.toml reads it.
fn read(task: &MujocoTask, recorded: &[Demonstration], file: &SetFile) -> Vec<Demonstration> {
    let observations = task.observation_ranges();
    let ranges = Ranges { controls: &task.specification().control_ranges, observations: &observations };
    let (observed, acted) = (recorded[0].observations().width(), recorded[0].actions().width());
    let conversion = file.conversion(observed, acted, ranges).unwrap();
    let each = recorded.iter();
    each.map(|one| {
        let observations = conversion.observations(one.observations());
        Demonstration::new(observations, conversion.actions(one.actions())).unwrap()
    })
    .collect()
}

/// Both checks name what is wrong, propose the same lines, and find nothing wrong with the set that these make.
#[track_caller]
fn assert_mended(task: &MujocoTask, recorded: &[Demonstration], states: Option<&[StateLog]>, lines: &str) {
    let plain = Presented::plain(recorded, states);
    let (_, long) = check::compare_presented(task, &plain).unwrap();
    let short = check::fit(task.specification(), Some(task), &plain).unwrap();
    assert!(!errors(&long).is_empty(), "{long:#?}");
    let file = proposed(&long);
    assert_eq!(file.to_string(), lines, "{long:#?}");
    assert!(!errors(&short).is_empty(), "{short:#?}");
    assert_eq!(proposed(&short).to_string(), lines, "{short:#?}");
    let set = read(task, recorded, &file);
    let mended = Presented { set: &set, set_file: file, ..plain };
    let (_, long) = check::compare_presented(task, &mended).unwrap();
    assert!(errors(&long).is_empty(), "{long:#?}");
    assert!(long.iter().any(|finding| finding.message.contains("leads to the next recorded state")));
    let short = check::fit(task.specification(), Some(task), &mended).unwrap();
    assert!(errors(&short).is_empty(), "{short:#?}");
}

#[test]
fn a_set_of_the_task_fits_and_says_how_many_actions_are_clipped() {
    for task in [arm(MOTORS), arm(SERVOS)] {
        let set = record(&task);
        for states in [Some(&set.states[..]), None] {
            let plain = Presented::plain(&set.demonstrations, states);
            let findings = check::fit(task.specification(), Some(&task), &plain).unwrap();
            assert!(findings.iter().all(|one| one.severity == Severity::Fine), "{findings:#?}");
            assert!(findings.iter().any(|one| one.message.contains("clipped, as they were when")));
        }
    }
}

#[test]
fn signs_orders_and_units_of_actions_are_found_and_mended() {
    let (motors, servos) = (arm(MOTORS), arm(SERVOS));
    for (task, act, lines) in [
        (&motors, (|row| vec![-row[0], row[1]]) as fn(&[f32]) -> Vec<f32>, "actions.sign = [-1, 1]\n"),
        (&motors, |row| vec![-row[0], -row[1]], "actions.sign = -1\n"),
        (&motors, |row| vec![row[1], row[0]], "actions.order = [1, 0]\n"),
        (&motors, |row| vec![row[1], -row[0]], "actions.order = [1, 0]\nactions.sign = [-1, 1]\n"),
        (&motors, |row| vec![0.5 * row[0], 0.5 * row[1]], "actions.scale = 2\n"),
        (
            &motors,
            |row| vec![0.3 * row[0] + 0.1, row[1]],
            "actions.scale = [3.333, 1]\nactions.offset = [-0.3333, 0]\n",
        ),
        (&motors, |row| row.iter().map(|number| 100.0 * number).collect(), "actions.units = \"percent\"\n"),
        (&servos, |row| vec![2.8 * row[0], 0.25 + 2.25 * row[1]], "actions.units = \"controls\"\n"),
        (
            &servos,
            |row| vec![(2.8 * row[0]).to_degrees(), (0.25 + 2.25 * row[1]).to_degrees()],
            "actions.units = \"degrees\"\n",
        ),
        (
            &servos,
            |row| vec![-2.8 * row[0], 50.0 + 50.0 * row[1]],
            "actions.sign = [-1, 1]\nactions.units = { controls = \"0\", percent_from_0 = \"1\" }\n",
        ),
    ] {
        let set = record(task);
        let recorded = changed(&set, same, act);
        for states in [Some(&set.states[..]), None] {
            assert_mended(task, &recorded, states, lines);
        }
    }
}

#[test]
fn signs_orders_and_units_of_observations_are_found_and_mended() {
    let task = arm(MOTORS);
    let set = record(&task);
    for (observe, lines) in [
        (
            (|row| row.iter().map(|number| number.to_degrees()).collect()) as fn(&[f32]) -> Vec<f32>,
            "observations.units = \"degrees\"\n",
        ),
        (
            |row| vec![row[0].to_degrees(), row[1].to_degrees(), row[2], row[3]],
            "observations.units = { degrees = \"0-1\" }\n",
        ),
        (|row| vec![row[2], row[3], row[0], row[1]], "observations.order = [2, 3, 0, 1]\n"),
        (|row| vec![row[1], row[0], row[3], row[2]], "observations.order = [1, 0, 3, 2]\n"),
        (|row| vec![row[0], -row[1], row[2], -row[3]], "observations.sign = [1, -1, 1, -1]\n"),
        (|row| vec![row[0], row[1], -row[2], row[3]], "observations.sign = [1, 1, -1, 1]\n"),
    ] {
        let recorded = changed(&set, observe, same);
        for states in [Some(&set.states[..]), None] {
            assert_mended(&task, &recorded, states, lines);
        }
    }
}

#[test]
fn both_sides_in_degrees_are_found_without_states() {
    let task = arm(SERVOS);
    let set = record(&task);
    let recorded = changed(
        &set,
        |row| row.iter().map(|number| number.to_degrees()).collect(),
        |row| vec![(2.8 * row[0]).to_degrees(), (0.25 + 2.25 * row[1]).to_degrees()],
    );
    assert_mended(&task, &recorded, None, "actions.units = \"degrees\"\nobservations.units = \"degrees\"\n");
}

/// Without velocities nothing can be played, and what is left are the ranges of the model.
#[test]
fn what_no_joint_and_no_actuator_can_reach_is_found_without_the_physics() {
    let text = TASK.replace(", { qvel = \"all\" }", "");
    let model = MODEL.replace("ACTUATORS", SERVOS);
    let task = MujocoTask::from_texts(&text, &[("arm.xml", &model)], None).unwrap();
    let set = record(&task);
    let fit = |recorded: &[Demonstration], file: &SetFile| {
        let set = read(&task, recorded, file);
        let presented = Presented { set: &set, set_file: file.clone(), ..Presented::plain(recorded, None) };
        check::fit(task.specification(), Some(&task), &presented).unwrap()
    };
    let nothing = SetFile::default();
    let degrees = changed(
        &set,
        |row| row.iter().map(|number| number.to_degrees()).collect(),
        |row| vec![(2.2 * row[0]).to_degrees(), (0.25 + 1.8 * row[1]).to_degrees()],
    );
    let findings = fit(&degrees, &nothing);
    let messages: Vec<&str> = errors(&findings).iter().map(|finding| finding.message.as_str()).collect();
    assert!(messages[0].contains("lie far outside the range of 2 joints: shoulder, elbow"), "{messages:?}");
    assert!(messages[1].contains("of the numbers of actions are outside [-1, 1], up to 15"), "{messages:?}");
    let file = proposed(&findings);
    assert_eq!(file.to_string(), "actions.units = \"degrees\"\nobservations.units = \"degrees\"\n");
    assert!(errors(&fit(&degrees, &file)).is_empty());
    let radians = changed(&set, same, |row| vec![2.2 * row[0], 0.25 + 1.8 * row[1]]);
    let findings = fit(&radians, &nothing);
    assert_eq!(proposed(&findings).to_string(), "actions.units = \"controls\"\n", "{findings:#?}");
    // Whoever says that they are right is believed.
    let right = SetFile::parse("actions.units = 'task'\nobservations.units = 'task'").unwrap();
    let findings = fit(&degrees, &right);
    assert!(errors(&findings).is_empty(), "{findings:#?}");
    assert!(check::count(&findings, Severity::Warning) == 2, "{findings:#?}");
}

#[test]
fn another_body_is_not_explained_away_by_units() {
    let task = arm(MOTORS);
    let set = record(&task);
    let other =
        MODEL.replace("ACTUATORS", MOTORS).replace("armature=\"0.01\"", "armature=\"0.1\" stiffness=\"1\"");
    let other = MujocoTask::from_texts(TASK, &[("arm.xml", &other)], None).unwrap();
    for states in [Some(&set.states[..]), None] {
        let plain = Presented::plain(&set.demonstrations, states);
        let (_, findings) = check::compare_presented(&other, &plain).unwrap();
        assert!(findings.iter().all(|finding| finding.lines.is_none()), "{findings:#?}");
        let findings = check::fit(other.specification(), Some(&other), &plain).unwrap();
        assert!(errors(&findings).is_empty(), "a run may be what the user wants: {findings:#?}");
        assert!(findings.iter().any(|one| one.message.contains("do not lead to the next recorded state")));
    }
}

/// Between the same body and quite another one nothing is silent.
#[test]
fn whatever_recorded_steps_miss_is_said() {
    let set = record(&arm(MOTORS));
    let mut severities = Vec::new();
    for damping in ["0.05", "0.06", "0.08", "0.1", "0.15", "0.2", "0.4", "1", "3"] {
        let model =
            MODEL.replace("ACTUATORS", MOTORS).replace("damping=\"0.05\"", &format!("damping=\"{damping}\""));
        let other = MujocoTask::from_texts(TASK, &[("arm.xml", &model)], None).unwrap();
        let plain = Presented::plain(&set.demonstrations, Some(&set.states));
        let findings = check::fit(other.specification(), Some(&other), &plain).unwrap();
        let said: Vec<&Finding> =
            findings.iter().filter(|finding| finding.message.contains("next recorded state")).collect();
        assert_eq!(said.len(), 1, "{damping}: {findings:?}");
        severities.push(said[0].severity);
    }
    assert!(severities.is_sorted_by_key(|severity| *severity != Severity::Fine), "{severities:?}");
    assert_eq!(severities.first(), Some(&Severity::Fine));
    assert_ne!(severities.last(), Some(&Severity::Fine));
}

#[test]
fn nothing_is_proposed_that_misses_as_much_as_before() {
    let task = arm(SERVOS);
    let set = record(&task);
    // A thousand times too fast, and no unit.
    let recorded = changed(&set, |row| row.iter().map(|number| 1000.0 * number.powi(3)).collect(), same);
    let (_, findings) = check::compare(&task, &recorded, None).unwrap();
    let advice: Vec<&str> = findings.iter().filter_map(|finding| finding.advice.as_deref()).collect();
    assert!(advice.iter().all(|advice| !advice.contains("it seems that")), "{advice:#?}");
}

#[test]
fn another_rate_is_found_and_what_is_said_of_it_is_believed() {
    // Without velocities no step is played, which would tell that only the clock is wrong.
    let text = TASK.replace(", { qvel = \"all\" }", "");
    let model = MODEL.replace("ACTUATORS", MOTORS);
    let task = MujocoTask::from_texts(&text, &[("arm.xml", &model)], None).unwrap();
    let set = record(&task);
    let says = |rate: f64| Says { steps_per_sec: Some(rate), file: "meta/info.json", ..Says::default() };
    let fit = |says: Says, timing: Option<Timing>, file: &str| {
        let set_file = SetFile::parse(file).unwrap();
        let plain = Presented::plain(&set.demonstrations, None);
        let presented = Presented { says, timing, set_file, ..plain };
        check::fit(task.specification(), Some(&task), &presented).unwrap()
    };
    assert!(errors(&fit(says(25.0), None, "")).is_empty());
    let findings = fit(says(50.0), None, "");
    let [error] = errors(&findings)[..] else { panic!("{findings:#?}") };
    assert!(error.message.starts_with("meta/info.json says 50 steps a second, and the task 'arm' takes 25"));
    assert!(error.advice.as_ref().unwrap().contains("frame_skip = 2 in task.toml"), "{error:#?}");
    assert_eq!(error.lines.as_deref(), Some("rate = 25\n"));
    assert!(errors(&fit(says(50.0), None, "rate = 25")).is_empty());
    let findings = fit(Says::default(), None, "rate = 60");
    assert!(errors(&findings)[0].message.starts_with("set.toml says 60 steps a second"), "{findings:#?}");
    let clock = |step_secs: f64, jumps| Some(Timing { step_secs, jumps });
    let findings = fit(Says::default(), clock(0.1, Vec::new()), "");
    assert!(
        errors(&findings)[0].message.starts_with("the timestamps say 10 steps a second"),
        "{findings:#?}"
    );
    let jump = Jump { label: "7".to_owned(), step: 3, secs: 3.04 };
    let findings = fit(says(25.0), clock(0.04, vec![jump.clone()]), "");
    let [error] = errors(&findings)[..] else { panic!("{findings:#?}") };
    assert!(
        error.message.contains("in episode 7 3.040 s pass before step 3, and 0.040 s before most"),
        "{error:#?}"
    );
    assert!(error.advice.as_ref().unwrap().contains("--without 7"), "{error:#?}");
    assert!(errors(&fit(says(25.0), clock(0.04, vec![jump]), "rate = 25")).is_empty());
    // A simulator that does not say how long its steps are refuses nobody.
    let unsure = Specification { is_control_step_told: false, ..task.specification().clone() };
    for (said, file) in [(50.0, ""), (50.0, "rate = 50")] {
        let set_file = SetFile::parse(file).unwrap();
        let plain = Presented::plain(&set.demonstrations, None);
        let findings = check::fit(&unsure, None, &Presented { says: says(said), set_file, ..plain }).unwrap();
        assert!(errors(&findings).is_empty(), "{findings:#?}");
        let words = "meta/info.json says 50 steps a second, and the environment does not say";
        let warned = findings.iter().any(|finding| finding.message.starts_with(words));
        assert_eq!(warned, file.is_empty(), "{findings:#?}");
    }
    let played = arm(MOTORS);
    let set = record(&played);
    let presented = Presented { says: says(50.0), ..Presented::plain(&set.demonstrations, None) };
    let findings = check::fit(played.specification(), Some(&played), &presented).unwrap();
    let [error] = errors(&findings)[..] else { panic!("{findings:#?}") };
    assert!(error.message.ends_with("yet its steps follow each other as at the rate of the task"));
    assert_eq!(error.lines.as_deref(), Some("rate = 25\n"));
}

#[test]
fn a_box_that_a_set_says_its_actions_lie_in_is_scaled_to_that_of_the_task() {
    let text = TASK.replace(", { qvel = \"all\" }", "");
    let model = MODEL.replace("ACTUATORS", SERVOS);
    let task = MujocoTask::from_texts(&text, &[("arm.xml", &model)], None).unwrap();
    let set = record(&task);
    for (bounds, wanted) in [
        (vec![[-1.0, 1.0]; 2], ""),
        (vec![[-3.4e38, 3.4e38]; 2], ""),
        (vec![[-0.4, 0.4]; 2], "actions.scale = 2.5\n"),
        (vec![[-2.8, 2.8], [-2.0, 2.5]], "actions.units = \"controls\"\n"),
        (vec![[0.0, 1.0], [-1.0, 1.0]], "actions.scale = [2, 1]\nactions.offset = [-1, 0]\n"),
    ] {
        let says = Says { action_bounds: Some(bounds), file: "metadata.json", ..Says::default() };
        let presented = Presented { says, ..Presented::plain(&set.demonstrations, None) };
        let findings = check::fit(task.specification(), Some(&task), &presented).unwrap();
        assert_eq!(proposed(&findings).to_string(), wanted, "{findings:#?}");
        assert_eq!(errors(&findings).is_empty(), wanted.is_empty());
        let set_file = SetFile::parse("actions.units = 'task'").unwrap();
        let findings =
            check::fit(task.specification(), Some(&task), &Presented { set_file, ..presented }).unwrap();
        assert!(errors(&findings).is_empty(), "{findings:#?}");
    }
}

/// Policies with noise, of which much is outside [−1, 1], recorded by others.
#[test]
fn public_sets_of_policies_with_noise_fit() {
    for name in ["half_cheetah", "walker2d"] {
        let path = format!("../../../shared/data/{name}_noisy/{name}_noisy.hdf5");
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
        if !path.exists() {
            eprintln!("skipped: the public {name} set is not there");
            continue;
        }
        let task = registry::load(name).unwrap();
        let set = d4rl::read(&path).unwrap();
        let set: Vec<Demonstration> = set.iter().map(|(_, one)| one.clone()).collect();
        let findings = check::fit(task.specification(), Some(&task), &Presented::plain(&set, None)).unwrap();
        assert!(findings.iter().all(|one| one.severity == Severity::Fine), "{findings:#?}");
    }
}

/// So do the sets of the repository, of which one has guests with another body.
#[test]
fn the_sets_of_the_repository_fit_their_tasks() {
    for (task, set) in
        [("free_throw", "free_throw_8"), ("free_throw", "free_throw_20"), ("penalty_save", "penalty_save_12")]
    {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data").join(set);
        let path = path.join("demonstrations.hdf5");
        let (set, states) = (d4rl::read(&path).unwrap(), d4rl::read_states(&path).unwrap().unwrap());
        let set: Vec<Demonstration> = set.iter().map(|(_, one)| one.clone()).collect();
        let task = registry::load(task).unwrap();
        for states in [Some(&states[..]), None] {
            let plain = Presented::plain(&set, states);
            let findings = check::fit(task.specification(), Some(&task), &plain).unwrap();
            assert!(errors(&findings).is_empty(), "{findings:#?}");
        }
    }
}
