//! A first task file for a model: it is a task that the check accepts, and observes what a set holds.

use std::path::{Path, PathBuf};

use demosift::basics::seed::Seed;
use demosift::data::demonstration::Demonstration;
use demosift::world::environment::Task as _;
use demosift_mujoco::check::{self, Severity};
use demosift_mujoco::draft::{Draft, Wanted, draft};
use demosift_mujoco::model::Model;
use demosift_mujoco::mujoco_task::MujocoTask;

fn in_repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

/// The draft for a model of the repository, and the task that it is, which the check accepts.
#[track_caller]
fn drafted(model: &str, set: Option<&[Demonstration]>, steps_per_sec: Option<f64>) -> (Draft, MujocoTask) {
    let path = in_repository(model);
    let wanted = Wanted { name: "first", model_file: path.to_str().unwrap(), set, steps_per_sec };
    let draft = draft(&Model::from_file(&path).unwrap(), &wanted).unwrap();
    let folder = std::env::temp_dir().join(format!("demosift-draft-{}-{}", std::process::id(), model.len()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("task.toml");
    std::fs::write(&file, &draft.text).unwrap();
    let task = MujocoTask::from_file(&file).unwrap();
    let (_, mut findings) = check::look(&task);
    findings.extend(check::play(&task, &Seed::new(3)).unwrap().1);
    assert_eq!(check::count(&findings, Severity::Error), 0, "{findings:#?}\n{}", draft.text);
    std::fs::remove_dir_all(&folder).unwrap();
    (draft, task)
}

#[test]
fn a_model_alone_gets_all_of_its_joints_and_a_usual_rate() {
    let (draft, task) = drafted("tasks/half_cheetah/half_cheetah.xml", None, None);
    assert_eq!((task.specification().observation_size, draft.fits), (18, None));
    assert!((task.specification().control_step_secs - 0.04).abs() < 1e-9);
    assert_eq!(draft.text.matches("TODO").count(), 3, "{}", draft.text);
}

#[test]
fn a_set_tells_length_rate_and_which_positions_are_left_out() {
    let rows = |width: usize| demosift::math::rows::Rows::from_flat(vec![0.1; 300 * width], width).unwrap();
    let set: Vec<Demonstration> = (0..2).map(|_| Demonstration::new(rows(17), rows(6)).unwrap()).collect();
    let (draft, task) = drafted("tasks/half_cheetah/half_cheetah.xml", Some(&set), Some(20.0));
    assert_eq!(draft.fits, Some(true), "{}", draft.text);
    assert!(draft.text.contains("{ qpos = \"all[1:]\" }, { qvel = \"all\" }"), "{}", draft.text);
    assert_eq!((task.specification().horizon, task.specification().steps_per_sec()), (300, 20));
    let odd: Vec<Demonstration> = (0..2).map(|_| Demonstration::new(rows(3), rows(6)).unwrap()).collect();
    let (draft, _) = drafted("tasks/half_cheetah/half_cheetah.xml", Some(&odd), None);
    assert_eq!(draft.fits, Some(false));
    assert!(draft.text.contains("holds 3 numbers in an observation, and this has 18"), "{}", draft.text);
}

#[test]
fn a_model_with_keyframes_starts_in_the_first_that_has_a_name() {
    let model = r#"
<mujoco>
  <worldbody>
    <body name="arm"><joint name="elbow" axis="0 1 0" range="30 150" damping="1"/><geom size="0.1" pos="0.2 0 0"/></body>
  </worldbody>
  <actuator><motor name="bend" joint="elbow" gear="9" ctrlrange="-1 1"/></actuator>
  <keyframe><key qpos="2"/><key name="the 'home'" qpos="1.5"/><key name="other" qpos="1"/></keyframe>
</mujoco>"#;
    let model = Model::from_texts("arm.xml", &[("arm.xml", model)]).unwrap();
    let wanted = Wanted { name: "first", model_file: "arm.xml", set: None, steps_per_sec: None };
    let text = draft(&model, &wanted).unwrap().text;
    let written: toml::Table = toml::from_str(&text).unwrap();
    assert_eq!(written["reset"]["keyframe"].as_str(), Some("the 'home'"), "{text}");
    let cheetah = Model::from_file(&in_repository("tasks/half_cheetah/half_cheetah.xml")).unwrap();
    let still = draft(&cheetah, &wanted).unwrap().text;
    assert!(still.contains("as the model says") && !still.contains("keyframe"), "{still}");
}
