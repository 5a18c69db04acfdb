//! Parts of a run: machines that share its folder do every n-th piece each, and the whole finds the same bits.

use std::collections::BTreeMap;
use std::fs;
use std::process::Stdio;

use demosift::math::arithmetic::Arithmetic;
use demosift::results::artifact;
use demosift::stages::method::Spent;

use crate::support::{self, Scratch};

const TASK: &str = "--task point_mass --config tiny.toml";

/// Results by name, without what tells of the way there.
fn results(scratch: &Scratch, folder: &str) -> BTreeMap<String, Vec<u8>> {
    let of_the_way =
        |name: &String| name.starts_with("metrics") || name == "measured.json" || name.starts_with("events.");
    scratch.files(folder).into_iter().filter(|(name, _)| !of_the_way(name)).collect()
}

/// What the whole holds is what the parts made: all results of `whole` are the same in `shared`, in the folder itself.
#[track_caller]
fn assert_collected(scratch: &Scratch, whole: &str, shared: &str) {
    support::assert_same_files(&results(scratch, whole), &results(scratch, shared));
}

#[test]
fn parts_that_judge_at_the_same_time_find_what_one_process_finds() {
    let scratch = Scratch::new("parts-judge");
    let said = scratch.succeed(&format!("judge set {TASK} --out undivided"));
    scratch.succeed(&format!("meta-train set {TASK} --out shared"));
    let parts: Vec<_> = (1..=3)
        .map(|part| {
            let typed = format!("judge set {TASK} --out shared --part {part}/3");
            scratch.command(&typed).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
        })
        .collect();
    for part in parts {
        let output = part.wait_with_output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let told = String::from_utf8(output.stdout).unwrap();
        assert!(
            told.contains(" is done; ") && told.contains("demosift judge --out shared --resume"),
            "{told}"
        );
    }
    let collected = scratch.succeed("judge --out shared --resume");
    assert_eq!(collected.replace("shared", "undivided"), said);
    assert_collected(&scratch, "undivided", "shared");
}

/// Whom the judge of the paper judges is known once the judge by cloning has judged all, by whomever.
#[test]
fn parts_wait_for_each_other_to_know_who_is_near_the_cut() {
    let scratch = Scratch::new("parts-near");
    let asked = format!("set {TASK} --set near_cut=2");
    let said = scratch.succeed(&format!("judge {asked} --out undivided"));
    scratch.succeed(&format!("meta-train {asked} --out shared"));
    let first = scratch.succeed(&format!("judge {asked} --out shared --part 1/2"));
    assert!(first.contains("left") && first.contains("by the judge of the paper"), "{first}");
    for part in ["2/2", "1/2", "2/2", "1/2"] {
        scratch.succeed(&format!("judge {asked} --out shared --part {part}"));
    }
    let collected = scratch.succeed("judge --out shared --resume");
    assert_eq!(collected.replace("shared", "undivided"), said);
    assert_collected(&scratch, "undivided", "shared");
}

/// Repeats that race for the cut need all that was found before them; parts make them too, one round at each start.
#[test]
fn parts_that_are_started_again_finish_by_themselves() {
    let scratch = Scratch::new("parts-again");
    scratch.succeed(&format!("judge set {TASK} --judge cloning --out undivided"));
    let mut told = Vec::new();
    for _ in 0..3 {
        for part in ["1/2", "2/2"] {
            told.push(
                scratch
                    .succeed(&format!("judge set {TASK} --judge cloning --out shared --part {part} --json")),
            );
        }
    }
    let left = |told: &str| {
        serde_json::from_str::<serde_json::Value>(told).unwrap()["left"].as_array().unwrap().len()
    };
    assert_eq!((left(&told[0]), left(&told[5])), (1, 0), "{told:?}");
    scratch.succeed("judge --out shared --resume");
    let (whole, shared) = (results(&scratch, "undivided"), results(&scratch, "shared"));
    assert!(whole["panel.json"] == shared["panel.json"]);
}

/// Killed behind its first checkpoint, with units half done; another process takes its place, and no unit counts twice.
#[test]
fn a_part_that_was_killed_is_replaced_by_the_same_line() {
    let scratch = Scratch::new("parts-killed");
    let job =
        format!("judge set {TASK} --judge cloning --set cloning_judge.judging.iterations=60 --threads 1");
    scratch.succeed(&format!("{job} --out undivided"));
    let line = format!("{job} --out shared --part 1/2");
    let mut killed = scratch.command(&line).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let checkpoint = scratch.0.join("shared/parts/1-of-2/checkpoint_judge_cloning.bin");
    while !checkpoint.exists() && killed.try_wait().unwrap().is_none() {
        std::thread::yield_now();
    }
    let _ = killed.kill();
    killed.wait().unwrap();
    assert!(checkpoint.exists(), "it was killed before it had done anything");
    scratch.succeed(&line);
    scratch.succeed(&line.replace("1/2", "2/2"));
    scratch.succeed("judge --out shared --resume");
    // What was played is among the results, so a unit that counted twice would show.
    assert!(results(&scratch, "undivided").contains_key("spent_judge_cloning.json"));
    assert_collected(&scratch, "undivided", "shared");
}

/// Makes it look as if the process that holds the lock of a folder ran on another machine.
fn put_elsewhere(folder: &std::path::Path) {
    let lock = folder.join(".lock");
    let holder = fs::read_dir(&lock).unwrap().next().unwrap().unwrap().file_name().into_string().unwrap();
    let (_, rest) = holder.split_once('+').unwrap();
    fs::rename(lock.join(&holder), lock.join(format!("lab7+{rest}"))).unwrap();
}

/// Of a process on another machine nobody here can tell whether it is gone, so the part goes on beside it.
#[test]
fn a_part_whose_machine_was_lost_is_replaced_by_the_same_line_elsewhere() {
    let scratch = Scratch::new("parts-moved");
    let job =
        format!("judge set {TASK} --judge cloning --set cloning_judge.judging.iterations=60 --threads 1");
    scratch.succeed(&format!("{job} --out undivided"));
    let line = format!("{job} --out shared --part 1/2");
    let kill = |own: &str| {
        let own = scratch.0.join("shared/parts").join(own);
        let mut killed = scratch.command(&line).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let checkpoint = own.join("checkpoint_judge_cloning.bin");
        while !checkpoint.exists() && killed.try_wait().unwrap().is_none() {
            std::thread::yield_now();
        }
        let _ = killed.kill();
        killed.wait().unwrap();
        assert!(checkpoint.exists(), "it was killed before it had done anything");
        put_elsewhere(&own);
    };
    kill("1-of-2");
    kill("1-of-2.2");
    let output = scratch.run(&line);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && said.contains("note: part 1/2 was begun by process"), "{said}");
    assert!(said.contains("of the host lab7") && scratch.0.join("shared/parts/1-of-2.3").is_dir(), "{said}");
    scratch.succeed(&line.replace("1/2", "2/2"));
    scratch.succeed("judge --out shared --resume");
    assert_collected(&scratch, "undivided", "shared");
}

#[test]
fn what_a_part_did_not_do_the_whole_does() {
    let scratch = Scratch::new("parts-lost");
    scratch.succeed(&format!("judge set {TASK} --judge cloning --out undivided"));
    scratch.succeed(&format!("judge set {TASK} --judge cloning --out shared --part 2/3"));
    scratch.succeed("judge --out shared --resume");
    assert_collected(&scratch, "undivided", "shared");
}

#[test]
fn the_oracle_and_the_referee_have_parts_too() {
    let scratch = Scratch::new("parts-trainings");
    let job = format!("set {TASK} --judge cloning");
    for folder in ["undivided", "shared"] {
        scratch.succeed(&format!("select {job} --out {folder}"));
    }
    for command in ["oracle", "referee"] {
        scratch.succeed(&format!("{command} --out undivided --resume"));
        // The referee asks for what it needs next when it knows what was found, so parts are started until all is there.
        for _ in 0..4 {
            for part in ["1/2", "2/2"] {
                scratch.succeed(&format!("{command} {job} --out shared --part {part}"));
            }
        }
        let told = scratch.succeed(&format!("{command} {job} --out shared --part 1/2"));
        let options = if command == "oracle" { " --repeats 3" } else { "" };
        assert!(told.ends_with(&format!("demosift {command} --out shared --resume{options}\n")), "{told}");
        let own = scratch.0.join("shared/parts/1-of-2");
        assert!(fs::read_dir(&own).unwrap().count() > 1, "a part has files of its own");
        if command == "referee" {
            // As if this part had been made on another kind of machine.
            let noted = Spent { arithmetic: [Arithmetic::Other].into(), ..Spent::default() };
            fs::write(own.join("checkpoint_referee.bin"), artifact::write_checkpoint(&(noted, ()))).unwrap();
        }
        let said = scratch.succeed(&format!("{command} --out shared --resume"));
        assert_eq!(
            said,
            scratch.succeed(&format!("{command} --out undivided --resume")).replace("undivided", "shared")
        );
    }
    let (whole, shared) = (results(&scratch, "undivided"), results(&scratch, "shared"));
    for name in ["verdict.json", "policy_best.safetensors"] {
        assert!(whole[name] == shared[name], "{name}");
    }
    let spent = |of: &BTreeMap<String, Vec<u8>>| String::from_utf8(of["spent_referee.json"].clone()).unwrap();
    assert!(
        spent(&shared).contains("\"other\"") && !spent(&whole).contains("\"other\""),
        "{}",
        spent(&shared)
    );
    assert!(!whole.contains_key("checkpoint_referee.bin") && !shared.contains_key("checkpoint_referee.bin"));
}

/// What the parts concluded of what was kept stays theirs; what they trained is used where it is asked for.
#[test]
fn another_keep_after_parts_is_that_of_one_process() {
    let scratch = Scratch::new("parts-keep");
    let job = format!("set {TASK} --judge cloning");
    scratch.succeed(&format!("referee {job} --out undivided"));
    for command in ["judge", "referee"] {
        for _ in 0..4 {
            for part in ["1/2", "2/2"] {
                scratch.succeed(&format!("{command} {job} --out shared --part {part}"));
            }
        }
    }
    // As parts of before wrote them, beside what they trained.
    for name in ["verdict.json", "subset.json", "policy_best.safetensors", "policy_best.onnx"] {
        fs::copy(scratch.0.join("undivided").join(name), scratch.0.join("shared/parts/1-of-2").join(name))
            .unwrap();
    }
    // Before anybody collected them, and then with each of what was asked before.
    for keep in ["2", "quarter", "2"] {
        for folder in ["undivided", "shared"] {
            scratch.succeed(&format!("referee --out {folder} --resume --keep {keep}"));
        }
        let (whole, shared) = (results(&scratch, "undivided"), results(&scratch, "shared"));
        for name in
            ["resolved.toml", "subset.json", "verdict.json", "policy_best.safetensors", "policy_best.onnx"]
        {
            assert!(whole[name] == shared[name], "{name} of --keep {keep}");
        }
    }
    // A part of the new one finds nothing of the old one either.
    for _ in 0..4 {
        for part in ["1/2", "2/2"] {
            scratch.succeed(&format!("referee {job} --keep 2 --out shared --part {part}"));
        }
    }
    scratch.succeed("select --out shared --resume --keep 3");
    let left = scratch.files("shared");
    assert!(
        !left.contains_key("verdict.json") && !left.contains_key("policy_best.onnx"),
        "{:?}",
        left.keys()
    );
}

#[test]
fn what_a_part_cannot_do_is_one_error() {
    let scratch = Scratch::new("parts-errors");
    let complaint = |typed: &str| {
        let output = scratch.run(typed);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{said}");
        said
    };
    let said = complaint(&format!("judge set {TASK} --out shared --part 1/2"));
    assert!(said.contains("needs the prior") && said.contains("demosift meta-train"), "{said}");
    assert!(complaint(&format!("judge set {TASK} --out shared --part 3/2")).contains("from 1 to 2"));
    scratch.succeed(&format!("judge set {TASK} --judge cloning --out shared --part 1/2"));
    let said = complaint(&format!("judge set {TASK} --judge cloning --seed 5 --out shared --part 2/2"));
    assert!(said.contains("the run folder is of another run"), "{said}");
    let said = complaint(&format!("judge set {TASK} --judge cloning --keep 3 --out shared --part 2/2"));
    assert!(said.contains("another --keep"), "{said}");
    let said = complaint("judge set --prior shared --out standing --part 1/2");
    assert!(said.contains("--part 1/2 and --prior do not go together"), "{said}");
    assert!(!scratch.0.join("standing").exists());
}

/// Each round of weighing starts from the one before, so parts would all do the same.
#[test]
fn weighing_is_done_once_and_not_by_a_part() {
    let scratch = Scratch::new("parts-weights");
    let job = format!("set {TASK} --keep weights --judge cloning --set subset_selection.rounds=2");
    scratch.succeed(&format!("meta-train {job} --out shared"));
    scratch.succeed("judge --out shared --resume");
    let part = format!("referee {job} --out shared --part 1/2");
    scratch
        .refuse(&part, &["part 1/2 of the run needs the weights", "hint: make them with `demosift weigh`"]);
    scratch.succeed("weigh --out shared --resume");
    scratch.succeed(&part);
}
