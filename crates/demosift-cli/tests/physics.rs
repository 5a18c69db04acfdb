//! The command on real physics: the set of the repository, with tiny budgets.

use crate::support::{Scratch, assert_same_files, in_repository};
use demosift::basics::seed::Seed;
use demosift::data::demonstration::DemonstrationSet;
use demosift::data::demonstration::d4rl::{self, Episode, States};
use demosift::math::rows::Rows;
use demosift::results::recording::Origin;
use demosift::world::environment::{EnvVariant, Environment as _, Task as _};
use demosift_mujoco::registry;

#[test]
fn eight_free_throws_are_sifted_to_the_same_bytes_on_one_thread_and_two() {
    let scratch = Scratch::new("free-throw");
    let set = in_repository("data/free_throw_8");
    for threads in [1, 2] {
        let job = format!("--task free_throw --config tiny.toml --threads {threads} --out run{threads}");
        let said = scratch.succeed(&format!("sift {} {job}", set.display()));
        assert!(said.contains("gain [m]") && said.contains("all 8"), "{said}");
        assert!(said.contains("cloning loss\n") && said.contains("fast power   heuristic\n"), "{said}");
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
    let column = &said["own_heuristic"];
    assert!(said["data_only"].as_array().unwrap().iter().all(|column| column["name"] != "heuristic"));
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
    let said = scratch.succeed(&format!("judge misfit.hdf5 {tiny} --out run")).replace('\n', " ");
    assert!(said.contains("gain [m]") && !said.contains("cloning loss   heuristic"), "{said}");
    let wanted = "own heuristic is not known: demonstration 0: 180 numbers of qpos in 60 steps do not fit";
    assert!(said.contains(wanted), "{said}");
    // The report says so too, and still shows the agent.
    scratch.succeed("report run");
    let page = String::from_utf8(scratch.files("run").remove("report.html").unwrap()).unwrap();
    assert!(page.contains("Demonstrations are not shown: demonstration 0: 180 numbers of qpos"));
    assert!(page.contains("\"part\":\"after\"") && !page.contains("\"part\":\"demonstration\""));
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

/// Equals: all of one stage, no matter which.
#[test]
fn the_null_sets_are_of_one_policy_each() {
    for name in
        ["null_free_throw_low", "null_free_throw_high", "null_martial_arts_middle", "null_martial_arts_high"]
    {
        let set = d4rl::read(&in_repository("data").join(name).join("demonstrations.hdf5")).unwrap();
        assert_eq!((set.len(), set.observation_size(), set.action_size()), (10, 55, 21));
        let provenance =
            std::fs::read(in_repository("data/provenance").join(name).with_extension("json")).unwrap();
        let provenance: serde_json::Value = serde_json::from_slice(&provenance).unwrap();
        let recorded = provenance["demonstrations"].as_array().unwrap();
        assert!(recorded.iter().all(|one| one["updates"] == recorded[0]["updates"]), "{provenance}");
    }
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

    assert!(said.replace('\n', " ").contains("by the mean, which chooses nothing"), "{said}");

    let again = scratch.succeed(&format!("judge {} {tiny} --json --resume --out run", set.display()));
    let again: serde_json::Value = serde_json::from_str(&again).unwrap();
    let provenance = std::fs::read(in_repository("data/provenance/penalty_save_12.json")).unwrap();
    let provenance: serde_json::Value = serde_json::from_slice(&provenance).unwrap();
    let stored = provenance["demonstrations"].as_array().unwrap();
    let own = again["own_heuristic"]["scores"].as_array().unwrap();
    assert_eq!((own.len(), stored.len()), (12, 12));
    for (own, origin) in own.iter().zip(stored) {
        assert!((own.as_f64().unwrap() - origin["score"].as_f64().unwrap()).abs() < 1e-6, "{own} {origin}");
    }
}

/// A run about one of several goals says so wherever it is gone on with, looked at or passed on.
#[test]
fn a_set_is_sifted_for_one_of_the_goals() {
    let scratch = Scratch::new("one-goal");
    let set = in_repository("data/penalty_save_12");
    let tiny = "--task penalty_save --config tiny.toml --set meta_train.rounds=1 --set judge.iterations=1 \
                --set judge.averaged=1 --set inner.batch_steps=120 --set imitate.environment_steps=240";
    let sift = format!("sift {} {tiny} --out run", set.display());
    let said = scratch.succeed(&format!("{sift} --variant high_left"));
    assert!(!said.contains("under each variant"), "{said}");
    for name in ["scores_cloning.json", "scores_paper.json"] {
        let scores = String::from_utf8(scratch.files("run")[name].clone()).unwrap();
        assert!(!scores.contains("\"variant\": 1"), "{scores}");
    }

    scratch.succeed("select --out run --resume");
    scratch.succeed("report run");
    let page = String::from_utf8(scratch.files("run")["report.html"].clone()).unwrap();
    assert!(page.contains("\"variant\":\"high_left\"") && page.contains("\"variants\":[\"high_left\"]"));
    assert!(scratch.succeed("export run --as csv").contains("task penalty_save, variant high_left, seed"));
    assert!(scratch.succeed("export run --as json").contains("\"variant\": \"high_left\""));

    let play = "play --task penalty_save --policy run/policy_best.safetensors --json";
    assert_eq!(scratch.succeed(play), scratch.succeed(&format!("{play} --variant high_left")));
    assert_ne!(scratch.succeed(play), scratch.succeed(&format!("{play} --variant low_left")));

    let refused = |variant: &str| {
        let out = scratch.run(&format!("{sift} --resume --variant {variant}"));
        assert_eq!(out.status.code(), Some(2));
        String::from_utf8(out.stderr).unwrap()
    };
    let (refused, unknown) = (refused("over"), refused("up"));
    let elsewhere = scratch.run("select --task handstand --out run --resume");
    let elsewhere = String::from_utf8(elsewhere.stderr).unwrap();
    assert!(elsewhere.contains("the task was penalty_save there, and is handstand now"), "{elsewhere}");
    assert!(refused.contains("the variant was high_left there, and is over now"), "{refused}");
    assert!(unknown.contains("'up'") && unknown.contains("has: low_left, low_right, high_left"), "{unknown}");
}

/// Eq. 9 is taken per goal: each has its own ranking, subset, referee and report, from what was judged for all together.
#[test]
fn a_set_of_several_goals_is_sifted_for_each_of_them() {
    let scratch = Scratch::new("all-goals");
    let set = in_repository("data/penalty_save_12");
    let tiny = "--task penalty_save --config tiny.toml --set meta_train.rounds=1 --set judge.iterations=1 \
                --set judge.averaged=1 --set inner.batch_steps=120 --referee cloning=3 --set imitate.cloning_updates=2 \
                --set imitate.evaluations=2 --set judge.repeats=1 --set cloning_judge.judging.most_repeats=2";
    let sift = format!("sift {} {tiny} --out run", set.display());
    let planned = scratch.succeed(&format!("{sift} --dry-run"));
    assert!(
        planned.contains("final policies, several each") && planned.contains("Nothing was written"),
        "{planned}"
    );
    assert!(!scratch.0.join("run").exists());
    let said = scratch.succeed(&sift);
    assert!(said.contains("under each variant"), "{said}");
    for goal in ["low_left", "low_right", "high_left", "high_right", "over"] {
        assert!(said.contains(&format!("Goal {goal}")), "{said}");
        let files = scratch.files(&format!("run/{goal}"));
        for name in ["ranking.json", "subset.json", "verdict.json", "policy_best.onnx", "report.html"] {
            assert!(files.contains_key(name), "{goal}: {name}");
        }
        let scores = String::from_utf8(files["scores_cloning.json"].clone()).unwrap();
        assert!(!scores.contains("\"variant\": 1"), "{scores}");
    }
    assert!(!scratch.files("run").contains_key("ranking.json"), "no order is that of all goals");
    let whole = scratch.run("export run --as csv");
    assert_eq!(whole.status.code(), Some(2));
    assert!(
        String::from_utf8(whole.stderr).unwrap().contains("several goals; give the folder of one of them")
    );
    scratch.refuse(
        "export run --as onnx --out models",
        &["several goals; give the folder of one of them", "run/"],
    );
    scratch.succeed("export run/over --as onnx --out models");
    let page = String::from_utf8(scratch.files("run")["report.html"].clone()).unwrap();
    assert!(page.contains("{\"name\":\"over\",\"page\":\"./over/report.html\"}"), "a link to each goal");
    // A goal is a run like any other, and the whole goes on as it was.
    assert!(scratch.succeed("export run/over --as csv").contains("task penalty_save, variant over, seed"));
    scratch.succeed("report run/over");
    let again = scratch.succeed("sift --out run --resume --json");
    let again: serde_json::Value = serde_json::from_str(&again).unwrap();
    assert_eq!(again["goals"].as_object().unwrap().len(), 5);
    assert_eq!(again["goals"]["over"]["kept"].as_array().unwrap().len(), 3);
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
    assert!(scratch.files("run").contains_key("scores_cloning.json"));
    assert!(scratch.files("run").contains_key("scores_paper.json"));
}

/// A set of free throws with where each came from.
fn throws(name: &str) -> (DemonstrationSet, Vec<Origin>) {
    let set = d4rl::read(&in_repository(&format!("data/{name}/demonstrations.hdf5"))).unwrap();
    let provenance = std::fs::read(in_repository(&format!("data/provenance/{name}.json"))).unwrap();
    let provenance: serde_json::Value = serde_json::from_slice(&provenance).unwrap();
    let origins = serde_json::from_value(provenance["demonstrations"].clone()).unwrap();
    (set, origins)
}

/// The simulator's states of a set: one row of positions, one of velocities, for each of its steps.
fn states(name: &str) -> [Vec<f64>; 2] {
    let file = hdf5_pure::File::open(in_repository(&format!("data/{name}/demonstrations.hdf5"))).unwrap();
    ["infos/qpos", "infos/qvel"].map(|table| file.dataset(table).unwrap().read_f64().unwrap())
}

/// A change of a thrower's model makes the recorded sets wrong; this test says so.
#[test]
fn each_recorded_throw_plays_again_to_the_bit_in_the_body_that_threw_it() {
    for name in ["free_throw_8", "free_throw_20"] {
        let (set, origins) = throws(name);
        let [qpos, qvel] = states(name);
        for ((id, throw), origin) in set.iter().zip(&origins) {
            let task = registry::load(&origin.task).unwrap();
            let mut environment = task.mujoco_environment().unwrap();
            let (mut observation, mut measurements) = ([0.0; 55], [0.0; 8]);
            for step in 0..throw.steps() {
                let row = id.0 * throw.steps() + step;
                let recorded = (&qpos[row * 28..][..28], &qvel[row * 27..][..27]);
                if step == 0 {
                    environment.set_state(recorded.0, recorded.1).unwrap();
                }
                assert_eq!((environment.qpos(), environment.qvel()), recorded, "{name} {id} at step {step}");
                environment.step(throw.actions().row(step), &mut observation, &mut measurements);
            }
        }
    }
}

/// The same throw, from other starts and in whatever body.
fn scores(task: &str, actions: &Rows, starts: usize) -> usize {
    let task = registry::load(task).unwrap();
    let mut environment = task.mujoco_environment().unwrap();
    let width = task.specification().measurements.len();
    let scored = |start: &usize| {
        let (mut observation, mut now) = ([0.0; 55], vec![0.0; width]);
        environment.reset(EnvVariant(0), Seed::new(*start as u64), &mut observation, &mut now);
        let mut measurements = Rows::with_capacity(width, actions.len() + 1);
        measurements.push(&now);
        for action in actions.iter() {
            environment.step(action, &mut observation, &mut now);
            measurements.push(&now);
        }
        task.succeeded(&measurements).unwrap()
    };
    (0..starts).filter(scored).count()
}

/// What makes the taller thrower a guest: no throw that scores for one body is a recipe for the other.
#[test]
fn a_throw_that_scores_for_one_body_seldom_scores_for_the_other() {
    let (set, origins) = throws("free_throw_20");
    let bodies = ["free_throw", "free_throw_taller"];
    // Of ten starts each: how often a body's successful throws score for the body, and for the other one.
    let outcomes = [(bodies[0], bodies[1]), (bodies[1], bodies[0])].map(|(own, other)| {
        let successful = |origin: &Origin| origin.task == own && origin.succeeded == Some(true);
        let throws: Vec<&Rows> = set
            .iter()
            .zip(&origins)
            .filter(|(_, origin)| successful(origin))
            .map(|((_, throw), _)| throw.actions())
            .collect();
        let count = |task: &str| throws.iter().map(|actions| scores(task, actions, 10)).sum::<usize>();
        (throws.len(), count(own), count(other))
    });
    let [(throws, in_own, in_taller), (taller_throws, in_taller_own, in_shorter)] = outcomes;
    assert!(throws >= 2 && taller_throws == 6, "{outcomes:?}");
    assert!(in_own > 5 * throws && in_taller_own > 5 * taller_throws, "{outcomes:?}");
    // The taller thrower is too weak for what the other one does.
    assert_eq!(in_taller, 0, "{outcomes:?}");
    // The other way round some go in by luck: the full strength of the one is the full strength of the other.
    assert!(in_shorter < 4 * taller_throws, "{outcomes:?}");
}
