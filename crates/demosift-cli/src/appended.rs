//! A file that grows at its end, and is opened for writing when there is something to write: a finished run can be read where
//! nothing may be written.

use std::fs::{File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

#[derive(Debug)]
pub(crate) struct Appended {
    path: PathBuf,
    /// What of it counts, in bytes; a kill may have left more.
    counts: u64,
    file: Option<File>,
}

impl Appended {
    /// Of the file that is there so many bytes count, and of those that are `missing` behind them it gets as many as may be
    /// written now.
    pub(crate) fn after(path: &Path, counts: u64, found: u64, missing: &[u8]) -> io::Result<Self> {
        let mut file = Self { path: path.to_owned(), counts, file: None };
        if counts == found && missing.is_empty() {
            return Ok(file);
        }
        match file.append(missing) {
            Err(error) if is_forbidden(&error) => Ok(file),
            mended => mended.map(|()| file),
        }
    }

    pub(crate) fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        let file = match &mut self.file {
            Some(file) => file,
            None => {
                let file = OpenOptions::new().create(true).append(true).open(&self.path)?;
                file.set_len(self.counts)?;
                self.file.insert(file)
            }
        };
        file.write_all(bytes)
    }
}

fn is_forbidden(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem)
}
