//! `demosift judge --prior` as a user sees it: new demonstrations are judged from the prior of an earlier run.

use crate::support::{Scratch, write_set};
use demosift::basics::seed::Seed;
use demosift::world::point_mass;
use serde_json::Value;

/// A run of four demonstrations in `run`, and others beside it.
fn scratch(name: &str) -> Scratch {
    let scratch = Scratch::new(name);
    for (file, angles) in [("better.hdf5", vec![2.0]), ("three.hdf5", vec![170.0, 5.0, 100.0])] {
        let set = point_mass::planted_set(&angles, Seed::new(5)).unwrap();
        write_set(&scratch.0.join(file), &set);
    }
    scratch.succeed("sift set --task point_mass --config tiny.toml --out run --referee none");
    scratch
}

#[test]
fn one_new_demonstration_is_told_its_place() {
    let scratch = scratch("prior-one");
    let before = scratch.files("run");
    let told = scratch.succeed("judge better.hdf5 --prior run --out new").replace('\n', " ");
    for part in [
        "By the judge by cloning: where each would stand",
        "place",
        "of 5",
        "kept",
        "The prior was paid once",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    crate::support::assert_same_files(&before, &scratch.files("run"));

    let json = scratch.succeed("judge better.hdf5 --prior run --out again --json");
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["judges"].as_array().unwrap().len(), 2, "{json}");
    let standing = &json["judges"][0]["standings"][0];
    assert_eq!(standing["of"], 5);
    assert!(standing["low"].as_f64() < standing["score"].as_f64(), "{standing}");
    assert_eq!(json["likeness"].as_array().unwrap().len(), 1);

    // No second meta-training: the dry run counts judging alone, and touches nothing.
    let told = scratch.succeed("judge better.hdf5 --prior run --out dry --dry-run");
    assert!(!told.contains("learning to imitate") && !scratch.0.join("dry").exists(), "{told}");
}

#[test]
fn the_same_demonstrations_get_the_same_scores() {
    let scratch = scratch("prior-same");
    scratch.succeed("judge set --prior run --out same");
    for judge in ["cloning", "paper"] {
        let scores = |run: &str| -> Value {
            let bytes = std::fs::read(scratch.0.join(format!("{run}/scores_{judge}.json"))).unwrap();
            serde_json::from_slice(&bytes).unwrap()
        };
        assert_eq!(scores("same"), scores("run"), "{judge}");
    }
    // A demonstration does not depend on which others are judged with it.
    let judged = |file: &str, out: &str, episodes: &str| -> Value {
        let json = scratch.succeed(&format!("judge {file} --prior run --out {out} --json {episodes}"));
        let json: Value = serde_json::from_str(&json).unwrap();
        let last = json["judges"][1]["standings"].as_array().unwrap().last().unwrap().clone();
        last["score"].clone()
    };
    assert_eq!(judged("three.hdf5", "all", ""), judged("three.hdf5", "last", "--episodes 2"));
}

/// A large set is judged with fewer repeats, and so is whatever is to stand beside it.
#[test]
fn a_few_are_judged_as_the_large_set_was_of_the_prior() {
    let scratch = scratch("prior-large");
    scratch.succeed(
        "sift set --task point_mass --config tiny.toml --out large --referee none --set cloning_judge.full_effort_up_to=3 \
         --set cloning_judge.judging.repeats=4 --set cloning_judge.judging.most_repeats=0",
    );
    scratch.succeed("judge set --prior large --out few --episodes 0,1");
    let after = |run: &str, demo: usize| {
        let bytes = std::fs::read(scratch.0.join(format!("{run}/scores_cloning.json"))).unwrap();
        let scores: Value = serde_json::from_slice(&bytes).unwrap();
        scores["suitabilities"][demo]["after"].clone()
    };
    for demo in 0..2 {
        assert_eq!(after("large", demo).as_array().unwrap().len(), 3, "fewer than the four of a small set");
        assert_eq!(after("few", demo), after("large", demo));
    }
}

#[test]
fn what_does_not_fit_the_prior_is_one_error() {
    let scratch = scratch("prior-wrong");
    scratch.succeed("judge set --task point_mass --config tiny.toml --out cloned --judge cloning");
    let long = std::fs::read_to_string(scratch.0.join("tiny.toml"))
        .unwrap()
        .replace("evaluations = 4", "evaluations = 5");
    std::fs::write(scratch.0.join("other.toml"), long).unwrap();
    for (arguments, wanted) in [
        ("judge better.hdf5 --prior nowhere --out x", vec!["this is not a run folder", "nowhere"]),
        (
            "judge better.hdf5 --prior cloned --out x",
            vec!["the run has no prior", "prior.safetensors", "meta-train"],
        ),
        (
            "judge better.hdf5 --prior run --out x --task half_cheetah",
            vec!["the task of its run was point_mass", "half_cheetah"],
        ),
        (
            "judge better.hdf5 --prior run --out x --config other.toml",
            vec!["was 4 in the run of the prior, and is 5 now"],
        ),
        (
            "judge better.hdf5 --prior run --out x --seed 3",
            vec!["seed was 0 in the run of the prior, and is 3 now"],
        ),
        ("judge better.hdf5 --prior run --out x --preset quick", vec!["cannot be used with", "--preset"]),
        ("judge better.hdf5 --task point_mass --out x", vec!["holds 1 demonstration; at least 2"]),
        ("judge missing.hdf5 --prior run --out x", vec!["missing.hdf5"]),
    ] {
        let output = scratch.run(arguments);
        let complaint = String::from_utf8(output.stderr).unwrap().replace('\n', " ");
        assert_eq!(output.status.code(), Some(2), "{arguments}: {complaint}");
        assert!(wanted.iter().all(|part| complaint.contains(part)), "{arguments}: {complaint}");
        assert!(!scratch.0.join("x").exists(), "{arguments} left something");
    }
    // A run that was given a prior goes on with that one only.
    scratch.succeed("judge better.hdf5 --prior run --out new");
    let output = scratch.run("judge --out new --resume");
    let complaint = String::from_utf8(output.stderr).unwrap();
    assert!(
        complaint.contains("the SHA-256 of the prior that it was given was")
            || complaint.contains("at least 2"),
        "{complaint}"
    );
    scratch.succeed("judge --prior run --out new --resume");
}
