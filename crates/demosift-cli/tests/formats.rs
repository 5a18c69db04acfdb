//! Every command takes every format, and what a run kept goes back to the tool that its demonstrations came from.

use std::fs;

use crate::support::{RECORD, Scratch, in_repository};
use demosift::data::demonstration::episode::{Columns, Format, Source};
use demosift::data::demonstration::open;
use demosift::data::demonstration::{self, d4rl};
use hdf5_pure::FileBuilder;
use serde_json::Value;

fn read(scratch: &Scratch, path: &str) -> Source {
    open::open(&scratch.0.join(path), None, &Columns::default()).unwrap()
}

/// The command fails with one error that says all of `wanted`, and says nothing else.
#[track_caller]
fn refuses(scratch: &Scratch, arguments: &str, wanted: &[&str]) {
    scratch.refuse(arguments, wanted);
}

/// The set of the scratch folder as robomimic would store it, its observation split over two columns.
fn write_robomimic(scratch: &Scratch) {
    let set = d4rl::read(&scratch.0.join("set/demonstrations.hdf5")).unwrap();
    let mut file = FileBuilder::new();
    let mut data = file.create_group("data");
    for (id, demonstration) in set.iter() {
        let mut group = data.create_group(&format!("demo_{id}"));
        let steps = demonstration.steps() as u64;
        group.create_dataset("actions").with_f32_data(demonstration.actions().flat()).with_shape(&[steps, 2]);
        let mut observations = group.create_group("obs");
        for (name, columns) in [("velocity", 2..4), ("position", 0..2)] {
            let rows = demonstration.observations().iter();
            let part: Vec<f32> = rows.flat_map(|row| row[columns.clone()].to_vec()).collect();
            observations.create_dataset(name).with_f32_data(&part).with_shape(&[steps, 2]);
        }
        group.add_group(observations.finish());
        data.add_group(group.finish());
    }
    file.add_group(data.finish());
    file.write(scratch.0.join("set.robomimic.hdf5")).unwrap();
}

#[test]
fn the_same_demonstrations_give_the_same_scores_in_every_format() {
    let scratch = Scratch::new("same");
    scratch.succeed("convert set --to lerobot --task point_mass lerobot");
    write_robomimic(&scratch);
    let tail = "--task point_mass --config tiny.toml --threads 1";
    scratch.succeed(&format!("judge set {tail} --out a"));
    scratch.succeed(&format!("judge lerobot {tail} --out b"));
    let columns = "--observation-columns obs/position,obs/velocity --format robomimic";
    scratch.succeed(&format!("judge set.robomimic.hdf5 {columns} {tail} --out c"));
    let scores = |folder: &str| fs::read(scratch.0.join(folder).join("scores_paper.json")).unwrap();
    assert_eq!(scores("a"), scores("b"));
    assert_eq!(scores("a"), scores("c"));

    // A run that goes on knows how its demonstrations were read, and does not take others for them.
    scratch.succeed("select --resume --out c --threads 1");
    let other = "select --resume --out c --observation-columns obs/velocity,obs/position --format robomimic";
    refuses(&scratch, other, &["the columns of the demonstrations", "obs/position,obs/velocity"]);
}

#[test]
fn a_set_that_is_a_folder_gets_the_whole_job() {
    let scratch = Scratch::new("folder");
    scratch.succeed("convert set --to lerobot --fps 10 lerobot");
    let said = scratch.succeed("sift lerobot --task point_mass --config tiny.toml --threads 1 --out run");
    assert!(said.contains("Report: run/report.html"), "{said}");
    let run: Value = serde_json::from_slice(&scratch.files("run")["run.json"]).unwrap();
    let page = String::from_utf8(scratch.files("run")["report.html"].clone()).unwrap();
    assert!(page.contains(run["data"]["sha256"].as_str().unwrap()));
}

#[test]
fn what_is_kept_goes_back_to_where_it_came_from() {
    let scratch = Scratch::new("back");
    scratch.succeed("convert set --to lerobot --fps 10 lerobot");
    scratch.succeed("convert set --to minari minari");
    write_robomimic(&scratch);
    let tail = "--task point_mass --config tiny.toml --threads 1 --keep 2";
    for (set, run) in [("lerobot", "l"), ("minari", "m"), ("set.robomimic.hdf5", "r")] {
        scratch.succeed(&format!("select {set} {tail} --out {run}"));
    }
    let list: Vec<usize> = serde_json::from_str(&scratch.succeed("export l --as lerobot-episodes")).unwrap();
    assert_eq!(list.len(), 2);

    scratch.succeed("export l --as lerobot --out kept_lerobot");
    let (whole, kept) = (read(&scratch, "lerobot"), read(&scratch, "kept_lerobot"));
    for (episode, &id) in kept.episodes.iter().zip(&list) {
        assert_eq!(episode.actions, whole.episodes[id].actions);
    }
    scratch.succeed("export m --as minari --out kept_minari");
    let kept = read(&scratch, "kept_minari");
    assert_eq!((kept.format, kept.episodes.len()), (Format::MinariHdf5, 2));

    let file = scratch.0.join("set.robomimic.hdf5");
    let before = fs::read(&file).unwrap();
    refuses(&scratch, "export r --as robomimic-filter-key", &["itself", "--edit-my-file"]);
    assert_eq!(fs::read(&file).unwrap(), before, "nothing is edited that was not asked for");
    scratch.succeed("export r --as robomimic-filter-key --edit-my-file --name good");
    let key = hdf5_pure::File::open(&file).unwrap().dataset("mask/good").unwrap().read_string().unwrap();
    assert_eq!(key.len(), 2);
    refuses(&scratch, "export r --as robomimic-filter-key --edit-my-file --name good", &["'good' already"]);
    refuses(&scratch, "export m --as lerobot-episodes", &["stored as minari-hdf5", "--as lerobot --out"]);
    refuses(&scratch, "export l --as minari", &["a folder", "--out FOLDER"]);
    for (nothing, command) in [
        ("--edit-my-file", "export l --as lerobot --out again"),
        ("--name good", "export l --as csv"),
        ("--fps 5", "export m --as minari --out again"),
        ("--out again", "export r --as robomimic-filter-key --edit-my-file"),
        ("--demonstration-ids 1", "export r --as onnx --out again"),
        ("--data set", "export r --as onnx --out again"),
        ("--fps 5", "convert set again --to minari"),
        ("--task point_mass", "convert set again --to minari"),
    ] {
        let option = nothing.split(' ').next().unwrap();
        refuses(
            &scratch,
            &format!("{command} {nothing}"),
            &[&format!("{option} changes nothing of"), "leave it away"],
        );
    }
    assert!(!scratch.0.join("again").exists());

    fs::write(
        scratch.0.join("lerobot/data/chunk-000/file-000.parquet"),
        fs::read(scratch.0.join("kept_lerobot/data/chunk-000/file-000.parquet")).unwrap(),
    )
    .unwrap();
    refuses(&scratch, "export l --as csv", &["info.json says 4 episodes", "hold 2"]);
}

#[test]
fn scores_come_with_where_they_are_from() {
    let scratch = Scratch::new("scores");
    scratch
        .succeed("select set --task point_mass --config tiny.toml --threads 1 --keep 1 --seed 7 --out run");
    let all: Value = serde_json::from_str(&scratch.succeed("export run --as json")).unwrap();
    assert_eq!((&all["seed"], &all["task"]), (&Value::from(7), &Value::from("point_mass")));
    assert_eq!(all["demosift"], env!("CARGO_PKG_VERSION"));
    let set = in_scratch_sha256(&scratch, "set/demonstrations.hdf5");
    assert_eq!(all["data"]["sha256"], set.as_str());
    let rows = all["demonstrations"].as_array().unwrap();
    assert_eq!(rows.len(), 4);
    assert_eq!(rows.iter().filter(|row| row["kept"] == true).count(), 1);
    assert!(rows[0]["kept"] == true && rows[0]["rank"] == 1 && rows[0]["low"].is_f64());

    scratch.succeed("export run --as csv --out scores.csv");
    let table = fs::read_to_string(scratch.0.join("scores.csv")).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    assert!(
        lines[0].starts_with("# ") && lines[0].contains(&set) && lines[0].contains("seed 7"),
        "{}",
        lines[0]
    );
    assert_eq!(lines.len(), 2 + 4);
    assert!(lines.iter().skip(1).all(|line| line.split(',').count() == 12), "{table}");
    let first: Vec<&str> = lines[2].split(',').collect();
    assert_eq!(first[5].parse::<f64>().unwrap(), rows[0]["score"].as_f64().unwrap());

    let before = fs::read(scratch.0.join("run/run.json")).unwrap();
    refuses(&scratch, "export run --as json --out run/run.json", &["already", "new file"]);
    assert_eq!(fs::read(scratch.0.join("run/run.json")).unwrap(), before);

    fs::remove_file(scratch.0.join("run/subset.json")).unwrap();
    refuses(&scratch, "export run --as json", &["kept no demonstrations yet", "demosift select"]);
    refuses(&scratch, "export set --as json", &["not a run folder", "run.json"]);
}

fn in_scratch_sha256(scratch: &Scratch, path: &str) -> String {
    demosift::basics::files::sha256(&[scratch.0.join(path)]).unwrap()
}

#[test]
fn a_look_at_a_set_says_what_is_odd() {
    let scratch = Scratch::new("look");
    let seen = scratch.succeed("inspect set --task point_mass");
    for part in ["4 episodes", "stored as d4rl", "(4 numbers)", "fits the task 'point_mass'"] {
        assert!(seen.contains(part), "{seen} does not say '{part}'");
    }
    let mut file = FileBuilder::new();
    let observations = [0.0, 1.0, 0.5, 1.0, f64::NAN, 1.0, 0.25, 1.0];
    file.create_dataset("observations").with_f64_data(&observations).with_shape(&[4, 2]);
    file.create_dataset("actions").with_f64_data(&[0.5, -1.5, 0.0, 0.0]).with_shape(&[4, 1]);
    file.create_dataset("timeouts").with_u8_data(&[0, 1, 1, 0]);
    file.write(scratch.0.join("odd.hdf5")).unwrap();
    let seen = scratch.succeed("inspect odd.hdf5 --task point_mass");
    for part in [
        "1 step after the last complete episode was left out",
        "not finite at 1 step",
        "constant",
        "outside [-1, 1] at 1 step",
        "Nobody can learn from this set: episode 1: observation 0 at step 0 is NaN",
        "It does not fit the task",
    ] {
        assert!(seen.contains(part), "{seen} does not say '{part}'");
    }
    let seen: Value = serde_json::from_str(&scratch.succeed("inspect odd.hdf5 --json")).unwrap();
    assert_eq!(seen["learnable"], false);
    assert_eq!(seen["inspection"]["observations"][1]["least"], 1.0);
    refuses(&scratch, "inspect nowhere", &["does not exist", "nowhere"]);
    refuses(&scratch, "convert set --to lerobot out", &["rate", "--fps N"]);
    refuses(&scratch, "convert set --to minari set", &["already", "new folder"]);
    let output = scratch.run("inspect set --format hdf");
    let complaint = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(2) && complaint.contains("minari-parquet"), "{complaint}");
}

#[test]
fn a_rate_that_lerobot_has_no_place_for_is_told() {
    let scratch = Scratch::new("rate");
    let set = in_repository("crates/demosift/tests/formats/lerobot_ragged");
    let convert = format!("convert {} --to lerobot --skip-bad", set.display());
    let output = scratch.run(&format!("{convert} rounded"));
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && said.contains("has 12.5 steps a second, and 13 is written"), "{said}");
    let output = scratch.run(&format!("{convert} --fps 25 asked"));
    assert!(!String::from_utf8(output.stderr).unwrap().contains("12.5"));
}

/// They are for a column beside the ranking, and for replays.
#[test]
fn states_that_cannot_be_used_are_left_out_with_a_word() {
    let scratch = Scratch::new("no-states");
    let set = d4rl::read(&in_repository("data/free_throw_8").join("demonstrations.hdf5")).unwrap();
    let states = d4rl::read_states(&in_repository("data/free_throw_8").join("demonstrations.hdf5"));
    let states = states.unwrap().unwrap();
    let write = |name: &str, change: &dyn Fn(usize, &mut Vec<f64>)| {
        let mut changed = states.clone();
        changed.iter_mut().enumerate().for_each(|(at, log)| change(at, &mut log.qpos));
        let episodes = set.iter().zip(&changed).map(|((_, one), log)| d4rl::Episode {
            observations: one.observations(),
            actions: one.actions(),
            states: Some(d4rl::States { qpos: &log.qpos, qvel: &log.qvel }),
            terminated: false,
        });
        d4rl::write(&scratch.0.join(name), &episodes.collect::<Vec<_>>()).unwrap();
    };
    let steps = set.iter().next().unwrap().1.steps();
    let width = states[0].qpos.len() / steps;
    write("nan.hdf5", &|at, qpos| qpos[3 * width + 1] = if at == 1 { f64::NAN } else { qpos[3 * width + 1] });
    write("narrow.hdf5", &|_, qpos| qpos.truncate(steps * (width - 1)));
    let note = |arguments: &str| {
        let output = scratch.run(arguments);
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{arguments}: {said}");
        said
    };
    let left_out = "note: the recorded states are left out: episode ";
    for (name, wanted) in [("nan", "1: qpos[1] at step 3 is NaN"), ("narrow", "0: ")] {
        let said = note(&format!("inspect {name}.hdf5 --task free_throw"));
        assert!(said.contains(&format!("{left_out}{wanted}")) && said.contains(".hdf5"), "{said}");
    }
    let said = note("convert nan.hdf5 --to lerobot --task free_throw converted");
    assert!(said.contains(left_out), "{said}");
    assert_eq!(demonstration::open::read_states(&scratch.0.join("converted"), None).unwrap(), None);

    let mut file = FileBuilder::new();
    for (name, width) in [("observations", 4), ("actions", 2)] {
        file.create_dataset(name).with_f64_data(&vec![0.5; 4 * width]).with_shape(&[4, width as u64]);
    }
    file.create_dataset("timeouts").with_u8_data(&[0, 1, 0, 1]);
    let mut infos = file.create_group("infos");
    infos.create_dataset("qpos").with_f64_data(&[0.5; 8]).with_shape(&[4, 2]);
    file.add_group(infos.finish());
    file.write(scratch.0.join("half.hdf5")).unwrap();
    let said = note("inspect half.hdf5 --task point_mass");
    assert!(said.contains("holds 'infos/qpos' but no 'infos/qvel'") && said.contains("left out"), "{said}");
}

#[test]
fn states_survive_a_conversion() {
    let scratch = Scratch::new("states");
    let set = in_repository("data/free_throw_8");
    scratch.succeed(&format!("convert {} --to lerobot --task free_throw lerobot", set.display()));
    let (old, new) = (set.join("demonstrations.hdf5"), scratch.0.join("lerobot"));
    assert_eq!(demonstration::open::read_states(&new, None).unwrap(), d4rl::read_states(&old).unwrap());
    assert_eq!(read(&scratch, "lerobot").set().unwrap(), d4rl::read(&old).unwrap());
}

/// Minari wants an observation after the last action, so a set without one loses that action.
#[test]
fn steps_are_those_that_were_written() {
    let scratch = Scratch::new("steps");
    scratch.succeed("convert set --to lerobot --fps 10 lerobot");
    let written = |arguments: &str| {
        let answer: Value =
            serde_json::from_str(&scratch.succeed(&format!("convert {arguments} --json"))).unwrap();
        answer["steps"].as_u64().unwrap()
    };
    let all = written("set --to lerobot --fps 10 again");
    for (set, out) in [("set", "of_set"), ("lerobot", "of_lerobot")] {
        let steps = written(&format!("{set} --to minari {out}"));
        let metadata: Value =
            serde_json::from_slice(&scratch.files(&format!("{out}/data"))["metadata.json"]).unwrap();
        assert_eq!((steps, &metadata["total_steps"]), (all - 4, &Value::from(steps)));
    }
    assert_eq!(
        written("of_set --to minari once_more"),
        all - 4,
        "with an observation at its end it keeps all"
    );
    let said = scratch.succeed("convert set --to minari in_words");
    assert!(said.contains(&format!("4 episodes of {} steps in all", all - 4)), "{said}");
}

#[test]
fn sentences_that_are_not_known_are_told() {
    let scratch = Scratch::new("sentences");
    scratch.succeed("convert set --to lerobot --fps 10 lerobot");
    let list = scratch.0.join("lerobot/meta/episodes/chunk-000/file-000.parquet");
    fs::copy(in_repository("crates/demosift/tests/formats/lerobot_sentences.parquet"), &list).unwrap();
    let note = |out: &str| {
        let output = scratch.run(&format!("convert lerobot --to lerobot {out}"));
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    let said = note("again");
    assert!(
        said.contains("note: 2 episodes without a sentence") && said.contains("such as episode 2"),
        "{said}"
    );
    let tasks = fs::read(scratch.0.join("again/meta/tasks.parquet")).unwrap();
    assert!(tasks.windows(5).any(|bytes| bytes == b"grasp"), "the first of two sentences");
    fs::write(&list, "no parquet").unwrap();
    let said = note("without");
    assert!(said.contains("note: sentences of the episodes are not passed on, as meta/episodes/"), "{said}");
}

#[test]
fn a_recording_is_no_run_to_hand_on() {
    let scratch = Scratch::new("recording");
    scratch.succeed(&format!("{RECORD} --out recorded"));
    refuses(&scratch, "export recorded --as csv", &["has no demonstrations", "recorded"]);
}

/// Six episodes as robomimic would store them, three of them in a filter key, and what else such files hold.
fn write_odd_robomimic(scratch: &Scratch) {
    let mut file = FileBuilder::new();
    let mut data = file.create_group("data");
    for name in ["demo_0", "demo_1", "demo_2", "demo_3", "demo_5", "demo_7", "demo_8_retry", "episode_9"] {
        let steps = if name == "demo_7" { 1_u8 } else { 6 };
        let mut group = data.create_group(name);
        let number = |step: u8| f64::from(step) / 7.0 + name.len() as f64;
        let mut actions: Vec<f64> = (0..2 * steps).map(|place| f64::from(place) / 20.0).collect();
        if name == "demo_1" {
            actions[3] = f64::NAN;
        }
        let shape = |width: u64| [u64::from(steps), width];
        group.create_dataset("actions").with_f64_data(&actions).with_shape(&shape(2));
        let mut observations = group.create_group("obs");
        let flat: Vec<f64> = (0..4 * steps).map(number).collect();
        observations.create_dataset("state").with_f64_data(&flat).with_shape(&shape(4));
        let gripper: Vec<f64> = (0..steps).map(number).collect();
        observations.create_dataset("gripper").with_f64_data(&gripper);
        group.add_group(observations.finish());
        data.add_group(group.finish());
    }
    file.add_group(data.finish());
    file.write(scratch.0.join("odd.hdf5")).unwrap();
    let labels = ["demo_0", "demo_3", "demo_5"].map(str::to_owned);
    demosift::data::demonstration::robomimic::add_filter_key(&scratch.0.join("odd.hdf5"), "better", &labels)
        .unwrap();
}

#[test]
fn what_is_left_out_of_a_set_is_said() {
    let scratch = Scratch::new("said");
    write_odd_robomimic(&scratch);
    let seen = scratch.succeed("inspect odd.hdf5").replace('\n', " ");
    for part in [
        "2 groups that are not called demo_<number>, so not read: demo_8_retry, episode_9",
        "obs/gripper (one number a step)",
        "--observation-columns obs/state,obs/gripper",
        "episode demo_1: action 1 at step 1 is NaN",
        "--skip-bad",
        "1 step is too short",
    ] {
        assert!(seen.contains(part), "{seen} does not say '{part}'");
    }
    let seen: Value = serde_json::from_str(&scratch.succeed("inspect odd.hdf5 --skip-bad --json")).unwrap();
    assert_eq!(seen["learnable"], true);
    assert_eq!(seen["inspection"]["left_out"].as_array().unwrap().len(), 2);
    assert_eq!(seen["inspection"]["episodes"][1]["demonstration"], 2);
    assert!(seen["episodes_by_oddness"][0]["fast_power"].is_number());
    refuses(&scratch, "inspect odd.hdf5 --filter-key best", &["no filter key 'best'", "better"]);
    refuses(&scratch, "inspect odd.hdf5 --without 4", &["--without 4", "0, 1, 2, 3, 5, 7"]);
    refuses(&scratch, "inspect set --filter-key better", &["only a robomimic file has filter keys"]);
    let seen = scratch.succeed("inspect odd.hdf5 --filter-key better");
    assert!(seen.contains("3 episodes of 6 steps each"), "{seen}");
}

#[test]
fn a_run_on_some_episodes_calls_them_as_the_file_does() {
    let scratch = Scratch::new("some");
    write_robomimic(&scratch);
    let columns = "--observation-columns obs/position,obs/velocity";
    let tail = "--task point_mass --config tiny.toml --threads 1 --keep 2";
    scratch.succeed(&format!("select set.robomimic.hdf5 {columns} --without 1 {tail} --out run"));
    let all: Value = serde_json::from_str(&scratch.succeed("export run --as json")).unwrap();
    let mut shown: Vec<(u64, String)> = all["demonstrations"]
        .as_array()
        .unwrap()
        .iter()
        .map(|row| (row["demonstration"].as_u64().unwrap(), row["label"].as_str().unwrap().to_owned()))
        .collect();
    shown.sort();
    assert_eq!(shown, [(0, "demo_0"), (2, "demo_2"), (3, "demo_3")].map(|(id, name)| (id, name.to_owned())));
    // The choice is part of the run, which goes on with it and with no other.
    let again = scratch.succeed("select --resume --out run --threads 1");
    assert!(!again.contains("demonstration 1"), "{again}");
    refuses(
        &scratch,
        "select --resume --out run --without 2",
        &["the choice of episodes", "--without 1", "--without 2"],
    );
    scratch.succeed("export run --as robomimic-filter-key --edit-my-file --name good");
    let file = hdf5_pure::File::open(scratch.0.join("set.robomimic.hdf5")).unwrap();
    let key = file.dataset("mask/good").unwrap().read_string().unwrap();
    assert!(key.len() == 2 && !key.contains(&"demo_1".to_owned()), "{key:?}");
    refuses(
        &scratch,
        "imitate --resume --out run --demonstration-ids 1",
        &["demonstrations of this set are 0, 2, 3"],
    );
}

#[test]
fn what_a_set_of_lerobot_says_of_itself_is_handed_on() {
    let scratch = Scratch::new("handed");
    scratch.succeed("convert set --to lerobot --fps 10 lerobot");
    let info = scratch.0.join("lerobot/meta/info.json");
    let mut text: Value = serde_json::from_slice(&fs::read(&info).unwrap()).unwrap();
    text["robot_type"] = "arm".into();
    text["features"]["action"]["names"] = serde_json::json!(["east", "north"]);
    fs::write(&info, text.to_string()).unwrap();
    scratch.succeed("convert lerobot --to lerobot --without 2 again");
    let again: Value = serde_json::from_slice(&scratch.files("again/meta")["info.json"]).unwrap();
    assert_eq!((&again["fps"], &again["robot_type"]), (&Value::from(10), &Value::from("arm")));
    assert_eq!(again["features"]["action"]["names"], serde_json::json!(["east", "north"]));
    assert_eq!((&again["total_episodes"], &again["total_tasks"]), (&Value::from(3), &Value::from(1)));
    let tail = "--task point_mass --config tiny.toml --threads 1 --keep 1";
    scratch.succeed(&format!("select lerobot --without 0 {tail} --out run"));
    let output = scratch.run("export run --as lerobot-episodes");
    let (list, said) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    let kept: Vec<usize> = serde_json::from_str(&list).unwrap();
    assert!(kept.len() == 1 && kept[0] > 0, "{list}");
    let rest: Vec<String> = (0..4).filter(|id| !kept.contains(id)).map(|id| id.to_string()).collect();
    for part in [
        format!("--dataset.episodes=\"[{}]\"", kept[0]),
        "--policy.push_to_hub=false (act and diffusion want a camera".to_owned(),
        "--new_repo_id SET_kept ".to_owned(),
        format!("delete_episodes --operation.episode_indices \"[{}]\"", rest.join(",")),
    ] {
        assert!(said.contains(&part), "{said} does not say '{part}'");
    }
}
