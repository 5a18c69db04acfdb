//! The demonstrations that a user names, read and checked, with what identifies them.

use std::path::{Path, PathBuf};

use demosift::data::demonstration::choice::{self, Choice};
use demosift::data::demonstration::episode::{self, Columns, Source};
use demosift::data::demonstration::open::{self, Located};
use demosift::data::demonstration::{DemoId, DemonstrationSet};
use demosift::data::trajectory::StateLog;
use demosift::run::experiment::{self, Config};
use demosift::world::rollout::Playground;
use demosift::{Error, Result};

use crate::arguments::{SetArguments, SourceArguments};
use crate::run_folder::{self, Data};
use crate::terminal;

/// Demonstrations with the file or folder that they are in.
pub(crate) struct Demonstrations {
    pub(crate) source: Source,
    pub(crate) set: DemonstrationSet,
    pub(crate) path: PathBuf,
    choice: Choice,
}

impl Demonstrations {
    /// Whether set, task and configuration fit each other.
    pub(crate) fn check(&self, playground: &Playground<'_>, config: &Config) -> Result<()> {
        experiment::check(&self.set, playground.specification(), config)
            .map_err(|error| if error.is_bad_input() { error.at(&self.path) } else { error })
    }

    /// What a run depends on.
    pub(crate) fn data(&self) -> Result<Data> {
        let format = self.source.format;
        let path = std::fs::canonicalize(&self.path)
            .map_err(|error| Error::io("cannot find", &self.path, &error))?;
        if path.to_str().is_none() {
            return Err(Error::bad_input("the path is not UTF-8, and a run cannot write it down")
                .at(&path)
                .with_hint("rename it, or give a link to it that has another name"));
        }
        Ok(Data {
            sha256: open::sha256(&self.source, &self.path)?,
            path,
            format: Some(format),
            columns: self.source.columns.clone(),
            choice: self.choice.clone(),
        })
    }
}

/// Reads what is given, or what a run that goes on was begun with.
pub(crate) fn open(
    given: Option<&Path>,
    how: &SetArguments,
    recorded: Option<&Data>,
) -> Result<Demonstrations> {
    let opened = open_unchecked(given, how, recorded)?;
    let set = opened.source.set();
    opened.with(set)
}

/// The same where one demonstration is enough.
pub(crate) fn open_of_any_size(
    given: Option<&Path>,
    how: &SetArguments,
    recorded: Option<&Data>,
) -> Result<Demonstrations> {
    let opened = open_unchecked(given, how, recorded)?;
    let set = opened.source.set_of_any_size();
    opened.with(set)
}

/// What lies there, of which not all need be fit to learn from.
pub(crate) struct Opened {
    pub(crate) source: Source,
    pub(crate) path: PathBuf,
    choice: Choice,
}

impl Opened {
    fn with(self, set: Result<DemonstrationSet>) -> Result<Demonstrations> {
        let Self { source, path, choice } = self;
        let set = set.map_err(|error| error.at(&path))?;
        say_what_is_not_read(&source);
        Ok(Demonstrations { source, set, path, choice })
    }
}

/// Nothing is left out without a word.
pub(crate) fn say_what_is_not_read(source: &Source) {
    choice::in_words(&source.left_out).iter().chain(&source.not_read).for_each(|words| terminal::note(words));
}

/// The simulator's states of a demonstration, which `states` holds by the positions in the file.
pub(crate) fn states_of(states: &[StateLog], demo: DemoId) -> Result<&StateLog> {
    states
        .get(demo.0)
        .ok_or_else(|| Error::bad_input(format!("the set has no states of demonstration {demo}")))
}

/// The same without the check that one could learn from them.
pub(crate) fn open_unchecked(
    given: Option<&Path>,
    how: &SetArguments,
    recorded: Option<&Data>,
) -> Result<Opened> {
    let given = given.or(recorded.map(|data| data.path.as_path())).ok_or_else(|| {
        Error::bad_input("no demonstrations are given").with_hint(
            "give the path of a file or folder of demonstrations; docs/formats.md lists the formats",
        )
    })?;
    if run_folder::is_one(given) && !given.join(episode::RECORDED).exists() {
        let go_on =
            format!("to go on with the run: --out {} --resume, and no demonstrations", given.display());
        return Err(Error::bad_input("this is a run folder and holds no demonstrations")
            .at(given)
            .with_hint(go_on));
    }
    let columns = match recorded {
        Some(data) if how.columns().are_usual() => data.columns.clone(),
        _ => how.columns(),
    };
    let choice = match recorded {
        Some(data) if how.choice().is_all() => data.choice.clone(),
        _ => how.choice(),
    };
    let format = how.storage.format.or(recorded.and_then(|data| data.format));
    let Located { path, format } = open::located(given, format)?;
    Ok(Opened { source: open::open_chosen(&path, Some(format), &columns, &choice)?, path, choice })
}

impl SetArguments {
    /// All episodes that are not left out by name.
    pub(crate) fn of(storage: &SourceArguments) -> Self {
        Self { episodes: None, storage: storage.clone() }
    }

    fn columns(&self) -> Columns {
        let SourceArguments { observation_columns, action_columns, .. } = &self.storage;
        Columns { observations: observation_columns.clone(), actions: action_columns.clone() }
    }

    fn choice(&self) -> Choice {
        let SourceArguments { without, skip_bad, filter_key, .. } = &self.storage;
        Choice {
            episodes: self.episodes.clone(),
            without: without.clone(),
            skip_bad: *skip_bad,
            filter_key: filter_key.clone(),
        }
    }
}
