//! Tasks in MuJoCo: an MJCF model and a `task.toml` become a [`demosift::environment::Task`].
//!
//! The flow: [`registry::load`] finds the two files, [`mujoco_task::MujocoTask`] resolves every name in them once,
//! and each worker plays on a [`environment::MujocoEnvironment`] of its own.
//! No algorithm is known here.

pub mod environment;
mod heuristic_fold;
mod measurement;
pub mod model;
pub mod mujoco_task;
mod observation;
mod quiet;
pub mod registry;
pub mod render;
mod reset;
pub mod reward;
mod task_file;
mod tasks;
