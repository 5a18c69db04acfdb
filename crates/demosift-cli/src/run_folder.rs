//! The run folder: what a run depends on, and every noun and checkpoint as a file.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use demosift::basics::files;
use demosift::basics::ledger::Ledger;
use demosift::data::demonstration::choice::Choice;
use demosift::data::demonstration::episode::{Columns, Format};
use demosift::results::artifact::FORMAT_VERSION;
use demosift::{Error, Result};
use serde::{Deserialize, Serialize};
use toml::Table;

use crate::configuration;
use crate::given_prior::Origin;
use crate::interruption;
use crate::simulator::{Earlier, Simulator};
use crate::writing::undisturbed;

const RUN: &str = "run.json";
pub(crate) const RESOLVED: &str = "resolved.toml";

/// What a run depends on besides its configuration; kept in `run.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Identity {
    /// The version of demosift that began the run.
    pub(crate) demosift: String,
    /// The format version of its files; runs of before there was a second do not say.
    #[serde(default = "first_format")]
    pub(crate) format: u32,
    /// The task, as `--task` takes it, or the environment as `--env` does.
    pub(crate) task: String,
    /// Hash of the files of a task that does not come with demosift.
    pub(crate) task_sha256: Option<String>,
    /// The one variant of the task that the run is about; without it the run is about all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) variant: Option<String>,
    /// What is known of the environment, if the task is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) simulator: Option<Simulator>,
    /// The demonstrations; a recording has none.
    pub(crate) data: Option<Data>,
    /// The prior that the run was given, if it did not make its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) prior: Option<Origin>,
}

impl Identity {
    /// The environment of the run, if its task was one.
    pub(crate) fn environment(&self) -> Option<Earlier<'_>> {
        self.simulator.as_ref().map(|simulator| Earlier { env: &self.task, simulator })
    }
}

fn first_format() -> u32 {
    1
}

/// The demonstrations of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Data {
    /// Where they were when the run began.
    pub(crate) path: PathBuf,
    /// What they were.
    pub(crate) sha256: String,
    /// How they were stored; runs of before there were several do not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) format: Option<Format>,
    /// Which columns were read.
    #[serde(default)]
    pub(crate) columns: Columns,
    /// Which episodes of them were taken.
    #[serde(default, skip_serializing_if = "Choice::is_all")]
    pub(crate) choice: Choice,
}

/// What a folder tells of the run that it holds.
#[derive(Debug)]
pub(crate) struct Begun {
    pub(crate) identity: Identity,
    pub(crate) configuration: Table,
}

/// `--resume` names a folder without a run, and nothing else says what should begin there.
pub(crate) fn nothing_to_resume(folder: &Path) -> Error {
    Error::bad_input("no run to resume, and no task to begin one with, in the run folder")
        .at(folder)
        .with_hint("check --out, or add --task NAME to begin a run there")
}

/// The run that a folder holds, if it holds one.
///
/// Without `resume` a folder that holds anything is an error.
pub(crate) fn look_into(folder: &Path, resume: bool) -> Result<Option<Begun>> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) if error.kind() == ErrorKind::NotADirectory => {
            return Err(
                Error::bad_input("the run folder is a file; wanted a folder, or a new name").at(folder)
            );
        }
        Err(error) => return Err(Error::io("cannot look into the run folder", folder, &error)),
    };
    let mut names = entries
        .map(|entry| entry.map(|entry| entry.file_name().to_string_lossy().into_owned()))
        .collect::<std::io::Result<Vec<_>>>()
        .map_err(|error| Error::io("cannot look into the run folder", folder, &error))?;
    names.sort();
    let begun = names.iter().any(|name| name == RUN);
    // A run that was killed while it began leaves these only, and has done nothing yet.
    let empty = names.iter().all(|name| name == RESOLVED || name.ends_with(".partial"));
    match (begun, resume) {
        (false, _) if empty => Ok(None),
        (false, _) => Err(Error::bad_input(format!(
            "the run folder holds other files ({}) and no run",
            names.join(", ")
        ))
        .at(folder)
        .with_hint("give the name of a new folder to --out")),
        (true, false) => Err(Error::bad_input("the run folder holds a run already")
            .at(folder)
            .with_hint("add --resume to go on with it, or give another folder to --out")),
        (true, true) => Ok(Some(Begun {
            identity: read_identity(&folder.join(RUN))?,
            configuration: configuration::Layer::from_file(&folder.join(RESOLVED))?.values,
        })),
    }
}

/// Whether a folder holds a run, of whatever kind.
pub(crate) fn is_one(folder: &Path) -> bool {
    folder.join(RUN).exists()
}

/// The first, by name, of the runs within a run's folder: those about one of its goals each.
pub(crate) fn first_within(folder: &Path) -> Option<PathBuf> {
    let entries = fs::read_dir(folder).ok()?.filter_map(|entry| entry.ok().map(|entry| entry.path()));
    entries.filter(|path| is_one(path)).min()
}

/// Looks into the folder of a finished run without touching it.
pub(crate) fn of_finished(folder: &Path) -> Result<(Identity, RunFolder)> {
    let file = folder.join(RUN);
    if !file.exists() {
        return Err(Error::bad_input(format!("this is not a run folder: it has no {RUN}"))
            .at(folder)
            .with_hint("give the folder that the run had as --out, or runs/NAME of its task"));
    }
    Ok((read_identity(&file)?, RunFolder { path: folder.to_owned() }))
}

/// The configuration of a run, as it is written down.
pub(crate) fn resolved(folder: &Path) -> Result<String> {
    let path = folder.join(RESOLVED);
    fs::read_to_string(&path).map_err(|error| Error::io("cannot read the configuration", &path, &error))
}

fn read_identity(path: &Path) -> Result<Identity> {
    let bytes = fs::read(path).map_err(|error| Error::io("cannot read the run", path, &error))?;
    let identity: Identity = serde_json::from_slice(&bytes)
        .map_err(|error| Error::bad_input(format!("this is not the file of a run: {error}")).at(path))?;
    if identity.format == FORMAT_VERSION {
        return Ok(identity);
    }
    Err(Error::bad_input(format!(
        "the run is of demosift {}, whose files have format version {}; this is demosift {}, which reads format version \
         {FORMAT_VERSION}",
        identity.demosift,
        identity.format,
        env!("CARGO_PKG_VERSION")
    ))
    .at(path)
    .with_hint("run it anew with another folder for --out"))
}

/// Nouns and checkpoints as files of one folder.
#[derive(Clone, Debug)]
pub(crate) struct RunFolder {
    path: PathBuf,
}

impl RunFolder {
    /// Begins a run, or goes on with the one in the folder if that depends on the same things.
    pub(crate) fn open(
        path: PathBuf,
        begun: Option<&Begun>,
        identity: &Identity,
        configuration: &Table,
    ) -> Result<Self> {
        if begun.is_some() {
            let folder = Self::look(path, begun, identity, configuration)?;
            remove_partial(&folder.path)?;
            interruption::run_is_in(&folder.path);
            return Ok(folder);
        }
        fs::create_dir_all(&path).map_err(|error| Error::io("cannot make the run folder", &path, &error))?;
        let text = toml::to_string_pretty(configuration).expect("what was read from TOML is TOML");
        let mut json = serde_json::to_vec_pretty(identity).expect("names and hashes are JSON");
        json.push(b'\n');
        undisturbed(|| {
            files::write_atomically(&path.join(RESOLVED), text.as_bytes())?;
            // Last, since it makes the folder a run.
            files::write_atomically(&path.join(RUN), &json)
        })?;
        interruption::run_is_in(&path);
        Ok(Self { path })
    }

    /// The folder of a run that would begin or go on; touches nothing.
    pub(crate) fn look(
        path: PathBuf,
        begun: Option<&Begun>,
        identity: &Identity,
        configuration: &Table,
    ) -> Result<Self> {
        if let Some(begun) = begun {
            check_same(begun, identity, configuration).map_err(|error| error.at(&path))?;
        }
        Ok(Self { path })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
}

impl Ledger for RunFolder {
    fn recall(&self, name: &str) -> Result<Option<Vec<u8>>> {
        let path = self.path.join(name);
        match fs::read(&path) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(Error::io("cannot read", &path, &error)),
        }
    }

    fn store(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        undisturbed(|| files::write_atomically(&self.path.join(name), bytes))
    }

    fn forget(&mut self, name: &str) -> Result<()> {
        let path = self.path.join(name);
        match undisturbed(|| fs::remove_file(&path)) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                Err(Error::io("cannot delete", &path, &error))
            }
            _ => Ok(()),
        }
    }
}

/// The files and folders that a killed write left behind.
fn remove_partial(folder: &Path) -> Result<()> {
    let failed = |error: std::io::Error| Error::io("cannot tidy the run folder", folder, &error);
    for entry in fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        if entry.file_name().to_string_lossy().ends_with(".partial") {
            let path = entry.path();
            let is_folder = entry.file_type().map_err(failed)?.is_dir();
            if is_folder { fs::remove_dir_all(path) } else { fs::remove_file(path) }.map_err(failed)?;
        }
    }
    Ok(())
}

/// The task was held against the run's before its goal was looked for, in [`crate::job::Request`].
fn check_same(begun: &Begun, identity: &Identity, configuration: &Table) -> Result<()> {
    let sha256 = |identity: &Identity| identity.data.as_ref().map(|data| data.sha256.clone());
    let old = &begun.identity;
    let columns = |identity: &Identity| match (&identity.data, &old.data) {
        (Some(data), Some(Data { format: Some(_), .. })) => {
            format!("{} and {}", data.columns.observations.join(","), data.columns.actions.join(","))
        }
        _ => String::new(),
    };
    let choice =
        |identity: &Identity| identity.data.as_ref().map_or_else(String::new, |data| data.choice.to_string());
    let prior =
        |identity: &Identity| identity.prior.as_ref().map_or("none".to_owned(), |prior| prior.sha256.clone());
    let text = |value: Option<String>| value.unwrap_or_else(|| "none".to_owned());
    let variant = |identity: &Identity| identity.variant.clone().unwrap_or_else(|| "all of them".to_owned());
    let pairs = [
        ("the version of demosift", old.demosift.clone(), identity.demosift.clone()),
        ("the variant", variant(old), variant(identity)),
        // Before the hash, which may depend on them.
        ("the columns of the demonstrations", columns(old), columns(identity)),
        ("the choice of episodes", choice(old), choice(identity)),
        ("the SHA-256 of the prior that it was given", prior(old), prior(identity)),
        ("the SHA-256 of the demonstrations", text(sha256(old)), text(sha256(identity))),
    ];
    let differs = pairs.into_iter().find(|(_, old, new)| old != new);
    let (what, old, new) =
        match (differs, configuration::first_difference(&begun.configuration, configuration)) {
            (Some((what, old, new)), _) => (what.to_owned(), old, new),
            (None, Some(difference)) => difference,
            (None, None) => return Ok(()),
        };
    Err(of_another_run(&what, &old, &new))
}

/// A run folder cannot go on with something else.
pub(crate) fn of_another_run(what: &str, old: &str, new: &str) -> Error {
    Error::bad_config(format!("the run folder is of another run: {what} was {old} there, and is {new} now"))
        .with_hint("take back the change, or give another folder to --out")
}
