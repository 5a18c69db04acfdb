//! What a `task.toml` says, part by part, and how its names are looked up in the model.

pub(crate) mod blueprint;
pub(crate) mod columns;
pub(crate) mod ends;
pub(crate) mod interval;
pub(crate) mod measurement;
pub(crate) mod observation;
pub(crate) mod reset;
pub mod reward;
mod slice;
pub(crate) mod task_file;
