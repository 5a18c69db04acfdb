//! What a run is of, which must be the same where it goes on.

use std::path::PathBuf;

use demosift::data::demonstration::choice::Choice;
use demosift::data::demonstration::episode::{Columns, Format};
use demosift::data::demonstration::set_file::SetFile;
use demosift::{Error, Result};
use serde::{Deserialize, Serialize};
use toml::Table;

use crate::configuration;
use crate::configuration::resolved::fixed;
use crate::task::Chosen;
use crate::task::simulator::{self, Earlier, Simulator};

/// What a run depends on besides its configuration; kept in `run.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
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
    pub(crate) prior: Option<PriorOrigin>,
    /// Hash of what of the configuration must stay as it is; the whole stands in a file of its own.
    #[serde(default)]
    pub(crate) configuration_sha256: String,
}

impl Identity {
    /// The environment of the run, if its task was one.
    pub(crate) fn environment(&self) -> Option<Earlier<'_>> {
        self.simulator.as_ref().map(|simulator| Earlier { env: &self.task, simulator })
    }

    /// Whether the files of the task are still what they were in the run.
    ///
    /// # Errors
    /// `is_bad_input` if they are others.
    pub(crate) fn check_unchanged(&self, task: &Chosen) -> Result<()> {
        if task.sha256 == self.task_sha256 {
            return Ok(());
        }
        Err(Error::bad_input(
            "the files of the task have changed since the run, so its actions may mean something else",
        ))
    }
}

/// That of before there was a second.
pub(super) fn first_format() -> u32 {
    1
}

/// Which prior a run was given.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct PriorOrigin {
    /// The folder of the run that made it.
    pub(crate) run: PathBuf,
    /// Hash of its file.
    pub(crate) sha256: String,
}

/// The demonstrations of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
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
    /// What the user says of their numbers.
    #[serde(default, skip_serializing_if = "SetFile::is_none")]
    pub(crate) set_file: SetFile,
}

/// What a folder tells of the run that it holds.
#[derive(Debug)]
pub(crate) struct Begun {
    pub(crate) identity: Identity,
    pub(crate) configuration: Table,
}

/// Whether a run is about the same task as one that is there, in the same environment by the same versions.
pub(super) fn check_same_task(old: &Identity, now: &Identity) -> Result<()> {
    let hash = |of: &Identity| of.task_sha256.clone().unwrap_or_else(|| "none".to_owned());
    let pair = |what: &str, old: String, new: String| (old != new).then(|| (what.to_owned(), old, new));
    // What is called something else is of other files too.
    let differs = pair("the task", old.task.clone(), now.task.clone())
        .or_else(|| simulator::difference(old.simulator.as_ref(), now.simulator.as_ref()))
        .or_else(|| pair("the SHA-256 of the task's files", hash(old), hash(now)));
    match differs {
        Some((what, old, new)) => Err(of_another_run(&what, &old, &new)),
        None => Ok(()),
    }
}

/// Whether what is to be done now is the same run in all that it depends on.
///
/// A run that was there was asked for its task before its goal was looked for, in [`crate::job::request::Request`]; one that
/// another part has begun since then has not been.
pub(super) fn check_same(begun: &Begun, identity: &Identity, configuration: &Table) -> Result<()> {
    check_same_task(&begun.identity, identity)?;
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
    let set_file = |identity: &Identity| {
        let lines = identity.data.as_ref().map_or_else(String::new, |data| data.set_file.to_string());
        if lines.is_empty() { "nothing".to_owned() } else { lines.trim_end().replace('\n', "; ") }
    };
    let text = |value: Option<String>| value.unwrap_or_else(|| "none".to_owned());
    let variant = |identity: &Identity| identity.variant.clone().unwrap_or_else(|| "all of them".to_owned());
    if old.data.is_none() && identity.data.is_some() {
        return Err(Error::bad_config(
            "the run folder is of another run: it began without demonstrations, as one of `record` does",
        )
        .with_hint("give another folder to --out; what `record` wrote is a set: demosift sift FOLDER"));
    }
    let pairs = [
        ("the version of demosift", old.demosift.clone(), identity.demosift.clone()),
        ("the variant", variant(old), variant(identity)),
        // Before the hash, which may depend on them.
        ("the columns of the demonstrations", columns(old), columns(identity)),
        ("the choice of episodes", choice(old), choice(identity)),
        ("the SHA-256 of the prior that it was given", prior(old), prior(identity)),
        ("what set.toml says of the demonstrations", set_file(old), set_file(identity)),
        ("the SHA-256 of the demonstrations", text(sha256(old)), text(sha256(identity))),
    ];
    let differs = pairs.into_iter().find(|(_, old, new)| old != new);
    let (what, old, new) =
        match (differs, configuration::first_difference(&fixed(&begun.configuration), &fixed(configuration)))
        {
            (Some((what, old, new)), _) => (what.to_owned(), old, new),
            (None, Some(difference)) => difference,
            (None, None) => return Ok(()),
        };
    Err(of_another_run(&what, &old, &new))
}

/// A run folder cannot go on with something else.
fn of_another_run(what: &str, old: &str, new: &str) -> Error {
    Error::bad_config(format!("the run folder is of another run: {what} was {old} there, and is {new} now"))
        .with_hint("take back the change, or give another folder to --out")
}
