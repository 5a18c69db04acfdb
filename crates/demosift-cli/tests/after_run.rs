//! What can be asked of a run that is finished: another number to keep, more final policies, what it passes on.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::{Duration, SystemTime};

use crate::support::{Scratch, assert_same_files, rewritten, write_set};
use demosift::basics::seed::Seed;
use demosift::world::point_mass;
use serde_json::Value;

/// Without a race, which would give further repeats to those near the cut.
const JOB: &str =
    "set --task point_mass --config tiny.toml --judge cloning --set cloning_judge.judging.most_repeats=0";

type Files = BTreeMap<String, Vec<u8>>;

fn json(files: &Files, name: &str) -> Value {
    serde_json::from_slice(&files[name]).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Those files that another run has too are the same there.
#[track_caller]
fn assert_holds(files: &Files, held: &Files, but: &[&str]) {
    for (name, bytes) in held.iter().filter(|(name, _)| !but.contains(&name.as_str())) {
        assert!(files.get(name).is_some_and(|found| found == bytes), "{name} differs");
    }
}

/// What grows.
const GROWS: [&str; 3] = ["metrics.jsonl", "measured.json", "events.out.tfevents.demosift"];

/// Where the judge of the paper is asked about a part of the set, everything says so and shows the rest without it.
#[test]
fn a_judge_of_those_near_the_cut_is_shown_as_one() {
    let scratch = Scratch::new("near-cut");
    let near = "Of the 4 demonstrations the judge of the paper judged the 2 nearest to the cut";
    let asked = "set --task point_mass --config tiny.toml --keep 1 --set near_cut=2";
    let foreseen = scratch.succeed(&format!("sift {asked} --out run --dry-run"));
    assert!(
        unwrapped(&foreseen).contains("judges the 2 nearest to the cut of the judge by cloning"),
        "{foreseen}"
    );
    let said = scratch.succeed(&format!("sift {asked} --out run"));
    assert!(unwrapped(&said).contains(near), "{said}");
    let unseen = said.lines().filter(|line| line.trim_end().ends_with('-') && line.contains('[')).count();
    assert_eq!(unseen, 2, "{said}");

    let judged: Value = serde_json::from_str(&scratch.succeed("judge --out run --resume --json")).unwrap();
    let of_paper = judged["judges"].as_array().unwrap().iter().find(|one| one["judge"] == "paper").unwrap();
    assert_eq!(of_paper["scores"]["suitabilities"].as_array().unwrap().len(), 2);
    assert_eq!(of_paper["best"]["k"], 1, "of two that stand on both sides of the cut one is above");

    let report: Value = serde_json::from_str(&scratch.succeed("report run --json")).unwrap();
    let entries = report["report"]["entries"].as_array().unwrap();
    let by_paper: Vec<bool> = entries.iter().map(|entry| !entry["by_judge"][1].is_null()).collect();
    assert_eq!(by_paper, [true, true, false, false], "the first is kept");

    // Another cut needs no more of it.
    let again = scratch.succeed("sift --out run --resume --keep 2");
    assert!(unwrapped(&again).contains(near), "{again}");

    let new = scratch.succeed("judge set --prior run --episodes 0,3 --out new");
    assert!(new.contains("of 3") && new.contains("of 5"), "beside the two and the four of before: {new}");
}

/// Without the ends of lines.
fn unwrapped(said: &str) -> String {
    said.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// What a run is computed with stands in its files, and portable arithmetic is part of the run.
#[test]
fn portable_arithmetic_is_kept_to_and_told() {
    let scratch = Scratch::new("portable");
    let asked = "set --task point_mass --config tiny.toml --portable";
    scratch.succeed(&format!("sift {asked} --out one --threads 1"));
    scratch.succeed(&format!("judge {asked} --out two --threads 2"));
    scratch.succeed("sift --out two --resume --threads 2");
    let (one, two) = (scratch.files("one"), scratch.files("two"));
    assert_holds(&two, &one, &[GROWS[0], GROWS[1], GROWS[2], "report.html"]);
    let resolved = String::from_utf8(one["resolved.toml"].clone()).unwrap();
    assert!(resolved.contains("portable = true"), "{resolved}");
    let spent: Vec<&String> = one.keys().filter(|name| name.starts_with("spent_")).collect();
    assert!(spent.len() >= 4, "{spent:?}");
    for name in spent {
        assert_eq!(json(&one, name)["arithmetic"], serde_json::json!(["portable"]), "{name}");
    }

    scratch.succeed("sift set --task point_mass --config tiny.toml --out native --referee none");
    let native = json(&scratch.files("native"), "spent_judge_paper.json")["arithmetic"].clone();
    let of_processor = ["x86-64-v4", "x86-64-v3", "x86-64", "other"].map(|name| serde_json::json!([name]));
    assert!(of_processor.contains(&native), "{native}");
    scratch.refuse("sift --out native --resume --portable", &["portable was false there, and is true now"]);
}

/// A run that processors of two kinds worked on says so.
#[test]
fn unlike_arithmetic_is_told() {
    let scratch = Scratch::new("unlike");
    scratch.succeed("judge set --task point_mass --config tiny.toml --judge cloning --out run");
    let path = scratch.0.join("run/spent_judge_cloning.json");
    let mut other = "x86-64-v3";
    rewritten(&path, |spent| {
        let arithmetic = spent["arithmetic"].as_array_mut().unwrap();
        if arithmetic[0] == other {
            other = "x86-64-v4";
        }
        arithmetic.push(other.into());
    });
    let said = unwrapped(&scratch.succeed("judge --out run --resume"));
    assert!(said.contains("computed by unlike processors") && said.contains(other), "{said}");
}

#[test]
fn another_keep_judges_nothing_again_and_says_what_a_new_run_would() {
    let scratch = Scratch::new("keep-again");
    scratch.succeed(&format!("sift {JOB} --keep 1 --out run"));
    scratch.succeed(&format!("sift {JOB} --keep 2 --out fresh"));
    let (first, fresh) = (scratch.files("run"), scratch.files("fresh"));

    let said = scratch.succeed("sift --out run --resume --keep 2");
    assert!(said.contains("2 kept"), "{said}");
    let second = scratch.files("run");
    assert_holds(
        &second,
        &first,
        &[
            "subset.json",
            "verdict.json",
            "panel.json",
            "spent_referee.json",
            "resolved.toml",
            "policy_best.safetensors",
            "policy_best.onnx",
            "report.html",
            GROWS[0],
            GROWS[1],
            GROWS[2],
        ],
    );
    for name in ["subset.json", "verdict.json", "report.html", "policy_best.onnx"] {
        let (stem, ending) = name.split_once('.').unwrap();
        assert_eq!(second[&format!("{stem}_keep_1.{ending}")], first[name], "{name}");
    }
    // What a run with this keep from the start says; only the names of what was trained on tell the two apart.
    for name in ["subset.json", "panel.json", "policy_best.safetensors", "spent_referee.json"] {
        assert!(second[name] == fresh[name], "{name} differs");
    }
    let (again, anew) = (json(&second, "verdict.json"), json(&fresh, "verdict.json"));
    assert_eq!((&again["pairs"], &again["sentence"]), (&anew["pairs"], &anew["sentence"]));
    assert_eq!(
        second["policy_referee_kept_keep_2_cloning_0.safetensors"],
        fresh["policy_referee_kept_cloning_0.safetensors"]
    );
    let resolved = String::from_utf8(second["resolved.toml"].clone()).unwrap();
    assert!(resolved.contains("keep = \"2\"") && resolved.contains("judged_for = \"1\""), "{resolved}");

    // There and back.
    scratch.succeed("sift --out run --resume --keep 1");
    let third = scratch.files("run");
    assert_holds(&third, &first, &GROWS);
    let appended = [GROWS[0], GROWS[2]];
    assert!(appended.iter().all(|name| third[*name].starts_with(&first[*name])));
    assert_eq!(third["metrics.jsonl"], second["metrics.jsonl"], "nothing is trained twice");
}

#[test]
fn what_was_asked_for_stays_asked_for_and_other_values_stay_fixed() {
    let scratch = Scratch::new("keep-stays");
    scratch.succeed(&format!("select {JOB} --keep 1 --out run"));
    let said = scratch.succeed("select --out run --resume --keep auto --json");
    let before = scratch.files("run");
    // A preset says nothing of what is kept, and the command that is typed again need not either.
    assert_eq!(scratch.succeed(&format!("select {JOB} --preset standard --out run --resume --json")), said);
    assert_same_files(&before, &scratch.files("run"));
    let output = scratch.run("select --out run --resume --keep 2 --set judge.repeats=7");
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("judge.repeats was 2 there, and is 7 now"), "{said}");
    assert_same_files(&before, &scratch.files("run"));
    let output = scratch.run("select --out run --resume --keep 5");
    assert!(String::from_utf8(output.stderr).unwrap().contains("from 1 to the 4"));
    assert_same_files(&before, &scratch.files("run"));
    // Before anything is judged there is nothing to remember.
    scratch.succeed("meta-train set --task point_mass --config tiny.toml --keep 1 --out begun");
    scratch.succeed("select --out begun --resume --keep 2");
    let resolved = String::from_utf8(scratch.files("begun")["resolved.toml"].clone()).unwrap();
    assert!(resolved.contains("keep = \"2\"") && !resolved.contains("judged_for"), "{resolved}");
}

/// A kill between any two steps leaves some files set aside and others not.
#[test]
fn a_change_that_was_killed_goes_on_either_way() {
    let scratch = Scratch::new("keep-killed");
    scratch.succeed(&format!("sift {JOB} --keep 1 --out run"));
    let first = scratch.files("run");
    scratch.succeed("select --out run --resume --keep 2");
    let second = scratch.files("run");
    let aside: Vec<&String> = second.keys().filter(|name| name.contains("_keep_1.")).collect();
    assert_eq!(aside.len(), 6, "{aside:?}");
    let run = scratch.0.join("run");
    for moved in 0..=aside.len() {
        let restore = || {
            fs::remove_dir_all(&run).unwrap();
            fs::create_dir(&run).unwrap();
            first.iter().for_each(|(name, bytes)| fs::write(run.join(name), bytes).unwrap());
            for name in &aside[..moved] {
                fs::rename(run.join(name.replace("_keep_1.", ".")), run.join(name)).unwrap();
            }
        };
        restore();
        scratch.succeed("select --out run --resume");
        assert_same_files(&first, &scratch.files("run"));
        restore();
        scratch.succeed("select --out run --resume --keep 2");
        assert_same_files(&second, &scratch.files("run"));
    }
}

#[test]
fn more_trainings_go_on_from_those_that_are_there() {
    let scratch = Scratch::new("referee-again");
    scratch.succeed(&format!("sift {JOB} --referee cloning=3 --out run"));
    let first = scratch.files("run");
    scratch.succeed("referee --out run --resume --referee cloning=4,gail=1");
    let second = scratch.files("run");
    assert_holds(
        &second,
        &first,
        &[
            "verdict.json",
            "spent_referee.json",
            "resolved.toml",
            "policy_best.safetensors",
            "policy_best.onnx",
            GROWS[0],
            GROWS[1],
            GROWS[2],
        ],
    );
    scratch.succeed(&format!("sift {JOB} --referee cloning=4,gail=1 --out fresh"));
    let fresh = scratch.files("fresh");
    for name in
        ["verdict.json", "resolved.toml", "policy_best.safetensors", "policy_best.onnx", "spent_referee.json"]
    {
        assert!(second[name] == fresh[name], "{name} differs");
    }
    // Fewer are asked of those that are there.
    scratch.succeed("referee --out run --resume --referee cloning=3");
    let third = scratch.files("run");
    assert_eq!(third["verdict.json"], first["verdict.json"]);
    assert_eq!(third["metrics.jsonl"], second["metrics.jsonl"]);
}

#[test]
fn one_training_of_each_keep_has_files_of_its_own() {
    let scratch = Scratch::new("imitate-again");
    scratch.succeed(&format!("imitate {JOB} --keep 1 --out run"));
    let first = scratch.files("run");
    scratch.succeed("imitate --out run --resume --keep 2");
    let second = scratch.files("run");
    for name in ["learning_curve_subset.json", "policy_subset.onnx", "policy_all.onnx"] {
        assert_eq!(second[name], first[name], "{name}");
    }
    assert_eq!(
        json(&second, "learning_curve_subset_keep_2.json")["demos"],
        json(&second, "subset.json")["demos"]
            .as_array()
            .map(|demos| {
                let mut demos = demos.clone();
                demos.sort_by_key(Value::as_u64);
                Value::from(demos)
            })
            .unwrap()
    );
    let costs = scratch.succeed("select --out run --resume");
    assert!(costs.contains("from scratch, the kept") && !costs.contains("subset"), "{costs}");
}

/// When each file and the folder were written last.
fn times(folder: &Path) -> BTreeMap<String, SystemTime> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let time = |path: &Path| fs::metadata(path).unwrap().modified().unwrap();
    entries.chain([folder.to_owned()]).map(|path| (path.display().to_string(), time(&path))).collect()
}

#[test]
fn a_finished_run_is_read_where_nothing_may_be_written() {
    let scratch = Scratch::new("read-only");
    scratch.succeed(&format!("sift {JOB} --keep 1 --out run"));
    scratch.succeed("imitate --out run --resume");
    scratch.succeed("report run");
    let run = scratch.0.join("run");
    let long_ago = SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000_000);
    for path in times(&run).keys() {
        fs::File::open(path).unwrap().set_modified(long_ago).unwrap();
    }
    let before = scratch.files("run");
    let commands = [
        "select --out run --resume --json",
        "judge --out run --resume",
        "referee --out run --resume --json",
        "sift --out run --resume",
        "imitate --out run --resume --json",
        "report run",
        "export run --as csv",
        "export run --as json",
        "select --out run --resume --keep 2 --dry-run",
        "sift --out run --resume --keep 2 --dry-run",
    ];
    for command in commands {
        scratch.succeed(command);
        assert!(times(&run).values().all(|time| *time == long_ago), "{command} wrote something");
    }
    assert_same_files(&before, &scratch.files("run"));

    let dry = scratch.run("select --out run --resume --keep 2 --dry-run --json");
    let dry: Value = serde_json::from_slice(&dry.stdout).unwrap();
    assert_eq!(dry["kept"].as_array().unwrap().len(), 2, "{dry}");

    let mut permissions = fs::metadata(&run).unwrap().permissions();
    permissions.set_readonly(true);
    fs::set_permissions(&run, permissions.clone()).unwrap();
    let output = scratch.run("select --out run --resume --keep 2");
    let is_root = fs::write(run.join("probe"), "").is_ok();
    #[allow(clippy::permissions_set_readonly_false, reason = "of a folder that is removed")]
    permissions.set_readonly(false);
    fs::set_permissions(&run, permissions).unwrap();
    if is_root {
        eprintln!("skipped: to root nothing is read-only");
        return;
    }
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("cannot") && said.contains("--dry-run"), "{said}");
    assert_same_files(&before, &scratch.files("run"));
}

/// Their numbers are too long for the name of a file.
#[test]
fn many_demonstrations_that_are_named_are_imitated_and_known_again() {
    let scratch = Scratch::new("many-named");
    let angles: Vec<f32> = (0..72).map(|demonstration| 5.0 * demonstration as f32).collect();
    let set = point_mass::planted_set(&angles, Seed::new(3)).unwrap();
    write_set(&scratch.0.join("many.hdf5"), &set);
    let numbers = (0..70).map(|id| id.to_string()).collect::<Vec<_>>().join(",");
    let imitate = format!("--demonstration-ids {numbers} --out run");
    scratch.succeed(&format!("imitate many.hdf5 --task point_mass --config tiny.toml {imitate}"));
    let whole = scratch.files("run");
    let name = whole.keys().find(|name| name.starts_with("learning_curve_demonstrations_70_of_")).unwrap();
    assert_eq!(json(&whole, name)["demos"].as_array().unwrap().len(), 70);
    scratch.succeed(&format!("imitate {imitate} --resume"));
    assert_same_files(&whole, &scratch.files("run"));
    let export = |ids: &str, out: &str| {
        let output = scratch.run(&format!("export run --as minari --out {out} --demonstration-ids {ids}"));
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    let said = export("0,1", "two");
    assert!(said.contains(&format!("--demonstration-ids {numbers} hands these on")), "{said}");
    assert!(!export(&numbers, "same").contains("were also trained"));
}

#[test]
fn an_export_says_whose_choice_it_hands_on() {
    let scratch = Scratch::new("export-says");
    scratch.succeed(&format!("select {JOB} --keep 1 --out run"));
    let export = |arguments: &str| {
        let output = scratch.run(&format!("export run --as csv {arguments}"));
        assert!(output.status.success());
        let table = String::from_utf8(output.stdout).unwrap();
        let mut kept: Vec<usize> = table
            .lines()
            .filter(|line| line.contains(",true,"))
            .map(|line| line.split(',').next().unwrap().parse().unwrap())
            .collect();
        kept.sort_unstable();
        (kept, String::from_utf8(output.stderr).unwrap())
    };
    let (kept, said) = export("");
    assert_eq!(kept.len(), 1);
    assert!(said.contains("1 of 4 demonstrations, as the ranking keeps them (keep = 1)"), "{said}");

    scratch.succeed("imitate --out run --resume --demonstration-ids 2,0");
    let (same, said) = export("");
    assert_eq!(same, kept);
    assert!(said.contains("(0,2); --demonstration-ids 0,2 hands these on"), "{said}");
    let (named, said) = export("--demonstration-ids 0,2");
    assert_eq!(named, [0, 2]);
    assert!(said.contains("as you name them: 0, 2") && !said.contains("were also trained"), "{said}");
    let output = scratch.run("export run --as csv --demonstration-ids 4");
    assert_eq!(output.status.code(), Some(2));
    assert!(
        String::from_utf8(output.stderr)
            .unwrap()
            .contains("--demonstration-ids 4: the demonstrations of this set are")
    );

    scratch.succeed("referee --out run --resume");
    let recommended = json(&scratch.files("run"), "verdict.json");
    let (_, said) = export("");
    assert!(said.contains("as the referee recommends"), "{said} {recommended}");
    // What was kept last, and not what a referee said of something else.
    scratch.succeed("select --out run --resume --keep 2");
    let (kept, said) = export("");
    assert_eq!(kept.len(), 2);
    assert!(said.contains("as the ranking keeps them (keep = 2)"), "{said}");
    scratch.succeed("select --out run --resume --keep 1");
    assert!(export("").1.contains("as the referee recommends"));
}
