//! The tests of tasks in MuJoCo, in one program: each program more would be linked by itself.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "a failed unwrap is a failed test, and one that is skipped says so"
)]

mod check;
mod draft;
mod early_end;
mod environment;
mod fatal;
mod free_throw;
mod half_cheetah;
mod handstand;
mod linking;
mod martial_arts;
mod penalty_save;
mod render;
mod replay;
mod scene;
mod suite;
mod support;
mod task_file;
mod units;
mod walker2d;
