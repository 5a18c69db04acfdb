//! Sets in other units than their task's, as a user meets them: stopped, mended by a set.toml, ranked, and passed on as they were.

use std::path::Path;

use crate::support::Scratch;
use demosift::basics::seed::Seed;
use demosift::data::demonstration::episode::{Columns, Episode, Source};
use demosift::data::demonstration::lerobot::{self, Described};
use demosift::data::demonstration::open;
use demosift::math::rows::Rows;
use demosift::world::environment::{EnvVariant, Environment as _, Task as _};
use demosift_mujoco::mujoco_task::MujocoTask;
use serde_json::Value;

const MODEL: &str = "<mujoco><option timestep='0.01'/><worldbody><camera name='side' pos='0 -1 0'/>\
    <site name='target' pos='0 0 0.2'/><body name='rod'>\
    <joint name='hinge' type='hinge' axis='0 1 0' damping='0.05' armature='0.01' limited='true' range='-170 170'/>\
    <geom name='rod' type='capsule' size='0.02' fromto='0 0 0 0.2 0 0'/><site name='tip' pos='0.2 0 0'/></body></worldbody>\
    <actuator><position name='servo' joint='hinge' kp='3' ctrlrange='-2.5 2.5'/></actuator></mujoco>";
const TASK: &str = "name = 'rod'\nmodel = 'rod.xml'\nframe_skip = 4\nhorizon = 40\n\
    observation = [{ qpos = 'all' }, { qvel = 'all' }]\nreset = { qpos_noise = { uniform = 0.3 } }\n\
    measurements = { reach = { distance = ['tip', 'target'] } }\n\
    heuristic = { fold = 'mean', of = 'reach', negate = true, unit = 'm' }\n";

/// A folder with the task `rod`.
fn scratch(name: &str) -> Scratch {
    let scratch = Scratch::new(name);
    std::fs::create_dir_all(scratch.0.join("rod")).unwrap();
    std::fs::write(scratch.0.join("rod/rod.xml"), MODEL).unwrap();
    std::fs::write(scratch.0.join("rod/task.toml"), TASK).unwrap();
    scratch
}

/// Six episodes of the task, each number of an action made into another.
fn record(scratch: &Scratch, act: fn(f32) -> f32) -> Vec<Episode> {
    let task = MujocoTask::from_file(&scratch.0.join("rod/task.toml")).unwrap();
    let mut environment = task.mujoco_environment().unwrap();
    let (mut observation, mut now) = ([0.0; 2], [0.0; 1]);
    let mut episodes = Vec::new();
    for number in 0..6 {
        environment.reset(EnvVariant(0), Seed::new(2).at(number), &mut observation, &mut now);
        let (mut observations, mut actions) = (Rows::with_capacity(2, 40), Rows::with_capacity(1, 40));
        let mut action = 0.0;
        for step in 0..task.specification().horizon {
            if step % 8 == 0 {
                action = ((number * 5 + step / 8 * 3) % 7) as f32 / 4.0 - 0.75;
            }
            observations.push(&observation);
            actions.push(&[act(action)]);
            environment.step(&[action], &mut observation, &mut now);
        }
        episodes.push(episode(number, observations, actions));
    }
    episodes
}

fn episode(number: usize, observations: Rows, actions: Rows) -> Episode {
    Episode {
        label: number.to_string(),
        observations,
        actions,
        last_observation: None,
        timestamps_secs: Vec::new(),
        unreadable: None,
    }
}

fn write(scratch: &Scratch, name: &str, episodes: &[Episode], steps_per_sec: u32) {
    let described = Described { steps_per_sec, tasks: vec!["reach".to_owned()], ..Described::default() };
    lerobot::write(&scratch.0.join(name), episodes, None, &described).unwrap();
}

/// The task's actions and the same as controls, in two sets.
fn two_sets(name: &str) -> Scratch {
    let scratch = scratch(name);
    write(&scratch, "norm", &record(&scratch, |action| action), 25);
    write(&scratch, "rad", &record(&scratch, |action| 2.5 * action), 25);
    scratch
}

fn mend(scratch: &Scratch, set: &str, lines: &str) {
    std::fs::write(scratch.0.join(set).join("set.toml"), lines).unwrap();
}

/// What a command that must fail by the user's mistake complains of, in one line.
#[track_caller]
fn complaint(scratch: &Scratch, arguments: &str) -> String {
    let output = scratch.run(arguments);
    let complaint = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments}: {complaint}");
    complaint.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn read(path: &Path) -> Source {
    open::open(path, None, &Columns::default()).unwrap()
}

const SIFT: &str = "--task rod --config tiny.toml --judge cloning --referee none";

#[test]
fn controls_are_stopped_everywhere_and_mended_by_the_line_that_is_proposed() {
    let scratch = two_sets("units-stopped");
    let line = "actions.units = \"controls\"";
    for command in
        ["sift rad", "sift rad --dry-run", "judge rad", "select rad", "meta-train rad", "oracle rad"]
    {
        let said = complaint(&scratch, &format!("{command} {}", SIFT.replace("--referee none", "")));
        assert!(said.contains("the set cannot be what the task 'rod' takes"), "{said}");
        assert!(
            said.contains("controls in the units of ctrlrange (then a typical step misses 0.0 %)"),
            "{said}"
        );
        assert!(said.contains(&format!("write into rad/set.toml: {line}")), "{said}");
        assert!(!scratch.0.join("runs").exists(), "nothing is begun");
    }
    let said = scratch.succeed("inspect rad --task rod");
    assert!(said.contains("It does not fit the task 'rod': "), "{said}");
    assert!(said.contains(&format!("write into rad/set.toml:\n    {line}\n")), "{said}");
    let json: Value = serde_json::from_str(&scratch.succeed("inspect rad --task rod --json")).unwrap();
    assert_eq!(json["fits_task"], false);
    let lines: Vec<&Value> = json["findings"].as_array().unwrap().iter().map(|one| &one["lines"]).collect();
    assert!(lines.contains(&&Value::from(format!("{line}\n"))), "{json:#}");
    let output = scratch.run("task check rod --data rad");
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.code() == Some(2) && said.contains(&format!("set.toml:\n    {line}\n")), "{said}");

    mend(&scratch, "rad", line);
    assert!(scratch.succeed("inspect rad --task rod").contains("It fits the task 'rod'."));
    scratch.succeed("task check rod --data rad");
    scratch.succeed(&format!("sift rad {SIFT} --dry-run"));
    // Without a task nobody knows what the controls' range is.
    let shown = scratch.succeed("inspect rad");
    assert!(shown.contains("outside [-1, 1]"), "{shown}");
}

#[test]
fn both_sets_then_give_the_same_ranking_and_the_run_remembers_what_was_said() {
    let scratch = two_sets("units-ranked");
    mend(&scratch, "rad", "[actions]\nunits = 'controls' # joint targets\n");
    let order = |set: &str| -> Vec<Value> {
        let json = scratch.succeed(&format!("sift {set} {SIFT} --out {set}_run --json"));
        let found: Value = serde_json::from_str(&json).unwrap();
        let ranking = found["ranking"].as_array().unwrap();
        ranking.iter().map(|row| row["demonstration"].clone()).collect()
    };
    assert_eq!(order("rad"), order("norm"));
    let run: Value =
        serde_json::from_slice(&std::fs::read(scratch.0.join("rad_run/run.json")).unwrap()).unwrap();
    assert_eq!(run["data"]["set_file"]["actions"]["units"], "controls");
    let numbers = |page: &str| {
        let page = std::fs::read_to_string(scratch.0.join(page)).unwrap();
        page.split("\"numbers\":").nth(1).unwrap().split(']').next().unwrap().to_owned()
    };
    let sentence = "[\"Number 0 of an action is number 0 of the set, taken as a control of the model, in the unit of its range.\"";
    assert_eq!([numbers("rad_run/report.html"), numbers("norm_run/report.html")], [sentence, "["]);
    scratch.succeed("inspect rad --task rod --html looks.html");
    assert_eq!(numbers("looks.html"), sentence);
    let again = "sift --out rad_run --resume";
    scratch.succeed(again);
    mend(&scratch, "rad", "actions.units = 'degrees'");
    let said = complaint(&scratch, again);
    let wanted = "what set.toml says of the demonstrations was actions.units = \"controls\" there, and is \
                  actions.units = \"degrees\" now";
    assert!(said.contains(wanted), "{said}");
    // A comment changes nothing, and neither does a file that lies elsewhere.
    std::fs::remove_file(scratch.0.join("rad/set.toml")).unwrap();
    scratch.succeed(again);
    std::fs::write(scratch.0.join("elsewhere.toml"), "actions = { units = 'controls' }").unwrap();
    scratch.succeed(&format!("{again} --set-file elsewhere.toml"));

    // What is passed on is what came in, with what was said of it.
    scratch.succeed("export rad_run --as lerobot --out kept");
    let (kept, all) = (read(&scratch.0.join("kept")), read(&scratch.0.join("rad")));
    assert!(!kept.episodes.is_empty() && kept.says.steps_per_sec == Some(25.0));
    for episode in &kept.episodes {
        assert!(all.episodes.iter().any(|one| one.actions == episode.actions), "bit for bit");
    }
    let handed_on = std::fs::read_to_string(scratch.0.join("kept/set.toml")).unwrap();
    assert_eq!(handed_on, "actions.units = \"controls\"\n");
    assert!(scratch.succeed("inspect kept --task rod").contains("It fits the task 'rod'."));
}

#[test]
fn a_rate_is_held_against_the_task_and_kept_by_what_is_written() {
    let scratch = scratch("units-rate");
    let episodes = record(&scratch, |action| action);
    write(&scratch, "fps60", &episodes, 60);
    let said = complaint(&scratch, &format!("sift fps60 {SIFT} --dry-run"));
    assert!(said.contains("meta/info.json says 60 steps a second, and the task 'rod' takes 25"), "{said}");
    assert!(said.contains("write into fps60/set.toml: rate = 25"), "{said}");
    let shown = scratch.succeed("inspect fps60 --task rod");
    assert!(shown.contains("ERROR") && shown.contains("60 steps a second"), "{shown}");
    scratch.succeed("convert fps60 --to lerobot again");
    assert_eq!(read(&scratch.0.join("again")).says.steps_per_sec, Some(60.0));
    mend(&scratch, "fps60", "rate = 25");
    scratch.succeed(&format!("sift fps60 {SIFT} --out run"));
    scratch.succeed("export run --as lerobot --out kept");
    assert_eq!(read(&scratch.0.join("kept")).says.steps_per_sec, Some(60.0), "as it came in");
    scratch.succeed("export run --as lerobot --fps 25 --out right");
    assert_eq!(read(&scratch.0.join("right")).says.steps_per_sec, Some(25.0));
}

#[test]
fn a_box_of_minari_is_said_scaled_and_kept() {
    let scratch = scratch("units-box");
    let episodes = record(&scratch, |action| 0.4 * action);
    let bounds = [[-0.4, 0.4]];
    demosift::data::demonstration::minari::write(
        &scratch.0.join("box"),
        &episodes,
        "demosift/box-v0",
        Some(&bounds),
    )
    .unwrap();
    let said = complaint(&scratch, &format!("sift box {SIFT} --dry-run"));
    assert!(said.contains("metadata.json says that actions lie in [-0.4, 0.4]"), "{said}");
    assert!(said.contains("write into box/set.toml: actions.scale = 2.5"), "{said}");
    mend(&scratch, "box", "actions.scale = 2.5");
    scratch.succeed(&format!("sift box {SIFT} --dry-run"));
    scratch.succeed("convert box --to minari again");
    assert_eq!(read(&scratch.0.join("again")).says.action_bounds, Some(bounds.to_vec()));
    assert!(scratch.0.join("again/set.toml").exists());
}

#[test]
fn a_clock_that_jumps_is_found_and_the_episode_can_be_left_out() {
    let scratch = scratch("units-clock");
    let file = scratch.0.join("jump.toml");
    std::fs::write(&file, "rate = 25").unwrap();
    // Its parquet tables are written by another tool, see make.py.
    let set = Path::new(env!("CARGO_MANIFEST_DIR")).join("../demosift/tests/formats/lerobot_jump");
    let set = set.display();
    let shown = scratch.run(&format!("inspect {set} --task rod"));
    let words = String::from_utf8(shown.stdout).unwrap().split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(words.contains("the timestamps of 1 of 3 episodes jump: in episode 1 3.0"), "{words}");
    assert!(words.contains("--without 1"), "{words}");
    for options in ["--without 1".to_owned(), format!("--set-file {}", file.display())] {
        let shown = scratch.succeed(&format!("inspect {set} --task rod {options}"));
        assert!(!shown.contains("the timestamps"), "{shown}");
    }
}

#[test]
fn a_mistake_in_a_set_file_is_named_with_what_would_be_right() {
    let scratch = two_sets("units-mistakes");
    for (text, wanted) in [
        (
            "actions.unit = 'controls'",
            "unknown key `unit`, expected one of `order`, `sign`, `scale`, `offset`, `units`",
        ),
        ("actions.units = 'deg'", "there is no unit 'deg'; there are: task, controls, degrees"),
        ("actions.sign = [1, -1]", "actions: sign has 2 numbers; wanted 1, one for each"),
        ("observations.units = { percent = '0-1' }", "number 1 is a share of the range of a joint"),
    ] {
        mend(&scratch, "rad", text);
        let said = complaint(&scratch, &format!("sift rad {SIFT} --dry-run"));
        assert!(said.contains(wanted) && said.contains("rad/set.toml"), "{text}: {said}");
    }
    let said = complaint(&scratch, "inspect rad --set-file nowhere.toml");
    assert!(said.contains("cannot read the set file"), "{said}");
}
