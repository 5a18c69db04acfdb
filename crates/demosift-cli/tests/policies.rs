//! Policies of run folders, played without demosift.

use crate::support::{RECORD, Scratch, in_repository};
use demosift::data::demonstration::d4rl;
use demosift::results::artifact;
use demosift::world::environment::Task as _;
use demosift::world::policy::Player;
use demosift_mujoco::registry;

/// On observations that others made; the policy has learned a little, and its filter is that of its own episodes.
#[test]
fn a_recorded_demonstrator_plays_the_same_in_onnxruntime() {
    let Some(packages) = crate::onnxruntime::packages() else { return };
    let scratch = Scratch::new("onnx");
    let training = "--set demonstrator.updates=6 --set demonstrator.snapshot_every=1 \
                    --set demonstrator.batch_steps=600 --set demonstrator.policy.initial_std=1.0";
    scratch.succeed(&format!("record --task free_throw --count 2 {training} --out run"));
    let files = scratch.files("run");
    let policy = artifact::read_policy(&files["policy_demonstrator.safetensors"], "the policy").unwrap();
    assert!(policy.filter().std().iter().any(|std| (std - 1.0).abs() > 0.5), "{:?}", policy.filter());

    let set = d4rl::read(&in_repository("data/free_throw_8/demonstrations.hdf5")).unwrap();
    let observations: Vec<f32> =
        set.iter().flat_map(|(_, demonstration)| demonstration.observations().flat().to_vec()).collect();
    let model = &files["policy_demonstrator.onnx"];
    let [actions, controls] = crate::onnxruntime::played(&packages, "command", model, &observations);
    assert!(actions.len() >= 8 * 60 * 21, "{}", actions.len());

    let ranges = registry::load("free_throw").unwrap().specification().control_ranges.clone();
    let (mut player, mut action) = (Player::new(&policy), [0.0; 21]);
    let rows = actions.chunks(21).zip(controls.chunks(21));
    for (observation, (found, controls)) in observations.chunks(55).zip(rows) {
        player.mean(observation, &mut action);
        for (index, mean) in action.iter().enumerate() {
            let (wanted, [low, high]) = (mean.clamp(-1.0, 1.0), ranges[index]);
            assert!((wanted - found[index]).abs() <= 1e-5, "{wanted}, found {}", found[index]);
            let control = low + 0.5 * (high - low) * (f64::from(wanted) + 1.0);
            let error = (control - f64::from(controls[index])).abs();
            assert!(error <= 1e-5 * (high - low), "{control}, found {}", controls[index]);
        }
    }
}

#[test]
fn policies_of_an_older_run_are_handed_on_and_a_run_that_goes_on_writes_them() {
    let scratch = Scratch::new("older");
    let imitate = "--task point_mass --config tiny.toml --demonstration-ids 1 --out run";
    scratch.succeed(&format!("imitate set {imitate}"));
    let whole = scratch.files("run");
    let model = "policy_demonstrations_1.onnx";
    std::fs::remove_file(scratch.0.join("run").join(model)).unwrap();
    std::fs::rename(scratch.0.join("set"), scratch.0.join("moved")).unwrap();
    assert_eq!(scratch.succeed("export run --as onnx --out models"), "1 policy: models\n");
    let exported = scratch.files("models");
    assert_eq!(exported.keys().collect::<Vec<_>>(), [model]);
    assert!(exported[model] == whole[model]);

    std::fs::rename(scratch.0.join("moved"), scratch.0.join("set")).unwrap();
    scratch.succeed("imitate --out run --resume --demonstration-ids 1");
    crate::support::assert_same_files(&scratch.files("run"), &whole);
}

#[test]
fn mistakes_are_told() {
    let scratch = Scratch::new("onnx-mistakes");
    scratch.succeed(&format!("{RECORD} --out recorded"));
    scratch.succeed("meta-train set --task point_mass --config tiny.toml --out run");
    let refuses = |arguments: &str, wanted: &[&str]| {
        let output = scratch.run(arguments);
        let complaint = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{complaint}");
        assert!(wanted.iter().all(|wanted| complaint.contains(wanted)), "{complaint}");
    };
    refuses("export recorded --as onnx", &["a folder", "--out FOLDER"]);
    refuses("export recorded --as onnx --out set", &["already", "new folder"]);
    refuses("export run --as onnx --out models", &["no policies yet", "demosift imitate"]);
    refuses("export set --as onnx --out models", &["not a run folder"]);
    let policy = scratch.0.join("recorded/policy_demonstrator.safetensors");
    std::fs::write(&policy, &std::fs::read(&policy).unwrap()[..50]).unwrap();
    refuses("export recorded --as onnx --out models", &["not a safetensors file", "policy_demonstrator"]);
    assert!(!scratch.0.join("models").exists());
}
