//! Each word of `task.toml` on a small model, and what becomes of states that cannot be simulated.

use demosift::basics::seed::Seed;
use demosift::data::trajectory::{Ended, Parts, Trajectory};
use demosift::math::rows::Rows;
use demosift::world::environment::{EnvVariant, Environment, Task};
use demosift_mujoco::environment::MujocoEnvironment;
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::registry;
use demosift_mujoco::task::reward::{RewardShaping, Transition};

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
    let trouble = environment.trouble().expect("MuJoCo has warned");
    assert!(trouble.contains("(BADQ"), "{trouble}");
    let mut observations = Rows::with_capacity(17, 2);
    observations.push(&[0.0; 17]);
    observations.push(&observation);
    let error = Trajectory::new(Parts {
        observations,
        actions: Rows::from_flat(vec![0.0; 6], 6).unwrap(),
        measurements: Rows::from_flat(vec![0.0; 2], 1).unwrap(),
        task_rewards: vec![0.0],
        ended: Ended::Horizon,
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
fn a_keyframe_sets_activations_and_mocap_bodies_too_at_every_start() {
    // A filter that hardly moves within a step, so that its activation is the force.
    let model = r#"
<mujoco>
  <option timestep="0.01" gravity="0 0 0"/>
  <worldbody>
    <body name="mark" mocap="true"><geom name="mark" size="0.1" contype="0" conaffinity="0"/></body>
    <body name="cart"><joint name="slider" type="slide" axis="1 0 0"/><geom name="box" size="0.1" mass="2"/></body>
  </worldbody>
  <actuator>
    <general name="push" joint="slider" dyntype="filter" dynprm="1e6" gainprm="1" ctrlrange="-2 2"/>
  </actuator>
  <keyframe>
    <key name="other" qpos="9"/>
    <key name="pushed" act="1" mpos="1 2 3" mquat="0 1 0 0"/>
  </keyframe>
</mujoco>"#;
    let text = r#"
name = "cart"
model = "cart.xml"
frame_skip = 1
horizon = 4
observation = [{ qpos = "all" }, { position = ["body:mark"] }]
reset = { keyframe = "pushed" }
measurements = { x = { qpos = "slider" } }
heuristic = { fold = "max", of = "x" }
"#;
    let task = MujocoTask::from_texts(text, &[("cart.xml", model)], None).unwrap();
    let (mut environment, mut buffers) = start(&task, 0);
    let assert_pushed = |environment: &mut MujocoEnvironment, buffers: &mut Buffers| {
        environment.observe(&mut buffers.observation, &mut buffers.measurements);
        assert_eq!(buffers.observation, [0.0, 1.0, 2.0, 3.0]);
        environment.step(&[0.0], &mut buffers.observation, &mut buffers.measurements);
        // 1 N on 2 kg for 0.01 s.
        assert!((environment.qvel()[0] - 0.005).abs() < 1e-6, "{}", environment.qvel()[0]);
        environment.step(&[-1.0], &mut buffers.observation, &mut buffers.measurements);
    };
    assert_pushed(&mut environment, &mut buffers);
    environment.set_state(&[0.0], &[0.0]).unwrap();
    assert_pushed(&mut environment, &mut buffers);
    let plain = text.replace("reset = { keyframe = \"pushed\" }\n", "");
    let (plain, buffers) = start(&MujocoTask::from_texts(&plain, &[("cart.xml", model)], None).unwrap(), 0);
    assert_eq!((plain.qpos()[0], &buffers.observation[1..]), (0.0, &[0.0; 3][..]));
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

/// The cart with a range to keep to, and what can be measured of its steps.
fn ending(old: &str, new: &str) -> MujocoTask {
    let text = TASK.replace("qpos_noise", "# qpos_noise").replace(
        "[heuristic]",
        "rush = { rate_of = \"x\" }\neffort = \"effort\"\nalive = \"alive\"\n\
         worth = { sum = { alive = 2.0, rush = 1.0, effort = -0.5 } }\n[ends]\nx = [-1, 0.05]\nv = [-inf, 9]\n\
         [return]\nmeasurement = \"worth\"\n[heuristic]",
    );
    cart(&text.replace(old, new))
}

/// Without force the cart goes 0.02 m a step and leaves 0.05 m in the third; each number by hand.
#[test]
fn the_step_that_leaves_a_range_is_the_last_one_and_what_it_measures_is_right() {
    let task = ending("horizon = 4", "horizon = 40");
    assert!(task.may_end_early() && !cart(TASK).may_end_early());
    let (mut environment, mut buffers) = start(&task, 0);
    let column = |name: &str| task.specification().measurement(name).unwrap();
    let mut rows = Rows::with_capacity(14, 0);
    rows.push(&buffers.measurements);
    // 1 N is action 0; −1 N, which holds the speed at less than 1 m/s, and beyond the range.
    let mut x = 0.0;
    for (step, action, ends) in [(1, 0.0, false), (2, -1.0 / 3.0, false), (3, 5.0, true), (4, -5.0, true)] {
        let outcome = environment.step(&[action], &mut buffers.observation, &mut buffers.measurements);
        assert_eq!(outcome.terminated, ends, "step {step}");
        rows.push(&buffers.measurements);
        let rush = (environment.qpos()[0] - x) / 0.02;
        x = environment.qpos()[0];
        let effort = f64::from(action.clamp(-1.0, 1.0)).powi(2);
        let alive = if ends { 0.0 } else { 1.0 };
        let wanted = [
            ("rush", rush),
            ("effort", effort),
            ("alive", alive),
            ("worth", 2.0 * alive + rush - 0.5 * effort),
        ];
        for (name, wanted) in wanted {
            let got = f64::from(buffers.measurements[column(name)]);
            assert!((got - wanted).abs() < 1e-5, "step {step}: {name} {got} {wanted}");
        }
    }
    // Nothing led to the first row, so it has no rate and no effort, and counts in no return.
    assert_eq!(
        ["rush", "effort", "alive", "worth"].map(|name| rows.row(0)[column(name)]),
        [0.0, 0.0, 1.0, 2.0]
    );
    let whole = rows.head(4);
    let sum: f64 = (1..4).map(|row| f64::from(whole.row(row)[column("worth")])).sum();
    assert_eq!(task.true_return(&whole), Some(sum));
    assert_eq!(cart(TASK).true_return(&whole), None);
}

#[test]
fn an_infinite_end_never_ends_an_episode_and_a_finite_one_does() {
    for (range, ends) in [
        ("[-1, inf]", false),
        ("[-inf, 0.5]", true),
        ("[0.5, 2]", true),
        ("[-1, 0.99]", true),
        ("[-1, 1.001]", false),
    ] {
        let task = ending("v = [-inf, 9]", &format!("v = {range}"));
        let (mut environment, mut buffers) = start(&task, 0);
        environment.set_state(&[-0.5, 3.0, 4.0, 0.1, 1.0, 0.0, 0.0, 0.0], &[0.0; 7]).unwrap();
        let mut state = environment.qvel().to_vec();
        // 1/3 of the way from −2 N to 4 N is no force.
        state[0] = if range == "[0.5, 2]" { 0.25 } else { 1.0 };
        environment.set_state(&[-0.5, 3.0, 4.0, 0.1, 1.0, 0.0, 0.0, 0.0], &state).unwrap();
        let outcome = environment.step(&[-1.0 / 3.0], &mut buffers.observation, &mut buffers.measurements);
        assert_eq!(outcome.terminated, ends, "{range}: {}", environment.qvel()[0]);
    }
}

#[test]
fn a_success_that_may_be_undone_is_paid_at_an_early_end() {
    let last = "fold = \"max\"\nof = \"x\"\nabove = 0.05";
    let task = ending(last, "fold = \"last\"\nof = \"x\"\nabove = 0.05");
    let free = ending(last, "fold = \"last\"\nof = \"x\"\nabove = 9.0");
    let (mut with, mut buffers) = start(&task, 0);
    let (mut without, _) = start(&free, 0);
    for step in 1..=3 {
        let mut reward = |environment: &mut MujocoEnvironment| {
            environment.step(&[0.0], &mut buffers.observation, &mut buffers.measurements)
        };
        let (paid, unpaid) = (reward(&mut with), reward(&mut without));
        assert_eq!(paid.terminated, step == 3);
        let difference = paid.task_reward - unpaid.task_reward;
        assert!((difference - if step == 3 { 100.0 } else { 0.0 }).abs() < 1e-4, "step {step}: {difference}");
    }
}

/// Of a state whose numbers are all different, each slice is held against the numbers of MuJoCo's own state.
#[test]
fn slices_take_some_numbers_and_clips_cut_them_off() {
    let observation = |parts: &str| {
        let (from, to) = (TASK.find("observation = [").unwrap(), TASK.find("reward = [").unwrap());
        let text = TASK.replace(&TASK[from..to], &format!("observation = [{parts}]\n"));
        let task = cart(&text);
        let (mut environment, mut buffers) = start(&task, 0);
        environment
            .set_state(&[0.5, 3.0, 4.0, 2.0, 0.5, 0.5, 0.5, 0.5], &[-20.0, 11.0, 12.0, -13.0, 4.0, 5.0, -6.0])
            .unwrap();
        environment.observe(&mut buffers.observation, &mut buffers.measurements);
        let names: Vec<String> = task
            .specification()
            .observation_parts
            .iter()
            .map(|(name, width)| format!("{name}: {width}"))
            .collect();
        (buffers.observation, names.join(", "))
    };
    for (parts, wanted, names) in [
        ("{ qpos = 'ball_root[2:]' }", &[2.0, 0.5, 0.5, 0.5, 0.5][..], "qpos ball_root[2:7]: 5"),
        (
            "{ qpos = ['slider', 'ball_root[:2]'] }",
            &[0.5, 3.0, 4.0],
            "qpos slider: 1, qpos ball_root[0:2]: 2",
        ),
        ("{ qpos = 'all[3:4]' }", &[2.0], "qpos ball_root[2:3]: 1"),
        ("{ qvel = 'all[:2]' }", &[-20.0, 11.0], "qvel slider: 1, qvel ball_root[0:1]: 1"),
        (
            "{ position = ['leather[2:]', 'box[:1]'] }",
            &[2.0, 0.5],
            "position leather[2:]: 1, position box[:1]: 1",
        ),
        ("{ velocity = ['body:ball[1:3]'] }", &[12.0, -13.0], "velocity body:ball[1:3]: 2"),
        (
            "{ qvel = 'all', clip = [-10, 11.5] }",
            &[-10.0, 11.0, 11.5, -10.0, 4.0, 5.0, -6.0],
            "qvel slider clipped to [-10, 11.5]: 1, qvel ball_root clipped to [-10, 11.5]: 6",
        ),
        (
            "{ qvel = 'slider', clip = [-10, inf] }, { qvel = 'ball_root[:1]' }",
            &[-10.0, 11.0],
            "qvel slider clipped to [-10, inf]: 1, qvel ball_root[0:1]: 1",
        ),
        (
            "{ position = ['leather'], clip = [-1, 3.5] }",
            &[3.0, 3.5, 2.0],
            "position leather clipped to [-1, 3.5]: 3",
        ),
    ] {
        let (seen, called) = observation(parts);
        assert_eq!((seen.as_slice(), called.as_str()), (wanted, names), "{parts}");
    }
    // A wrench takes 6 numbers; here the forces of the ball that nothing touches.
    assert_eq!(observation("{ contact_wrench = ['ball[3:]'] }").0, [0.0; 3]);
}
