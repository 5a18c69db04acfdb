//! Each mistake of a user gets one clear error, exit code 2, and leaves nothing half-written.

use crate::support::Scratch;
use demosift::data::demonstration::d4rl::{self, Episode};
use demosift::data::observation_filter::ObservationFilter;
use demosift::math::rows::Rows;
use demosift::results::artifact;
use demosift::world::policy::{Policy, PolicyShape};
use hdf5_pure::FileBuilder;

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
    let complaint = scratch.refuse(arguments, wanted);
    assert!(complaint.starts_with("error: "), "{complaint}");
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
    let takes = "--observation-columns takes them, such as observations[0:4]";
    let wanted = ["5 numbers in an observation", "'point_mass' has 4", "bad.hdf5", takes];
    refuses(&scratch, &format!("sift bad.hdf5 {TASK}"), &wanted);
    write_shapes(&scratch, &[6, 4], &[6, 3]);
    let wanted = ["3 numbers in an action", "'point_mass' has 2", "bad.hdf5"];
    refuses(&scratch, &format!("judge bad.hdf5 {TASK}"), &wanted);
}

#[test]
fn a_dry_run_meets_the_same_mistakes() {
    let scratch = Scratch::new("dry-mistakes");
    write_shapes(&scratch, &[6, 5], &[6, 2]);
    let wanted = ["5 numbers in an observation", "'point_mass' has 4", "bad.hdf5"];
    refuses(&scratch, &format!("sift bad.hdf5 {TASK} --dry-run"), &wanted);
    refuses(&scratch, &format!("judge set {TASK} --dry-run --set judge.repeats=0"), &["judge.repeats = 0"]);
    refuses(&scratch, &format!("oracle set {TASK} --dry-run --random 2"), &["--random compares with"]);
    refuses(&scratch, &format!("imitate set {TASK} --dry-run --demonstration-ids 9"), &["9", "0 to 3"]);
    refuses(&scratch, &format!("weigh set {TASK} --dry-run --method from-scratch"), &["from-scratch"]);
    refuses(&scratch, "record --task point_mass --out run --dry-run --count 1", &["--count 1", "at least 2"]);
    scratch.succeed(&format!("judge set {TASK}"));
    refuses(&scratch, &format!("judge set {TASK} --dry-run"), &["holds a run already", "--resume"]);
    let other = format!("judge set {TASK} --dry-run --resume --seed 7");
    refuses(&scratch, &other, &["seed was 0 there, and is 7 now"]);
}

#[test]
fn folders_that_are_taken_for_others() {
    let scratch = Scratch::new("folders");
    scratch.succeed(&format!("judge set {TASK}"));
    let wanted =
        ["a run folder", "holds no demonstrations", "hint: to go on with the run: --out run --resume"];
    complaint(&scratch, "sift run --task point_mass --out other", &wanted);
    complaint(&scratch, "report set", &["not a run folder", "run.json", "\nhint: "]);
    complaint(&scratch, "report nothing", &["not a run folder", "nothing", "\nhint: "]);
    complaint(&scratch, "judge --resume", &["which run is to go on", "\nhint: add --out DIR"]);
}

#[test]
fn a_budget_that_pays_for_nothing() {
    let scratch = Scratch::new("budget");
    let job = format!("judge set {TASK} --method maml-mi");
    let wanted = ["meta_train.rounds = 1 ", "maml-mi", "must be at least "];
    let said = complaint(&scratch, &format!("{job} --set meta_train.rounds=1"), &wanted);
    let enough = said.split("must be at least ").nth(1).unwrap().trim();
    scratch.succeed(&format!("{job} --set meta_train.rounds={enough}"));
}

/// What learns no prior asks for no budget that would pay for one.
#[test]
fn a_budget_that_nobody_spends() {
    let scratch = Scratch::new("unspent");
    let task = TASK.replace("--out run", "");
    let job = format!("set {task} --method maml-mi --set meta_train.rounds=1");
    let wanted = ["meta_train.rounds = 1 ", "must be at least "];
    complaint(&scratch, &format!("imitate {job} --out kept"), &wanted);
    scratch.succeed(&format!("imitate {job} --out named --demonstration-ids 1"));
    // A prior that is kept has been learned, whatever today's budget would pay for.
    scratch.succeed(&format!("judge set {task} --method maml-mi --set meta_train.rounds=30 --out kept"));
    for name in ["named/run.json", "kept/prior.safetensors"] {
        assert!(scratch.0.join(name).exists(), "{name}");
    }
    std::fs::copy(scratch.0.join("kept/prior.safetensors"), scratch.0.join("named/prior.safetensors"))
        .unwrap();
    scratch.succeed(&format!("select {job} --out named --resume"));
    scratch.succeed("report named");
}

#[test]
fn one_episode_is_enough_to_convert() {
    let scratch = Scratch::new("one");
    let observations = Rows::from_flat(vec![0.5; 24], 4).unwrap();
    let actions = Rows::from_flat(vec![0.0; 12], 2).unwrap();
    let episode = Episode { observations: &observations, actions: &actions, states: None, terminated: false };
    d4rl::write(&scratch.0.join("one.hdf5"), &[episode]).unwrap();
    let said = scratch.succeed("convert one.hdf5 --to minari one_minari");
    // D4RL has no observation after the last action, so that one is not written.
    assert!(said.starts_with("1 episode of 5 steps"), "{said}");
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
        &["'tennis'", "point_mass, free_throw, ", "half_cheetah", "\nhint: "],
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
    refuses(
        &scratch,
        &format!("sift set {TASK} --keep most"),
        &["most", "auto, weights, quarter, or a number"],
    );
    refuses(&scratch, &format!("sift set {TASK} --keep 5"), &["--keep 5", "from 1 to the 4"]);
    refuses(&scratch, &format!("sift set {TASK} --set keep=5"), &["keep = 5", "from 1 to the 4"]);
    let five = format!("sift set {TASK} --set subset_selection.smallest=5");
    refuses(&scratch, &five, &["subset_selection.smallest = 5", "at most the 4"]);
    let other = "--task point_mass set --method from-scratch";
    refuses(&scratch, &format!("weigh {other}"), &["method = from-scratch", "maml or maml-mi"]);
    refuses(&scratch, &format!("sift {other} --keep weights"), &["method = from-scratch", "maml or maml-mi"]);
    refuses(&scratch, &format!("sift set {TASK} --set method=maml2"), &["maml2", "avg-fine-tune"]);
    refuses(
        &scratch,
        &format!("imitate set {TASK} --demonstration-ids 1,4"),
        &["--demonstration-ids 4", "0 to 3"],
    );
    refuses(&scratch, &format!("oracle set {TASK} --repeats 0"), &["--repeats 0", "at least 1"]);
    refuses(&scratch, "record --task point_mass --out run --count 1", &["--count 1", "at least 2"]);
    refuses(&scratch, "record --task point_mass --out run --unseen 1", &["--unseen 1", "at least 2"]);
    refuses(
        &scratch,
        "record --task point_mass --out run --stage 1.5",
        &["--stage 1.5", "from 0, the worst"],
    );
    refuses(
        &scratch,
        "record --task point_mass --out run --stage nan",
        &["--stage NaN", "from 0, the worst"],
    );
    refuses(&scratch, "record --task point_mass --out run --stage 0.5 --unseen 2", &["--stage", "--unseen"]);
}

#[test]
fn demonstrators_that_are_none_or_do_not_fit() {
    let scratch = Scratch::new("demonstrators");
    scratch.succeed(&format!("{} --out trained", crate::support::RECORD));
    scratch.succeed("record --demonstrator trained --out recorded");
    let record = "record --task point_mass --out run";
    refuses(&scratch, &format!("{record} --demonstrator none"), &["no such run folder", "none"]);
    refuses(
        &scratch,
        &format!("{record} --demonstrator set"),
        &["not a run folder: it has no run.json", "set"],
    );
    let wanted = ["has no stages.bin", "recorded", "\nhint: "];
    refuses(&scratch, &format!("{record} --demonstrator recorded"), &wanted);
    let wanted = ["--set demonstrator.", "would change nothing", "\nhint: "];
    refuses(&scratch, &format!("{record} --demonstrator trained --set demonstrator.updates=3"), &wanted);
    let wanted = ["trained on the task point_mass", "is of free_throw", "\nhint: "];
    refuses(&scratch, "record --task free_throw --demonstrator trained --out run", &wanted);
    for guest in ["trained", "trained=0", "trained=six"] {
        let wanted = [&*format!("--guest {guest}: "), "wanted DIR=N", "\nhint: "];
        refuses(&scratch, &format!("{record} --guest {guest}"), &wanted);
    }
    refuses(&scratch, &format!("{record} --guest none=2"), &["no such run folder", "none"]);
    let wanted = ["8 of the 8 demonstrations are by guests", "at least 1 must be", "\nhint: "];
    refuses(&scratch, &format!("{record} --guest trained=8"), &wanted);
    let wanted = ["'point_mass' has 4 numbers in an observation", "'free_throw' has 55"];
    refuses(&scratch, "record --task free_throw --guest trained=2 --out run", &wanted);
    refuses(&scratch, &format!("{record} --preset quick"), &["--preset"]);

    let whole = std::fs::read(scratch.0.join("trained/stages.bin")).unwrap();
    std::fs::write(scratch.0.join("trained/stages.bin"), &whole[..whole.len() / 2]).unwrap();
    refuses(
        &scratch,
        &format!("{record} --demonstrator trained"),
        &["stages.bin is not as it was written", "trained"],
    );
    std::fs::write(scratch.0.join("trained/stages.bin"), [9, 0, 0, 0]).unwrap();
    refuses(&scratch, &format!("{record} --demonstrator trained"), &["stages.bin has format version 9"]);

    // A demonstrator that has changed since the recording began.
    std::fs::remove_file(scratch.0.join("recorded/provenance.json")).unwrap();
    complaint(&scratch, "record --out recorded --resume", &["not the one that this recording began with"]);
}

#[test]
fn a_guest_that_never_succeeds() {
    let scratch = Scratch::new("hopeless-guest");
    scratch.succeed(&format!("{} --set demonstrator.updates=0 --out hopeless", crate::support::RECORD));
    let wanted = ["at least 50 %", "this one reaches 0 %", "hopeless"];
    refuses(&scratch, "record --task point_mass --guest hopeless=2 --out run", &wanted);
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
        ("--method avg-fine-tune", ["method was \"maml\"", "is \"avg-fine-tune\""]),
        ("--keep 3 --set imitate.evaluations=5", ["imitate.evaluations was 4", "is 5"]),
        ("--preset paper", ["cloning_judge.judging.averaged was 2", "is 10"]),
        ("--judge paper", ["judges was \"both\"", "is \"paper\""]),
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
    let set =
        demosift::world::point_mass::planted_set(&[0.0, 90.0], demosift::basics::seed::Seed::new(4)).unwrap();
    crate::support::write_set(&scratch.0.join("other.hdf5"), &set);
    refuses(&scratch, &format!("judge other.hdf5 {TASK} --resume"), &["SHA-256 of the demonstrations was"]);
    crate::support::assert_same_files(&before, &scratch.files("run"));

    crate::support::rewritten(&scratch.0.join("run/run.json"), |run| run["demosift"] = "0.0.1".into());
    refuses(&scratch, "judge --out run --resume", &["the version of demosift was 0.0.1"]);
    std::fs::write(scratch.0.join("run/run.json"), "{").unwrap();
    refuses(&scratch, "judge --out run --resume", &["not the file of a run", "run.json"]);
}

#[test]
fn a_referee_that_is_none() {
    let scratch = Scratch::new("referee-words");
    for (typed, wanted) in [
        (
            "--referee ten",
            "referee = ten, and must be none, or numbers of trainings such as cloning=10,gail=3",
        ),
        ("--referee cloning=3,trpo=2", "such as cloning=10,gail=3"),
        ("--set referee.cloning=many", "referee.cloning = \"many\""),
        ("--set referee.trpo=3", "in referee there are: cloning, gail"),
    ] {
        refuses(&scratch, &format!("sift set {TASK} {typed}"), &[wanted]);
    }
}

#[test]
fn a_run_folder_of_an_earlier_format() {
    let scratch = Scratch::new("format");
    scratch.succeed(&format!("judge set {TASK}"));
    let file = scratch.0.join("run/run.json");
    let text = std::fs::read_to_string(&file).unwrap();
    let begun = text.find("  \"format\"").unwrap();
    let end = begun + text[begun..].find('\n').unwrap() + 1;
    let earlier = [&text[..begun], &text[end..]].concat().replace(env!("CARGO_PKG_VERSION"), "0.0.9");
    // Those carried no checksum.
    let first = earlier.find("  \"demosift\"").unwrap();
    std::fs::write(&file, format!("{{\n{}", &earlier[first..])).unwrap();
    let before = scratch.files("run");
    for command in
        ["sift --out run --resume", "report run", "export run --as json", "export run --as onnx --out models"]
    {
        let version = format!("this is demosift {}, which reads format version 7", env!("CARGO_PKG_VERSION"));
        let wanted = [
            "the run is of demosift 0.0.9, whose files have format version 1",
            &version,
            "run.json",
            "hint: ",
        ];
        complaint(&scratch, command, &wanted);
    }
    assert!(before == scratch.files("run"), "nothing was touched");
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

/// `policy.safetensors`, for the point mass.
fn write_policy(scratch: &Scratch) {
    let shape = PolicyShape { hidden: vec![4], initial_std: 0.5 };
    let policy =
        Policy::untrained(&shape, ObservationFilter::identity(4), 2, demosift::basics::seed::Seed::new(1));
    std::fs::write(scratch.0.join("policy.safetensors"), artifact::write_policy(&policy)).unwrap();
}

#[test]
fn policies_that_are_none() {
    let scratch = Scratch::new("play-policy");
    write_policy(&scratch);
    let play = "play --task point_mass --policy";
    refuses(
        &scratch,
        &format!("{play} none.safetensors"),
        &["does not exist", "none.safetensors", "\nhint: "],
    );
    refuses(&scratch, &format!("{play} tiny.toml"), &["not a safetensors file", "tiny.toml"]);
    let whole = std::fs::read(scratch.0.join("policy.safetensors")).unwrap();
    std::fs::write(scratch.0.join("half.safetensors"), &whole[..whole.len() / 2]).unwrap();
    refuses(&scratch, &format!("{play} half.safetensors"), &["not a safetensors file", "half.safetensors"]);
    refuses(
        &scratch,
        "play --task half_cheetah --policy policy.safetensors",
        &["4 observations to 2 actions", "'half_cheetah' has 17 and 6", "policy.safetensors"],
    );
    refuses(&scratch, &format!("{play} policy.safetensors --episodes 0"), &["--episodes 0", "at least 1"]);
    refuses(
        &scratch,
        &format!("{play} policy.safetensors --variant left"),
        &["no variant is called 'left'", "has: east"],
    );
    refuses(
        &scratch,
        "sift set.hdf5 --task point_mass --variant left",
        &["there is no variant 'left'", "'point_mass' has a single goal", "leave --variant away"],
    );
    refuses(
        &scratch,
        "play --task tennis --policy policy.safetensors",
        &["'tennis'", "point_mass, free_throw"],
    );
}

#[test]
fn replays_that_cannot_be() {
    let scratch = Scratch::new("play-replay");
    refuses(&scratch, "play --task point_mass --data set", &["'point_mass' has no MuJoCo model", "\nhint: "]);
    refuses(
        &scratch,
        "play --task half_cheetah --data set",
        &["no states of the simulator, 'infos/qpos' and 'infos/qvel'", "set/demonstrations.hdf5", "\nhint: "],
    );
    let throws = crate::support::in_repository("data/free_throw_8");
    let replay = format!("play --data {} --task", throws.display());
    refuses(&scratch, &format!("{replay} free_throw --demonstration 0,8"), &["--demonstration 8", "0 to 7"]);
    refuses(
        &scratch,
        &format!("{replay} half_cheetah"),
        &["demonstration 0", "'half_cheetah' takes", "of 6 numbers", "demonstrations.hdf5"],
    );
    refuses(&scratch, "play --task half_cheetah --data none.hdf5", &["does not exist", "none.hdf5"]);
    refuses(&scratch, "play --task half_cheetah", &["--policy <FILE>|--data <SET>"]);
    refuses(&scratch, "play --task half_cheetah --data set --policy tiny.toml", &["cannot be used with"]);
    refuses(&scratch, "play --task half_cheetah --data set --seed 3", &["--seed", "cannot be used with"]);
}

#[test]
fn pictures_that_cannot_be_taken() {
    let scratch = Scratch::new("play-pictures");
    write_policy(&scratch);
    let throws = crate::support::in_repository("data/free_throw_8");
    let play = "play --task point_mass --policy policy.safetensors";
    refuses(
        &scratch,
        &format!("{play} --sheet --out run"),
        &["'point_mass' has no MuJoCo model", "\nhint: "],
    );
    refuses(
        &scratch,
        &format!("{play} --out run"),
        &["nothing is to be written", "run\n", "\nhint: ", "--sheet"],
    );
    let play = format!("play --task free_throw --data {} --demonstration 1", throws.display());
    let wanted = ["no camera is called 'roof'", "side, oblique, front"];
    refuses(&scratch, &format!("{play} --sheet --camera roof --out run"), &wanted);
    refuses(&scratch, &format!("{play} --sheet --size 320 --out run"), &["--size", "such as 320x240"]);
    refuses(
        &scratch,
        &format!("{play} --sheet --size 0x240 --out run"),
        &["0 x 240", "from 1 x 1 to 1920 x 1080"],
    );
    refuses(&scratch, &format!("{play} --sheet --moments 0 --out run"), &["--moments 0", "at least 1"]);
    refuses(&scratch, &format!("{play} --sheet --out set"), &["holds other files", "set\n", "\nhint: "]);
    refuses(&scratch, &format!("{play} --sheet --out tiny.toml"), &["is a file", "tiny.toml"]);
    let left: Vec<_> =
        std::fs::read_dir(&scratch.0).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left.len(), 3, "{left:?}");
}

/// A limit of the size of files stands in for a disk: what goes beyond it cannot be written.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk() {
    let scratch = Scratch::new("full");
    let whole = scratch.succeed(&format!("judge set {}", TASK.replace("--out run", "--out other")));
    for (kilobytes, noun, left) in [(0, "resolved.toml", 0), (8, "checkpoint_judge_cloning.bin", 2)] {
        let _ = std::fs::remove_dir_all(scratch.0.join("run"));
        let output =
            scratch.within(&format!("trap '' XFSZ; ulimit -f {kilobytes}"), &format!("judge set {TASK}"));
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{said}");
        for part in ["cannot write", noun, "raise the limit of the size of files"] {
            assert!(said.contains(part), "{said} does not say '{part}'");
        }
        assert_eq!(said.matches("error: ").count(), 1, "{said}");
        let files = scratch.files("run");
        // A checkpoint of before may stand there, whole.
        assert!(left > 0 || !files.contains_key(noun), "{noun} is half-written");
        assert!(!files.keys().any(|name| name.ends_with(".partial")), "{:?}", files.keys());
        let made = files.keys().filter(|name| ["resolved.toml", "run.json"].contains(&name.as_str())).count();
        assert_eq!(made, left, "{:?}", files.keys());
        assert!(files.get("metrics.jsonl").is_none_or(|lines| lines.ends_with(b"\n")), "a torn line");
    }
    // With space again the run goes on as if nothing had been.
    assert_eq!(scratch.succeed("judge --out run --resume").replace("run\n", "other\n"), whole);
    crate::support::assert_same_files(&scratch.files("run"), &scratch.files("other"));
}

#[test]
fn help_is_no_mistake_and_nonsense_is_one() {
    let scratch = Scratch::new("help");
    assert!(scratch.succeed("--help").contains("sift"));
    assert!(scratch.succeed("sift --help").contains("--resume"));
    assert_eq!(scratch.run("stir").status.code(), Some(2));
    assert_eq!(scratch.run("").status.code(), Some(2));
}
