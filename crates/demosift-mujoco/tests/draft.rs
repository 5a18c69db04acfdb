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
