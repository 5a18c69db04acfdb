//! The command as a user runs it, on the point mass with tiny budgets.

use std::io::Read as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::support::{RECORD, Scratch, assert_same_files, write_set};
use demosift::basics::seed::Seed;
use demosift::data::demonstration::d4rl;
use demosift::world::point_mass;
use rustix::process::{Pid, Signal, kill_process};

const TASK: &str = "--task point_mass --config tiny.toml";

#[test]
fn sift_ends_with_a_table_that_puts_good_demonstrations_first() {
    let scratch = Scratch::new("sift");
    let said = scratch.succeed(&format!("sift set {TASK} --set meta_train.rounds=20 --keep 2 --out run"));
    for wanted in [
        "rank   demonstration",
        "gain [m]",
        "90 % interval",
        "P(top 2)",
        "group",
        "kept",
        "mutual information",
        "Spearman",
        "2 kept",
        "all 4",
        "random 2",
        "train on this",
        "final policies, several each",
        "success",
        "Run folder: run",
    ] {
        assert!(said.contains(wanted), "{said}");
    }
    assert!(said.contains("train on "), "{said}");
    let files = scratch.files("run");
    for name in [
        "resolved.toml",
        "run.json",
        "metrics.jsonl",
        "events.out.tfevents.demosift",
        "scores_cloning.json",
        "scores_paper.json",
        "panel.json",
        "ranking.json",
        "uncertainty.json",
        "subset.json",
        "data_only.json",
        "verdict.json",
        "spent_referee.json",
        "policy_best.safetensors",
        "policy_best.onnx",
        "policy_referee_all_cloning_2.safetensors",
        "learning_curve_referee_all_gail_0.json",
        "report.html",
    ] {
        assert!(files.contains_key(name), "{name}");
    }
    assert!(!files.keys().any(|name| name.starts_with("checkpoint")), "{:?}", files.keys());
}

#[test]
fn the_referee_says_what_it_was_asked() {
    let scratch = Scratch::new("referee");
    let said = scratch.succeed(&format!("referee set {TASK} --referee cloning=4 --out run"));
    for wanted in ["policies from", "times", "± 95 %", "by cloning", "Run folder: run"] {
        assert!(said.contains(wanted), "{said}");
    }
    assert!(!said.contains("GAIL") && said.lines().all(|line| line.chars().count() <= 100), "{said}");
    assert_eq!(scratch.succeed("referee --out run --resume"), said);
    let none = scratch.succeed(&format!("sift set {TASK} --referee none --out none"));
    assert!(none.contains("No policy was trained"), "{none}");
    assert!(!scratch.files("none").keys().any(|name| name.starts_with("policy_")));
    scratch.succeed(&format!("sift set {TASK} --keep 4 --out all"));
    assert!(scratch.files("all").contains_key("policy_best.onnx"));
    let once = scratch.succeed("imitate --out run --resume").replace('\n', " ");
    assert!(once.contains("That is one training each"), "{once}");
    let free = scratch.succeed("sift --out run --resume --dry-run");
    assert!(free.contains("Nothing is left to do"), "{free}");
}

#[test]
fn one_thread_and_two_give_the_same_bytes() {
    let scratch = Scratch::new("threads");
    for threads in [1, 2] {
        scratch.succeed(&format!("sift set {TASK} --threads {threads} --out run{threads}"));
    }
    assert_same_files(&scratch.files("run1"), &scratch.files("run2"));
}

#[test]
fn one_arrow_after_another_is_the_whole_job() {
    let scratch = Scratch::new("arrows");
    let whole = scratch.succeed(&format!("sift set {TASK} --keep 2 --out whole"));
    scratch.succeed(&format!("meta-train set {TASK} --keep 2 --out steps"));
    for stage in ["judge", "select", "referee"] {
        scratch.succeed(&format!("{stage} --out steps --resume"));
    }
    scratch.succeed("report steps");
    // The prior was learned before the judge by cloning judged, so what was measured stands in another order.
    let unordered = |folder: &str| {
        let mut files = scratch.files(folder);
        files.remove("events.out.tfevents.demosift");
        let metrics = String::from_utf8(files["metrics.jsonl"].clone()).unwrap();
        let mut lines: Vec<&str> = metrics.lines().collect();
        lines.sort_unstable();
        files.insert("metrics.jsonl".to_owned(), lines.join("\n").into_bytes());
        files.remove("measured.json");
        files
    };
    assert_same_files(&unordered("whole"), &unordered("steps"));
    let again = scratch.succeed("sift --out steps --resume");
    let nameless = |said: &str| {
        said.replace("steps/report.html", "")
            .replace("whole/report.html", "")
            .replace("steps\n", "\n")
            .replace("whole\n", "\n")
    };
    assert_eq!(nameless(&again), nameless(&whole));
}

#[test]
fn a_run_that_was_killed_resumes_to_the_identical_result() {
    let scratch = Scratch::new("kill");
    // Long enough that the kill comes between two checkpoints of each stage.
    let job = format!("sift set {TASK} --set meta_train.rounds=30 --set imitate.environment_steps=30000");
    scratch.succeed(&format!("{job} --out whole"));
    for checkpoint in [
        "checkpoint_meta_train.bin",
        "checkpoint_judge_paper.bin",
        "learning_curve_referee_all_cloning_1.json",
    ] {
        kill_after(
            &scratch,
            &format!("{job} --out killed --resume"),
            &scratch.0.join("killed").join(checkpoint),
        );
    }
    scratch.succeed("sift --out killed --resume");
    assert_same_files(&scratch.files("whole"), &scratch.files("killed"));
}

#[test]
fn a_run_that_was_interrupted_says_how_it_goes_on_to_the_identical_result() {
    let scratch = Scratch::new("interrupted");
    let job = format!("sift set {TASK} --set meta_train.rounds=30 --set imitate.environment_steps=30000");
    scratch.succeed(&format!("{job} --out whole"));
    let mut typed = format!("{job} --out stopped");
    for (signal, code, checkpoint) in [
        (Signal::INT, 130, "checkpoint_meta_train.bin"),
        (Signal::TERM, 143, "checkpoint_judge_paper.bin"),
        // Thousands of updates of the other trainings are still to be made.
        (Signal::INT, 130, "learning_curve_referee_random_1_cloning_0.json"),
    ] {
        let mut child = started(&scratch, &typed, &scratch.0.join("stopped").join(checkpoint));
        kill_process(Pid::from_child(&child), signal).unwrap();
        let mut said = String::new();
        child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(code), "{said}");
        assert!(said.starts_with("stopped: what is finished is kept in the run folder stopped\n"), "{said}");
        // What it says to type is what is typed next.
        let command = said.lines().nth(1).unwrap().strip_prefix("hint: go on with: ").unwrap();
        typed = command.strip_prefix(env!("CARGO_BIN_EXE_demosift")).unwrap().to_owned();
        assert!(typed.ends_with(" --out stopped --resume"), "{typed}");
        let files = scratch.files("stopped");
        assert!(!files.keys().any(|name| name.contains("partial")), "{:?}", files.keys());
        assert!(files["metrics.jsonl"].ends_with(b"\n"), "the last line is whole");
    }
    scratch.succeed(&typed);
    assert_same_files(&scratch.files("whole"), &scratch.files("stopped"));
}

/// Runs until the file appears, then kills without warning.
fn kill_after(scratch: &Scratch, arguments: &str, file: &Path) {
    let mut child = started(scratch, arguments, file);
    child.kill().unwrap();
    child.wait().unwrap();
}

/// A run that has come as far as this file.
fn started(scratch: &Scratch, arguments: &str, file: &Path) -> Child {
    let mut child = scratch.command(arguments).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    while !file.exists() {
        assert!(child.try_wait().unwrap().is_none(), "the run ended without {}", file.display());
        assert!(start.elapsed() < Duration::from_secs(120), "{} does not appear", file.display());
        std::thread::sleep(Duration::from_micros(200));
    }
    child
}

#[test]
fn results_as_json() {
    let scratch = Scratch::new("json");
    let said = scratch.succeed(&format!("sift set {TASK} --keep 1 --json --out run"));
    let value: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(value["ranking"].as_array().unwrap().len(), 4);
    assert_eq!(value["kept"].as_array().unwrap().len(), 1);
    let doubts = &value["uncertainty"];
    assert_eq!(doubts["demonstrations"].as_array().unwrap().len(), 4);
    assert_eq!(value["best"]["demonstrations"].as_array().unwrap().len(), 4);
    assert!(value["caveat"].is_null() && doubts["too_narrow"] == false, "two repeats have no caveat");
    let columns = value["data_only"].as_array().unwrap();
    assert!(columns.iter().all(|column| column["scores"].as_array().unwrap().len() == 4));
    let verdict = &value["verdict"];
    let difference = &verdict["difference"];
    assert!(difference["low"].as_f64().unwrap() <= difference["high"].as_f64().unwrap());
    assert!(
        verdict["conclusion"].is_string() && verdict["sentence"].as_str().unwrap().ends_with('.'),
        "{said}"
    );
    let pairs = verdict["pairs"].as_array().unwrap();
    let trainings: Vec<usize> =
        pairs.iter().map(|pair| pair["trainings"].as_array().unwrap().len()).collect();
    let (by_gail, by_cloning) = trainings.split_last_chunk::<2>().map(|(front, last)| (last, front)).unwrap();
    assert_eq!(by_gail, &[1, 1], "the winner and all");
    assert!(by_cloning.len() >= 3 && by_cloning.iter().all(|times| *times == 3), "{trainings:?}");
    let once = scratch.succeed("imitate --out run --resume --json");
    let once: serde_json::Value = serde_json::from_str(&once).unwrap();
    assert!(once["from_subset"]["end"].is_null() && once["gain"]["low"].is_f64(), "{once}");
    let said = scratch.succeed("tasks --json");
    assert!(serde_json::from_str::<Vec<String>>(&said).unwrap().contains(&"point_mass".to_owned()));
}

#[test]
fn keep_auto_says_what_it_went_by_and_one_repeat_what_it_lacks() {
    let scratch = Scratch::new("auto");
    let away = point_mass::planted_set(&[180.0, 170.0, 190.0, 175.0], Seed::new(4)).unwrap();
    write_set(&scratch.0.join("away.hdf5"), &away);
    let job = format!(
        "{TASK} --set cloning_judge.judging.iterations=40 --set cloning_judge.judging.repeats=4 --keep auto"
    );
    // Two of the four drive to the goal; of the others all drive away from it.
    for (set, wanted, other) in [
        ("set", "Kept is what makes the agent better", "Nothing surely helps"),
        ("away.hdf5", "Nothing surely helps", "Kept is what makes the agent better"),
    ] {
        let said = scratch.succeed(&format!("select {set} {job} --judge cloning --out {}", &wanted[..4]));
        assert!(said.lines().all(|line| line.chars().count() <= 100), "{said}");
        let words = said.replace('\n', " ");
        assert!(words.contains(wanted) && !words.contains(other), "{said}");
        assert!(!words.contains("imitated once"), "{said}");
    }
    let once = scratch.succeed(&format!("select set {job} --judge paper --set judge.repeats=1 --out once"));
    assert!(once.replace('\n', " ").contains("imitated once, so what another try would change"), "{once}");
    assert!(once.lines().all(|line| line.chars().count() <= 100), "{once}");
}

#[test]
fn the_oracle_is_compared_with_the_ranking() {
    let scratch = Scratch::new("oracle");
    let alone = scratch.succeed(&format!("oracle set {TASK} --repeats 2 --out run"));
    assert!(alone.contains("no ranking to compare with"), "{alone}");
    scratch.succeed("select --out run --resume");
    let said = scratch.succeed("oracle --out run --resume --repeats 2");
    assert!(said.contains("Spearman's rank correlation with the ranking: "), "{said}");
    let named = scratch.succeed("imitate --out run --resume --demonstration-ids 3,1,3");
    assert!(named.contains("demonstrations 1, 3"), "{named}");
}

#[test]
fn the_oracle_tells_every_agreement_and_goes_on_with_more_repeats() {
    let scratch = Scratch::new("oracle-json");
    scratch.succeed(&format!("select set {TASK} --out run"));
    scratch.succeed("oracle --out run --resume --repeats 1");
    let first = scratch.files("run")["learning_curve_oracle_2_0.json"].clone();
    let said = scratch.succeed("oracle --out run --resume --repeats 2 --json");
    assert_eq!(scratch.files("run")["learning_curve_oracle_2_0.json"], first);
    let value: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert!(value["spearman"].is_f64() && value["kendall"].is_f64(), "{said}");
    // Of four demonstrations, 2 is half of them.
    assert_eq!(value["hit_rates"].as_array().unwrap().len(), 1);
    assert_eq!(value["hit_rates"][0]["k"], 2);
    assert!((0.0..=1.0).contains(&value["hit_rates"][0]["rate"].as_f64().unwrap()));
    assert_eq!(value["alone"][3]["scores"].as_array().unwrap().len(), 2);
    let said = scratch.succeed("oracle --out run --resume --repeats 2");
    assert!(said.contains("Kendall's: ") && said.contains("Of the ranking's first 2, among"), "{said}");
}

#[test]
fn the_kept_are_compared_with_random_subsets_and_the_best_alone() {
    let scratch = Scratch::new("oracle-random");
    scratch.succeed(&format!("imitate set {TASK} --out run"));
    let said = scratch.succeed("oracle --out run --resume --repeats 1 --random 2 --json");
    let value: serde_json::Value = serde_json::from_str(&said).unwrap();
    let kept = &value["kept"];
    assert_eq!(kept["random"].as_array().unwrap().len(), 2, "{said}");
    assert!(kept["share_of_best"].is_f64() && kept["against_random"]["beaten"].is_f64(), "{said}");
    let files = scratch.files("run");
    let size = |name: &str| {
        let curve: serde_json::Value = serde_json::from_slice(&files[name]).unwrap();
        curve["demos"].as_array().unwrap().len()
    };
    let of_subset = size("learning_curve_subset.json");
    assert_eq!(size(&format!("learning_curve_random_{of_subset}_1.json")), of_subset);
    let said = scratch.succeed("oracle --out run --resume --repeats 1 --random 2");
    assert!(
        said.contains("of the way from an untrained policy") && said.contains("random subsets"),
        "{said}"
    );
    assert!(said.lines().all(|line| line.chars().count() <= 100), "{said}");
    scratch.succeed(&format!("select set {TASK} --out other"));
    let output = scratch.run("oracle --out other --resume --repeats 1 --random 2");
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("--random compares with") && said.contains("hint: "), "{said}");
}

/// Each method is a run of its own, spends about the same, and says so after a resume as well.
#[test]
fn every_method_judges_on_the_same_budget() {
    let scratch = Scratch::new("methods");
    let mut quotas = Vec::new();
    for method in ["maml", "maml-mi", "avg-fine-tune", "from-scratch"] {
        let job = format!("judge set {TASK} --set mutual_information.batch_steps=60 --out {method}");
        let said = scratch.succeed(&format!("{job} --method {method}"));
        assert!(said.contains(&format!("judging; {method} spent")), "{said}");
        assert!(said.lines().all(|line| line.chars().count() <= 100), "{said}");
        assert_eq!(scratch.succeed(&format!("judge --out {method} --resume")), said);
        let json = scratch.succeed(&format!("judge --out {method} --resume --json"));
        let costs = serde_json::from_str::<serde_json::Value>(&json).unwrap()["costs"].clone();
        assert_eq!(costs["method"], method);
        let (quota, spent) = (costs["quota"].as_u64().unwrap(), costs["spent_of_quota"].as_u64().unwrap());
        assert!(spent <= quota && spent > quota * 3 / 4, "{method}: {spent} of {quota}");
        // Each of the four demonstrations is paid for, and the prior once.
        let [once, each] = ["once", "each"].map(|part| costs["account"][part].as_u64().unwrap());
        assert_eq!(once == 0, method == "from-scratch", "{method}: {once}");
        assert_eq!((spent - once) / 4, each, "{method}: {once} and {each} of {spent}");
        quotas.push(quota);
    }
    assert!(quotas.iter().all(|quota| *quota == quotas[0]), "{quotas:?}");
}

#[test]
fn demonstrations_are_weighed_and_kept_by_weight() {
    let scratch = Scratch::new("weigh");
    let small = "--set subset_selection.rounds=4 --set subset_selection.meta_updates=2";
    let said = scratch.succeed(&format!("weigh set {TASK} {small} --out run"));
    for wanted in ["round 1", "demonstration", "kept", "It ended after", "weighing"] {
        assert!(said.contains(wanted), "{said}");
    }
    assert_eq!(scratch.succeed("weigh --out run --resume"), said);
    let whole = scratch.succeed(&format!("sift set {TASK} {small} --keep weights --out sifted"));
    assert!(whole.contains("when the demonstrations were weighed"), "{whole}");
    assert!(whole.lines().all(|line| line.chars().count() <= 100), "{whole}");
    let (weighed, sifted) = (scratch.files("run"), scratch.files("sifted"));
    assert_eq!(weighed["weights.json"], sifted["weights.json"]);
    let kept = |files: &std::collections::BTreeMap<String, Vec<u8>>, name: &str| {
        serde_json::from_slice::<serde_json::Value>(&files[name]).unwrap()["demos"].clone()
    };
    assert_eq!(kept(&sifted, "weights.json"), kept(&sifted, "subset.json"));
    let json = scratch.succeed("select --out sifted --resume --json");
    let value: serde_json::Value = serde_json::from_str(&json).unwrap();
    let rounds = value["weighing"]["rounds"].as_array().unwrap();
    assert_eq!(rounds[0]["weights"].as_array().unwrap().len(), 4);
}

#[test]
fn a_recording_is_a_set_and_resumes() {
    let scratch = Scratch::new("record");
    let record = crate::support::RECORD;
    let said = scratch.succeed(&format!("{record} --out recorded"));
    assert!(said.contains("The demonstrator was done after"), "{said}");
    let again = scratch.succeed("record --out recorded --resume");
    assert_eq!(again, said);
    scratch.succeed(&format!("{record} --out twice"));
    assert_same_files(&scratch.files("recorded"), &scratch.files("twice"));
    scratch.succeed(&format!("judge recorded {TASK} --out run"));
}

#[test]
fn a_training_that_was_killed_resumes_to_the_identical_recording() {
    let scratch = Scratch::new("kill-record");
    let job = format!("{} --unseen 2 --set demonstrator.enough_success=2.0", crate::support::RECORD);
    let job = format!("{job} --set demonstrator.updates=60 --set demonstrator.trust_region.max_kl=0.001");
    scratch.succeed(&format!("{job} --out whole"));
    kill_after(
        &scratch,
        &format!("{job} --out killed"),
        &scratch.0.join("killed/checkpoint_demonstrator.bin"),
    );
    scratch.succeed("record --out killed --resume");
    assert_same_files(&scratch.files("whole"), &scratch.files("killed"));
}

#[test]
fn other_sets_come_from_one_training() {
    let scratch = Scratch::new("demonstrator");
    scratch.succeed(&format!("{} --unseen 3 --out trained", crate::support::RECORD));
    // The same set, if the same is asked for.
    scratch.succeed("record --demonstrator trained --count 3 --unseen 3 --out again");
    let (trained, again) = (scratch.files("trained"), scratch.files("again"));
    for name in ["demonstrations.hdf5", "unseen.hdf5", "provenance.json", "unseen_provenance.json"] {
        assert!(trained[name] == again[name], "{name} differs");
    }
    // More demonstrations than stages, and others with another seed.
    scratch.succeed("record --demonstrator trained --count 40 --unseen 20 --seed 2 --out many --threads 1");
    scratch.succeed("record --demonstrator trained --count 40 --unseen 20 --seed 2 --out twice --threads 2");
    assert_same_files(&scratch.files("many"), &scratch.files("twice"));
    let said = scratch.succeed("record --out many --resume");
    assert!(said.contains("In 100 episodes after that it succeeds in "), "{said}");
    let read = |path: &str| d4rl::read(&scratch.0.join(path)).unwrap();
    let sets =
        [read("trained/demonstrations.hdf5"), read("many/demonstrations.hdf5"), read("many/unseen.hdf5")];
    assert_eq!(sets.each_ref().map(|set| set.len()), [3, 40, 20]);
    let all: Vec<_> = sets.iter().flat_map(|set| set.iter().map(|(_, one)| one.actions().flat())).collect();
    assert!((0..all.len()).all(|one| (0..one).all(|other| all[one] != all[other])), "an episode comes twice");
    // Equals: other episodes, all of one stage.
    scratch.succeed("record --demonstrator trained --count 4 --stage 1 --out equals");
    let provenance: serde_json::Value =
        serde_json::from_slice(&scratch.files("equals")["provenance.json"]).unwrap();
    let recorded = provenance["demonstrations"].as_array().unwrap();
    let (stage, scores): (Vec<_>, Vec<_>) =
        recorded.iter().map(|one| (&one["updates"], one["score"].as_f64().unwrap())).unzip();
    assert!(stage.iter().all(|updates| *updates == stage[0]), "{provenance}");
    assert!((0..4).all(|one| (0..one).all(|other| scores[one] != scores[other])), "{provenance}");
    scratch.succeed(&format!("judge many {TASK} --set judge.repeats=1 --out run"));
}

#[test]
fn a_guest_brings_demonstrations_at_which_it_succeeds() {
    let scratch = Scratch::new("guest");
    scratch.succeed(&format!("{} --out own", crate::support::RECORD));
    scratch.succeed(&format!("{} --seed 5 --out other", crate::support::RECORD));
    let said =
        scratch.succeed("record --demonstrator own --guest other=4 --count 10 --seed 1 --json --out mixed");
    let value: serde_json::Value = serde_json::from_str(&said).unwrap();
    let own: serde_json::Value = serde_json::from_slice(&scratch.files("own")["provenance.json"]).unwrap();
    let guest = &value["provenance"]["guests"][0];
    assert_eq!(value["provenance"]["updates"], own["updates"]);
    assert_eq!(guest["final"]["episodes"], 100);
    assert!(guest["final"]["success"].as_f64().unwrap() > 0.3, "{guest}");
    let set = d4rl::read(&scratch.0.join("mixed/demonstrations.hdf5")).unwrap();
    assert_eq!((set.len(), value["provenance"]["demonstrations"].as_array().unwrap().len()), (10, 10));
}

#[test]
fn a_dry_run_counts_what_is_then_played_and_touches_nothing() {
    let scratch = Scratch::new("dry");
    let json =
        |arguments: &str| -> serde_json::Value { serde_json::from_str(&scratch.succeed(arguments)).unwrap() };
    let steps = |said: &serde_json::Value| -> Vec<(String, u64)> {
        let stages = said["stages"].as_array().unwrap().iter();
        stages
            .map(|stage| {
                (stage["stage"].as_str().unwrap().to_owned(), stage["environment_steps"].as_u64().unwrap())
            })
            .collect()
    };
    // A race would play less than is counted.
    let job = format!("set {TASK} --keep 2 --set cloning_judge.judging.most_repeats=0 --out run");
    let whole = json(&format!("sift {job} --dry-run --json"));
    assert!(!scratch.0.join("run").exists());
    assert!(whole["minutes"].as_f64().unwrap() > 0.0 && whole["dry_run"] == true, "{whole}");
    let said = scratch.succeed(&format!("sift {job} --dry-run"));
    assert!(said.contains("learning to imitate") && said.contains("Nothing was written."), "{said}");

    scratch.succeed(&format!("judge {job}"));
    let before = scratch.files("run");
    let rest = json("sift --out run --resume --dry-run --json");
    assert_eq!(steps(&rest), &steps(&whole)[3..], "what is judged is not judged again");
    let named = json("imitate --out run --resume --demonstration-ids 1,0 --dry-run --json");
    assert_eq!(steps(&named)[0].0, "imitate_demonstrations_0_1");
    let alone = json("oracle --out run --resume --repeats 2 --dry-run --json");
    assert_eq!(steps(&alone)[0].1, 8 * steps(&named)[0].1);
    assert_same_files(&before, &scratch.files("run"));

    scratch.succeed("sift --out run --resume");
    let costs = &json("sift --out run --resume --json")["costs"]["environment_steps"];
    for (stage, steps) in steps(&whole) {
        // Judges that keep the same have one candidate.
        let played = costs[&stage].as_u64().unwrap();
        assert!(played == steps || stage == "referee" && (1..steps).contains(&played), "{stage}: {costs}");
    }
    let done = scratch.succeed("sift --out run --resume --dry-run");
    assert!(done.starts_with("Nothing is left to do"), "{done}");
}

#[test]
fn a_dry_run_of_a_recording() {
    let scratch = Scratch::new("dry-record");
    let said = scratch.succeed(&format!("{RECORD} --out made --dry-run"));
    assert!(said.contains("training the demonstrator *") && said.contains("* may end earlier"), "{said}");
    assert!(!scratch.0.join("made").exists());
    scratch.succeed(&format!("{RECORD} --out made"));
    let done = scratch.succeed(&format!("{RECORD} --out made --resume --dry-run"));
    assert!(done.starts_with("Nothing is left to do"), "{done}");
    let again = scratch.succeed("record --demonstrator made --count 3 --out more --dry-run --json");
    let value: serde_json::Value = serde_json::from_str(&again).unwrap();
    assert_eq!(value["stages"].as_array().unwrap().len(), 1, "{again}");
    assert_eq!(value["stages"][0]["stage"], "record");
}

#[test]
fn a_shell_accepts_its_completions() {
    let scratch = Scratch::new("completions");
    for shell in ["bash", "zsh", "fish"] {
        let script = scratch.succeed(&format!("completions {shell}"));
        assert!(script.contains("meta-train") && script.contains("dry-run"), "{shell}");
        std::fs::write(scratch.0.join(shell), script).unwrap();
        match Command::new(shell).arg("-n").arg(scratch.0.join(shell)).output() {
            Ok(read) => assert!(read.status.success(), "{}", String::from_utf8_lossy(&read.stderr)),
            Err(_) => eprintln!("skipped: there is no {shell}"),
        }
    }
}

#[test]
fn every_subcommand_has_examples() {
    let scratch = Scratch::new("help");
    let mut calls = vec![String::new()];
    let mut seen = 0;
    while let Some(call) = calls.pop() {
        let help = scratch.succeed(&format!("{call} --help"));
        let listed = help.lines().skip_while(|line| *line != "Commands:").skip(1);
        let names =
            listed.take_while(|line| !line.is_empty()).filter_map(|line| line.split_whitespace().next());
        let inner: Vec<String> =
            names.filter(|name| *name != "help").map(|name| format!("{call} {name}")).collect();
        if inner.is_empty() {
            let example = format!("demosift{call}");
            assert!(help.contains("Examples:") && help.contains(&example), "{call}: {help}");
            seen += 1;
        }
        calls.extend(inner);
    }
    assert!(seen > 14, "{seen}");
}

/// As `demosift tasks | head -1` does.
#[test]
fn a_reader_that_has_seen_enough_is_no_error() {
    let scratch = Scratch::new("head");
    for arguments in ["tasks", "--help", "inspect set", "completions bash"] {
        let mut child =
            scratch.command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert!(output.stderr.is_empty(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(output.status.code(), Some(0), "{arguments}");
    }
}
