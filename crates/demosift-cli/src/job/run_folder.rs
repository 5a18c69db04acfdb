//! The run folder: every result and checkpoint as a file, beside what the run depends on.

use std::collections::BTreeMap;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Duration;

use demosift::basics::files;
use demosift::basics::ledger::Ledger;
use demosift::basics::part::Part;
use demosift::basics::seal;
use demosift::results::artifact::FORMAT_VERSION;
use demosift::{Error, Result};
use serde::Deserialize;
use toml::Table;

use super::identity::{Begun, Identity, check_same, first_format};
use crate::configuration::asked_again::{self, PARTS, is_about_one_keep};
use crate::configuration::resolved::{self, RESOLVED};
use crate::console::{interruption, terminal};
use crate::files::lock::{self, Beside, Lock};
use crate::files::metrics_file::MEASURED;
use crate::files::writing::undisturbed;

const RUN: &str = "run.json";
/// The folder in which the wheel puts what a run in parts was given from memory (`demosift/runs.py`), before the run begins.
const INPUTS: &str = "inputs";

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
    let is_of_ours =
        |name: &String| name == RESOLVED || name == INPUTS || lock::is_one(name) || is_left_over(name);
    let empty = names.iter().all(is_of_ours);
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
        (true, true) => {
            let identity = read_identity(&folder.join(RUN))?;
            let configuration = read_configuration(folder, &identity)?;
            Ok(Some(Begun { identity, configuration }))
        }
    }
}

/// What a run was begun with; nothing of it may be changed by hand, as some results would be of one configuration and some of
/// another.
pub(crate) fn read_configuration(folder: &Path, identity: &Identity) -> Result<Table> {
    resolved::read(folder, &identity.configuration_sha256)
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
    Ok((read_identity(&file)?, RunFolder::at(folder.to_owned())))
}

/// The configuration of a run, as it is written down.
pub(crate) fn resolved(folder: &Path) -> Result<String> {
    let path = folder.join(RESOLVED);
    fs::read_to_string(&path).map_err(|error| Error::io("cannot read the configuration", &path, &error))
}

fn read_identity(path: &Path) -> Result<Identity> {
    let bytes = files::read(path)?;
    let none = |error| Error::bad_input(format!("this is not the file of a run: {error}")).at(path);
    let Written { demosift, format } = serde_json::from_slice(&bytes).map_err(none)?;
    if format != FORMAT_VERSION {
        return Err(Error::bad_input(format!(
            "the run is of demosift {demosift}, whose files have format version {format}; this is demosift {}, which \
             reads format version {FORMAT_VERSION}",
            env!("CARGO_PKG_VERSION")
        ))
        .at(path)
        .with_hint("run it again with another folder for --out"));
    }
    let damaged = |error: Error| {
        Error::bad_input(error.message()).at(path).with_hint("run it again with another folder for --out")
    };
    serde_json::from_slice(&seal::of_json(&bytes, RUN).map_err(damaged)?).map_err(none)
}

/// By whom and how a run was written, which later versions can read of every run.
#[derive(Deserialize)]
struct Written {
    demosift: String,
    #[serde(default = "first_format")]
    format: u32,
}

/// Results and checkpoints as files of one folder.
///
/// It is locked from the first write on: reading alone needs no lock, and no right to write.
#[derive(Debug)]
pub(crate) struct RunFolder {
    path: PathBuf,
    /// Which part of the run's work is done here.
    share: Option<Share>,
    lock: Option<Lock>,
    /// What is there instead of the files, where nothing may be written; `None` for a file that is taken to be away.
    unwritten: Option<BTreeMap<String, Option<Vec<u8>>>>,
}

/// A part of a run's work, whose files are written into a folder of their own.
#[derive(Debug)]
struct Share {
    part: Part,
    folder: PathBuf,
    /// The folders of those that began the part on other machines, whose checkpoints it goes on from.
    before: Vec<PathBuf>,
}

impl Share {
    /// A part in the folder of its name, or in one beside it; two folders do no harm.
    fn of(run: &Path, part: Part) -> Self {
        let parts = run.join(PARTS);
        let held_by = |name: &str| lock::held_elsewhere(&parts.join(name), "");
        let Beside { name, held } = Beside::of(&part.name(), held_by, |holder| {
            terminal::say(&format!(
                "note: part {part} was begun by {holder}, and this takes its place; if that one still works, one of them does \
                 it in vain"
            ));
        });
        Self { part, folder: parts.join(name), before: held.iter().map(|name| parts.join(name)).collect() }
    }
}

impl RunFolder {
    fn at(path: PathBuf) -> Self {
        Self { path, share: None, lock: None, unwritten: None }
    }

    /// Begins a run, or goes on with the one in the folder if that depends on the same things.
    pub(crate) fn open(
        path: PathBuf,
        begun: Option<&Begun>,
        identity: &Identity,
        configuration: &Table,
    ) -> Result<Self> {
        if let Some(begun) = begun {
            check_same(begun, identity, configuration).map_err(|error| error.at(&path))?;
            let mut folder = Self::at(path);
            interruption::run_is_in(&folder.path);
            folder.tidy();
            if !asked_again::is_settled(&folder.path, &begun.configuration, configuration) {
                folder.claim()?;
                asked_again::settle(&folder.path, &begun.configuration, configuration)?;
            }
            folder.collect()?;
            return Ok(folder);
        }
        fs::create_dir_all(&path).map_err(|error| Error::io("cannot make the run folder", &path, &error))?;
        let mut folder = Self::at(path);
        folder.claim()?;
        // Another command may have begun one since it was looked for.
        look_into(&folder.path, false)?;
        let configuration_sha256 = resolved::sha256_of_fixed(configuration);
        let identity = Identity { configuration_sha256, ..identity.clone() };
        let json = seal::to_json(&identity);
        undisturbed(|| {
            resolved::write(&folder.path, configuration)?;
            // Last, since it makes the folder a run.
            files::write_atomically(&folder.path.join(RUN), &json)
        })?;
        interruption::run_is_in(&folder.path);
        Ok(folder)
    }

    /// Copies what parts of the run have finished; their checkpoints and measurements stay where they are, and what follows
    /// from what is kept is made of the rest, for the `keep` that is asked for.
    fn collect(&mut self) -> Result<()> {
        let mut parts = self.others()?;
        parts.retain(|folder| *folder != self.path);
        for part in parts {
            for name in names_in(&part)? {
                let is_result =
                    [".json", ".safetensors", ".onnx"].iter().any(|ending| name.ends_with(ending));
                let is_of_part = name.starts_with('.') || name == MEASURED || is_about_one_keep(&name);
                if !is_result || is_of_part || self.path.join(&name).exists() {
                    continue;
                }
                // The part may be at work, and replace it.
                if let Some(bytes) = files::read_if_there(&part.join(&name))? {
                    self.store(&name, &bytes)?;
                }
            }
        }
        Ok(())
    }

    /// Joins a run to do a part of its work; the first part begins it.
    ///
    /// Parts that start at the same time find the run begun by one of them, whichever is first.
    pub(crate) fn join(
        path: PathBuf,
        part: Part,
        identity: &Identity,
        configuration: &Table,
    ) -> Result<Self> {
        let begun = begun_by_any(&path, identity, configuration)?;
        check_same(&begun, identity, configuration).map_err(|error| error.at(&path))?;
        if !asked_again::is_settled(&path, &begun.configuration, configuration) {
            return Err(Error::bad_config(
                "a part of a run cannot ask for another --keep or --referee than the run",
            )
            .at(&path)
            .with_hint("ask the whole run for it, with --resume and without --part"));
        }
        let folder = Self { share: Some(Share::of(&path, part)), ..Self::at(path) };
        let own = folder.written();
        fs::create_dir_all(&own)
            .map_err(|error| Error::io("cannot make the folder of the part", &own, &error))?;
        interruption::run_is_in(&folder.path);
        Ok(folder)
    }

    /// The folder of a run that would begin or go on; touches nothing, and what is stored lasts as long as this.
    pub(crate) fn look(
        path: PathBuf,
        begun: Option<&Begun>,
        identity: &Identity,
        configuration: &Table,
    ) -> Result<Self> {
        let mut unwritten = BTreeMap::new();
        if let Some(begun) = begun {
            check_same(begun, identity, configuration).map_err(|error| error.at(&path))?;
            let changed = asked_again::would_be(&path, &begun.configuration, configuration);
            unwritten.extend(changed.into_iter().map(|(name, held)| (name.to_owned(), fs::read(held).ok())));
        }
        Ok(Self { unwritten: Some(unwritten), ..Self::at(path) })
    }

    /// Takes away the lock of a process that is gone, and what it left; where that cannot be done, nothing depends on it.
    fn tidy(&mut self) {
        if lock::is_there(&self.path) && self.claim().is_ok() {
            self.lock = None;
        }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The folder into which results are written: that of the part, where only a part of the work is done.
    pub(crate) fn written(&self) -> PathBuf {
        self.share.as_ref().map_or_else(|| self.path.clone(), |share| share.folder.clone())
    }

    /// The other folders of the run: the whole, seen from a part, and those of its parts.
    fn others(&self) -> Result<Vec<PathBuf>> {
        let parts = self.path.join(PARTS);
        let mut folders = match fs::read_dir(&parts) {
            Ok(entries) => entries
                .map(|entry| entry.map(|entry| entry.path()))
                .collect::<std::io::Result<Vec<_>>>()
                .map_err(|error| Error::io("cannot look into the folder of the parts", &parts, &error))?,
            Err(error) if error.kind() == ErrorKind::NotFound => Vec::new(),
            Err(error) => return Err(Error::io("cannot look into the folder of the parts", &parts, &error)),
        };
        folders.retain(|folder| folder.is_dir());
        folders.sort();
        folders.insert(0, self.path.clone());
        let own = self.written();
        folders.retain(|folder| *folder != own);
        Ok(folders)
    }
}

/// How the names of checkpoints begin, of which each part has another.
const CHECKPOINT: &str = "checkpoint_";

/// How long a part waits for another one that begins the run.
const TRIES_TO_BEGIN: usize = 600;
const BETWEEN_TRIES: Duration = Duration::from_millis(100);

/// The run, begun here or by another part.
fn begun_by_any(path: &Path, identity: &Identity, configuration: &Table) -> Result<Begun> {
    let mut failed = None;
    for _ in 0..TRIES_TO_BEGIN {
        if let Some(begun) = look_into(path, true)? {
            return Ok(begun);
        }
        match RunFolder::open(path.to_owned(), None, identity, configuration) {
            Ok(folder) => drop(folder),
            Err(error) if error.is_bad_input() => {
                failed = Some(error);
                std::thread::sleep(BETWEEN_TRIES);
            }
            Err(error) => return Err(error),
        }
    }
    Err(failed.unwrap_or_else(|| nothing_to_resume(path)))
}

fn names_in(folder: &Path) -> Result<Vec<String>> {
    let failed = |error: std::io::Error| Error::io("cannot look into the folder", folder, &error);
    let name = |entry: std::io::Result<fs::DirEntry>| {
        entry.map(|entry| entry.file_name().to_string_lossy().into_owned())
    };
    let mut names = fs::read_dir(folder)
        .map_err(failed)?
        .map(name)
        .collect::<std::io::Result<Vec<_>>>()
        .map_err(failed)?;
    names.sort();
    Ok(names)
}

impl Ledger for RunFolder {
    fn claim(&mut self) -> Result<()> {
        if self.lock.is_none() {
            let folder = self.written();
            self.lock = Some(lock::take(&folder, "")?);
            remove_left_over(&folder)?;
        }
        Ok(())
    }

    fn recall(&self, name: &str) -> Result<Option<Vec<u8>>> {
        if let Some(instead) = self.unwritten.as_ref().and_then(|unwritten| unwritten.get(name)) {
            return Ok(instead.clone());
        }
        if is_about_one_keep(name) {
            return files::read_if_there(&self.path.join(name));
        }
        let own = files::read_if_there(&self.written().join(name))?;
        if own.is_some() {
            return Ok(own);
        }
        // A result is the same whoever made it.
        let others = match name.starts_with(CHECKPOINT) {
            true => self.share.iter().flat_map(|share| share.before.clone()).collect(),
            false => self.others()?,
        };
        for folder in others {
            if let Some(found) = files::read_if_there(&folder.join(name))? {
                return Ok(Some(found));
            }
        }
        Ok(None)
    }

    /// What is there already is not written again, so that a finished run may lie on a disk that is only read.
    ///
    /// What follows from what is kept is written by the whole run alone: the folder of a part may outlive another `keep`.
    fn store(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        if let Some(unwritten) = &mut self.unwritten {
            unwritten.insert(name.to_owned(), Some(bytes.to_vec()));
            return Ok(());
        }
        if self.share.is_some() && is_about_one_keep(name) {
            return Ok(());
        }
        let path = self.written().join(name);
        if holds(&path, bytes) {
            return Ok(());
        }
        self.claim()?;
        undisturbed(|| files::write_atomically(&path, bytes))
    }

    fn forget(&mut self, name: &str) -> Result<()> {
        if let Some(unwritten) = &mut self.unwritten {
            unwritten.insert(name.to_owned(), None);
            return Ok(());
        }
        if self.share.is_some() && is_about_one_keep(name) {
            return Ok(());
        }
        let path = self.written().join(name);
        if fs::symlink_metadata(&path).is_err_and(|error| error.kind() == ErrorKind::NotFound) {
            return Ok(());
        }
        self.claim()?;
        match undisturbed(|| fs::remove_file(&path)) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                Err(Error::io("cannot delete", &path, &error))
            }
            _ => Ok(()),
        }
    }

    fn part(&self) -> Option<Part> {
        self.share.as_ref().map(|share| share.part)
    }

    fn of_parts(&self, name: &str) -> Result<Vec<Vec<u8>>> {
        let found = self.others()?.into_iter().map(|folder| files::read_if_there(&folder.join(name)));
        Ok(found.collect::<Result<Vec<_>>>()?.into_iter().flatten().collect())
    }

    fn each(&self) -> Result<Vec<Box<dyn Ledger>>> {
        let others = self.others()?;
        if others.is_empty() {
            return Ok(Vec::new());
        }
        let all = [self.written()].into_iter().chain(others);
        Ok(all.map(|folder| Box::new(OneFolder(folder)) as Box<dyn Ledger>).collect())
    }
}

/// What lies in one of the folders of a run, to be read alone.
struct OneFolder(PathBuf);

impl Ledger for OneFolder {
    fn recall(&self, name: &str) -> Result<Option<Vec<u8>>> {
        files::read_if_there(&self.0.join(name))
    }

    fn store(&mut self, name: &str, _: &[u8]) -> Result<()> {
        unreachable!("{name} is stored in the folder of the run, and not in one that is looked into")
    }

    fn forget(&mut self, name: &str) -> Result<()> {
        unreachable!("{name} is forgotten in the folder of the run, and not in one that is looked into")
    }
}

/// Writes a file unless it holds these bytes already: a finished run can be read where nothing may be written.
pub(crate) fn write_if_new(path: &Path, bytes: &[u8]) -> Result<()> {
    if holds(path, bytes) { Ok(()) } else { undisturbed(|| files::write_atomically(path, bytes)) }
}

fn holds(path: &Path, bytes: &[u8]) -> bool {
    let is_as_long = |found: &fs::Metadata| found.is_file() && found.len() == bytes.len() as u64;
    fs::symlink_metadata(path).is_ok_and(|found| is_as_long(&found))
        && fs::read(path).is_ok_and(|found| found == bytes)
}

/// Removes what a killed command left behind, and nothing of the user's.
fn remove_left_over(folder: &Path) -> Result<()> {
    let failed = |error: std::io::Error| Error::io("cannot tidy the run folder", folder, &error);
    for entry in fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let (name, path) = (entry.file_name(), entry.path());
        let name = name.to_string_lossy();
        match entry.file_type().map_err(failed)?.is_dir() {
            // Another command may be on its way to the lock, and tries again.
            true if lock::is_left_over(&name) => drop(fs::remove_dir_all(path)),
            false if is_left_over(&name) => fs::remove_file(path).map_err(failed)?,
            _ => {}
        }
    }
    Ok(())
}

/// Whether a name is that of a write of ours which did not come to its end.
fn is_left_over(name: &str) -> bool {
    const KINDS: [&str; 7] = ["json", "toml", "bin", "safetensors", "onnx", "html", "hdf5"];
    let written = files::Unfinished::of(name).and_then(|write| write.name.rsplit_once('.'));
    written.is_some_and(|(_, kind)| KINDS.contains(&kind))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
