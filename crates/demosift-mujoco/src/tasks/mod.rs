//! What `task.toml` cannot say of the tasks that come with demosift.

pub(crate) mod free_throw;
pub(crate) mod martial_arts;
pub(crate) mod penalty_save;
