//! Tasks in MuJoCo: an MJCF model and a `task.toml` become a [`demosift::world::environment::Task`].
//!
//! The flow: [`registry::load`] finds the two files, [`mujoco_task::MujocoTask`] resolves every name in them once,
//! and each worker plays on a [`environment::MujocoEnvironment`] of its own.
//! No algorithm is known here.
//! Recorded states go the other way: [`replay`] measures them, and [`pictures::render`] and [`pictures::film`] make them into
//! pictures.
//!
//! # A task of your own
//!
//! needs no Rust: a folder with an MJCF file, in which every actuator has a `ctrlrange`, and a `task.toml`, whose whole form is
//! `docs/task-file.md` of the repository.
//! `demosift task check FOLDER` ([`check`]) says what it sees there and what is wrong; with `--data SET` also whether
//! demonstrations fit.

pub mod check;
pub mod draft;
pub mod environment;
mod include;
pub mod model;
pub mod mujoco_task;
pub mod pictures;
mod quiet;
pub mod registry;
pub mod replay;
pub mod task;
mod tasks;

pub use demosift::basics::names;

/// The version of the MuJoCo library that this program found when it started, such as `3.17.0`.
pub fn mujoco_version() -> &'static str {
    mujoco_rs::mujoco_version()
}
