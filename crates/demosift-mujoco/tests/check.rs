//! What a check of a task finds: mistakes that are planted one by one in an arm that is right, and in recordings of it.

mod ends;
mod recorded;

use demosift::basics::seed::Seed;
use demosift::data::demonstration::{Demonstration, DemonstrationSet};
use demosift::data::trajectory::StateLog;
use demosift::math::rows::Rows;
use demosift::world::environment::{EnvVariant, Environment as _, Task as _};
use demosift_mujoco::check::{self, Finding, Presented, Recorded, Severity, StatesFrom};
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
        ("<camera name=\"above\" pos=\"0 0 1\"/>", "", Warning, "the model has no camera, so"),
        ("<camera name=\"above\" pos", "<camera pos", Warning, "the model has no camera with a name, so"),
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
            "<joint name=\"elbow\"/>",
            "<joint name=\"elbow\" range=\"30 150\"/>",
            Warning,
            "joints start outside of their ranges: elbow at 0.000, range 0.524 to 2.618: start within them",
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

#[test]
fn each_control_of_an_actuator_that_takes_several_is_named_with_its_own_range() {
    let motor = "<motor name=\"bend\" joint=\"elbow\" gear=\"0.1\" ctrlrange=\"-2 2\"/>";
    let servo = "<pid name=\"bend\" joint=\"elbow\" kp=\"1\" kv=\"0.1\" input=\"pos vel\" posrange=\"-1 1\" velrange=\"-3 3\"/>\
         <motor name=\"none\" joint=\"elbow\" gear=\"0\" ctrlrange=\"-2 2\"/>";
    let task = load(TASK, &MODEL.replace(motor, servo));
    let (seen, _) = check::look(&task);
    let named = seen.actuators.iter().map(|one| format!("{} {} {}", one.name, one.low, one.high));
    assert_eq!(named.collect::<Vec<_>>(), ["push -1 1", "bend[0] -1 1", "bend[1] -3 3", "none -2 2"]);
    assert_eq!(check::play(&task, &Seed::new(0)).unwrap().0.without_effect, ["none"]);
    let model = MODEL.replace(motor, &servo.replace(" velrange=\"-3 3\"", ""));
    let error = MujocoTask::from_texts(TASK, &[("arm.xml", &model)], None).err().unwrap();
    assert!(error.to_string().contains("the actuator bend[1] has no ctrlrange;"), "{error}");
    assert!(error.hint().unwrap().contains("velrange"), "{error}");
}

#[test]
fn a_start_is_held_against_the_ranges_of_joints_without_its_noise_and_for_each_variant() {
    let limited = MODEL.replace("<joint name=\"elbow\"/>", "<joint name=\"elbow\" range=\"0 90\"/>");
    let words = |task: &str| {
        let (_, findings) = check::play(&load(task, &limited), &Seed::new(0)).unwrap();
        let found = findings.iter().find(|one| one.message.contains("outside of their ranges"));
        found.map(|one| one.message.clone())
    };
    assert_eq!(words(TASK), None, "at the end of the range, from where noise leads out of it");
    let variants = "[[variant]]\nname = \"bent\"\nqpos = { elbow = 1.571 }\n[[variant]]\nname = \"over\"\nqpos = { elbow = 2 }";
    let wanted = "joints start outside of their ranges: elbow at 2.000, range 0.000 to 1.571 under 'over'";
    assert_eq!(words(&format!("{TASK}\n{variants}")).as_deref(), Some(wanted));
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
