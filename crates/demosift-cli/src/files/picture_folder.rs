//! A folder of pictures that appears whole or not at all.
//!
//! Ctrl-C while pictures are rendered leaves the hidden folder with those that are there, each of them whole; the next attempt
//! takes it away.

use std::ffi::OsString;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use demosift::basics::files;
use demosift::{Error, Result};

use crate::files::writing::undisturbed;

/// Pictures wait in a hidden folder beside it until all are there.
pub(crate) struct PictureFolder {
    path: PathBuf,
    partial: PathBuf,
}

impl PictureFolder {
    /// Whether a folder can be made here: there is none, or one that is empty.
    pub(crate) fn check(path: &Path) -> Result<()> {
        match fs::read_dir(path).map(|mut entries| entries.next().is_none()) {
            Ok(true) => Ok(()),
            Ok(false) => Err(Error::bad_input("the folder for the pictures holds other files")
                .at(path)
                .with_hint("give the name of a new folder to --out")),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
            Err(error) if error.kind() == ErrorKind::NotADirectory => {
                Err(Error::bad_input("the folder for the pictures is a file; wanted a folder, or a new name")
                    .at(path))
            }
            Err(error) => Err(Error::io("cannot look into the folder for the pictures", path, &error)),
        }
    }

    pub(crate) fn begin(path: &Path) -> Result<Self> {
        Self::check(path)?;
        let name =
            path.file_name().ok_or_else(|| Error::bad_input("wanted the name of a folder").at(path))?;
        let mut hidden = OsString::from(".");
        hidden.push(name);
        hidden.push(".partial");
        let partial = path.with_file_name(hidden);
        // Of an earlier attempt that was killed.
        let _ = fs::remove_dir_all(&partial);
        let folder = Self { path: path.to_owned(), partial };
        folder.make(&folder.partial)?;
        Ok(folder)
    }

    /// Adds a file; its name may lead into folders of the folder.
    pub(crate) fn add(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.partial.join(name);
        path.parent().map_or(Ok(()), |parent| self.make(parent))?;
        undisturbed(|| files::write_atomically(&path, bytes))
    }

    /// Lets the folder appear.
    pub(crate) fn finish(self) -> Result<()> {
        fs::rename(&self.partial, &self.path)
            .map_err(|error| Error::io("cannot make the folder for the pictures", &self.path, &error))?;
        files::sync_folder_of(&self.path)
    }

    fn make(&self, folder: &Path) -> Result<()> {
        fs::create_dir_all(folder)
            .map_err(|error| Error::io("cannot make the folder for the pictures", &self.path, &error))
    }
}

impl Drop for PictureFolder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.partial);
    }
}
