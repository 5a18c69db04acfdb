//! The extension module of the wheel: the whole command, policies, recorded arrays, and what plays episodes in a worker.
//!
//! The face that users see is in Python, `python/demosift`; here is only what has to be Rust.
//! Arrays cross as bytes of little-endian f32, so that nothing here depends on a version of numpy.

mod playing;
mod policy;
mod recorded;

use std::ffi::OsString;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Runs the command as it was typed, the name of the program first; returns its exit code.
///
/// Once a process, which it may end: on Ctrl-C a run stops at once.
#[pyfunction]
fn run(py: Python<'_>, typed: Vec<OsString>) -> u8 {
    py.detach(|| demosift_cli::run(typed))
}

/// An error of demosift with the same words; the hint is its second argument.
fn raised(error: &demosift::Error) -> PyErr {
    PyValueError::new_err((error.to_string(), error.hint().map(str::to_owned)))
}

fn f32s(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|of| f32::from_le_bytes([of[0], of[1], of[2], of[3]])).collect()
}

fn bytes_of(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

#[pymodule]
mod _demosift {
    #[pymodule_export]
    use super::playing::play;
    #[pymodule_export]
    use super::policy::Policy;
    #[pymodule_export]
    use super::recorded::read;
    #[pymodule_export]
    use super::run;

    /// The version of demosift.
    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
    /// What plays whole episodes here; a worker is asked for them if this is the same on both sides.
    #[pymodule_export]
    const PLAYER: &str = demosift_gymnasium::whole::PLAYER;
}
