//! The folder of a study: each finished cell is a small file, which says what it depends on.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use demosift::basics::files::{self, Unfinished};
use demosift::basics::part::Part;
use demosift::basics::seal;
use demosift::run::experiment::Config;
use demosift::run::study::{Cell, Fingerprint, Work, hash_of_entering};
use demosift::{Error, Result};

use crate::console::{interruption, terminal};
use crate::files::lock::{self, Beside, Holder, Lock};
use crate::files::writing::undisturbed;
use crate::study::study_file::OpenedSet;

const CELLS: &str = "cells";
const SET_ASIDE: &str = "set_aside";

/// What a cell of this set would be made with now, its prior on the set of `lender`, where that is another.
pub(crate) fn fingerprint(work: &Work, opened: &OpenedSet, lender: Option<&OpenedSet>) -> Fingerprint {
    let task = [Some(&opened.task), opened.chosen.variant.as_ref(), opened.chosen.sha256.as_ref()];
    let task: Vec<&str> = task.into_iter().flatten().map(String::as_str).collect();
    let demonstrations = |of: &OpenedSet| {
        let episodes = of.episodes.as_ref().map_or(String::new(), |episodes| format!(" {episodes:?}"));
        // The same file is another set by other columns of it.
        let columns = if of.columns.are_usual() { String::new() } else { format!(" {:?}", of.columns) };
        let format = of.format.map_or(String::new(), |format| format!(" {format:?}"));
        format!("{}{episodes}{columns}{format}", of.sha256)
    };
    let lender = lender.map_or(String::new(), |lender| format!(", prior of {}", demonstrations(lender)));
    let config = match work {
        Work::Training { .. } => &opened.training,
        Work::Judging { method, .. } | Work::Weighing { method, .. } => opened.of_method(method),
    };
    Fingerprint {
        demosift: env!("CARGO_PKG_VERSION").to_owned(),
        task: task.join(" "),
        set: format!("{}{lender}", demonstrations(opened)),
        configuration: hash_of_entering(work, config),
    }
}

impl OpenedSet {
    /// The configuration of a method that has cells of its own.
    pub(crate) fn of_method(&self, name: &str) -> &Config {
        let found = self.methods.iter().find(|(known, _)| known == name);
        &found.expect("only methods of the study have work").1
    }
}

/// What the folder holds of some work.
pub(crate) enum Recalled {
    Nothing,
    Cell(Box<Cell>),
    /// A cell that is not believed, and why.
    NotBelieved(&'static str),
}

pub(crate) struct StudyFolder {
    path: PathBuf,
    /// That of the part that is made here; other parts may be made by others at the same time.
    lock: Option<Lock>,
}

impl StudyFolder {
    /// Looks into a folder that need not be there.
    pub(crate) fn look(path: PathBuf) -> Result<Self> {
        if path.is_file() {
            return Err(Error::bad_input(
                "the folder of the study is a file; wanted a folder, or a new name",
            )
            .at(&path));
        }
        Ok(Self { path, lock: None })
    }

    /// Makes it, where it is not there; from here on an interruption names it.
    pub(crate) fn begin(&mut self, part: Option<Part>) -> Result<()> {
        let cells = self.path.join(CELLS);
        fs::create_dir_all(&cells)
            .map_err(|error| Error::io("cannot make the folder of the study", &cells, &error))?;
        let name = part.map_or(String::new(), |part| self.lock_of(part));
        self.lock = Some(lock::take(&self.path, &name)?);
        [&self.path, &cells].into_iter().try_for_each(|folder| remove_left_over(folder))?;
        interruption::run_is_in(&self.path);
        Ok(())
    }

    /// The name of a part's lock, or of one beside it; a cell that two make is the same.
    fn lock_of(&self, part: Part) -> String {
        let held_by = |name: &str| lock::held_elsewhere(&self.path, name);
        let tell = |holder: &Holder| {
            terminal::say(&format!(
                "note: part {part} was begun by {holder}, and this takes its place; if that one still works, both make the same \
                 cells"
            ));
        };
        Beside::of(&format!("_{}", part.name()), held_by, tell).name
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    fn file(&self, work: &Work) -> PathBuf {
        self.path.join(CELLS).join(format!("{}.json", work.name()))
    }

    pub(crate) fn recall(&self, work: &Work, fingerprint: &Fingerprint) -> Result<Recalled> {
        let path = self.file(work);
        let Some(bytes) = files::read_if_there(&path)? else { return Ok(Recalled::Nothing) };
        let Ok(bytes) = seal::of_json_if_sealed(bytes, "the cell") else {
            return Ok(Recalled::NotBelieved("a file that was damaged"));
        };
        Ok(match serde_json::from_slice::<Cell>(&bytes) {
            Err(_) => Recalled::NotBelieved("a file that cannot be read"),
            Ok(cell) if cell.work != *work => Recalled::NotBelieved("other work"),
            Ok(cell) => match cell.fingerprint.difference(fingerprint) {
                Some(what) => Recalled::NotBelieved(what),
                None => Recalled::Cell(Box::new(cell)),
            },
        })
    }

    pub(crate) fn store(&self, cell: &Cell) -> Result<()> {
        let path = self.file(&cell.work);
        let bytes = seal::to_json(cell);
        undisturbed(|| files::write_atomically(&path, &bytes))
    }

    /// Moves a cell that is not believed out of the way, under a name that is free.
    pub(crate) fn set_aside(&self, work: &Work) -> Result<()> {
        let (from, folder) = (self.file(work), self.path.join(CELLS).join(SET_ASIDE));
        let failed = |error: std::io::Error| Error::io("cannot set the cell aside", &from, &error);
        fs::create_dir_all(&folder).map_err(failed)?;
        let free = (1..)
            .map(|number| folder.join(format!("{}_{number}.json", work.name())))
            .find(|path| !path.exists())
            .expect("numbers do not end");
        match undisturbed(|| fs::rename(&from, free)) {
            // Another part of the study was faster.
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
            moved => moved.map_err(failed),
        }
    }

    /// The file of results of this name.
    pub(crate) fn store_results(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.path.join(format!("{name}.json"));
        undisturbed(|| files::write_atomically(&path, bytes))
    }
}

/// Removes what killed processes of this machine left behind; other parts may be writing at the same time.
fn remove_left_over(folder: &Path) -> Result<()> {
    let failed = |error: std::io::Error| Error::io("cannot tidy the folder of the study", folder, &error);
    for entry in fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        if Unfinished::of(&entry.file_name().to_string_lossy()).is_some_and(|write| write.is_left_over()) {
            // Another part may have been faster.
            let _ = fs::remove_file(entry.path());
        }
    }
    Ok(())
}
