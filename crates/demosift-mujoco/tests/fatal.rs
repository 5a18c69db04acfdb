//! Errors after which MuJoCo cannot go on: the process ends with a word, and with the exit code of a failure.

use std::process::Command;

use demosift::basics::seed::Seed;
use demosift::world::environment::{EnvVariant, Environment as _};
use demosift_mujoco::mujoco_task::MujocoTask;

/// A box on a floor takes more room than there is; above the floor, where the model has it, it does not.
const MODEL: &str = r#"
<mujoco>
  <size memory="4K"/>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 1"/>
    <body pos="0 0 1"><joint name="slider" type="slide" axis="0 0 1"/><geom type="box" size="0.1 0.1 0.1"/></body>
  </worldbody>
  <actuator><motor name="push" joint="slider" ctrlrange="-1 1"/></actuator>
</mujoco>"#;

const TASK: &str = r#"
name = "cart"
model = "cart.xml"
frame_skip = 1
horizon = 2
observation = [{ qpos = "all" }]
reset = { qpos = { slider = -0.95 } }
[measurements]
x = { qpos = "slider" }
[heuristic]
fold = "max"
of = "x"
"#;

fn load(memory: &str) -> demosift::Result<MujocoTask> {
    MujocoTask::from_texts(TASK, &[("cart.xml", &MODEL.replace("4K", memory))], None)
}

/// Says to a process that it is the one which may end.
const MAY_END: &str = "DEMOSIFT_TEST_MAY_END";

/// Not a test: it ends the process that plays it.
#[test]
#[ignore = "played by the test of what it says, in a process of its own"]
fn play_a_model_with_too_little_memory() {
    if std::env::var_os(MAY_END).is_none() {
        return;
    }
    let mut environment = load("4K").unwrap().mujoco_environment().unwrap();
    let (mut observation, mut measurements) = ([0.0], [0.0]);
    environment.reset(EnvVariant(0), Seed::new(0), &mut observation, &mut measurements);
    environment.step(&[0.0], &mut observation, &mut measurements);
}

#[test]
fn an_error_that_ends_the_simulation_is_told_before_the_process_ends() {
    let played = Command::new(std::env::current_exe().unwrap())
        .args(["fatal::play_a_model_with_too_little_memory", "--exact", "--ignored", "--nocapture"])
        .env(MAY_END, "1")
        .output()
        .unwrap();
    let said = String::from_utf8(played.stderr).unwrap();
    assert_eq!(played.status.code(), Some(1), "{said}");
    let lines: Vec<&str> = said.lines().collect();
    assert!(lines[0].starts_with("error: MuJoCo: mj_stackAlloc: out of memory, stack overflow"), "{said}");
    assert!(lines[1].starts_with("hint: ") && lines[1].contains("<size memory="), "{said}");
    assert_eq!(lines.len(), 2, "{said}");
}

#[test]
fn an_error_while_a_model_is_loaded_is_an_error_like_others() {
    let error = load("1").err().unwrap();
    assert!(error.is_bad_input() && error.to_string().contains("out of memory"), "{error}");
}
