//! Writes that are done whole: an interruption of the process waits for the one that is under way.

use std::fs::{self, File, OpenOptions};
use std::io::{Read as _, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

use demosift::basics::files;
use demosift::{Error, Result};
use rustix::fs::OFlags;

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

/// A file of a run that grows: opened at its end, with all that it holds.
///
/// What lies there may come from another person, as the run folder may, so nothing is written through a link.
///
/// # Errors
/// `is_bad_input` if it is no plain file; `is_io` if it cannot be opened.
pub(crate) fn open_to_grow(path: &Path) -> Result<(File, Vec<u8>)> {
    let failed = |error: std::io::Error| Error::io("cannot open", path, &error);
    if fs::symlink_metadata(path).is_ok_and(|found| !found.is_file()) {
        return Err(Error::bad_input("this is a link or no file; wanted a plain file, as a run writes it")
            .at(path)
            .with_hint("delete it; it is made again as far as the run goes on"));
    }
    let flags = OFlags::NOFOLLOW | OFlags::NONBLOCK;
    let mut options = OpenOptions::new();
    let options = options.create(true).read(true).append(true).custom_flags(flags.bits().cast_signed());
    let mut file = options.open(path).map_err(failed)?;
    let mut held = Vec::new();
    file.read_to_end(&mut held).map_err(failed)?;
    Ok((file, held))
}

/// Appends to a file of this length whole or not at all, as far as the disk lets a half be taken back.
///
/// # Errors
/// `is_io` if it could not be written.
pub(crate) fn grow(file: &mut File, path: &Path, length: u64, bytes: &[u8]) -> Result<()> {
    file.write_all(bytes).map_err(|error| {
        // The first error is the one to tell; a half that stays is cut off when the file is opened again.
        let _ = file.set_len(length);
        files::cannot_write(path, &error)
    })
}
