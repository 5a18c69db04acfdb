//! `resolved.toml`: the whole configuration of a run, with its checksum in the last line.
//!
//! Most of it must stay as it was when the run began, and `run.json` holds the hash of that part.
//! The rest may be asked for differently later, and is then written again.

use std::path::Path;

use demosift::basics::files;
use demosift::{Error, Result};
use toml::Table;

use crate::configuration::{self, TRAINER};

pub(crate) const RESOLVED: &str = "resolved.toml";

/// What may be asked for differently, and what says so in the configuration.
const CHANGES: [&str; 4] = ["keep", "referee", TRAINER, JUDGED_FOR];
/// For how many the run was judged, if that is not what is kept now.
pub(crate) const JUDGED_FOR: &str = "judged_for";

/// Before the checksum of all lines above.
const SEAL: &str = "# sha256 of the lines above: ";

/// What of a configuration must stay as it was when the run began.
pub(crate) fn fixed(configuration: &Table) -> Table {
    configuration.clone().into_iter().filter(|(key, _)| !CHANGES.contains(&key.as_str())).collect()
}

/// What was last asked for, as far as it may be asked for differently.
pub(crate) fn changeable(configuration: &Table) -> Table {
    configuration.clone().into_iter().filter(|(key, _)| CHANGES.contains(&key.as_str())).collect()
}

/// The hash by which a run knows its configuration again.
pub(crate) fn sha256_of_fixed(configuration: &Table) -> String {
    files::sha256_of(text(&fixed(configuration)).as_bytes())
}

fn text(configuration: &Table) -> String {
    toml::to_string_pretty(configuration).expect("what was read from TOML is TOML")
}

/// Writes it into a run folder.
pub(crate) fn write(folder: &Path, configuration: &Table) -> Result<()> {
    let text = text(configuration);
    let sealed = format!("{text}{SEAL}{}\n", files::sha256_of(text.as_bytes()));
    files::write_atomically(&folder.join(RESOLVED), sealed.as_bytes())
}

/// Reads that of a run which was begun with the configuration of this hash.
///
/// # Errors
/// `is_bad_input` if it is damaged, was changed by hand, or is that of another run.
pub(crate) fn read(folder: &Path, sha256: &str) -> Result<Table> {
    let path = folder.join(RESOLVED);
    let bytes = files::read(&path)?;
    let sealed = String::from_utf8_lossy(&bytes);
    let is_whole = sealed.trim_end().rsplit_once(SEAL).is_some_and(|(text, held)| {
        files::sha256_of(text.as_bytes()) == held && sealed.len() == text.len() + SEAL.len() + held.len() + 1
    });
    let changed = || {
        Error::bad_input("the configuration is not the one that the run was begun with")
            .at(&path)
            .with_hint("take back the change, or begin another run with it: --config FILE --out OTHER_FOLDER")
    };
    if !is_whole {
        return Err(changed());
    }
    let values = configuration::Layer::from_file(&path)?.values;
    if sha256_of_fixed(&values) == sha256 { Ok(values) } else { Err(changed()) }
}
