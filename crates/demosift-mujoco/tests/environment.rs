//! Each word of `task.toml` on a small model, and what becomes of states that cannot be simulated.
#![allow(clippy::unwrap_used, clippy::print_stderr, missing_docs)]

use demosift::environment::{EnvVariant, Environment, Task};
use demosift::rows::Rows;
use demosift::seed::Seed;
use demosift::trajectory::{Parts, Trajectory};
use demosift_mujoco::environment::MujocoEnvironment;
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::registry;
use demosift_mujoco::reward::{RewardShaping, Transition};

struct Buffers {
    observation: Vec<f32>,
    measurements: Vec<f32>,
}

impl Buffers {
    fn of(task: &MujocoTask) -> Self {
        let specification = task.specification();
        Self {
            observation: vec![0.0; specification.observation_size],
            measurements: vec![0.0; specification.measurements.len()],
        }
    }
}

#[test]
fn an_unstable_simulation_is_an_error_of_the_trajectory() {
    let task = registry::load("half_cheetah").unwrap();
    let mut environment = task.mujoco_environment().unwrap();
    let Buffers { mut observation, mut measurements } = Buffers::of(&task);
    environment.set_state(&[0.0; 9], &[1e9; 9]).unwrap();
    for _ in 0..3 {
        let outcome = environment.step(&[0.0; 6], &mut observation, &mut measurements);
        assert!(outcome.task_reward.is_nan());
    }
    assert!(observation.iter().chain(&measurements).all(|value| value.is_nan()));
    let mut observations = Rows::with_capacity(17, 2);
    observations.push(&[0.0; 17]);
    observations.push(&observation);
    let error = Trajectory::new(Parts {
        observations,
        actions: Rows::from_flat(vec![0.0; 6], 6).unwrap(),
        measurements: Rows::from_flat(vec![0.0; 2], 1).unwrap(),
        task_rewards: vec![0.0],
        terminated: false,
    });
    assert!(error.unwrap_err().is_diverged());
}

#[test]
fn a_state_of_another_model_is_refused() {
    let mut environment = registry::load("half_cheetah").unwrap().mujoco_environment().unwrap();
    let error = environment.set_state(&[0.0; 8], &[0.0; 9]).unwrap_err();
    assert!(error.to_string().contains("qpos of this model has 9 numbers, got 8"), "{error}");
    let error = environment.set_state(&[0.0; 9], &[f64::NAN; 9]).unwrap_err();
    assert!(error.to_string().contains("qvel[0] is NaN"), "{error}");
}

/// A cart 1 m over the floor, a ball that lies on the floor 3 m before and 4 m beside it.
const MODEL: &str = r#"
<mujoco>
  <option timestep="0.01" integrator="implicitfast"/>
  <worldbody>
    <geom name="floor" type="plane" size="9 9 1"/>
    <body name="cart" pos="0 0 1">
      <joint name="slider" type="slide" axis="1 0 0"/>
      <geom name="box" type="box" size="0.1 0.1 0.1" mass="2"/>
      <site name="flag" pos="0 0 0.5"/>
    </body>
    <body name="ball" pos="3 4 0.1">
      <freejoint name="ball_root"/>
      <geom name="leather" size="0.1" mass="1"/>
    </body>
  </worldbody>
  <actuator><motor name="push" joint="slider" ctrllimited="true" ctrlrange="-2 4"/></actuator>
  <keyframe><key name="away" qpos="5 3 4 0.1 1 0 0 0" qvel="0.5 0 0 0 0 0 0"/></keyframe>
</mujoco>"#;

const TASK: &str = r#"
name = "cart"
model = "cart.xml"
frame_skip = 2
horizon = 4
observation = [
  { qpos = { except = ["ball_root"] } }, { qvel = "slider" }, { qpos = "ball_root" }, { qvel = "ball_root" },
  { position = ["flag", "body:ball"] }, { velocity = ["cart"] }, { contact_wrench = ["ball"] }, "phase",
]
reward = [
  { measurement = "above", weight = 2.0 }, { rate_of = "x", weight = 3.0 }, { control_cost = 0.5 }, { constant = 0.25 },
]

[reset]
qvel = { slider = 1 }
qpos_noise = { uniform = 0.2, except = ["ball_root"] }

[measurements]
x = { qpos = "slider" }
v = { qvel = "slider" }
far = { distance = ["body:cart", "body:ball"] }
plan = { horizontal_distance = ["flag", "leather"] }
flag = { height = "flag" }
above = { height_above = ["flag", "box"] }
ball_y = { position = { of = "leather", axis = "y" } }
speed = { velocity = { of = "flag", axis = "x" } }
rests = { contact = ["ball", "floor"] }
crash = { contact = ["box", "leather"] }

[heuristic]
fold = "max"
of = "x"

[success]
fold = "max"
of = "x"
above = 0.05
reward = 100.0

[[variant]]
name = "plain"

[[variant]]
name = "late"
qpos = { ball_root = [1, 2, 0.1, 2, 0, 0, 0] }
qvel = { slider = -3.0 }
"#;

struct Counting;

impl RewardShaping for Counting {
    fn reward(&self, step: &Transition<'_>) -> f64 {
        assert_eq!((step.horizon, step.after.len(), step.observation.len()), (4, 10, 31));
        1000.0 * step.steps as f64
    }
}

fn cart(task: &str) -> MujocoTask {
    MujocoTask::from_texts(task, &[("cart.xml", MODEL)], None).unwrap()
}

fn start(task: &MujocoTask, variant: usize) -> (MujocoEnvironment, Buffers) {
    let mut environment = task.mujoco_environment().unwrap();
    let mut buffers = Buffers::of(task);
    let seed = Seed::new(5);
    environment.reset(EnvVariant(variant), seed, &mut buffers.observation, &mut buffers.measurements);
    (environment, buffers)
}

#[test]
fn each_word_of_a_task_file_means_what_it_says() {
    let task = cart(TASK);
    let (mut environment, mut buffers) = start(&task, 0);
    environment
        .set_state(&[0.0, 3.0, 4.0, 0.0999, 1.0, 0.0, 0.0, 0.0], &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        .unwrap();
    environment.observe(&mut buffers.observation, &mut buffers.measurements);
    let names = &task.specification().measurements;
    assert_eq!(names.join(" "), "above ball_y crash far flag plan rests speed v x");
    let far = (25.0_f64 + 0.9001 * 0.9001).sqrt() as f32;
    let wanted = [0.5, 4.0, 0.0, far, 1.5, 5.0, 1.0, 1.0, 1.0, 0.0];
    for ((name, got), wanted) in names.iter().zip(&buffers.measurements).zip(wanted) {
        assert!((got - wanted).abs() < 1e-6, "{name}: {got} {wanted}");
    }
    let seen = &buffers.observation;
    assert_eq!(seen.len(), 31);
    assert_eq!(seen[..9], [0.0, 1.0, 3.0, 4.0, 0.0999, 1.0, 0.0, 0.0, 0.0]);
    assert_eq!(seen[9..15], [0.0; 6]);
    assert_eq!(seen[15..21], [0.0, 0.0, 1.5, 3.0, 4.0, 0.0999]);
    assert_eq!(seen[21..24], [1.0, 0.0, 0.0]);
    assert_eq!(seen[30], 0.0);
    // 0.1 mm deep in the floor, the ball rests on it. After some steps the floor carries the ball's weight: 1 kg.
    for _ in 0..200 {
        environment.step(&[0.0], &mut buffers.observation, &mut buffers.measurements);
    }
    let lift = buffers.observation[29];
    assert!((lift - 9.81).abs() < 0.05, "{lift}");
    assert_eq!(buffers.observation[30], 50.0, "200 of 4 steps");
}

#[test]
fn actions_are_clipped_and_scaled_to_the_range_of_the_actuator() {
    let task = cart(TASK);
    // −1 → −2 N, 1 → 4 N on 2 kg; two physics steps of 0.01 s.
    for (action, force) in [(0.0, 1.0), (1.0, 4.0), (-1.0, -2.0), (9.0, 4.0), (0.5, 2.5)] {
        let (mut environment, mut buffers) = start(&task, 0);
        environment.step(&[action], &mut buffers.observation, &mut buffers.measurements);
        let speed = environment.qvel()[0];
        assert!((speed - (1.0 + force / 2.0 * 0.02)).abs() < 1e-12, "{action}: {speed}");
    }
}

#[test]
fn places_contacts_and_velocities_belong_to_the_state_in_which_the_step_ended() {
    for integrator in ["implicitfast", "Euler", "RK4"] {
        let model = MODEL.replace("implicitfast", integrator);
        let task = MujocoTask::from_texts(TASK, &[("cart.xml", &model)], None).unwrap();
        let (mut environment, mut buffers) = start(&task, 0);
        environment.step(&[1.0], &mut buffers.observation, &mut buffers.measurements);
        let (x, v) = (environment.qpos()[0] as f32, environment.qvel()[0] as f32);
        assert_eq!((buffers.observation[15], buffers.observation[21]), (x, v), "{integrator}");
    }
}

#[test]
fn variants_and_keyframes_and_values_set_the_start_and_noise_spares_the_excepted() {
    let task = cart(TASK);
    assert_eq!(task.specification().variants, ["plain", "late"]);
    let (plain, _) = start(&task, 0);
    assert!(plain.qpos()[0] != 0.0 && plain.qpos()[0].abs() <= 0.2);
    assert_eq!(plain.qpos()[1..], [3.0, 4.0, 0.1, 1.0, 0.0, 0.0, 0.0]);
    assert_eq!(plain.qvel()[0], 1.0);
    let (late, _) = start(&task, 1);
    assert_eq!(late.qpos()[0], plain.qpos()[0], "the same seed draws the same noise for all variants");
    assert_eq!(late.qpos()[1..], [1.0, 2.0, 0.1, 1.0, 0.0, 0.0, 0.0], "quaternions are normalized");
    assert_eq!(late.qvel()[0], -3.0);
    let keyed = TASK.replace("[reset]\nqvel = { slider = 1 }", "[reset]\nkeyframe = \"away\"");
    let keyed = cart(&keyed.replace("qpos_noise", "qvel_noise"));
    let (keyed, _) = start(&keyed, 0);
    assert_eq!(keyed.qpos()[0], 5.0);
    assert!(keyed.qvel()[0] != 0.5 && (keyed.qvel()[0] - 0.5).abs() <= 0.2);
    assert_eq!(keyed.qvel()[1..], [0.0; 6]);
}

#[test]
fn the_task_reward_adds_terms_shaping_and_success_once() {
    let text = TASK.replace("qpos_noise", "# qpos_noise");
    let task =
        MujocoTask::from_texts(&text, &[("cart.xml", MODEL)], Some(|_| Ok(Box::new(Counting)))).unwrap();
    let (mut environment, mut buffers) = start(&task, 0);
    let mut x = 0.0;
    let mut rows = Rows::with_capacity(10, 5);
    rows.push(&buffers.measurements);
    // About 0.02 m a step: 0.05 m is passed in the third.
    for (step, success) in [(1, 0.0), (2, 0.0), (3, 100.0), (4, 0.0)] {
        assert_eq!(task.succeeded(&rows), Some(step > 3));
        let reward =
            environment.step(&[-2.0], &mut buffers.observation, &mut buffers.measurements).task_reward;
        rows.push(&buffers.measurements);
        let speed = (environment.qpos()[0] - x) / 0.02;
        x = environment.qpos()[0];
        let wanted = 2.0 * 0.5 + 3.0 * speed - 0.5 * 4.0 + 0.25 + 1000.0 * f64::from(step) + success;
        assert!((f64::from(reward) - wanted).abs() < 1e-3, "step {step}: {reward} {wanted}");
    }
    assert_eq!(task.heuristic().score(&rows), f64::from(x as f32));
}

#[test]
fn a_success_that_may_be_undone_is_paid_at_the_end() {
    for (bound, wanted) in [("above = 0.05", 100.0), ("above = 5.0", 0.0)] {
        let text = TASK.replace(
            "fold = \"max\"\nof = \"x\"\nabove = 0.05",
            &format!("fold = \"last\"\nof = \"x\"\n{bound}"),
        );
        let task = cart(&text.replace("qpos_noise", "# qpos_noise"));
        let free =
            cart(&text.replace("qpos_noise", "# qpos_noise").replace("reward = 100.0", "reward = 0.0"));
        let (mut with, mut buffers) = start(&task, 0);
        let (mut without, _) = start(&free, 0);
        for step in 1..=4 {
            let mut step_of = |environment: &mut MujocoEnvironment| {
                environment.step(&[0.0], &mut buffers.observation, &mut buffers.measurements).task_reward
            };
            let paid = step_of(&mut with) - step_of(&mut without);
            assert!((paid - if step == 4 { wanted } else { 0.0 }).abs() < 1e-4, "step {step}: {paid}");
        }
    }
}

#[test]
fn a_success_that_holds_from_the_start_is_paid_in_the_first_step() {
    let task = cart(&TASK.replace("above = 0.05", "above = -1.0"));
    let (mut environment, mut buffers) = start(&task, 0);
    let mut step =
        || environment.step(&[0.0], &mut buffers.observation, &mut buffers.measurements).task_reward;
    assert!(step() > 100.0);
    assert!(step() < 50.0);
}
