//! Tasks: a `task.toml` beside a model of two files, and the MJCF of which only the names of other files are read here.

use std::path::Path;

use demosift::basics::seed::Seed;
use demosift::world::environment::{EnvVariant, Environment as _, Task as _};
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::registry;

use crate::scratch;

/// Reads the bytes as a `task.toml` and makes a step of it; and as a file that its model includes, for the files it is made of.
///
/// MuJoCo itself is not given the bytes: what it makes of a model is not ours to mend.
pub(crate) fn task_file(bytes: &[u8]) {
    let folder = scratch::folder("task");
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("model");
    scratch::copy(&kept, &folder);
    let path = folder.join("task.toml");
    scratch::write(&folder.join("arm.xml"), bytes);
    let _ = registry::files(&path);
    scratch::copy(&kept, &folder);
    scratch::write(&path, bytes);
    let _ = registry::files(&path);
    if let Ok(task) = MujocoTask::from_file(&path) {
        step(&task);
    }
}

fn step(task: &MujocoTask) {
    // A control step may be long, and is then no fault.
    let Ok(mut environment) = task.mujoco_environment() else { return };
    let specification = task.specification();
    let mut observation = vec![0.0; specification.observation_size];
    let mut measurements = vec![0.0; specification.measurements.len()];
    environment.reset(EnvVariant(0), Seed::new(1), &mut observation, &mut measurements);
    if task.frame_skip() <= 100 {
        environment.step(&vec![0.5; specification.action_size], &mut observation, &mut measurements);
    }
}
