//! Demonstrators that were trained before, in run folders of their own.

use std::path::{Path, PathBuf};

use demosift::basics::files;
use demosift::results::artifact::{self, Artifact as _};
use demosift::results::recording;
use demosift::stages::demonstrator::Stage;
use demosift::{Error, Result};
use serde::{Deserialize, Serialize};

use crate::job::run_folder;
use crate::task::{self, Chosen};

/// The demonstrator of a run folder.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Source {
    /// Where it was when the recording began.
    folder: PathBuf,
    /// The task that it was trained on, as `--task` takes it.
    pub(super) task: String,
    /// Hash of the files of a task that does not come with demosift.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    task_sha256: Option<String>,
    /// Hash of its stages.
    sha256: String,
}

/// A demonstrator that plays in a body of its own, and how many of the demonstrations are its.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Guest {
    pub(super) count: usize,
    #[serde(flatten)]
    pub(super) source: Source,
}

impl Source {
    /// What a run folder tells of its demonstrator.
    pub(super) fn of(folder: &Path) -> Result<Self> {
        if !folder.is_dir() {
            return Err(Error::bad_input("there is no such run folder of a demonstrator").at(folder));
        }
        let (identity, _) = run_folder::of_finished(folder)?;
        let stages = folder.join(artifact::STAGES);
        if !stages.exists() {
            return Err(Error::bad_input(format!("this run folder has no {}", artifact::STAGES))
                .at(folder)
                .with_hint("name the folder of a `demosift record` that has finished its training"));
        }
        let folder =
            std::fs::canonicalize(folder).map_err(|error| Error::io("cannot find", folder, &error))?;
        let sha256 = files::sha256(&[stages])?;
        Ok(Self { folder, task: identity.task, task_sha256: identity.task_sha256, sha256 })
    }

    /// Its task, if that is still the one it was trained on.
    pub(super) fn task(&self) -> Result<Chosen> {
        let (identity, _) = run_folder::of_finished(&self.folder)?;
        let chosen = task::of_run(&identity.task, identity.environment())?;
        if chosen.sha256 != self.task_sha256 {
            return Err(Error::bad_input(
                "the files of the task have changed since this demonstrator was trained on it",
            )
            .at(&self.folder));
        }
        Ok(chosen)
    }

    /// An error that is about its folder.
    pub(super) fn blame(&self, error: Error) -> Error {
        error.at(&self.folder)
    }

    /// Its stages, if they fit the task and are still those that the recording began with.
    pub(super) fn stages(&self, chosen: &Chosen) -> Result<Vec<Stage>> {
        let now = Self::of(&self.folder)?;
        if now.sha256 != self.sha256 {
            return Err(Error::bad_input(format!(
                "{} is not the one that this recording began with: its SHA-256 was {}, and is {} now",
                artifact::STAGES,
                self.sha256,
                now.sha256
            ))
            .at(&self.folder));
        }
        let (_, ledger) = run_folder::of_finished(&self.folder)?;
        let stages = Vec::recall(&ledger, "").and_then(|stages| {
            let stages = stages.expect("Source::of found the file");
            recording::check_stages(&stages, chosen.task.specification())?;
            Ok(stages)
        });
        stages.map_err(|error| error.at(&self.folder))
    }
}

impl Guest {
    /// From what is typed, `DIR=N`.
    pub(super) fn of(typed: &str) -> Result<Self> {
        let parts = typed.rsplit_once('=').and_then(|(folder, count)| Some((folder, count.parse().ok()?)));
        match parts {
            Some((folder, count)) if count > 0 => Ok(Self { count, source: Source::of(Path::new(folder))? }),
            _ => Err(Error::bad_config(format!("--guest {typed}: wanted DIR=N, with N at least 1"))
                .with_hint("for example --guest runs/free_throw_taller=6")),
        }
    }
}
