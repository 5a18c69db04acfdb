//! `--env from-set` for a set of robomimic: the environment of robosuite that it names, held against what a stand-in for
//! robosuite recorded by itself.
//!
//! Without Gymnasium these tests say that they were skipped.

use std::path::Path;
use std::process::{Command, Output};

use crate::support::Scratch;
use hdf5_pure::{AttrValue, FileBuilder};
use serde_json::{Value, json};

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Episodes of an environment of the stand-in, as it records them.
fn recorded(python: &Path, name: &str) -> Value {
    let script = crate::python::stand_in().join("record.py");
    let output = Command::new(python).arg(script).arg(name).output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Writes them as robomimic would.
fn write(path: &Path, episodes: &Value, env_args: &Value) {
    let mut file = FileBuilder::new();
    let mut data = file.create_group("data");
    data.set_attr("env_args", AttrValue::VarLenString(env_args.to_string()));
    for (number, episode) in episodes.as_array().unwrap().iter().enumerate() {
        let rows = |key: &str| -> Vec<Vec<f64>> { serde_json::from_value(episode[key].clone()).unwrap() };
        let mut demo = data.create_group(&format!("demo_{number}"));
        demo.set_attr("model_file", AttrValue::VarLenString(episode["model"].as_str().unwrap().to_owned()));
        let mut obs = demo.create_group("obs");
        for (key, rows) in [("object", rows("object")), ("robot0_eef_pos", rows("robot0_eef_pos"))] {
            let shape = [rows.len() as u64, rows[0].len() as u64];
            obs.create_dataset(key).with_f64_data(&rows.concat()).with_shape(&shape);
        }
        demo.add_group(obs.finish());
        for key in ["states", "actions"] {
            let rows = rows(key);
            let shape = [rows.len() as u64, rows[0].len() as u64];
            demo.create_dataset(key).with_f64_data(&rows.concat()).with_shape(&shape);
        }
        data.add_group(demo.finish());
    }
    file.add_group(data.finish());
    file.write(path).unwrap();
}

fn arguments(name: &str) -> Value {
    // As robomimic writes them, with what would open a window.
    let kwargs =
        json!({ "robots": ["Hand"], "control_freq": 20, "has_renderer": true, "use_camera_obs": true });
    json!({ "env_name": name, "env_version": "1.4.1", "type": 1, "env_kwargs": kwargs })
}

fn in_one_line(shown: &str) -> String {
    shown.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn recorded_actions_lead_where_they_led_in_robosuite() {
    let Some(python) = crate::python::interpreter_with_stand_in() else { return };
    let scratch = Scratch::new("robosuite-replay");
    let episodes = recorded(&python, "Push");
    write(&scratch.0.join("push.hdf5"), &episodes, &arguments("Push"));
    let from_set = format!("--env from-set --python {}", python.display());
    let shown = scratch.succeed(&format!("task check {from_set} --data push.hdf5"));
    let shown = in_one_line(&shown);
    for words in [
        "The environment 'Push'",
        "robosuite 1.5.2",
        "episode 12 steps of 0.05 s",
        "observation 5 numbers: object 3, robot0_eef_pos 2",
        "action 2 numbers: from -2 to 2, -1 to 1",
        "played again from the recorded state",
        "drift of states",
        "0 9 of 9",
        "repeats: the same seed and actions make the same episode",
        "3 demonstrations played again from the recorded state lead where they led when they were recorded",
    ] {
        assert!(shown.contains(words), "{words}: {shown}");
    }

    // In whatever order and part the columns are read.
    let columns = "--observation-columns robot0_eef_pos,obs/object[1:],object[0]";
    let found = scratch.succeed(&format!("task check {from_set} --data push.hdf5 {columns} --json"));
    let found: Value = serde_json::from_str(&found).unwrap();
    assert_eq!(
        found["observation_parts"],
        json!([["robot0_eef_pos", 2], ["object[1:]", 2], ["object[0:1]", 1]])
    );
    assert_eq!(
        (&found["tried"]["trial"]["repeats"], &found["tried"]["alike"]),
        (&json!("exactly"), &json!(true))
    );
    assert_eq!(found["tried"]["trial"]["starts_differ"], true);
    let replayed = found["compared"]["replayed"].as_array().unwrap();
    let lengths: Vec<u64> = replayed.iter().map(|one| one["steps"].as_u64().unwrap()).collect();
    assert_eq!(lengths, [9, 12, 7]);
    for one in replayed {
        assert_eq!((one["drift"].as_f64(), one["state_drift"].as_f64()), (Some(0.0), Some(0.0)), "{one}");
    }

    // Actions that are not those that were recorded lead elsewhere.
    let mut other = episodes;
    other[1]["actions"][3][0] = json!(-2.0);
    write(&scratch.0.join("other.hdf5"), &other, &arguments("Push"));
    let shown = in_one_line(&scratch.succeed(&format!("task check {from_set} --data other.hdf5")));
    assert!(shown.contains("go elsewhere, by"), "{shown}");
    assert!(shown.contains("recorded in robosuite 1.4.1, and the interpreter has 1.5.2"), "{shown}");
}

#[test]
fn a_run_remembers_the_environment_of_robosuite() {
    let Some(python) = crate::python::interpreter_with_stand_in() else { return };
    let scratch = Scratch::new("robosuite-run");
    write(&scratch.0.join("push.hdf5"), &recorded(&python, "Push"), &arguments("Push"));
    let how = "--judge cloning --config tiny.toml --set cloning_judge.judging.evaluations=2 --json";
    let asked = format!("judge push.hdf5 --env from-set --python {} {how}", python.display());
    let found: Value = serde_json::from_str(&scratch.succeed(&asked)).unwrap();
    assert!(found["run_folder"].as_str().unwrap().ends_with("runs/Push"), "{found}");
    let run: Value = serde_json::from_slice(&scratch.files("runs/Push")["run.json"]).unwrap();
    assert_eq!(run["simulator"]["horizon"], 12);
    let spec: Value = serde_json::from_str(run["simulator"]["spec"].as_str().unwrap()).unwrap();
    assert_eq!(spec["env_name"], "Push");
    scratch.succeed("judge --resume --out runs/Push --json");
    scratch.succeed("judge --resume --out runs/Push --env from-set --json");
    let output = scratch.run("judge --resume --out runs/Push --horizon 10");
    assert!(said(&output).contains("the horizon was 12 there, and is 10 now"), "{}", said(&output));
}

#[test]
fn a_demonstration_of_robosuite_is_seen_from_the_camera_of_its_set() {
    let Some(python) = crate::python::interpreter_with_stand_in() else { return };
    let scratch = Scratch::new("robosuite-pictures");
    let episodes = recorded(&python, "Push");
    let mut named = arguments("Push");
    named["env_kwargs"]["camera_names"] = json!(["robot0_eye", "frontview"]);
    // The stand-in paints a camera's number blue, and what is higher up redder.
    for (arguments, blue) in [(arguments("Push"), 80), (named, 40)] {
        write(&scratch.0.join("push.hdf5"), &episodes, &arguments);
        let looked = "--demonstration 1 --frames --sheet --size 240x180 --out seen";
        let play = format!("play --data push.hdf5 --env from-set --python {} {looked}", python.display());
        scratch.succeed(&play);
        let frames = scratch.files("seen/frames/demonstration_1");
        let (first, last) = (decoded(&frames["step_0000.png"]), decoded(&frames["step_0011.png"]));
        assert_eq!((frames.len(), first.len()), (12, 240 * 180));
        assert!(first[0][0] > 250 && first[240 * 179][0] < 5, "{:?} {:?}", first[0], first[240 * 179]);
        assert_ne!(first[0][1], last[0][1], "the hand has moved");
        assert!(first.iter().chain(&last).all(|pixel| pixel[2] == blue));
        std::fs::remove_dir_all(scratch.0.join("seen")).unwrap();
    }
}

/// Red, green and blue of each pixel, from the upper left on.
fn decoded(png: &[u8]) -> Vec<[u8; 3]> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut rgb).unwrap();
    rgb.as_chunks().0.to_vec()
}

#[test]
fn where_a_reset_leaves_something_behind_the_model_is_loaded_anew() {
    let Some(python) = crate::python::interpreter_with_stand_in() else { return };
    let scratch = Scratch::new("robosuite-sticky");
    write(&scratch.0.join("sticky.hdf5"), &recorded(&python, "Sticky"), &arguments("Sticky"));
    let from_set = format!("--env from-set --python {}", python.display());
    let found = scratch.succeed(&format!("task check {from_set} --data sticky.hdf5 --json"));
    let found: Value = serde_json::from_str(&found).unwrap();
    assert_eq!(found["tried"]["trial"]["repeats"], "exactly");
    // Where the set says so, it is as the set says.
    let mut soft = arguments("Sticky");
    soft["env_kwargs"]["hard_reset"] = json!(false);
    write(&scratch.0.join("soft.hdf5"), &recorded(&python, "Sticky"), &soft);
    let found = scratch.succeed(&format!("task check {from_set} --data soft.hdf5 --json"));
    let found: Value = serde_json::from_str(&found).unwrap();
    assert_eq!(found["tried"]["trial"]["repeats"], "no");
}

#[test]
fn what_a_set_names_and_cannot_be_made_is_one_sentence() {
    let Some(python) = crate::python::interpreter_with_stand_in() else { return };
    let Some(without) = crate::python::interpreter() else { return };
    let scratch = Scratch::new("robosuite-mistakes");
    let episodes = recorded(&python, "Push");
    write(&scratch.0.join("push.hdf5"), &episodes, &arguments("Push"));
    write(&scratch.0.join("pusch.hdf5"), &episodes, &arguments("Pusch"));
    write(
        &scratch.0.join("gym.hdf5"),
        &episodes,
        &json!({ "env_name": "Hopper-v3", "type": 2, "env_kwargs": {} }),
    );
    let (with, without) = (python.display(), without.display());
    for (arguments, wanted, hint) in [
        (
            format!("sift push.hdf5 --env from-set --python {without}"),
            "the set was recorded in robosuite, which is not installed in this interpreter",
            "--python PATH",
        ),
        (
            format!("sift pusch.hdf5 --env from-set --python {with}"),
            "'Pusch', and robosuite 1.5.2 has none of that name; did you mean Push?",
            "--env my_env.py:make",
        ),
        (
            format!("sift gym.hdf5 --env from-set --python {with}"),
            "'Hopper-v3' and says type 2, gym; from-set makes those of type 1, robosuite",
            "--env gymnasium:ID",
        ),
        (
            format!("sift push.hdf5 --env from-set --python {with} --observation-columns states"),
            "'states' is none of the observations of the environment that the set names",
            "--env my_env.py:make",
        ),
    ] {
        let output = scratch.run(&arguments);
        let said = said(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {said}");
        assert!(
            said.contains(wanted) && said.contains(hint) && !said.contains("panicked"),
            "{arguments}: {said}"
        );
    }
}
