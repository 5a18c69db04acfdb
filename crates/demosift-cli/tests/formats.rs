//! Every command takes every format, and what a run kept goes back to the tool that its demonstrations came from.

#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod support;

use std::fs;

use demosift::data::demonstration::episode::{Columns, Format, Source};
use demosift::data::demonstration::open;
use demosift::data::demonstration::{self, d4rl};
use hdf5_pure::FileBuilder;
use serde_json::Value;
use support::{RECORD, Scratch, in_repository};

fn read(scratch: &Scratch, path: &str) -> Source {
    open::open(&scratch.0.join(path), None, &Columns::default()).unwrap()
}

/// The command fails with one error that says all of `wanted`, and says nothing else.
#[track_caller]
fn refuses(scratch: &Scratch, arguments: &str, wanted: &[&str]) {
    let output = scratch.run(arguments);
    let complaint = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments}: {complaint}");
    assert!(output.stdout.is_empty() && complaint.starts_with("error: "), "{complaint}");
    for part in wanted {
        assert!(complaint.contains(part), "{complaint} does not say '{part}'");
    }
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
        "1 steps after the last complete episode",
        "not finite at 1 steps",
        "constant",
        "outside [-1, 1] at 1 steps",
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
fn states_survive_a_conversion() {
    let scratch = Scratch::new("states");
    let set = in_repository("data/free_throw_8");
    scratch.succeed(&format!("convert {} --to lerobot --task free_throw lerobot", set.display()));
    let (old, new) = (set.join("demonstrations.hdf5"), scratch.0.join("lerobot"));
    assert_eq!(demonstration::open::read_states(&new, None).unwrap(), d4rl::read_states(&old).unwrap());
    assert_eq!(read(&scratch, "lerobot").set().unwrap(), d4rl::read(&old).unwrap());
}

#[test]
fn a_recording_is_no_run_to_hand_on() {
    let scratch = Scratch::new("recording");
    scratch.succeed(&format!("{RECORD} --out recorded"));
    refuses(&scratch, "export recorded --as csv", &["has no demonstrations", "recorded"]);
}
