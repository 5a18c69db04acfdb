//! What git leaves in place of a large file until it is fetched.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use crate::basics::error::{Error, Result};
use crate::basics::files;

const START: &[u8] = b"version https://git-lfs.github.com/spec/";

/// Refuses a file that only says where git lfs keeps the real one; what cannot be read is left to others to complain of.
///
/// # Errors
/// `is_bad_input` if it is one, or no plain file.
pub fn refuse(path: &Path) -> Result<()> {
    if path.exists() {
        files::check_is_plain(path)?;
    }
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(START.len() as u64).read_to_end(&mut start));
    if read.is_ok() && start == START {
        return Err(Error::bad_input("this is a pointer of git lfs, not the file itself")
            .with_hint("run `git lfs pull` in its folder, or download the data set by its own tool")
            .at(path));
    }
    Ok(())
}
