//! A user's own trainer as a judge: `--judge trainer` from a set to a ranking, and what is said where something is wrong.
//!
//! Without a Python that has numpy (that of the tests of `--env`) these tests say that they were skipped.

use crate::support::Scratch;
use crate::trainer::trainer;
use serde_json::Value;

const HOW: &str =
    "set --task point_mass --judge trainer --config tiny.toml --set trainer_judge.evaluations=4 --seed 1";

fn json(scratch: &Scratch, folder: &str, name: &str) -> Value {
    serde_json::from_slice(&scratch.files(folder)[name]).unwrap()
}

/// The lines that trainings have left: how many demonstrations, and the seed.
fn trainings(scratch: &Scratch) -> Vec<String> {
    let log = scratch.files(".").remove("trainings.log").unwrap_or_default();
    String::from_utf8(log).unwrap().lines().map(str::to_owned).collect()
}

#[test]
fn a_trainer_judges_each_demonstration_by_itself() {
    let Some(trainer) = trainer("least_squares") else { return };
    let scratch = Scratch::new("trainer-judge");
    let shown = scratch.succeed(&format!("sift {HOW} {trainer} --referee none --keep 2 --out run"));
    assert!(shown.contains("judging by your own trainer"), "{shown}");
    let scores = json(&scratch, "run", "scores_trainer.json");
    assert_eq!(scores["trainer"]["name"], "trainers.py:least_squares");
    assert_eq!(scores["trainer"]["sha256"].as_str().unwrap().len(), 64);
    for of in scores["suitabilities"].as_array().unwrap() {
        assert_eq!((of["before"].as_array().unwrap().len(), of["after"].as_array().unwrap().len()), (3, 3));
        assert_eq!(of["after"][0].as_array().unwrap().len(), 4);
    }
    let panel = json(&scratch, "run", "panel.json");
    assert_eq!((&panel["decides"], &panel["opinions"][0]["judge"]), (&"trainer".into(), &"trainer".into()));
    // A linear map from what goes to the goal goes there.
    let mut kept = json(&scratch, "run", "subset.json")["demos"].as_array().unwrap().clone();
    kept.sort_unstable_by_key(Value::as_u64);
    assert_eq!(kept, [1, 3]);
    let made = trainings(&scratch);
    assert_eq!(made.len(), 4 * 3);
    assert!(made.iter().all(|line| line.starts_with("1 ")), "{made:?}");
    // Its policies are not kept, and the page says so.
    let files = scratch.files("run");
    assert!(
        !files.contains_key("adapted_trainer.safetensors")
            && !files.contains_key("checkpoint_judge_trainer.bin")
    );
    let page = String::from_utf8(files["report.html"].clone()).unwrap();
    assert!(
        page.contains("Policies of your own trainer are not kept")
            && page.contains("trainers.py:least_squares")
    );

    // What is judged is not judged again, and who only looks at it needs no trainer.
    let answer: Value = serde_json::from_str(&scratch.succeed("judge --resume --out run --json")).unwrap();
    assert_eq!(
        (&answer["decides"], &answer["judges"][0]["scores"]["trainer"]),
        (&"trainer".into(), &scores["trainer"])
    );
    scratch.succeed("select --resume --out run --keep 1 --json");
    scratch.succeed("sift --resume --out run --keep 2 --json");
    scratch.succeed("report run --json");
    assert_eq!(trainings(&scratch), made);
}

#[test]
fn the_referee_asks_the_trainer_that_has_judged() {
    let Some(trainer) = trainer("least_squares") else { return };
    let scratch = Scratch::new("trainer-judge-referee");
    scratch.succeed(&format!("sift {HOW} {trainer} --referee trainer=3 --out run --json"));
    let verdict = json(&scratch, "run", "verdict.json");
    assert_eq!(verdict["candidates"][0]["names"][0], "kept");
    assert!(verdict["sentence"].as_str().unwrap().contains("by trainers.py:least_squares"), "{verdict}");
}

#[test]
fn a_dry_run_counts_its_trainings() {
    let Some(trainer) = trainer("least_squares") else { return };
    let scratch = Scratch::new("trainer-judge-dry");
    let shown = scratch.succeed(&format!("judge {HOW} {trainer} --dry-run"));
    let words = shown.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(words.contains("12 trainings by your own trainer, whose time is not known"), "{shown}");
    let answer =
        scratch.succeed(&format!("sift {HOW} {trainer} --set trainer_judge.repeats=2 --dry-run --json"));
    let answer: Value = serde_json::from_str(&answer).unwrap();
    let judging = answer["stages"].as_array().unwrap().iter().find(|stage| stage["stage"] == "judge_trainer");
    // Two repeats of four demonstrations, and of the agent before.
    assert_eq!(judging.unwrap()["by_trainer"], 8);
    assert_eq!(judging.unwrap()["environment_steps"], 10 * 4 * 30);
    assert!(trainings(&scratch).is_empty() && !scratch.0.join("runs").exists());
}

#[test]
fn parts_find_together_what_one_process_finds() {
    let Some(trainer) = trainer("least_squares") else { return };
    let scratch = Scratch::new("trainer-judge-parts");
    scratch.succeed(&format!("judge {HOW} {trainer} --out undivided"));
    for part in ["1/2", "2/2"] {
        scratch.succeed(&format!("judge {HOW} {trainer} --out shared --part {part} --json"));
    }
    let made = trainings(&scratch);
    assert_eq!(made.len(), 24, "each once there and once in a part");
    scratch.succeed("judge --resume --out shared");
    assert_eq!(trainings(&scratch), made);
    let (whole, shared) = (scratch.files("undivided"), scratch.files("shared"));
    for name in ["scores_trainer.json", "panel.json", "spent_judge_trainer.json"] {
        assert!(whole[name] == shared[name], "{name}");
    }
}

#[test]
fn what_was_judged_before_a_failure_is_kept() {
    let Some(trainer) = trainer("fails_where_it_is_told_to") else { return };
    let scratch = Scratch::new("trainer-judge-fails");
    let how = format!("{HOW} {trainer} --referee none --threads 1");
    scratch.succeed(&format!("sift {how} --out whole"));
    let undisturbed = trainings(&scratch);
    std::fs::remove_file(scratch.0.join("trainings.log")).unwrap();
    std::fs::write(scratch.0.join("fails"), "2").unwrap();
    let output = scratch.run(&format!("sift {how} --out begun"));
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    for words in [
        "judging demonstration 2: the trainer trainers.py:fails_where_it_is_told_to failed in a training on demonstration 2",
        "RuntimeError: out of memory of my own (trainers.py, line",
        "--resume goes on",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    assert_eq!(said.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{said}");
    assert_eq!(trainings(&scratch).len(), 2);
    std::fs::remove_file(scratch.0.join("fails")).unwrap();
    scratch.succeed("sift --resume --out begun --threads 1");
    assert_eq!(trainings(&scratch), undisturbed, "none was made twice");
    for name in ["scores_trainer.json", "ranking.json"] {
        assert!(scratch.files("whole")[name] == scratch.files("begun")[name], "{name}");
    }
}

/// The trainer's file, in the scratch folder, so that it can change.
fn own_trainer(scratch: &Scratch, changed: &str) {
    let text = std::fs::read_to_string(crate::python::environments().with_file_name("trainers.py")).unwrap();
    std::fs::write(scratch.0.join("mine.py"), format!("{text}{changed}")).unwrap();
}

#[test]
fn a_trainer_that_has_changed_begins_anew_and_is_refused_where_all_is_judged() {
    let Some(python) = crate::python::interpreter() else { return };
    let scratch = Scratch::new("trainer-judge-changed");
    own_trainer(&scratch, "");
    std::fs::write(scratch.0.join("fails"), "2").unwrap();
    let trainer = format!("--trainer mine.py:fails_where_it_is_told_to --python {}", python.display());
    let output = scratch.run(&format!("judge {HOW} {trainer} --threads 1 --out run"));
    assert_eq!(output.status.code(), Some(1));
    std::fs::remove_file(scratch.0.join("fails")).unwrap();
    own_trainer(&scratch, "# mended\n");
    scratch.succeed("judge --resume --out run");
    assert_eq!(trainings(&scratch).len(), 2 + 12, "those of before say nothing of this one");

    own_trainer(&scratch, "# mended again\n");
    let before = scratch.files("run");
    let wanted = "were judged by the trainer mine.py:fails_where_it_is_told_to, and the trainer is that of a file which has changed now";
    scratch.refuse("sift --resume --out run --referee trainer=3", &[wanted, "--out OTHER_FOLDER"]);
    scratch.refuse("sift --resume --out run --referee trainer=3 --dry-run", &[wanted]);
    scratch.refuse(&format!("sift --resume --out run --referee none {trainer}"), &[wanted]);
    let other = trainer.replace("fails_where_it_is_told_to", "least_squares");
    scratch.refuse(
        &format!("judge --resume --out run {other}"),
        &["and the trainer is mine.py:least_squares now"],
    );
    assert!(scratch.files("run") == before, "nothing was touched");
    // Without it what was found can be looked at.
    std::fs::remove_file(scratch.0.join("mine.py")).unwrap();
    scratch.succeed("select --resume --out run --keep 1");
    scratch.succeed("report run --json");
}

#[test]
fn mistakes_are_one_sentence_each() {
    let scratch = Scratch::new("trainer-judge-mistakes");
    for command in ["sift", "judge", "select"] {
        scratch.refuse(
            &format!("{command} {HOW}"),
            &[
                "a trainer of yours is to judge (judges = trainer), and there is none",
                "add --trainer FILE.py:FUNCTION",
            ],
        );
    }
    assert!(!scratch.0.join("runs").exists(), "nothing half-begun");
    let Some(trainer) = trainer("least_squares") else { return };
    scratch.refuse(
        &format!("sift {HOW} {trainer} --set trainer_judge.repeats=0"),
        &["trainer_judge.repeats = 0"],
    );
    scratch.succeed("judge set --task point_mass --judge paper --config tiny.toml --out prior");
    scratch.refuse(
        &format!("judge set --judge trainer --prior prior {trainer} --out standing"),
        &["--prior judges from what was learned", "--judge cloning, paper or both"],
    );
    // Another judge is another run.
    scratch.refuse(&format!("judge --resume --out prior --judge trainer {trainer}"), &["judges was"]);
}
