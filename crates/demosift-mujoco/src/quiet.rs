//! Keeps MuJoCo from writing to the terminal and into `MUJOCO_LOG.TXT`: a library prints nothing.
//!
//! What MuJoCo warns of is not lost: warnings of a simulation are counted in its data, and
//! [`MujocoEnvironment`](crate::environment::MujocoEnvironment) reads the counts after every control step.
//! The only unsafe code of the crate.
#![allow(unsafe_code)]

use std::sync::Once;

use mujoco_rs::wrappers::mj_logging::{log_config, set_log_config};

/// Silences MuJoCo, once for the process; every path to a model calls it first.
pub(crate) fn quiet() {
    static DONE: Once = Once::new();
    DONE.call_once(|| {
        let config = log_config().with_logto_console(false).with_logto_file(false);
        // SAFETY: no other thread uses MuJoCo: models are made in `model.rs` only, after this call, which all
        // threads await; and without a model nothing of MuJoCo can be used.
        unsafe { set_log_config(config) };
    });
}
