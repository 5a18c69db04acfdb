//! A user's own trainer: `--trainer` from a set to a verdict, and what is said where something is wrong.
//!
//! Without a Python that has numpy (that of the tests of `--env`) these tests say that they were skipped.

use std::path::PathBuf;
use std::time::Duration;

use crate::support::{Scratch, write_set};
use demosift::basics::seed::Seed;
use demosift::data::demonstration::{Demonstration, DemonstrationSet};
use demosift::math::rows::Rows;
use demosift::world::point_mass;
use serde_json::Value;

/// The file of the trainers.
fn trainers() -> PathBuf {
    crate::python::environments().with_file_name("trainers.py")
}

/// Arguments that name a trainer of the test's file.
pub(crate) fn trainer(name: &str) -> Option<String> {
    let python = crate::python::interpreter()?;
    Some(format!("--trainer {}:{name} --python {}", trainers().display(), python.display()))
}

const HOW: &str = "set --task point_mass --judge cloning --config tiny.toml --seed 1";

fn verdict(scratch: &Scratch, folder: &str) -> Value {
    serde_json::from_slice(&scratch.files(folder)["verdict.json"]).unwrap()
}

/// The pairs of an imitator.
fn pairs<'a>(verdict: &'a Value, imitator: &str) -> Vec<&'a Value> {
    let all = verdict["pairs"].as_array().unwrap().iter();
    all.filter(|pair| pair["imitator"] == imitator).collect()
}

fn outcome(pair: &Value, training: usize) -> f64 {
    pair["trainings"][training]["outcome"]["score"].as_f64().unwrap()
}

#[test]
fn a_trainer_is_a_third_imitator_of_the_referee() {
    let Some(trainer) = trainer("least_squares") else { return };
    let scratch = Scratch::new("trainer");
    let shown = scratch.succeed(&format!("sift {HOW} {trainer} --referee cloning=3 --out run"));
    assert!(shown.contains("trainers.py:least_squares"), "{shown}");
    let found = verdict(&scratch, "run");
    assert_eq!(found["trainer"]["name"], "trainers.py:least_squares");
    assert_eq!(found["trainer"]["sha256"].as_str().unwrap().len(), 64);
    // As often as decides, where nobody says how often.
    assert_eq!(found["asked"]["trainer"], 3);
    let of_trainer = pairs(&found, "trainer");
    assert_eq!(of_trainer.len(), pairs(&found, "behavioral_cloning").len());
    assert!(of_trainer.iter().all(|pair| pair["trainings"].as_array().unwrap().len() == 3));
    assert!(scratch.files("run").contains_key("training_referee_all_trainer_2.json"));
    // What is true of this set: from what goes to the goal a linear map goes there, and from the whole set it does not.
    let of_side = |side: &str| {
        let candidate = found["candidates"].as_array().unwrap().iter().position(|one| one["side"] == side);
        let is_it = |pair: &&&Value| pair["candidate"].as_u64() == candidate.map(|index| index as u64);
        of_trainer.iter().find(is_it).map(|pair| pair["mean"].as_f64().unwrap()).unwrap()
    };
    assert!(of_side("kept") > of_side("whole"), "{found}");
    let page = String::from_utf8(scratch.files("run")["report.html"].clone()).unwrap();
    assert!(page.contains("trainers.py:least_squares"));

    // The run remembers its trainer, and asks it for nothing that it has done.
    let log = scratch.files(".")["trainings.log"].clone();
    let again = scratch.succeed("referee --resume --out run --json");
    let again: Value = serde_json::from_str(&again).unwrap();
    assert_eq!(again["verdict"]["pairs"], found["pairs"]);
    assert_eq!(scratch.files(".")["trainings.log"], log, "nothing was trained again");
    // What is asked besides is made now.
    scratch.succeed("referee --resume --out run --referee cloning=3,trainer=4");
    let found = verdict(&scratch, "run");
    let longest =
        pairs(&found, "trainer").into_iter().map(|pair| pair["trainings"].as_array().unwrap().len()).max();
    assert_eq!(longest, Some(4));
    // With the seeds of before: the first trainings stay what they were.
    let seeds = |text: &[u8]| -> Vec<String> {
        String::from_utf8(text.to_vec()).unwrap().lines().map(str::to_owned).collect()
    };
    let (before, after) = (seeds(&log), seeds(&scratch.files(".")["trainings.log"]));
    assert!(after.len() > before.len() && after[..before.len()] == before[..]);
    scratch.succeed("report run --json");
}

/// The policy of a training by cloning, played by a trainer in numpy, does what it did for us: on the same episodes.
#[test]
fn its_policy_plays_the_episodes_that_ours_play() {
    let Some(trainer) = trainer("as_demosift") else { return };
    let scratch = Scratch::new("trainer-same");
    scratch.succeed(&format!("sift {HOW} --referee cloning=3 --out ours"));
    let of_ours = verdict(&scratch, "ours");
    let policy = scratch.0.join("ours/policy_referee_all_cloning_0.safetensors");
    let mut command = scratch.command(&format!("sift {HOW} {trainer} --referee trainer=1 --out theirs"));
    let output = command.env("POLICY", policy).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let of_theirs = verdict(&scratch, "theirs");
    let is_whole = |verdict: &Value, pair: &Value| {
        verdict["candidates"][pair["candidate"].as_u64().unwrap() as usize]["side"] == "whole"
    };
    let whole = |verdict: &Value, imitator: &str| {
        pairs(verdict, imitator).into_iter().find(|pair| is_whole(verdict, pair)).cloned().unwrap()
    };
    let (ours, theirs) = (whole(&of_ours, "behavioral_cloning"), whole(&of_theirs, "trainer"));
    let (ours, theirs) = (outcome(&ours, 0), outcome(&theirs, 0));
    assert!((ours - theirs).abs() < 1e-4 * ours.abs(), "{ours} by us, and {theirs} by numpy");
}

#[test]
fn a_policy_with_a_history_is_told_when_an_episode_begins() {
    let Some(trainer) = trainer("with_history") else { return };
    let scratch = Scratch::new("trainer-history");
    scratch.succeed(&format!("sift {HOW} {trainer} --referee trainer=3 --out run"));
    // The same policy on the same episodes, whatever it was to learn from.
    let found = verdict(&scratch, "run");
    let all = pairs(&found, "trainer");
    for training in 0..3 {
        assert!(all.iter().all(|pair| outcome(pair, training) == outcome(all[0], training)), "{found}");
    }
    assert!(!scratch.files("run").contains_key("policy_best.safetensors"), "the policy lives in the trainer");
    let sentence = found["sentence"].as_str().unwrap();
    assert!(sentence.contains("by trainers.py:with_history"), "{sentence}");
}

#[test]
fn what_was_trained_before_a_failure_is_kept() {
    let Some(trainer) = trainer("fails_where_it_is_told_to") else { return };
    let scratch = Scratch::new("trainer-fails");
    let how = format!("{HOW} {trainer} --referee cloning=3 --threads 1");
    scratch.succeed(&format!("sift {how} --out whole"));
    let lines = |scratch: &Scratch| String::from_utf8(scratch.files(".")["trainings.log"].clone()).unwrap();
    let undisturbed = lines(&scratch);
    std::fs::remove_file(scratch.0.join("trainings.log")).unwrap();
    std::fs::write(scratch.0.join("fails"), "4").unwrap();
    let output = scratch.run(&format!("sift {how} --out begun"));
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    for words in [
        "the trainer trainers.py:fails_where_it_is_told_to failed in a training on",
        "RuntimeError: out of memory of my own (trainers.py, line",
        "--resume goes on",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    assert_eq!(lines(&scratch).lines().count(), 4);
    std::fs::remove_file(scratch.0.join("fails")).unwrap();
    scratch.succeed("sift --resume --out begun --threads 1");
    assert_eq!(lines(&scratch).lines().count(), undisturbed.lines().count(), "none was made twice");
    assert_eq!(scratch.files("whole")["verdict.json"], scratch.files("begun")["verdict.json"]);
}

#[test]
fn in_an_environment_of_python_it_sees_and_acts_in_the_unit_of_that() {
    let Some(trainer) = trainer("in_newtons") else { return };
    let scratch = Scratch::new("trainer-environment");
    let planted = point_mass::planted_set(&[180.0, 0.0, 90.0, 10.0], Seed::new(3)).unwrap();
    let enlarged = planted.iter().map(|(_, of)| {
        let actions = of.actions().flat().iter().map(|number| 2.0 * number).collect();
        Demonstration::new(of.observations().clone(), Rows::from_flat(actions, 2).unwrap()).unwrap()
    });
    write_set(
        &scratch.0.join("set/demonstrations.hdf5"),
        &DemonstrationSet::new(enlarged.collect()).unwrap(),
    );
    let env = format!("--env {}:limited", crate::python::environments().display());
    let how = "--judge cloning --config tiny.toml --referee trainer=3 --seed 1 --out run --json";
    let mut command = scratch.command(&format!("sift set {env} {trainer} {how}"));
    let output = command.args(["--heuristic", "negated last distance"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    // By hand: pushed with 2 m/s² for thirty steps of 0.1 s against a friction of 1/s the point is at
    // 0.1 Σ 2 (1 − 0.9ᵏ) = 4.276 m, and the goal at 1 m; with 1 m/s² it would be 1.138 m beyond.
    let found = verdict(&scratch, "run");
    let is_there = |pair: &&Value| (pair["mean"].as_f64().unwrap() + 3.276).abs() < 0.1;
    assert!(pairs(&found, "trainer").iter().all(is_there), "{found}");
}

#[test]
fn a_file_of_onnx_is_a_policy() {
    let Some(trainer) = trainer("of_onnx") else { return };
    let scratch = Scratch::new("trainer-onnx");
    scratch.succeed(&format!("sift {HOW} --referee cloning=3 --out ours"));
    let policy = scratch.0.join("ours/policy_best.onnx");
    let mut command = scratch.command(&format!("sift {HOW} {trainer} --referee trainer=3 --out theirs"));
    let output = command.env("POLICY", &policy).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    if said.contains("onnxruntime is not installed") {
        assert!(output.status.code() == Some(2) && said.contains("install onnxruntime there"), "{said}");
        eprintln!("skipped: there is no onnxruntime; `cargo xtask test` fetches it");
        return;
    }
    assert!(output.status.success(), "{said}");
    assert_eq!(scratch.files("theirs")["policy_best.onnx"], std::fs::read(policy).unwrap(), "is handed over");
}

#[test]
fn a_dry_run_counts_its_trainings_and_does_not_know_their_time() {
    let Some(trainer) = trainer("least_squares") else { return };
    let scratch = Scratch::new("trainer-dry");
    let shown = scratch.succeed(&format!("sift {HOW} {trainer} --referee cloning=3,trainer=3 --dry-run"));
    let shown = shown.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(shown.contains("trainings by your own trainer, whose time is not known"), "{shown}");
    let answer = scratch.succeed(&format!("sift {HOW} {trainer} --referee trainer=3 --dry-run --json"));
    let answer: Value = serde_json::from_str(&answer).unwrap();
    let stages = answer["stages"].as_array().unwrap();
    let referee = stages.iter().find(|stage| stage["stage"] == "referee").unwrap();
    let trainings = referee["by_trainer"].as_u64().unwrap();
    // Four episodes of thirty steps each.
    assert_eq!(referee["environment_steps"].as_u64().unwrap(), trainings * 120);
    assert!(!scratch.0.join("trainings.log").exists() && !scratch.0.join("runs").exists());
}

#[test]
fn mistakes_are_one_sentence_each() {
    let Some(python) = crate::python::interpreter() else { return };
    let scratch = Scratch::new("trainer-mistakes");
    // Judged once, so that each mistake of a training costs no more than it must.
    scratch.succeed(&format!("judge {HOW} --out run"));
    let asked = |name: &str, more: &str| {
        let trainer = format!("--trainer {}:{name} --python {}", trainers().display(), python.display());
        format!("referee --resume --out run {trainer} --referee trainer=3 {more}")
    };
    let python = format!("--python {}", python.display());
    for (arguments, code, wanted) in [
        (format!("sift {HOW} --trainer no_such.py:train"), 2, "cannot find the trainer's file"),
        (
            format!("sift {HOW} --trainer train"),
            2,
            "'train' is no trainer: what is before the colon is missing",
        ),
        (
            format!("sift {HOW} --trainer no_such_module:train {python}"),
            2,
            "cannot be imported: ModuleNotFoundError",
        ),
        (
            format!("sift {HOW} --referee trainer=3"),
            2,
            "asks for trainings by a trainer of yours, and there is none",
        ),
        (
            format!("sift {HOW} --trainer-timeout 5"),
            2,
            "--trainer-timeout is about a trainer, and none is given",
        ),
        (
            format!("sift {HOW} --trainer {}:raises --referee none", trainers().display()),
            2,
            "--referee none asks for none",
        ),
        (asked("no_such_function", ""), 2, "has no attribute 'no_such_function'"),
        (asked("three", ""), 2, "'three' is of type int, and a trainer is a function"),
        (asked("least_squares", "--trainer-timeout 0"), 2, "must be from 1 to"),
        (asked("least_squares", "--trainer-timeout 18446744073709551615"), 2, "must be from 1 to"),
        (asked("least_squares", "--time-limit 18446744073709551615"), 2, "must be from 1 to"),
        (asked("returns_nothing", ""), 2, "it returned None, which is no policy"),
        (asked("returns_a_number", ""), 2, "it returned an object of type int, which is no policy"),
        (asked("returns_no_file", ""), 2, "nowhere.onnx', which is no ONNX file"),
        (asked("raises", ""), 1, "ValueError: the loss is a fish (trainers.py, line"),
        (asked("not_finite", ""), 2, "its policy returned nan in the action at step 1"),
        (asked("too_long", ""), 2, "its policy returned 3 numbers at step 1, and an action has 2"),
        (asked("dies", ""), 1, "ended with exit code 7 during a training on"),
        (asked("dies", ""), 1, "its last words: out of luck"),
        (asked("acts_and_dies", ""), 1, "ended with exit code 7 during an action of its policy"),
        (asked("hangs", "--trainer-timeout 2"), 1, "within 2 s"),
        (asked("acts_slowly", "--time-limit 15"), 1, "did not finish an action of its policy within 15 s"),
    ] {
        let output = scratch.run(&arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments}: {said}");
        assert!(said.contains(wanted) && !said.contains("panicked"), "{arguments}: {said}");
        let errors = said.lines().filter(|line| line.starts_with("error: ")).count();
        assert_eq!(errors, 1, "{arguments}: {said}");
        assert!(!said.contains("the environment"), "it is about a trainer: {said}");
    }
    assert!(!scratch.0.join("runs").exists(), "nothing half-begun");
    // And with one that works the run goes on.
    scratch.succeed(&asked("least_squares", ""));
}

#[test]
fn a_trainer_that_is_changed_while_it_is_used_is_told() {
    let Some(python) = crate::python::interpreter() else { return };
    let scratch = Scratch::new("trainer-changed");
    // It changes itself, as somebody does who edits it meanwhile.
    let changes = "    open(__file__, 'a').write('# More.\\n')\n";
    let text =
        format!("def train(demonstrations, seed):\n{changes}    return lambda observation: [1.0, 0.0]\n");
    let file = scratch.0.join("mine.py");
    std::fs::write(&file, &text).unwrap();
    let trainer = format!("--trainer mine.py:train --python {} --referee trainer=3", python.display());
    let wanted = ["the file of the trainer mine.py:train was changed since the command began", "--resume"];
    scratch.refuse(&format!("sift {HOW} {trainer} --threads 1 --out run"), &wanted);
    std::fs::write(&file, text.replace(changes, "")).unwrap();
    scratch.succeed("sift --resume --out run --threads 1");
    let found = verdict(&scratch, "run");
    assert_eq!(found["trainer"]["name"], "mine.py:train");
}

/// A measurement is known by its name, and what another trainer did is another one.
#[test]
fn what_a_changed_trainer_does_is_measured_beside_what_it_did_before() {
    let Some(python) = crate::python::interpreter() else { return };
    let scratch = Scratch::new("trainer-measured");
    let file = scratch.0.join("mine.py");
    let write = |action: &str| {
        let text = format!("def train(demonstrations, seed):\n    return lambda observation: {action}\n");
        std::fs::write(&file, text).unwrap();
    };
    let measured = || -> Vec<Value> {
        let text = String::from_utf8(scratch.files("run")["metrics.jsonl"].clone()).unwrap();
        let rows = text.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
        let is_by_trainer = |row: &Value| row["part"].as_str().unwrap().contains("_trainer_");
        rows.filter(|row| row["stage"] == "referee" && is_by_trainer(row)).collect()
    };
    let scores = || -> Vec<f64> {
        let found = verdict(&scratch, "run");
        let pairs = pairs(&found, "trainer");
        pairs.iter().flat_map(|pair| (0..3).map(|training| outcome(pair, training))).collect()
    };
    write("[1.0, 0.0]");
    let trainer = format!("--trainer mine.py:train --python {}", python.display());
    scratch.succeed(&format!("sift {HOW} {trainer} --referee cloning=3,trainer=3 --out run"));
    let (before, first) = (measured(), scores());
    write("[0.0, -1.0]");
    scratch.succeed("sift --resume --out run");
    let (after, second) = (measured(), scores());
    assert!(first.iter().all(|score| !second.contains(score)), "{first:?} {second:?}");
    assert!(after.len() == 2 * before.len() && after[..before.len()] == before[..], "{before:?} {after:?}");
    for (rows, scores) in [(&before[..], &first), (&after[before.len()..], &second)] {
        let is_measured = |score: &f64| rows.iter().any(|row| row["score"].as_f64() == Some(*score));
        assert!(scores.iter().all(is_measured), "{scores:?} {rows:?}");
    }
    // The same trainer is asked for nothing, and measured no more.
    scratch.succeed("sift --resume --out run");
    assert_eq!(measured(), after);
}

#[test]
fn no_trainer_outlives_the_command() {
    let Some(trainer) = trainer("hangs") else { return };
    let scratch = Scratch::new("trainer-orphan");
    let arguments = format!("sift {HOW} {trainer} --referee trainer=3 --threads 1");
    let mut command = scratch.command(&arguments).stdout(std::process::Stdio::null()).spawn().unwrap();
    let file = scratch.0.join("worker.pid");
    let worker = loop {
        assert!(command.try_wait().unwrap().is_none(), "it hangs in its first training");
        match std::fs::read_to_string(&file) {
            Ok(worker) if !worker.is_empty() => break worker,
            _ => std::thread::sleep(Duration::from_millis(20)),
        }
    };
    // Not by a signal that could be told of.
    command.kill().unwrap();
    command.wait().unwrap();
    crate::support::wait_until_gone(&worker);
}
