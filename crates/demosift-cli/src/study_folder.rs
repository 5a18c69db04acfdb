//! The folder of a study: each finished cell is a small file, which says what it depends on.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use demosift::basics::{files, seal};
use demosift::run::experiment::Config;
use demosift::run::study::{Cell, Work};
use demosift::{Error, Result};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::arguments::Part;
use crate::interruption;
use crate::lock::{self, Lock};
use crate::study_file::OpenedSet;
use crate::writing::undisturbed;

const CELLS: &str = "cells";
const SET_ASIDE: &str = "set_aside";
const RESULTS: &str = "study.json";

/// What a cell depends on besides its work; it is believed only while all of it is the same.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Fingerprint {
    /// Its version.
    demosift: String,
    /// Name, variant, and for a user's own the hash of its files.
    task: String,
    /// Hash of the file, and which episodes of it.
    set: String,
    /// Hash of the values that enter the work.
    configuration: String,
}

impl Fingerprint {
    pub(crate) fn of(work: &Work, opened: &OpenedSet) -> Self {
        let task = [Some(&opened.task), opened.chosen.variant.as_ref(), opened.chosen.sha256.as_ref()];
        let task: Vec<&str> = task.into_iter().flatten().map(String::as_str).collect();
        let episodes = opened.episodes.as_ref().map_or(String::new(), |episodes| format!(" {episodes:?}"));
        Self {
            demosift: env!("CARGO_PKG_VERSION").to_owned(),
            task: task.join(" "),
            set: format!("{}{episodes}", opened.sha256),
            configuration: files::sha256_of(entering(work, opened).to_string().as_bytes()),
        }
    }

    /// What differs, in words.
    fn difference(&self, now: &Self) -> Option<&'static str> {
        let pairs = [
            ("another version of demosift", &self.demosift, &now.demosift),
            ("another task", &self.task, &now.task),
            ("other demonstrations", &self.set, &now.set),
            ("another configuration", &self.configuration, &now.configuration),
        ];
        pairs.into_iter().find(|(_, old, now)| old != now).map(|(what, _, _)| what)
    }
}

/// The values that enter some work; its imitator and seed stand in its name.
fn entering(work: &Work, opened: &OpenedSet) -> Value {
    let (config, enters): (&Config, fn(&str) -> bool) = match work {
        Work::Training { .. } => (&opened.training, |key| ["policy", "imitate"].contains(&key)),
        Work::Judging { method, .. } => {
            (opened.of_method(method), |key| !["seed", "imitate", "subset_selection"].contains(&key))
        }
    };
    let mut values = serde_json::to_value(config).expect("a configuration is plain data");
    if let Value::Object(fields) = &mut values {
        fields.retain(|key, _| enters(key));
        if let Some(Value::Object(update)) = fields.get_mut("imitate").and_then(|of| of.get_mut("update")) {
            update.remove("imitation");
        }
    }
    values
}

impl OpenedSet {
    /// The configuration of a method that has cells of its own.
    pub(crate) fn of_method(&self, name: &str) -> &Config {
        let found = self.methods.iter().find(|(known, _)| known == name);
        &found.expect("only methods of the study have work").1
    }
}

/// A cell as its file holds it.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    fingerprint: Fingerprint,
    cell: Cell,
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
        let name = part.map_or(String::new(), |Part { index, of }| format!("_{index}_of_{of}"));
        self.lock = Some(lock::take(&self.path, &name)?);
        interruption::run_is_in(&self.path);
        Ok(())
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    fn file(&self, work: &Work) -> PathBuf {
        self.path.join(CELLS).join(format!("{}.json", work.name()))
    }

    pub(crate) fn recall(&self, work: &Work, fingerprint: &Fingerprint) -> Result<Recalled> {
        let path = self.file(work);
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Recalled::Nothing),
            Err(error) => return Err(Error::io("cannot read the cell", &path, &error)),
        };
        let Ok(bytes) = seal::of_json_if_sealed(bytes, "the cell") else {
            return Ok(Recalled::NotBelieved("a file that was damaged"));
        };
        Ok(match serde_json::from_slice::<File>(&bytes) {
            Err(_) => Recalled::NotBelieved("a file that cannot be read"),
            Ok(file) if file.cell.work != *work => Recalled::NotBelieved("other work"),
            Ok(file) => match file.fingerprint.difference(fingerprint) {
                Some(what) => Recalled::NotBelieved(what),
                None => Recalled::Cell(Box::new(file.cell)),
            },
        })
    }

    pub(crate) fn store(&self, cell: &Cell, fingerprint: Fingerprint) -> Result<()> {
        let path = self.file(&cell.work);
        let bytes = seal::to_json(&File { fingerprint, cell: cell.clone() });
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

    /// The file of results.
    pub(crate) fn store_results(&self, bytes: &[u8]) -> Result<()> {
        undisturbed(|| files::write_atomically(&self.path.join(RESULTS), bytes))
    }
}
