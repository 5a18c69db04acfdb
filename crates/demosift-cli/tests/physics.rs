//! The command on real physics: the set that the repository carries, with tiny budgets.

#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod support;

use std::path::PathBuf;

use demosift::demonstration::d4rl;
use support::{Scratch, assert_same_files};

fn in_repository(path: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

#[test]
fn eight_free_throws_are_sifted_to_the_same_bytes_on_one_thread_and_two() {
    let scratch = Scratch::new("free-throw");
    let set = in_repository("data/free_throw_8");
    for threads in [1, 2] {
        let job = format!("--task free_throw --config tiny.toml --threads {threads} --out run{threads}");
        let said = scratch.succeed(&format!("sift {} {job}", set.display()));
        assert!(said.contains("gain [m]") && said.contains("all 8"), "{said}");
    }
    assert_same_files(&scratch.files("run1"), &scratch.files("run2"));
}

#[test]
fn the_free_throws_are_whole_and_their_origin_stands_apart() {
    let folder = in_repository("data/free_throw_8");
    let set = d4rl::read(&folder.join("demonstrations.hdf5")).unwrap();
    assert_eq!((set.len(), set.observation_size(), set.action_size()), (8, 55, 21));
    assert!(set.iter().all(|(_, demonstration)| demonstration.steps() == 60));
    let files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().file_name()).collect();
    assert_eq!(files, ["demonstrations.hdf5"]);
    assert!(in_repository("data/provenance/free_throw_8.json").exists());
}

#[test]
fn the_martial_arts_sets_are_whole_and_share_no_demonstration() {
    let mut starts = Vec::new();
    for (name, count) in [("martial_arts_10", 10), ("martial_arts_100", 100), ("martial_arts_unseen", 20)] {
        let set = d4rl::read(&in_repository("data").join(name).join("demonstrations.hdf5")).unwrap();
        assert_eq!((set.len(), set.observation_size(), set.action_size()), (count, 55, 21));
        assert!(set.iter().all(|(_, demonstration)| demonstration.steps() == 60));
        assert!(in_repository("data/provenance").join(name).with_extension("json").exists());
        starts.extend(set.iter().map(|(_, demonstration)| demonstration.observations().row(0).to_vec()));
    }
    // The noise of the reset tells any two episodes apart.
    starts.sort_by(|a, b| a.partial_cmp(b).unwrap());
    assert!(starts.windows(2).all(|pair| pair[0] != pair[1]));
}

#[test]
fn the_public_half_cheetah_set_is_judged() {
    let set = in_repository("../shared/data/half_cheetah_noisy/half_cheetah_noisy.hdf5");
    if !set.exists() {
        eprintln!("skipped: the public HalfCheetah set is not there");
        return;
    }
    let scratch = Scratch::new("half-cheetah");
    let tiny = "--config tiny.toml --set meta_train.rounds=1 --set judge.iterations=1 --set judge.repeats=1 \
                --set judge.evaluations=2 --set inner.batch_steps=2000";
    let said = scratch.succeed(&format!("judge {} --task half_cheetah {tiny} --out run", set.display()));
    assert!(said.contains("gain [m]"), "{said}");
    assert!(scratch.files("run").contains_key("scores.json"));
}
