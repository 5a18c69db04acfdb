//! Nothing is lost, and nothing that is damaged is used: files that were changed, two runs in one folder, links and disks.

use std::fs;
use std::os::unix::ffi::OsStrExt as _;
use std::os::unix::fs::symlink;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::support::{Scratch, assert_same_files};
use demosift::data::demonstration::d4rl::{self, Episode};
use demosift::math::rows::Rows;

const TASK: &str = "--task point_mass --config tiny.toml";

/// The command fails as a mistake of the user, with one error that says all of `wanted`.
#[track_caller]
fn complaint(output: &Output, wanted: &[&str]) -> String {
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert_eq!(said.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{said}");
    for part in wanted {
        assert!(said.contains(part), "{said} does not say '{part}'");
    }
    said
}

/// Every file of a run by itself: a flipped bit is told with the file, or what it held is made again, or nobody reads it.
#[test]
fn a_flipped_bit_is_never_used() {
    let scratch = Scratch::new("flipped");
    let said = scratch.succeed(&format!("sift set {TASK} --out run"));
    let whole = scratch.files("run");
    // Of a finished run only `play`, `export` and steps that start from them read these; they say so.
    let unread =
        ["prior.safetensors", "trained_on.json", "policy_referee_", "learning_curve_referee_", "events."];
    for (name, bytes) in &whole {
        let mut damaged = bytes.clone();
        let place = damaged.len() / 2;
        damaged[place] ^= 1;
        fs::write(scratch.0.join("run").join(name), &damaged).unwrap();
        let output = scratch.run("sift --out run --resume");
        if output.status.success() {
            assert_eq!(String::from_utf8(output.stdout).unwrap(), said, "{name}");
            let now = fs::read(scratch.0.join("run").join(name)).unwrap();
            assert!(
                now == *bytes || unread.iter().any(|start| name.starts_with(start)),
                "{name} stays damaged"
            );
        } else {
            complaint(&output, &[name, "hint: "]);
        }
        fs::write(scratch.0.join("run").join(name), bytes).unwrap();
    }
    assert_same_files(&whole, &scratch.files("run"));
    let policy = scratch.0.join("run/policy_best.safetensors");
    let mut damaged = fs::read(&policy).unwrap();
    *damaged.last_mut().unwrap() ^= 1;
    fs::write(&policy, damaged).unwrap();
    let play = "play --task point_mass --episodes 1 --policy run/policy_best.safetensors";
    complaint(&scratch.run(play), &["not as it was written", "policy_best.safetensors"]);
}

/// What the hint says: the file is deleted, and is made again to the same bytes.
#[test]
fn a_file_that_is_deleted_is_made_again() {
    let scratch = Scratch::new("deleted");
    scratch.succeed(&format!("sift set {TASK} --out run"));
    let whole = scratch.files("run");
    for name in [
        "scores_cloning.json",
        "adapted_paper.safetensors",
        "ranking.json",
        "verdict.json",
        "learning_curve_referee_all_cloning_1.json",
        "policy_referee_all_gail_0.safetensors",
        "policy_best.onnx",
        "data_only.json",
        "report.html",
    ] {
        assert!(whole.contains_key(name), "{name}");
        fs::remove_file(scratch.0.join("run").join(name)).unwrap();
        if name.contains("_referee_") {
            // What was concluded from a training is concluded again, too.
            fs::remove_file(scratch.0.join("run/verdict.json")).unwrap();
        }
        scratch.succeed("sift --out run --resume");
        assert_same_files(&whole, &scratch.files("run"));
    }
    // A kill may have come between keeping a result and forgetting the checkpoint.
    for name in [
        "checkpoint_meta_train.bin",
        "checkpoint_judge_cloning.bin",
        ".scores_paper.json.partial",
        ".scores_paper.json.7-0-0123abcd.partial",
    ] {
        fs::write(scratch.0.join("run").join(name), "left").unwrap();
    }
    scratch.succeed("sift --out run --resume");
    assert_same_files(&whole, &scratch.files("run"));
}

#[test]
fn a_file_of_a_recording_that_is_deleted_is_made_again_and_a_changed_set_is_told() {
    let scratch = Scratch::new("deleted-recording");
    scratch.succeed(&format!("{} --unseen 2 --out recorded", crate::support::RECORD));
    let whole = scratch.files("recorded");
    let file = |name: &str| scratch.0.join("recorded").join(name);
    let resume = "record --out recorded --resume";
    for name in [
        "demonstrations.hdf5",
        "unseen.hdf5",
        "provenance.json",
        "unseen_provenance.json",
        "policy_demonstrator.safetensors",
        "policy_demonstrator.onnx",
        "stages.bin",
    ] {
        fs::remove_file(file(name)).unwrap();
        scratch.succeed(resume);
        assert_same_files(&whole, &scratch.files("recorded"));
    }
    for name in ["demonstrations.hdf5", "unseen.hdf5"] {
        let mut changed = whole[name].clone();
        let middle = changed.len() / 2;
        changed[middle] ^= 1;
        fs::write(file(name), &changed).unwrap();
        complaint(&scratch.run(resume), &["not as it was recorded", name, "hint: delete it"]);
        assert!(fs::read(file(name)).unwrap() == changed, "what may be meant stays");
        fs::write(file(name), &whole[name]).unwrap();
    }
    // Recordings of before do not say what their set was.
    crate::support::rewritten(&file("provenance.json"), |provenance| {
        provenance.as_object_mut().unwrap().remove("set_sha256").unwrap();
    });
    let older = scratch.files("recorded");
    scratch.succeed(resume);
    assert_same_files(&older, &scratch.files("recorded"));
    fs::remove_file(file("demonstrations.hdf5")).unwrap();
    let foreseen = scratch.succeed(&format!("{resume} --dry-run --json"));
    let foreseen: serde_json::Value = serde_json::from_str(&foreseen).unwrap();
    assert!(!foreseen["stages"].as_array().unwrap().is_empty(), "{foreseen}");
    scratch.succeed(resume);
    assert_same_files(&whole, &scratch.files("recorded"));
}

#[test]
fn a_checkpoint_that_was_changed_is_told_and_can_be_deleted() {
    let scratch = Scratch::new("checkpoint");
    let job = format!("judge set {TASK} --set meta_train.rounds=40");
    scratch.succeed(&format!("{job} --out whole"));
    let checkpoint = scratch.0.join("run/checkpoint_meta_train.bin");
    let mut child = scratch.command(&format!("{job} --out run")).stdout(Stdio::null()).spawn().unwrap();
    wait_for(&checkpoint, Duration::from_secs(120));
    child.kill().unwrap();
    child.wait().unwrap();
    let mut bytes = fs::read(&checkpoint).unwrap();
    let place = bytes.len() / 2;
    bytes[place] ^= 4;
    fs::write(&checkpoint, bytes).unwrap();
    let wanted = ["checkpoint_meta_train.bin is not as it was written", "hint: delete"];
    complaint(&scratch.run("judge --out run --resume"), &wanted);
    fs::remove_file(&checkpoint).unwrap();
    scratch.succeed("judge --out run --resume");
    assert_same_files(&scratch.files("whole"), &scratch.files("run"));
}

fn wait_for(file: &std::path::Path, longest: Duration) {
    let start = Instant::now();
    while !file.exists() {
        assert!(start.elapsed() < longest, "{} does not appear", file.display());
        std::thread::sleep(Duration::from_micros(200));
    }
}

#[test]
fn a_configuration_or_measurements_that_were_changed_are_told() {
    let scratch = Scratch::new("changed");
    scratch.succeed(&format!("judge set {TASK} --out run"));
    let resolved = scratch.0.join("run/resolved.toml");
    let text = fs::read_to_string(&resolved).unwrap();
    fs::write(&resolved, text.replacen("seed = 0", "seed = 1", 1)).unwrap();
    let wanted = ["not the one that the run was begun with", "resolved.toml", "hint: take back the change"];
    complaint(&scratch.run("select --out run --resume"), &wanted);
    fs::write(&resolved, &text).unwrap();
    let metrics = scratch.0.join("run/metrics.jsonl");
    let lines = fs::read_to_string(&metrics).unwrap();
    let half = lines.lines().count() / 2;
    let cut: String = lines.lines().take(half).map(|line| format!("{line}\n")).collect();
    for text in [cut.as_str(), ""] {
        fs::write(&metrics, text).unwrap();
        let wanted = ["measurements are missing", "metrics.jsonl", "hint: "];
        complaint(&scratch.run("select --out run --resume"), &wanted);
    }
    for name in ["metrics.jsonl", "measured.json"] {
        fs::remove_file(scratch.0.join("run").join(name)).unwrap();
    }
    scratch.succeed("select --out run --resume");
}

/// Whoever changes a file and its checksum still gets an error and no panic.
#[test]
fn a_demonstration_that_is_not_of_the_set() {
    let scratch = Scratch::new("ids");
    scratch.succeed(&format!("select set {TASK} --out run"));
    crate::support::rewritten(&scratch.0.join("run/ranking.json"), |ranking| {
        ranking["entries"][0]["demo"] = 99.into()
    });
    for form in ["csv", "json"] {
        let wanted = ["names demonstration 99", "0 to 3", "hint: "];
        complaint(&scratch.run(&format!("export run --as {form}")), &wanted);
    }
    crate::support::rewritten(&scratch.0.join("run/subset.json"), |subset| subset["demos"] = vec![7].into());
    complaint(&scratch.run("export run --as csv"), &["names demonstration 7"]);
}

#[test]
fn of_two_runs_in_one_folder_one_is_told() {
    let scratch = Scratch::new("two");
    let job = format!("judge set {TASK} --set meta_train.rounds=40");
    scratch.succeed(&format!("{job} --out whole"));
    let mut first = scratch.command(&format!("{job} --out run")).stdout(Stdio::null()).spawn().unwrap();
    wait_for(&scratch.0.join("run/checkpoint_meta_train.bin"), Duration::from_secs(120));
    let second = scratch.run("judge --out run --resume");
    let who = format!("process {} of the host", first.id());
    complaint(&second, &["another command writes into this folder", &who, "run\n", "hint: wait until"]);
    // Whoever only looks is let in.
    scratch.succeed("judge --out run --resume --dry-run");
    // A lock of a process that was killed holds nobody up.
    first.kill().unwrap();
    first.wait().unwrap();
    assert!(scratch.0.join("run/.lock").exists());
    scratch.succeed("judge --out run --resume");
    assert_same_files(&scratch.files("whole"), &scratch.files("run"));
    assert!(!scratch.0.join("run/.lock").exists());
}

#[test]
fn of_two_runs_that_begin_at_once_one_is_done() {
    let scratch = Scratch::new("at-once");
    let job = format!("judge set {TASK}");
    scratch.succeed(&format!("{job} --out whole"));
    for _ in 0..4 {
        let start = || {
            scratch.command(&format!("{job} --out run")).stderr(Stdio::piped()).stdout(Stdio::null()).spawn()
        };
        let children = [start().unwrap(), start().unwrap()];
        let ended = children.map(|child| child.wait_with_output().unwrap());
        let done = ended.iter().filter(|output| output.status.success()).count();
        assert_eq!(done, 1, "{ended:?}");
        for told in ended.iter().filter(|output| !output.status.success()) {
            let said = complaint(told, &["hint: "]);
            assert!(
                said.contains("another command writes") || said.contains("holds a run already"),
                "{said}"
            );
        }
        assert_same_files(&scratch.files("whole"), &scratch.files("run"));
        fs::remove_dir_all(scratch.0.join("run")).unwrap();
    }
}

/// As on a disk that is mounted so, where this can be had.
#[test]
fn a_finished_run_is_shown_from_a_disk_that_is_only_read() {
    let scratch = Scratch::new("read-only");
    let said = scratch.succeed(&format!("sift set {TASK} --out run"));
    let within = |arguments: &str| {
        let mount = "mount --bind run run && mount -o remount,ro,bind run run";
        let line = format!("{mount} || exit 99; exec '{}' {arguments}", env!("CARGO_BIN_EXE_demosift"));
        Command::new("unshare").args(["-rm", "bash", "-c", &line]).current_dir(&scratch.0).output()
    };
    match within("tasks") {
        Ok(output) if output.status.success() => {}
        _ => return eprintln!("skipped: no folder can be mounted to be read only"),
    }
    let again = within("sift --out run --resume").unwrap();
    assert_eq!(String::from_utf8(again.stdout).unwrap(), said, "{:?}", again.stderr);
    for arguments in
        ["report run", "report run --json", "select --out run --resume --json", "export run --as csv"]
    {
        let output = within(arguments).unwrap();
        assert!(output.status.success() && !output.stdout.is_empty(), "{arguments}: {output:?}");
    }
    // What is not there cannot be written, and numbers are told all the same.
    fs::remove_file(scratch.0.join("run/report.html")).unwrap();
    let output = within("report run --json").unwrap();
    assert!(output.status.success(), "{output:?}");
    assert!(String::from_utf8(output.stderr).unwrap().contains("note: the page was not written"));
    complaint(&within("report run").unwrap(), &["cannot lock the folder"]);
}

/// A run folder of somebody else may hold links to anything.
#[test]
fn nothing_is_written_through_a_link() {
    let scratch = Scratch::new("links");
    scratch.succeed(&format!("sift set {TASK} --out run"));
    let victim = scratch.0.join("victim");
    fs::write(&victim, "mine").unwrap();
    for name in [
        "events.out.tfevents.demosift",
        "metrics.jsonl",
        "report.html",
        "ranking.json",
        ".report.html.partial",
        ".report.html.7-0-0123abcd.partial",
    ] {
        let link = scratch.0.join("run").join(name);
        let _ = fs::remove_file(&link);
        symlink(&victim, &link).unwrap();
        // Whatever comes of it.
        scratch.run("report run");
        scratch.run("imitate --out run --resume --demonstration-ids 1");
        assert_eq!(fs::read_to_string(&victim).unwrap(), "mine", "{name}");
        let _ = fs::remove_file(&link);
    }
}

#[test]
fn what_is_the_users_stays() {
    let scratch = Scratch::new("users");
    scratch.succeed(&format!("judge set {TASK} --out run"));
    fs::create_dir(scratch.0.join("run/notes.partial")).unwrap();
    for name in ["notes.partial/note", "half.partial", ".mine.partial", "notes.txt"] {
        fs::write(scratch.0.join("run").join(name), "mine").unwrap();
    }
    scratch.succeed("select --out run --resume");
    for name in ["notes.partial/note", "half.partial", ".mine.partial", "notes.txt"] {
        assert!(scratch.0.join("run").join(name).exists(), "{name}");
    }
}

#[test]
fn results_that_could_not_be_shown_are_no_success() {
    let scratch = Scratch::new("shown");
    for arguments in
        ["tasks", "tasks --json", "inspect set", "inspect set --json", "completions bash", "--help"]
    {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = scratch.command(arguments).stdout(full).stderr(Stdio::piped()).output().unwrap();
        complaint(&output, &["cannot write", "standard output"]);
    }
}

#[test]
fn names_that_are_no_text_are_told() {
    let scratch = Scratch::new("names");
    let odd = std::ffi::OsStr::from_bytes(b"se\xfft");
    fs::copy(scratch.0.join("set/demonstrations.hdf5"), scratch.0.join(odd)).unwrap();
    for (command, rest) in [("sift", TASK), ("judge", TASK), ("inspect", "--json")] {
        let mut command = scratch.command(command);
        let output = command.arg(odd).args(rest.split_whitespace()).args(["--threads", "1"].iter().take(
            // Not every command takes it.
            if rest == TASK { 2 } else { 0 },
        ));
        complaint(&output.output().unwrap(), &["UTF-8"]);
    }
    // A terminal obeys such letters, and gets them as words.
    let output = scratch.command("inspect").arg("no\u{1b}[31mset\u{9b}").output().unwrap();
    let said = complaint(&output, &["no\\u{1b}[31mset\\u{9b}"]);
    assert!(!said.contains('\u{1b}'));
}

#[test]
fn numbers_and_files_that_cannot_be_meant() {
    let scratch = Scratch::new("meant");
    let job = format!("sift set {TASK} --out run");
    complaint(&scratch.run(&format!("{job} --threads 1000000")), &["--threads 1000000: must be at most"]);
    assert!(Command::new("mkfifo").arg(scratch.0.join("pipe")).status().unwrap().success());
    let write_set = |name: &str, observations: &Rows, actions: &Rows| {
        let episode = Episode { observations, actions, states: None, terminated: false };
        d4rl::write(&scratch.0.join(name), &[episode, episode]).unwrap();
    };
    let actions = Rows::from_flat((0..12).map(|at| at as f32 / 12.0).collect(), 2).unwrap();
    for (at, value, wanted) in [
        (9, 3e38, "observation 1 at step 2 is 3e38, and must be from -1e18 to 1e18"),
        (9, f32::INFINITY, "observation 1 at step 2 is inf (or is beyond 3.4e38"),
    ] {
        let mut observations = Rows::from_flat((0..24).map(|at| at as f32 / 24.0).collect(), 4).unwrap();
        observations.flat_mut()[at] = value;
        write_set("large.hdf5", &observations, &actions);
        complaint(&scratch.run(&format!("sift large.hdf5 {TASK} --out run")), &[wanted, "large.hdf5"]);
    }
    for constant in [0.0, 7.5, 1e6] {
        write_set("constant.hdf5", &Rows::from_flat(vec![constant; 24], 4).unwrap(), &actions);
        let wanted = ["no number of the observations varies", "constant.hdf5", "hint: "];
        complaint(&scratch.run(&format!("sift constant.hdf5 {TASK} --out run")), &wanted);
    }
    for arguments in [
        format!("sift pipe {TASK} --out run"),
        "inspect pipe".to_owned(),
        "inspect /dev/zero".to_owned(),
        "play --task point_mass --policy pipe".to_owned(),
        "play --task point_mass --policy /dev/zero".to_owned(),
        format!("sift set {TASK} --config pipe --out run").replace("--config tiny.toml", ""),
        "task check pipe".to_owned(),
    ] {
        complaint(&scratch.run(&arguments), &["plain file"]);
    }
    assert!(!scratch.0.join("run").exists());
}
