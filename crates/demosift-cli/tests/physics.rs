//! The command on real physics: the set that the repository carries, with tiny budgets.

#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod support;

use demosift::demonstration::d4rl::{self, Episode, States};
use support::{Scratch, assert_same_files, in_repository};

#[test]
fn eight_free_throws_are_sifted_to_the_same_bytes_on_one_thread_and_two() {
    let scratch = Scratch::new("free-throw");
    let set = in_repository("data/free_throw_8");
    for threads in [1, 2] {
        let job = format!("--task free_throw --config tiny.toml --threads {threads} --out run{threads}");
        let said = scratch.succeed(&format!("sift {} {job}", set.display()));
        assert!(said.contains("gain [m]") && said.contains("all 8"), "{said}");
        assert!(said.contains("cloning loss   heuristic\n"), "{said}");
    }
    assert_same_files(&scratch.files("run1"), &scratch.files("run2"));
}

/// The provenance was written when the set was recorded, by other code than that which replays it.
#[test]
fn beside_the_ranking_stands_what_each_demonstration_scored_when_it_was_recorded() {
    let scratch = Scratch::new("own");
    let set = in_repository("data/free_throw_8");
    let tiny = "--task free_throw --config tiny.toml --set meta_train.rounds=1 --set judge.iterations=1";
    let said = scratch.succeed(&format!("judge {} {tiny} --json --out run", set.display()));
    let said: serde_json::Value = serde_json::from_str(&said).unwrap();
    let provenance = std::fs::read(in_repository("data/provenance/free_throw_8.json")).unwrap();
    let provenance: serde_json::Value = serde_json::from_slice(&provenance).unwrap();
    let stored = provenance["demonstrations"].as_array().unwrap();
    let stored: Vec<f64> = stored.iter().map(|origin| origin["score"].as_f64().unwrap()).collect();
    let columns = said["data_only"].as_array().unwrap();
    let column = columns.iter().find(|column| column["name"] == "heuristic").unwrap();
    let own: Vec<f64> =
        column["scores"].as_array().unwrap().iter().map(|own| own.as_f64().unwrap()).collect();
    assert_eq!(own.len(), 8);
    assert!(own.iter().zip(&stored).all(|(own, stored)| (own - stored).abs() < 1e-6), "{own:?} {stored:?}");
    let agreement = column["spearman"].as_f64().unwrap();
    assert!((-1.0..=1.0).contains(&agreement), "{agreement}");
    // Nothing of it is kept where a judge that resumes could find it.
    let kept = scratch.files("run");
    assert!(
        kept.values().all(|bytes| !String::from_utf8_lossy(bytes).contains("heuristic of the recorded")),
        "{:?}",
        kept.keys()
    );
}

#[test]
fn states_that_do_not_fit_the_task_cost_the_column_and_not_the_ranking() {
    let scratch = Scratch::new("misfit");
    let set = d4rl::read(&in_repository("data/free_throw_8/demonstrations.hdf5")).unwrap();
    let states = [[0.0; 60 * 3], [0.5; 60 * 3]];
    let episodes: Vec<Episode<'_>> = set
        .iter()
        .zip(&states)
        .map(|((_, demonstration), states)| Episode {
            observations: demonstration.observations(),
            actions: demonstration.actions(),
            states: Some(States { qpos: states, qvel: states }),
            terminated: false,
        })
        .collect();
    d4rl::write(&scratch.0.join("misfit.hdf5"), &episodes).unwrap();
    let tiny = "--task free_throw --config tiny.toml --set meta_train.rounds=1 --set judge.iterations=1";
    let said = scratch.succeed(&format!("judge misfit.hdf5 {tiny} --out run"));
    assert!(said.contains("gain [m]") && !said.contains("cloning loss   heuristic"), "{said}");
    let wanted = "own heuristic is not known: demonstration 0: 180 numbers of qpos in 60 steps do not fit";
    assert!(said.contains(wanted), "{said}");
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

/// Twelve demonstrations under five shots, each told by name, and each demonstration as good as when it was recorded.
#[test]
fn penalties_are_judged_under_every_shot() {
    let scratch = Scratch::new("penalties");
    let set = in_repository("data/penalty_save_12");
    let tiny = "--task penalty_save --config tiny.toml --set meta_train.rounds=1 --set judge.iterations=1 \
                --set judge.averaged=1 --set inner.batch_steps=120";
    let said = scratch.succeed(&format!("judge {} {tiny} --out run", set.display()));
    assert!(said.contains("The gain [m] under each variant"), "{said}");
    assert!(
        ["low_left", "low_right", "high_left", "high_right", "over"].iter().all(|shot| said.contains(shot))
    );
    let table = said.split("marked with *:").nth(1).unwrap();
    assert_eq!(table.matches('*').count(), 5, "one best demonstration a shot: {said}");

    let again = scratch.succeed(&format!("judge {} {tiny} --json --resume --out run", set.display()));
    let again: serde_json::Value = serde_json::from_str(&again).unwrap();
    let provenance = std::fs::read(in_repository("data/provenance/penalty_save_12.json")).unwrap();
    let provenance: serde_json::Value = serde_json::from_slice(&provenance).unwrap();
    let stored = provenance["demonstrations"].as_array().unwrap();
    let columns = again["data_only"].as_array().unwrap();
    let own =
        columns.iter().find(|column| column["name"] == "heuristic").unwrap()["scores"].as_array().unwrap();
    assert_eq!((own.len(), stored.len()), (12, 12));
    for (own, origin) in own.iter().zip(stored) {
        assert!((own.as_f64().unwrap() - origin["score"].as_f64().unwrap()).abs() < 1e-6, "{own} {origin}");
    }
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
    assert!(
        said.contains("gain [m]") && !said.contains("loss   heuristic"),
        "the file holds no states: {said}"
    );
    assert!(scratch.files("run").contains_key("scores.json"));
}
