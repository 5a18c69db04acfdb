//! Writes that are done whole: an interruption of the process waits for the one that is under way.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Held while something is written, and by the interruption that ends the process.
static WRITING: Mutex<()> = Mutex::new(());

/// Writes something whole before an interruption may end the process; never one within another, which would wait for itself.
pub(crate) fn undisturbed<T>(write: impl FnOnce() -> T) -> T {
    let _writing = hold();
    write()
}

/// Waits for the write that is under way; nothing more is written for as long as this is held.
pub(crate) fn hold() -> MutexGuard<'static, ()> {
    WRITING.lock().unwrap_or_else(PoisonError::into_inner)
}
