//! `demosift task check` as a user runs it: on tasks that are right and wrong, with sets that fit and do not.

use crate::support::{Scratch, in_repository};
use demosift::data::demonstration::d4rl::{self, Episode};
use demosift::math::rows::Rows;
use serde_json::Value;

/// A block upon a slide, right in all but a camera.
const MODEL: &str = "<mujoco><worldbody><body name='block'><joint name='slide' type='slide' axis='1 0 0' damping='1'/>\
    <geom name='block' size='0.1'/></body></worldbody>\
    <actuator><motor name='push' joint='slide' ctrlrange='-1 1'/></actuator></mujoco>";
const TASK: &str = "name = 'block'\nmodel = 'block.xml'\nframe_skip = 10\nhorizon = 20\n\
    observation = [{ qpos = 'all' }, { qvel = 'all' }]\nreward = [{ measurement = 'x' }]\n\
    reset = { qpos_noise = { uniform = 0.1 } }\nmeasurements = { x = { qpos = 'slide' } }\n\
    heuristic = { fold = 'last', of = 'x', unit = 'm' }\n";

/// The folder `block` after a replacement in the task file.
pub(crate) fn with_task(name: &str, old: &str, new: &str) -> Scratch {
    let scratch = Scratch::new(name);
    assert!(TASK.contains(old));
    std::fs::create_dir_all(scratch.0.join("block")).unwrap();
    std::fs::write(scratch.0.join("block/block.xml"), MODEL).unwrap();
    std::fs::write(scratch.0.join("block/task.toml"), TASK.replace(old, new)).unwrap();
    scratch
}

#[test]
fn a_task_is_described_and_what_is_odd_is_told() {
    let scratch = with_task("check", "block", "block");
    let said = scratch.succeed("task check block");
    for wanted in [
        "The task 'block':",
        "episode        20 control steps, 0.40 s",
        "heuristic      the last x [m]; higher is better",
        "observation 1: qvel slide",
        "  warning   the model has no camera",
        "  fine      the same seed gives the same bits",
    ] {
        assert!(said.contains(wanted), "{wanted}\n{said}");
    }
    assert!(said.lines().all(|line| line.chars().count() <= 100), "{said}");
}

#[test]
fn an_error_among_the_findings_ends_with_exit_code_2_and_all_findings_are_still_told() {
    let scratch = with_task(
        "check-error",
        "x = { qpos = 'slide' }",
        "x = { position = { of = 'body:block', axis = 'z' } }",
    );
    let output = scratch.run("task check block");
    let (said, complaint) =
        (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert_eq!(output.status.code(), Some(2));
    assert!(said.contains("  ERROR     the heuristic is 0 in all random episodes"), "{said}");
    assert!(said.contains("  fine      the same seed"), "{said}");
    assert_eq!(complaint, "error: the check of 'block' found an error\n");
    let json = scratch.run("task check block --json");
    assert_eq!(json.status.code(), Some(2));
    let value: Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!(value["findings"][0]["severity"], "error");
    assert!(value["task"]["observation_size"] == 2 && value["steps_per_sec"].as_f64().unwrap() > 0.0);
}

#[test]
fn a_task_that_cannot_be_loaded_is_one_error_that_names_what_is_right() {
    for (old, new, wanted) in [
        ("qpos = 'slide'", "qpos = 'slid'", "did you mean 'slide'? the model has: slide"),
        ("frame_skip", "frameskip", "unknown key `frameskip`"),
        ("frame_skip", "frameskip", "did you mean `frame_skip`?"),
        ("block.xml", "blok.xml", "there is no such file; its folder has: block.xml"),
        ("block.xml", "blok.xml", "hint: `model` is relative to the folder of its task.toml"),
        ("heuristic = {", "# {", "missing key `heuristic`"),
        ("fold = 'last'", "fold = 'latest'", "did you mean `last`?"),
    ] {
        let scratch = with_task("check-load", old, new);
        let output = scratch.run("task check block");
        let complaint = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(2) && output.stdout.is_empty(), "{complaint}");
        assert!(complaint.contains(wanted), "{new}\nwanted: {wanted}\ngot: {complaint}");
    }
    let scratch = Scratch::new("check-none");
    for (task, wanted) in [
        ("no/such/folder", "there is no such file or folder"),
        ("half_chetah", "did you mean 'half_cheetah'?"),
        ("set", "this folder holds no task.toml"),
        ("point_mass", "has no model that could be checked"),
    ] {
        let output = scratch.run(&format!("task check {task}"));
        let complaint = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(2) && complaint.contains(wanted), "{complaint}");
    }
}

#[test]
fn a_set_is_played_again_or_found_not_to_fit() {
    let scratch = Scratch::new("check-data");
    let set = in_repository("data/free_throw_8");
    let said = scratch.succeed(&format!("task check free_throw --data {}", set.display()));
    assert!(said.contains("each recorded action leads to the next recorded state"), "{said}");
    assert!(said.lines().all(|line| line.chars().count() <= 100), "{said}");
    let json = scratch.succeed(&format!("task check free_throw --data {} --json", set.display()));
    let value: Value = serde_json::from_str(&json).unwrap();
    let demonstrations = value["recorded"]["demonstrations"].as_array().unwrap();
    assert!(demonstrations.len() == 8 && demonstrations.iter().all(|one| one["drift"]["left_at"].is_null()));
    let output = scratch.run(&format!("task check handstand --data {}", set.display()));
    let said = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(said.contains("ERROR"), "{said}");
    // The point mass has no states, and another size.
    let output = scratch.run("task check free_throw --data set");
    let said = String::from_utf8(output.stdout).unwrap().replace('\n', " ");
    assert!(output.status.code() == Some(2) && said.contains("the set holds no states"), "{said}");
    assert!(said.contains("an observation of the set has 4 numbers, and one of the task 55"), "{said}");
}

#[test]
fn a_set_that_cannot_be_read_is_one_of_the_findings() {
    let scratch = with_task("check-unreadable", "block", "block");
    std::fs::write(scratch.0.join("cut.hdf5"), b"\x89HDF\r\n\x1a\nand no more").unwrap();
    let numbers = |last: f32| Rows::from_flat(vec![0.1, 0.2, 0.1, last], 2).unwrap();
    let actions = Rows::from_flat(vec![0.0, 0.5], 1).unwrap();
    for (name, last) in [("nan", f32::NAN), ("one", 0.25)] {
        let observations = numbers(last);
        let episode =
            Episode { observations: &observations, actions: &actions, states: None, terminated: false };
        d4rl::write(&scratch.0.join(format!("{name}.hdf5")), &[episode]).unwrap();
    }
    for (set, wanted) in [
        ("cut.hdf5", "cut.hdf5"),
        ("nan.hdf5", "observation 1 at step 1 is NaN"),
        ("nowhere.hdf5", "nowhere.hdf5"),
    ] {
        let output = scratch.run(&format!("task check block --data {set}"));
        let said = String::from_utf8(output.stdout).unwrap();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.starts_with("The task 'block':") && said.contains("same bits"), "{said}");
        let words = said.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(
            words.contains("ERROR the demonstrations cannot be read: ") && words.contains(wanted),
            "{said}"
        );
    }
    // One episode is not enough to choose from, and enough to be held against the task.
    let output = scratch.run("task check block --data one.hdf5");
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.contains("1 demonstration with 2 observed numbers and 1 action fit the task"), "{said}");
}

#[test]
fn what_ends_an_episode_and_what_is_clipped_is_described() {
    let scratch = with_task(
        "check-ends",
        "heuristic = {",
        "ends = { x = [-0.4, 0.1] }\nreturn = { measurement = 'x' }\nheuristic = {",
    );
    let file = scratch.0.join("block/task.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replace("{ qvel = 'all' }", "{ qvel = 'all', clip = [-inf, 2.5] }")).unwrap();
    let said = scratch.succeed("task check block");
    for wanted in [
        "episode        20 control steps, 0.40 s; ends early as soon as x leaves [-0.4, 0.1]",
        "observation    2 numbers: qpos 1, qvel 1 clipped to [-inf, 2.5]",
        "return         the sum of x over the steps, for reports only",
        "of them ended early)",
        "random episodes end early, after ",
    ] {
        assert!(said.contains(wanted), "{wanted}\n{said}");
    }
    let json: Value = serde_json::from_str(&scratch.succeed("task check block --json")).unwrap();
    assert_eq!(json["task"]["ends"][0], "x leaves [-0.4, 0.1]");
    assert_eq!(json["task"]["true_return"], "x");
    assert!(json["played"]["ended_early"].as_u64().unwrap() > 0);
    // A set of such a task: its length is explained, and a dry run says what it cannot count.
    let numbers = |values: &[f32], width| Rows::from_flat(values.to_vec(), width).unwrap();
    let (observations, actions) = (numbers(&[0.085, 0.5, 0.095, 0.5], 2), numbers(&[0.0, 0.0], 1));
    let episode =
        || Episode { observations: &observations, actions: &actions, states: None, terminated: true };
    d4rl::write(&scratch.0.join("short.hdf5"), &[episode(), episode(), episode()]).unwrap();
    let said = scratch.run("task check block --data short.hdf5").stdout;
    let said = String::from_utf8(said).unwrap();
    let words = said.split_whitespace().collect::<Vec<_>>().join(" ");
    let wanted = "3 of 3 demonstrations have 2 steps, and an episode of the task 20; each of these ends where the task ends";
    assert!(words.contains(wanted), "{said}");
    let dry = scratch.succeed("sift short.hdf5 --task block --config tiny.toml --dry-run");
    assert!(dry.contains("Episodes of this task may end early"), "{dry}");
    let dry = scratch.succeed("sift set --task point_mass --config tiny.toml --dry-run");
    assert!(!dry.contains("may end early"), "{dry}");
}

#[test]
fn an_episode_has_an_end() {
    let scratch = with_task("check-endless", "horizon = 20", "horizon = 9000000000000000000");
    let output = scratch.run("task check block");
    let complaint = String::from_utf8(output.stderr).unwrap();
    assert!(complaint.contains("horizon = 9000000000000000000: must be at most 10000000"), "{complaint}");
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn nothing_is_recorded_where_no_reward_says_what_to_learn() {
    let scratch = with_task("record-without-reward", "reward = [{ measurement = 'x' }]\n", "");
    let wanted = ["has no reward", "block", "\nhint: add terms to `reward`"];
    scratch.refuse("record --task block --out run", &wanted);
    scratch.refuse("record --task block --out run --dry-run", &wanted);
    assert!(!scratch.0.join("run").exists());
}

#[test]
fn a_first_task_file_is_written_that_the_check_accepts_and_nothing_is_written_over() {
    let scratch = Scratch::new("task-new");
    std::fs::create_dir_all(scratch.0.join("block")).unwrap();
    std::fs::write(scratch.0.join("block/block.xml"), MODEL).unwrap();
    let numbers = |values: &[f32], width| Rows::from_flat(values.to_vec(), width).unwrap();
    let (observations, actions) = (numbers(&[0.1, 0.0, 0.1, 0.0], 2), numbers(&[0.0, 0.5], 1));
    let episode =
        || Episode { observations: &observations, actions: &actions, states: None, terminated: false };
    d4rl::write(&scratch.0.join("two.hdf5"), &[episode(), episode()]).unwrap();
    let said = scratch.succeed("task new block/block.xml --data two.hdf5");
    assert_eq!(said, "A first task file: block/task.toml. Say what you want where it says TODO.\n");
    let text = std::fs::read_to_string(scratch.0.join("block/task.toml")).unwrap();
    assert!(text.contains("model = \"block.xml\"") && text.contains("horizon = 2 "), "{text}");
    scratch.succeed("task check block");
    let output = scratch.run("task new block/block.xml");
    let complaint = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(2) && complaint.contains("a task file already"), "{complaint}");
    scratch.succeed("task new block/block.xml --out elsewhere/new");
    scratch.succeed("task check elsewhere/new");
    let output = scratch.run("task new nowhere.xml");
    assert!(String::from_utf8(output.stderr).unwrap().contains("there is no such file"));
    let output = scratch.command("task new blok.xml").current_dir(scratch.0.join("block")).output().unwrap();
    let complaint = String::from_utf8(output.stderr).unwrap();
    assert!(complaint.contains("there is no such file; its folder has: block.xml"), "{complaint}");
    assert!(!complaint.contains("task.toml"), "{complaint}");
}
