//! The tests of the library that take it as a user does, in one program: each program more would be linked by itself.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "a failed unwrap is a failed test, and one that is skipped says so"
)]

mod cloning;
mod fixtures;
mod forecast;
mod formats;
mod methods;
mod mutual_information;
mod onnx;
mod onnxruntime;
mod spine;
mod trainer;
