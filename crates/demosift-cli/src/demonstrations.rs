//! The demonstrations that a user names, read and checked, with what tells them apart from others.

use std::path::{Path, PathBuf};

use demosift::data::demonstration::DemonstrationSet;
use demosift::data::demonstration::episode::{self, Columns, Source};
use demosift::data::demonstration::open::{self, Located};
use demosift::{Error, Result};

use crate::arguments::SourceArguments;
use crate::run_folder::{self, Data};

/// Demonstrations with the file or folder that they are in.
pub(crate) struct Demonstrations {
    pub(crate) source: Source,
    pub(crate) set: DemonstrationSet,
    pub(crate) path: PathBuf,
}

impl Demonstrations {
    /// What a run depends on.
    pub(crate) fn data(&self) -> Result<Data> {
        let format = self.source.format;
        Ok(Data {
            sha256: open::sha256(&self.source, &self.path)?,
            path: std::fs::canonicalize(&self.path)
                .map_err(|error| Error::io("cannot find", &self.path, &error))?,
            format: Some(format),
            columns: self.source.columns.clone(),
        })
    }
}

/// Reads what is given, or what a run that goes on was begun with.
pub(crate) fn open(
    given: Option<&Path>,
    how: &SourceArguments,
    recorded: Option<&Data>,
) -> Result<Demonstrations> {
    let (source, path) = open_unchecked(given, how, recorded)?;
    let set = source.set().map_err(|error| error.at(&path))?;
    Ok(Demonstrations { source, set, path })
}

/// The same without the check that one could learn from them.
pub(crate) fn open_unchecked(
    given: Option<&Path>,
    how: &SourceArguments,
    recorded: Option<&Data>,
) -> Result<(Source, PathBuf)> {
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
    let format = how.format.or(recorded.and_then(|data| data.format));
    let Located { path, format } = open::located(given, format)?;
    Ok((open::open(&path, Some(format), &columns)?, path))
}

impl SourceArguments {
    fn columns(&self) -> Columns {
        Columns { observations: self.observation_columns.clone(), actions: self.action_columns.clone() }
    }
}
