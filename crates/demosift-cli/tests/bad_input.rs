//! Each mistake of a user gets one clear error, exit code 2, and leaves nothing half-written.

#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod support;

use demosift::demonstration::d4rl::{self, Episode};
use demosift::rows::Rows;
use hdf5_pure::FileBuilder;
use support::Scratch;

const TASK: &str = "--task point_mass --config tiny.toml --out run";

/// The command fails with one error that says all of `wanted`, and makes no run folder.
#[track_caller]
fn refuses(scratch: &Scratch, arguments: &str, wanted: &[&str]) {
    let existed = scratch.0.join("run").exists();
    complaint(scratch, arguments, wanted);
    assert_eq!(scratch.0.join("run").exists(), existed, "the run folder was touched");
}

#[track_caller]
fn complaint(scratch: &Scratch, arguments: &str, wanted: &[&str]) -> String {
    let output = scratch.run(arguments);
    let complaint = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments}: {complaint}");
    assert!(output.stdout.is_empty(), "{arguments}");
    assert!(complaint.starts_with("error: "), "{complaint}");
    assert_eq!(complaint.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{complaint}");
    for part in wanted {
        assert!(complaint.contains(part), "{complaint} does not say '{part}'");
    }
    complaint
}

/// `bad.hdf5` with tables of these shapes, all zeros, and ends marked at the last step of each half.
fn write_shapes(scratch: &Scratch, observations: &[u64], actions: &[u64]) {
    let mut file = FileBuilder::new();
    for (name, shape) in [("observations", observations), ("actions", actions)] {
        let count = shape.iter().product::<u64>() as usize;
        file.create_dataset(name).with_f32_data(&vec![0.0; count]).with_shape(shape);
    }
    let mut ends = vec![0; observations[0] as usize];
    for end in [ends.len() / 2, ends.len()] {
        ends[end - 1] = 1;
    }
    file.create_dataset("timeouts").with_u8_data(&ends);
    file.write(scratch.0.join("bad.hdf5")).unwrap();
}

#[test]
fn shapes_that_are_wrong() {
    let scratch = Scratch::new("shapes");
    write_shapes(&scratch, &[6, 2, 2], &[6, 2]);
    refuses(&scratch, &format!("sift bad.hdf5 {TASK}"), &["shape [6, 2, 2]", "bad.hdf5", "\nhint: "]);
    write_shapes(&scratch, &[6, 4], &[5, 2]);
    refuses(&scratch, &format!("sift bad.hdf5 {TASK}"), &["6 rows but 'actions' has 5", "bad.hdf5"]);
}

#[test]
fn a_set_that_does_not_fit_the_task() {
    let scratch = Scratch::new("fit");
    write_shapes(&scratch, &[6, 5], &[6, 2]);
    let wanted = ["5 numbers in an observation", "'point_mass' has 4", "bad.hdf5"];
    refuses(&scratch, &format!("sift bad.hdf5 {TASK}"), &wanted);
    write_shapes(&scratch, &[6, 4], &[6, 3]);
    let wanted = ["3 numbers in an action", "'point_mass' has 2", "bad.hdf5"];
    refuses(&scratch, &format!("judge bad.hdf5 {TASK}"), &wanted);
}

#[test]
fn a_number_that_is_none() {
    let scratch = Scratch::new("nan");
    let mut observations = Rows::from_flat(vec![0.0; 24], 4).unwrap();
    let actions = Rows::from_flat(vec![0.0; 12], 2).unwrap();
    let good = observations.clone();
    observations.flat_mut()[9] = f32::NAN;
    let episode = |observations| Episode { observations, actions: &actions, states: None, terminated: false };
    d4rl::write(&scratch.0.join("bad.hdf5"), &[episode(&good), episode(&observations)]).unwrap();
    let wanted = ["episode 1", "observation 1 at step 2 is NaN", "bad.hdf5"];
    refuses(&scratch, &format!("sift bad.hdf5 {TASK}"), &wanted);
}

#[test]
fn sets_without_a_choice() {
    let scratch = Scratch::new("choice");
    let observations = Rows::from_flat(vec![0.0; 24], 4).unwrap();
    let actions = Rows::from_flat(vec![0.0; 12], 2).unwrap();
    let episode = Episode { observations: &observations, actions: &actions, states: None, terminated: false };
    d4rl::write(&scratch.0.join("bad.hdf5"), &[episode]).unwrap();
    refuses(&scratch, &format!("sift bad.hdf5 {TASK}"), &["1 demonstration", "at least 2", "bad.hdf5"]);

    let mut file = FileBuilder::new();
    file.create_dataset("observations").with_f32_data(&[0.0; 24]).with_shape(&[6, 4]);
    file.create_dataset("actions").with_f32_data(&[0.0; 12]).with_shape(&[6, 2]);
    file.create_dataset("timeouts").with_u8_data(&[0; 6]);
    file.write(scratch.0.join("bad.hdf5")).unwrap();
    refuses(&scratch, &format!("sift bad.hdf5 {TASK}"), &["no complete episode", "bad.hdf5", "\nhint: "]);
}

#[test]
fn files_that_are_no_sets() {
    let scratch = Scratch::new("files");
    let whole = std::fs::read(scratch.0.join("set/demonstrations.hdf5")).unwrap();
    std::fs::write(scratch.0.join("bad.hdf5"), &whole[..whole.len() / 2]).unwrap();
    refuses(&scratch, &format!("sift bad.hdf5 {TASK}"), &["damaged or truncated", "bad.hdf5", "\nhint: "]);
    std::fs::write(scratch.0.join("bad.hdf5"), b"").unwrap();
    refuses(&scratch, &format!("sift bad.hdf5 {TASK}"), &["empty", "bad.hdf5"]);
    refuses(&scratch, &format!("sift none.hdf5 {TASK}"), &["does not exist", "none.hdf5"]);
    std::fs::create_dir(scratch.0.join("bare")).unwrap();
    refuses(&scratch, &format!("sift bare {TASK}"), &["no demonstrations.hdf5", "bare"]);
    refuses(&scratch, &format!("sift {TASK}"), &["no demonstrations are given", "\nhint: "]);
}

#[test]
fn tasks_that_are_none() {
    let scratch = Scratch::new("tasks");
    refuses(
        &scratch,
        "sift set --task tennis --out run",
        &["'tennis'", "point_mass, free_throw, half_cheetah", "\nhint: "],
    );
    refuses(&scratch, "sift set --task set --out run", &["no task.toml", "set"]);
    refuses(&scratch, "sift set --out run", &["no task is given", "point_mass", "\nhint: "]);
}

#[test]
fn configurations_that_are_wrong() {
    let scratch = Scratch::new("configuration");
    let job = "sift set --task point_mass --out run";
    let wanted = ["no key judge.iteratons", "--set judge.iteratons=3", "iterations"];
    refuses(&scratch, &format!("{job} --set judge.iteratons=3"), &wanted);
    let wanted = ["judge.iterations = \"many\"", "of type integer such as "];
    refuses(&scratch, &format!("{job} --set judge.iterations=many"), &wanted);
    refuses(&scratch, &format!("{job} --set judge.iterations"), &["wanted key=value", "\nhint: "]);
    refuses(&scratch, &format!("{job} --set judge.iterations=0"), &["judge.iterations = 0", "at least 1\n"]);
    let wanted = ["inner.advantage.discount = 7", "from 0 to 1"];
    refuses(&scratch, &format!("{job} --set inner.advantage.discount=7"), &wanted);
    let record = "record --task point_mass --out run --set demonstrator";
    let wanted = ["one of demonstrator.policy.hidden = 0", "at least 1"];
    refuses(&scratch, &format!("{record}.policy.hidden=[0]"), &wanted);
    let wanted = ["demonstrator.trust_region.max_kl = -1", "above 0"];
    refuses(&scratch, &format!("{record}.trust_region.max_kl=-1"), &wanted);
    refuses(&scratch, &format!("{job} --set judge.iterations=-1"), &["judge", "iterations", "-1"]);
    refuses(&scratch, &format!("{job} --set judge.acting=wild"), &["acting", "wild", "sampled"]);
    refuses(&scratch, &format!("{job} --config none.toml"), &["does not exist", "none.toml"]);
    std::fs::write(scratch.0.join("bad.toml"), "[meta_train]\nround = 3\n").unwrap();
    let wanted = ["no key meta_train.round", "bad.toml", "rounds"];
    refuses(&scratch, &format!("{job} --config bad.toml"), &wanted);
    std::fs::write(scratch.0.join("bad.toml"), "[meta_train\n").unwrap();
    refuses(&scratch, &format!("{job} --config bad.toml"), &["bad.toml is not TOML"]);
    refuses(&scratch, &format!("{job} --threads 0"), &["--threads 0", "at least 1"]);
    refuses(&scratch, &format!("{job} --preset huge"), &["huge", "quick, standard, paper"]);
}

#[test]
fn a_number_to_keep_that_is_not_there() {
    let scratch = Scratch::new("keep");
    refuses(&scratch, &format!("sift set {TASK} --keep 0"), &["--keep 0", "from 1 to the 4"]);
    refuses(&scratch, &format!("sift set {TASK} --keep most"), &["most", "auto, quarter, or a number"]);
    refuses(&scratch, &format!("sift set {TASK} --keep 5"), &["--keep 5", "from 1 to the 4"]);
    refuses(&scratch, &format!("sift set {TASK} --set keep=5"), &["keep = 5", "from 1 to the 4"]);
    refuses(
        &scratch,
        &format!("imitate set {TASK} --demonstration-ids 1,4"),
        &["--demonstration-ids 4", "0 to 3"],
    );
    refuses(&scratch, &format!("oracle set {TASK} --repeats 0"), &["--repeats 0", "at least 1"]);
    refuses(&scratch, "record --task point_mass --out run --count 1", &["--count 1", "at least 2"]);
}

#[test]
fn a_run_folder_of_another_run() {
    let scratch = Scratch::new("folder");
    scratch.succeed(&format!("judge set {TASK}"));
    let before = scratch.files("run");
    let again = format!("sift set {TASK}");
    refuses(&scratch, &again, &["holds a run already", "run\n", "\nhint: ", "--resume"]);
    for (option, wanted) in [
        ("--set judge.repeats=5", ["judge.repeats was 2", "is 5"]),
        ("--seed 9", ["seed was 0", "is 9"]),
        ("--keep 3", ["keep was \"quarter\"", "is \"3\""]),
        ("--preset paper", ["imitate.checkpoint_every was 2", "is 10"]),
    ] {
        refuses(&scratch, &format!("judge --out run --resume {option}"), &wanted);
    }
    refuses(&scratch, &format!("{again} --resume --seed 9"), &["seed was 0", "is 9"]);
    // The task is told apart before the demonstrations are found not to fit it.
    let wanted = ["the task was point_mass", "is half_cheetah"];
    refuses(&scratch, "judge --out run --resume --task half_cheetah", &wanted);
    // The same demonstrations may have moved.
    std::fs::copy(scratch.0.join("set/demonstrations.hdf5"), scratch.0.join("same.hdf5")).unwrap();
    scratch.succeed(&format!("judge same.hdf5 {TASK} --resume"));
    let set = demosift::point_mass::planted_set(&[0.0, 90.0], demosift::seed::Seed::new(4)).unwrap();
    support::write_set(&scratch.0.join("other.hdf5"), &set);
    refuses(&scratch, &format!("judge other.hdf5 {TASK} --resume"), &["SHA-256 of the demonstrations was"]);
    support::assert_same_files(&before, &scratch.files("run"));

    let run = std::fs::read_to_string(scratch.0.join("run/run.json")).unwrap();
    let older = run.replace(env!("CARGO_PKG_VERSION"), "0.0.1");
    std::fs::write(scratch.0.join("run/run.json"), older).unwrap();
    refuses(&scratch, "judge --out run --resume", &["the version of demosift was 0.0.1"]);
    std::fs::write(scratch.0.join("run/run.json"), "{").unwrap();
    refuses(&scratch, "judge --out run --resume", &["not the file of a run", "run.json"]);
}

#[test]
fn a_folder_that_is_no_run() {
    let scratch = Scratch::new("no-run");
    let job = "sift set --task point_mass --config tiny.toml";
    complaint(
        &scratch,
        &format!("{job} --out set"),
        &["holds other files (demonstrations.hdf5) and no run", "set"],
    );
    complaint(&scratch, &format!("{job} --out tiny.toml"), &["is a file", "tiny.toml"]);
    assert_eq!(scratch.files("set").len(), 1);
}

/// The device that is always full stands in for a disk; the bytes of a noun wait under this name.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk() {
    let scratch = Scratch::new("full");
    for (noun, left) in [("run.json", 1), ("scores.json", 5)] {
        let _ = std::fs::remove_dir_all(scratch.0.join("run"));
        std::fs::create_dir(scratch.0.join("run")).unwrap();
        let waiting = scratch.0.join(format!("run/.{noun}.partial"));
        std::os::unix::fs::symlink("/dev/full", waiting).unwrap();
        let said =
            complaint(&scratch, &format!("judge set {TASK}"), &["cannot write", noun, "free some space"]);
        assert_eq!(said.matches("error: ").count(), 1, "{said}");
        let files = scratch.files("run");
        assert!(!files.contains_key(noun), "{noun} is half-written");
        assert!(!files.keys().any(|name| name.ends_with(".partial")), "{:?}", files.keys());
        assert_eq!(files.len(), left, "{:?}", files.keys());
    }
    // With space again the run goes on as if nothing had been.
    scratch.succeed("judge --out run --resume");
    scratch.succeed("judge set --task point_mass --config tiny.toml --out other");
    support::assert_same_files(&scratch.files("run"), &scratch.files("other"));
}

#[test]
fn help_is_no_mistake_and_nonsense_is_one() {
    let scratch = Scratch::new("help");
    assert!(scratch.succeed("--help").contains("sift"));
    assert!(scratch.succeed("sift --help").contains("--resume"));
    assert_eq!(scratch.run("stir").status.code(), Some(2));
    assert_eq!(scratch.run("").status.code(), Some(2));
}
