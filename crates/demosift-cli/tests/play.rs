//! `demosift play` on the set of the repository, and on policies that other subcommands wrote.

use crate::support::{Scratch, in_repository};

fn replay(options: &str) -> String {
    format!("play --task free_throw --data {} {options}", in_repository("data/free_throw_8").display())
}

#[test]
fn demonstrations_are_told_in_the_order_in_which_they_are_named() {
    let scratch = Scratch::new("replay");
    let said = scratch.succeed(&replay("--demonstration 4 1,0"));
    let rows: Vec<Vec<&str>> = said.lines().map(|line| line.split_whitespace().collect()).collect();
    assert_eq!(rows[0], ["episode", "steps", "heuristic", "[m]", "success"]);
    assert_eq!(rows[1], ["demonstration", "4", "60", "-0.082", "yes"]);
    assert_eq!(rows[2], ["demonstration", "1", "60", "-1.412", "no"]);
    assert_eq!(rows[3], ["demonstration", "0", "60", "-0.495", "no"]);
    assert_eq!(rows.len(), 4, "no pictures were asked for: {said}");
    let said: serde_json::Value = serde_json::from_str(&scratch.succeed(&replay("--json"))).unwrap();
    assert_eq!(said["episodes"].as_array().unwrap().len(), 8);
    assert_eq!((&said["episodes"][4]["succeeded"], &said["unit"]), (&true.into(), &"m".into()));
}

#[test]
fn a_set_of_one_demonstration_is_played() {
    let scratch = Scratch::new("replay-one");
    let said = scratch.succeed(&replay("--without 0,1,2,3,5,6,7"));
    let rows: Vec<Vec<&str>> = said.lines().map(|line| line.split_whitespace().collect()).collect();
    assert_eq!(rows[1..], [["demonstration", "4", "60", "-0.0822", "yes"]], "{said}");
}

/// The policies of `record` and of `imitate`, on a task with a simulator and on one without.
#[test]
fn a_policy_plays_the_same_episodes_again_from_the_same_seed() {
    let scratch = Scratch::new("policy");
    let record = "--count 2 --set demonstrator.updates=2 --set demonstrator.snapshot_every=1 \
                  --set demonstrator.batch_steps=300";
    for task in ["point_mass", "free_throw"] {
        scratch.succeed(&format!("record --task {task} {record} --out {task}"));
    }
    scratch.succeed("imitate set --task point_mass --config tiny.toml --demonstration-ids 1 --out imitated");
    for (task, policy, variant) in [
        ("point_mass", "point_mass/policy_demonstrator", "east"),
        ("point_mass", "imitated/policy_demonstrations_1", "east"),
        ("free_throw", "free_throw/policy_demonstrator", "default"),
    ] {
        let play = |options: &str| {
            let said = format!("play --task {task} --policy {policy}.safetensors --episodes 3 {options}");
            scratch.succeed(&said)
        };
        let mean = play("");
        assert!(mean.contains("episode 2") && mean.contains("heuristic [m]"), "{mean}");
        assert_eq!(mean, play("--seed 0"));
        assert_ne!(mean, play("--seed 1"));
        assert_ne!(mean, play("--sampled"));
        assert_eq!(play("--sampled"), play(&format!("--sampled --variant {variant}")));
    }
}

#[test]
fn frames_sheet_and_clip_appear_together_or_not_at_all() {
    let scratch = Scratch::new("pictures");
    let options = "--demonstration 4 --frames --sheet --clip --moments 3 --size 60x40 --out looks/throws";
    let output = scratch.run(&replay(options));
    let complaint = String::from_utf8_lossy(&output.stderr).into_owned();
    if complaint.contains("off-screen rendering is not possible") {
        assert!(
            complaint.contains("hint: rendering needs EGL") && complaint.contains("apt-get install"),
            "{complaint}"
        );
        assert!(!scratch.0.join("looks").exists());
        return eprintln!("skipped: {complaint}");
    }
    assert!(output.status.success(), "{complaint}");
    assert!(String::from_utf8(output.stdout).unwrap().ends_with("\nPictures: looks/throws\n"));
    let beside = std::fs::read_dir(scratch.0.join("looks")).unwrap().count();
    assert_eq!(beside, 1, "nothing is left beside the folder");
    let size = |png: &[u8]| {
        assert_eq!(png[..8], *b"\x89PNG\r\n\x1a\n");
        [16, 20].map(|at| u32::from_be_bytes(png[at..at + 4].try_into().unwrap()))
    };
    let frames = scratch.files("looks/throws/frames/demonstration_4");
    assert_eq!(frames.len(), 60);
    assert!(frames.values().all(|frame| size(frame) == [60, 40]));
    assert_ne!(frames["step_0000.png"], frames["step_0030.png"], "something moves");
    let sheet = std::fs::read(scratch.0.join("looks/throws/sheet.png")).unwrap();
    let [width, height] = size(&sheet);
    assert!(width > 3 * 60 && width < 4 * 60 && height > 40, "{width} x {height}");
    let clip = std::fs::read(scratch.0.join("looks/throws/clip.gif")).unwrap();
    assert_eq!(clip[..6], *b"GIF89a");
    assert_eq!(clip.last(), Some(&b';'), "the clip is whole");
}

/// As an export of policies is refused then, too.
#[test]
fn a_policy_is_not_played_in_a_changed_task_without_a_word() {
    let scratch = crate::task_check::with_task("play-changed", "block", "block");
    let record = "--count 2 --set demonstrator.updates=2 --set demonstrator.snapshot_every=1 --set demonstrator.batch_steps=300";
    scratch.succeed(&format!("record --task block {record} --out run"));
    let play = "play --policy run/policy_demonstrator.safetensors --episodes 1";
    scratch.succeed(play);
    let model = scratch.0.join("block/block.xml");
    let text = std::fs::read_to_string(&model).unwrap();
    std::fs::write(&model, text.replace("damping='1'", "damping='5'")).unwrap();
    let changed = "the files of the task have changed since the run";
    scratch.refuse("export run --as onnx --out models", &[changed]);
    scratch.refuse(play, &[changed, "hint: --task ", "block plays it in the task as it is now"]);
    // Who says so knows which task it is, and is told all the same; another task is another matter.
    let output = scratch.run(&format!("{play} --task block"));
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && said.contains(&format!("note: {changed}")), "{said}");
    let other = scratch.0.join("other");
    std::fs::create_dir_all(&other).unwrap();
    for name in ["block.xml", "task.toml"] {
        std::fs::copy(scratch.0.join("block").join(name), other.join(name)).unwrap();
    }
    let output = scratch.run(&format!("{play} --task other"));
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    std::fs::write(&model, text).unwrap();
    scratch.succeed(play);
}

/// Where nothing is said of a folder, pictures stand beside the run whose policy plays; looked at by what stands in the way there.
#[test]
fn pictures_of_a_policy_go_beside_its_run() {
    let scratch = Scratch::new("beside");
    let record = "--count 2 --set demonstrator.updates=2 --set demonstrator.snapshot_every=1 --set demonstrator.batch_steps=300";
    scratch.succeed(&format!("record --task free_throw {record} --out made/thrower"));
    std::fs::copy(
        scratch.0.join("made/thrower/policy_demonstrator.safetensors"),
        scratch.0.join("lone.safetensors"),
    )
    .unwrap();
    for folder in ["made/thrower_pictures", "runs/free_throw_pictures"] {
        std::fs::create_dir_all(scratch.0.join(folder)).unwrap();
        std::fs::write(scratch.0.join(folder).join("old.png"), "").unwrap();
    }
    for (policy, wanted) in [
        ("made/thrower/policy_demonstrator.safetensors", "made/thrower_pictures"),
        ("lone.safetensors", "runs/free_throw_pictures"),
    ] {
        let output = scratch.run(&format!("play --task free_throw --policy {policy} --sheet"));
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains("holds other files") && said.contains(wanted), "{said}");
    }
    let mut within =
        scratch.command("play --task free_throw --policy policy_demonstrator.safetensors --sheet");
    let output = within.current_dir(scratch.0.join("made/thrower")).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("made/thrower_pictures"), "{said}");
}
