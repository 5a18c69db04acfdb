//! A user's own simulator: `--env` from a set to a ranking, and what is said where something is wrong.
//!
//! Without Gymnasium these tests say that they were skipped.

use std::path::Path;
use std::process::{Child, Output, Stdio};
use std::time::Duration;

use crate::support::{Scratch, assert_same_files, rewritten, write_set};
use demosift::basics::seed::Seed;
use demosift::data::demonstration::{Demonstration, DemonstrationSet};
use demosift::math::rows::Rows;
use demosift::world::point_mass;
use rustix::process::{Pid, Signal, kill_process};

/// Four demonstrations of the point mass, of which 1 and 3 go to the goal, in the unit of the environment: −2 to 2.
fn set_in_newtons(scratch: &Scratch) {
    let planted = point_mass::planted_set(&[180.0, 0.0, 90.0, 10.0], Seed::new(3)).unwrap();
    let enlarged = planted.iter().map(|(_, of)| {
        let actions = of.actions().flat().iter().map(|number| 2.0 * number).collect();
        Demonstration::new(of.observations().clone(), Rows::from_flat(actions, 2).unwrap()).unwrap()
    });
    write_set(
        &scratch.0.join("set/demonstrations.hdf5"),
        &DemonstrationSet::new(enlarged.collect()).unwrap(),
    );
}

/// Arguments that name an environment of the test's file.
fn env(name: &str) -> Option<String> {
    let python = crate::python::interpreter()?;
    Some(format!("--env {}:{name} --python {}", crate::python::environments().display(), python.display()))
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn sift_ranks_in_an_environment_of_the_user() {
    let Some(env) = env("limited") else { return };
    let scratch = Scratch::new("gymnasium-sift");
    set_in_newtons(&scratch);
    let how = "--judge cloning --referee cloning=3 --config tiny.toml --seed 1";
    let heuristic = ["--heuristic", "negated last distance"];
    let sift = |out: &str, more: &str| {
        let mut command = scratch.command(&format!("sift set {env} {how} {more} --json --out {out}"));
        let output = command.args(heuristic).output().unwrap();
        assert!(output.status.success(), "{}", said(&output));
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()
    };
    let found = sift("whole", "--workers 2");
    let order: Vec<u64> =
        found["ranking"].as_array().unwrap().iter().map(|one| one["demo"].as_u64().unwrap()).collect();
    assert!(order[..2] == [1, 3] || order[..2] == [3, 1], "those that go to the goal: {order:?}");
    let page = std::fs::read_to_string(scratch.0.join("whole/report.html")).unwrap();
    assert!(page.contains("There is no replay: ") && page.contains("pictures are made of 'rgb_array'"));

    // By another number of workers, and killed after judging, it is the same.
    let judged = |more: &str| {
        let mut command = scratch.command(&format!("judge set {env} {how} {more} --json --out parts"));
        let output = command.args(heuristic).output().unwrap();
        assert!(output.status.success(), "{}", said(&output));
    };
    judged("--workers 3");
    sift("parts", "--workers 1 --resume");
    let of_results = |folder: &str| {
        let mut files = scratch.files(folder);
        files.retain(|name, _| {
            name.ends_with(".json") && name != "run.json" || name.ends_with(".safetensors")
        });
        files
    };
    assert_same_files(&of_results("whole"), &of_results("parts"));

    let run: serde_json::Value = serde_json::from_slice(&scratch.files("whole")["run.json"]).unwrap();
    let simulator = &run["simulator"];
    assert_eq!(
        (simulator["horizon"].as_u64(), simulator["heuristic"].as_str()),
        (Some(30), Some("negated last distance"))
    );
    assert_eq!(simulator["repeats"], "exactly");
    assert!(simulator["versions"]["gymnasium"].is_string() && run["task_sha256"].is_string());

    // The run remembers its environment.
    let shown = scratch.succeed("play --policy whole/policy_best.safetensors --episodes 2");
    assert!(shown.contains("episode 1") && shown.contains("success"), "{shown}");
    let exported = scratch.succeed("export whole --as onnx --out policies");
    assert!(exported.contains("policies"), "{exported}");
    let output = scratch.run("export whole --as lerobot --out lerobot");
    assert!(said(&output).contains("--fps N"), "{}", said(&output));

    // And refuses what is another one.
    let path = scratch.0.join("whole/run.json");
    let gymnasium = simulator["versions"]["gymnasium"].as_str().unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    rewritten(&path, |run| run["simulator"]["versions"]["gymnasium"] = "0.29.1".into());
    let output = scratch.run("select --resume --out whole");
    let wanted = format!("the version of gymnasium was 0.29.1 there, and is {gymnasium} now");
    assert!(output.status.code() == Some(2) && said(&output).contains(&wanted), "{}", said(&output));
    std::fs::write(&path, &text).unwrap();
    rewritten(&path, |run| run["simulator"]["bounds"][1][1] = serde_json::json!(3.0));
    let output = scratch.run("select --resume --out whole");
    let wanted = "the range of an action was -2 to 2, -2 to 3 there, and is -2 to 2, -2 to 2 now";
    assert!(output.status.code() == Some(2) && said(&output).contains(wanted), "{}", said(&output));
    std::fs::write(&path, text).unwrap();
    let output = scratch.run("select --resume --out whole --horizon 20");
    assert!(said(&output).contains("the horizon was 30 there, and is 20 now"), "{}", said(&output));
}

#[test]
fn what_measures_and_scores_belongs_to_the_run() {
    let Some(env) = env("limited") else { return };
    let scratch = Scratch::new("gymnasium-own");
    set_in_newtons(&scratch);
    let text = "def measure(env, obs, reward, info):\n    return {'gap': abs(1.0 - obs[0])}\n\n\n\
                def score(observations, actions, rewards):\n    return -abs(1.0 - observations[1:, 0]).min()\n";
    for name in ["mine.py", "other.py"] {
        std::fs::write(scratch.0.join(name), text).unwrap();
    }
    let how = "--judge cloning --config tiny.toml --seed 1";
    let judged = |own: &[&str], out: &str| {
        let mut command = scratch.command(&format!("judge set {env} {how} --out {out}"));
        let output = command.args(own).output().unwrap();
        assert!(output.status.success(), "{}", said(&output));
        let scores: serde_json::Value =
            serde_json::from_slice(&scratch.files(out)["scores_cloning.json"]).unwrap();
        scores
    };
    let measured = judged(&["--measure", "mine.py:measure", "--heuristic", "negated min gap"], "measured");
    let scored = judged(&["--heuristic", "mine.py:score"], "scored");
    assert_eq!(measured, scored, "the same number, worked out in two ways");

    // The run remembers them, and refuses others.
    for (out, refused) in
        [("measured", "--measure other.py:measure"), ("scored", "--heuristic other.py:score")]
    {
        scratch.succeed(&format!("judge --resume --out {out}"));
        let output = scratch.run(&format!("judge --resume --out {out} {refused}"));
        let what = if out == "measured" { "the function that measures was " } else { "the heuristic was " };
        let said = said(&output);
        assert!(said.contains(what) && said.contains("mine.py:") && said.contains("other.py:"), "{said}");
        assert_eq!(output.status.code(), Some(2));
    }
    std::fs::write(scratch.0.join("mine.py"), format!("{text}\n# Changed.\n")).unwrap();
    for out in ["measured", "scored"] {
        let output = scratch.run(&format!("judge --resume --out {out}"));
        assert!(said(&output).contains("the SHA-256 of the task's files was "), "{}", said(&output));
    }
    let output = scratch.run("judge set --task point_mass --measure mine.py:measure");
    assert!(
        said(&output).contains("--measure is about an environment, and none is given"),
        "{}",
        said(&output)
    );
}

#[test]
fn a_dry_run_counts_and_a_recording_is_in_the_unit_of_the_environment() {
    let Some(env) = env("limited") else { return };
    let scratch = Scratch::new("gymnasium-record");
    set_in_newtons(&scratch);
    let shown = scratch.succeed(&format!("sift set {env} --judge cloning --config tiny.toml --dry-run"));
    assert!(shown.contains("Nothing was written"), "{shown}");
    scratch.succeed(&format!(
        "record {env} --count 3 --set demonstrator.snapshot_every=1 --set demonstrator.batch_steps=300 \
         --set demonstrator.updates=4 --out recorded"
    ));
    let seen = scratch.succeed("inspect recorded --json");
    let seen: serde_json::Value = serde_json::from_str(&seen).unwrap();
    assert_eq!(seen["learnable"], true);
    let shown = scratch.succeed(&format!("task check {env} --data recorded"));
    assert!(shown.contains("recorded actions lie within the bounds"), "{shown}");
}

#[test]
fn task_check_says_what_an_environment_is_and_whether_it_repeats() {
    let Some(env) = env("limited") else { return };
    let scratch = Scratch::new("gymnasium-check");
    set_in_newtons(&scratch);
    let shown = scratch.succeed(&format!("task check {env} --data set"));
    for words in [
        "2 numbers from -2 to 2",
        "observation    4 numbers: observation 4",
        "30 steps; how long a step is, it does not say",
        "distance, is_success",
        "repeats: the same seed and actions make the same episode",
        "recorded actions lie within the bounds",
        "the set tells no seeds",
    ] {
        assert!(shown.contains(words), "{words}: {shown}");
    }
    let loose = scratch.succeed(&format!("task check {} --horizon 30 --json", self::env("drifts").unwrap()));
    let loose: serde_json::Value = serde_json::from_str(&loose).unwrap();
    assert_eq!(loose["tried"]["trial"]["repeats"], "start_only");
    let findings = loose["findings"].to_string();
    assert!(findings.contains("does not repeat") && findings.contains("warning"), "{findings}");

    // Far beyond where the environment goes.
    let enlarged = point_mass::planted_set(&[0.0, 10.0], Seed::new(3)).unwrap();
    let enlarged = enlarged.iter().map(|(_, of)| {
        let actions = of.actions().flat().iter().map(|number| 100.0 * number).collect();
        Demonstration::new(of.observations().clone(), Rows::from_flat(actions, 2).unwrap()).unwrap()
    });
    write_set(
        &scratch.0.join("set/demonstrations.hdf5"),
        &DemonstrationSet::new(enlarged.collect()).unwrap(),
    );
    let output = scratch.run(&format!("task check {env} --data set"));
    let shown = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.code() == Some(2) && shown.contains("the set is in another unit"), "{shown}");
}

#[test]
fn the_action_that_lies_beyond_its_bounds_is_named() {
    let Some(env) = env("uneven") else { return };
    let scratch = Scratch::new("gymnasium-uneven");
    set_in_newtons(&scratch);
    let shown = scratch.run(&format!("task check {env} --horizon 30 --data set")).stdout;
    let shown = String::from_utf8_lossy(&shown).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(shown.contains("lie beyond the bounds: action 0 is recorded from"), "{shown}");
}

/// A set of Minari with one episode of `Exact`, whose actions of 64 bits were multiplied by `factor` when they were recorded.
fn exact_set(out: &std::path::Path, factor: f64) {
    use hdf5_pure::{AttrValue, FileBuilder};
    let actions: Vec<f64> = (0..60).map(|number| f64::from(number) / 30.0 - 0.9).collect();
    let left_out = |action: &f64| ((action - f64::from(*action as f32)) * f64::from(1 << 25)) as f32;
    let seen =
        |pair: &[f64]| [left_out(&pair[0]), left_out(&pair[1]), left_out(&pair[0]), left_out(&pair[1])];
    let observations: Vec<f32> = [0.0; 4].into_iter().chain(actions.chunks(2).flat_map(seen)).collect();
    let recorded: Vec<f64> = actions.iter().map(|action| factor * action).collect();
    let mut file = FileBuilder::new();
    let mut group = file.create_group("episode_0");
    group.set_attr("seed", AttrValue::U64(3));
    group.create_dataset("observations").with_f32_data(&observations).with_shape(&[31, 4]);
    group.create_dataset("actions").with_f64_data(&recorded).with_shape(&[30, 2]);
    file.add_group(group.finish());
    std::fs::create_dir_all(out.join("data")).unwrap();
    std::fs::write(out.join("data/main_data.hdf5"), file.finish().unwrap()).unwrap();
}

#[test]
fn recorded_actions_are_played_again_with_all_their_bits_and_as_the_set_file_says() {
    let Some(env) = env("Exact") else { return };
    let scratch = Scratch::new("gymnasium-exact");
    exact_set(&scratch.0.join("exact"), 1.0);
    // The unit of a policy: what it takes is half of what the environment does.
    exact_set(&scratch.0.join("halved"), 0.5);
    let check = |set: &str| {
        let output = scratch.run(&format!("task check {env} --horizon 30 --data {set}"));
        let shown = String::from_utf8_lossy(&output.stdout).split_whitespace().collect::<Vec<_>>().join(" ");
        (shown, said(&output))
    };
    let (led, elsewhere) = ("lead where they led when they were recorded", "go elsewhere");
    assert!(check("exact").0.contains(led), "{}", check("exact").0);
    assert!(check("halved").0.contains(elsewhere), "{}", check("halved").0);
    std::fs::write(scratch.0.join("halved/set.toml"), "[actions]\nunits = \"task\"\n").unwrap();
    let (shown, said) = check("halved");
    assert!(shown.contains(led), "{shown}");
    assert!(said.contains("the numbers of the set are read as") && said.contains("\"task\""), "{said}");
}

#[test]
fn mistakes_are_one_sentence_each() {
    let Some(limited) = env("limited") else { return };
    let scratch = Scratch::new("gymnasium-mistakes");
    set_in_newtons(&scratch);
    let of = |name: &str| env(name).unwrap();
    for (arguments, code, wanted) in [
        (format!("sift set {limited} --task point_mass"), 2, "cannot be used with"),
        (
            "sift set --task point_mass --heuristic count".to_owned(),
            2,
            "--heuristic is about an environment, and none is given",
        ),
        ("sift set --env HalfCheetah-v5".to_owned(), 2, "did you mean gymnasium:HalfCheetah-v5?"),
        ("sift set --env from-set".to_owned(), 2, "only sets of Minari do"),
        ("sift nowhere --env from-set".to_owned(), 2, "the demonstration file does not exist"),
        (
            format!("sift set {limited} --heuristic mine.py"),
            2,
            "'mine.py' names a file, and no function in it",
        ),
        (
            format!("sift set {} --horizon 30", of("narrow")),
            2,
            "the demonstrations have 2 numbers in an action, but the task 'point' has 1",
        ),
        (
            format!("task check {} --horizon 30", of("loses_sight")),
            1,
            "the environment returned nan as number 2 of the observation after step 5",
        ),
        (format!("sift set {}", of("make")), 2, "add --horizon N"),
        (
            format!("sift set {limited} --heuristic count --workers 0"),
            2,
            "--workers 0: must be from 1 to 4096",
        ),
        (format!("sift set {}", of("discrete")), 2, "the action space is Discrete"),
        (format!("sift set {limited} --python no_such_python/python3"), 2, "cannot be used multiple times"),
        (
            format!(
                "judge set {} --horizon 30 --judge cloning --config tiny.toml --out raised",
                of("raises_late")
            ),
            1,
            "the environment failed in a step: RuntimeError: the arm is gone (point.py, line",
        ),
        (
            format!(
                "judge set {} --horizon 30 --judge cloning --config tiny.toml --out killed",
                of("kills_itself")
            ),
            1,
            "ended by signal 9 (SIGKILL, perhaps for want of memory) during a step; its last words: out of luck",
        ),
    ] {
        let output = scratch.run(&arguments);
        let said = said(&output);
        assert_eq!(output.status.code(), Some(code), "{arguments}: {said}");
        assert!(said.contains(wanted) && !said.contains("panicked"), "{arguments}: {said}");
    }
}

#[test]
fn no_worker_outlives_the_command() {
    let Some(env) = env("hangs_and_says_who_it_is") else { return };
    let scratch = Scratch::new("gymnasium-orphan");
    set_in_newtons(&scratch);
    let arguments = format!(
        "judge set {env} --horizon 30 --judge cloning --config tiny.toml --workers 1 --time-limit 900"
    );
    let mut command = scratch.command(&arguments).spawn().unwrap();
    let worker = said_in(&scratch.0.join("worker.pid"), &mut command);
    // Not by a signal that could be told of.
    command.kill().unwrap();
    command.wait().unwrap();
    crate::support::wait_until_gone(&worker);
}

/// What an environment writes into a file before it hangs.
fn said_in(file: &Path, command: &mut Child) -> String {
    while !file.exists() {
        assert!(command.try_wait().unwrap().is_none(), "it hangs in its first episode");
        std::thread::sleep(Duration::from_millis(20));
    }
    std::fs::read_to_string(file).unwrap()
}

#[test]
fn what_a_worker_has_started_ends_with_a_command_that_is_stopped() {
    let Some(env) = env("hangs_beside_its_server") else { return };
    for (signal, code) in [(Signal::INT, 130), (Signal::TERM, 143)] {
        let scratch = Scratch::new("gymnasium-server");
        set_in_newtons(&scratch);
        let arguments = format!(
            "judge set {env} --horizon 30 --judge cloning --config tiny.toml --workers 1 --time-limit 900"
        );
        let mut command = scratch.command(&arguments).stderr(Stdio::piped()).spawn().unwrap();
        let server = said_in(&scratch.0.join("server.pid"), &mut command);
        kill_process(Pid::from_child(&command), signal).unwrap();
        let output = command.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{}", said(&output));
        assert!(!said(&output).contains("error: "), "{}", said(&output));
        crate::support::wait_until_gone(&server);
    }
}

/// As Minari writes it: an environment by its specification, and a seed beside each episode.
#[test]
fn a_set_of_minari_names_its_environment_and_its_episodes_come_again() {
    let Some(python) = crate::python::interpreter() else { return };
    let scratch = Scratch::new("gymnasium-minari");
    let script = crate::python::environments().with_file_name("record_pendulum.py");
    let made = std::process::Command::new(&python).arg(script).arg(scratch.0.join("made")).output().unwrap();
    assert!(made.status.success(), "{}", said(&made));
    minari_of(&scratch.0.join("made"), &scratch.0.join("pendulum"));
    let from_set = format!("--env from-set --python {}", python.display());
    let shown = scratch.succeed(&format!("task check {from_set} --data pendulum"));
    let shown = shown.split_whitespace().collect::<Vec<_>>().join(" ");
    for words in
        ["'Pendulum-v1'", "1 number from -2 to 2", "200 steps", "lead where they led when they were recorded"]
    {
        assert!(shown.contains(words), "{words}: {shown}");
    }
    let played = scratch.succeed(&format!("play --data pendulum {from_set} --demonstration 1,0"));
    let rows: Vec<Vec<&str>> = played.lines().map(|line| line.split_whitespace().collect()).collect();
    assert_eq!((rows[1][1], rows[1][2], rows[2][1]), ("1", "200", "0"), "{played}");
    let found = scratch.succeed(&format!(
        "judge pendulum {from_set} --judge cloning --config tiny.toml --set cloning_judge.judging.evaluations=2 --json"
    ));
    let found: serde_json::Value = serde_json::from_str(&found).unwrap();
    assert!(found["run_folder"].as_str().unwrap().ends_with("Pendulum-v1"), "{found}");

    // Code that nobody registered is not run for the asking.
    let metadata = scratch.0.join("pendulum/data/metadata.json");
    let text = std::fs::read_to_string(&metadata).unwrap();
    std::fs::write(&metadata, text.replace("pendulum:PendulumEnv", "os:getcwd")).unwrap();
    let output = scratch.run(&format!("task check {from_set} --data pendulum"));
    let said = said(&output);
    assert!(output.status.code() == Some(2) && said.contains("which is not registered here"), "{said}");
    assert!(said.contains("--trust-set"), "{said}");
}

/// Writes what `record_pendulum.py` recorded as Minari would.
fn minari_of(made: &std::path::Path, out: &std::path::Path) {
    use hdf5_pure::{AttrValue, FileBuilder};
    let read = |name: &str| -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(made.join(name)).unwrap()).unwrap()
    };
    let mut file = FileBuilder::new();
    let episodes = read("episodes.json");
    for (index, episode) in episodes.as_array().unwrap().iter().enumerate() {
        let numbers = |key: &str| -> Vec<f32> {
            episode[key].as_array().unwrap().iter().map(|number| number.as_f64().unwrap() as f32).collect()
        };
        let steps = numbers("actions").len() as u64;
        let mut group = file.create_group(&format!("episode_{index}"));
        group.set_attr("seed", AttrValue::U64(episode["seed"].as_u64().unwrap()));
        group
            .create_dataset("observations")
            .with_f32_data(&numbers("observations"))
            .with_shape(&[steps + 1, 3]);
        group.create_dataset("actions").with_f32_data(&numbers("actions")).with_shape(&[steps, 1]);
        file.add_group(group.finish());
    }
    std::fs::create_dir_all(out.join("data")).unwrap();
    std::fs::write(out.join("data/main_data.hdf5"), file.finish().unwrap()).unwrap();
    let metadata = serde_json::json!({
        "data_format": "hdf5",
        "env_spec": read("spec.json").to_string(),
        "total_episodes": episodes.as_array().unwrap().len(),
    });
    std::fs::write(out.join("data/metadata.json"), metadata.to_string()).unwrap();
}

/// The numbers that a report is made of.
fn data_of(page: &str) -> serde_json::Value {
    let (_, data) = page.split_once("<script type=\"application/json\" id=\"data\">").unwrap();
    serde_json::from_str(data.split_once("</script>").unwrap().0).unwrap()
}

/// An environment that renders is looked at: by `play`, and in the report, where the agent's episodes come again as they were.
#[test]
fn an_environment_that_renders_is_looked_at() {
    let Some(env) = env("drawn") else { return };
    let scratch = Scratch::new("gymnasium-pictures");
    set_in_newtons(&scratch);
    let how = "--judge cloning --referee cloning=3 --config tiny.toml";
    scratch.succeed(&format!("sift set {env} {how} --out run"));

    let page = std::fs::read_to_string(scratch.0.join("run/report.html")).unwrap();
    let replay = &data_of(&page)["replay"];
    let missing = replay["missing"].as_str().unwrap();
    assert!(missing.contains("does not say from which seeds or states"), "{missing}");
    let films = replay["films"].as_array().unwrap();
    // The agent before, and after each of four demonstrations.
    let demos: Vec<Option<u64>> = films.iter().map(|film| film["demo"].as_u64()).collect();
    assert_eq!(demos.len(), 5, "{demos:?}");
    assert_eq!(demos[0], None);
    for film in films {
        assert_eq!((film["width"].as_u64(), film["height"].as_u64()), (Some(160), Some(120)));
        assert_eq!((film["at"][0].as_u64(), film["at"].as_array().unwrap().len()), (Some(0), 30));
        assert!(film["strip"].as_str().unwrap().starts_with("iVBOR"), "a PNG");
    }

    let play = "play --policy run/policy_best.safetensors --episodes 2";
    let said = scratch.succeed(&format!("{play} --sheet --clip --frames --size 80x80 --out pictures"));
    assert!(said.contains("Pictures: pictures"), "{said}");
    let frame = &scratch.files("pictures/frames/episode_1")["step_0029.png"];
    let side = |at: usize| u32::from_be_bytes(frame[at..at + 4].try_into().unwrap());
    assert_eq!((side(16), side(20)), (80, 60), "made smaller by a whole number to fit");
    assert!(scratch.0.join("pictures/sheet.png").exists() && scratch.0.join("pictures/clip.gif").exists());
    scratch.refuse(&format!("{play} --sheet --camera side"), &["--camera", "as it renders itself"]);
    scratch.refuse(
        &format!("play --data set {env} --sheet"),
        &["from which seed or state demonstration 0 began"],
    );
    let nothing = env.replace("drawn", "draws_nothing");
    let output = scratch.run(&format!("{play} {nothing} --horizon 30 --sheet --out none"));
    assert!(
        !output.status.success() && self::said(&output).contains("its render() returned"),
        "{}",
        self::said(&output)
    );
    assert!(!scratch.0.join("none").exists(), "no folder for nothing");
}
