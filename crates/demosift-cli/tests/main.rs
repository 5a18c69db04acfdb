//! The tests of the command, which run it as a user would, in one program: each program more would be linked by itself.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "a failed unwrap is a failed test, and one that is skipped says so"
)]

mod after_run;
mod bad_input;
mod documents;
mod end_to_end;
mod formats;
mod golden;
mod guides;
mod gymnasium;
#[path = "../../demosift/tests/onnxruntime/mod.rs"]
mod onnxruntime;
mod parts;
mod physics;
mod play;
mod policies;
mod prior;
#[path = "../../demosift-gymnasium/tests/support/mod.rs"]
mod python;
mod report;
mod reproduce;
mod robosuite;
mod robust;
mod study;
mod support;
mod task_check;
mod trainer;
mod trainer_judge;
mod units;
