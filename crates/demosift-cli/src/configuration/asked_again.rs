//! A run that is asked again with another `keep`, or for more or fewer final policies.
//!
//! Judging and the ranking stay as they are. What follows from what is kept is made again, and that of before is set aside
//! under the name of its `keep`, so that it is there when that is asked for again. `docs/run-folder.md` has the names.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use demosift::{Error, Result};
use toml::{Table, Value};

use crate::configuration::resolved::{self, JUDGED_FOR};
use crate::files::writing::undisturbed;

/// Files that are about one `keep`, and do not say so by their names.
const ABOUT_ONE: [&str; 6] = [
    "subset.json",
    "verdict.json",
    "spent_referee.json",
    "policy_best.safetensors",
    "policy_best.onnx",
    "report.html",
];

/// The folder of a run in which its parts have theirs.
pub(crate) const PARTS: &str = "parts";

/// What was last asked for, as far as it may be asked for differently: a preset changes nothing of it.
pub(crate) fn last(begun: &Table) -> Table {
    resolved::changeable(begun)
}

/// Writes into a configuration for how many the run in the folder was judged, if that is not what is to be kept now.
pub(crate) fn remember(folder: &Path, begun: &Table, values: &mut Table) {
    values.remove(JUDGED_FOR);
    let first = begun.get(JUDGED_FOR).or(begun.get("keep"));
    if let Some(first) = first.filter(|first| Some(*first) != values.get("keep") && has_judged(folder)) {
        values.insert(JUDGED_FOR.to_owned(), first.clone());
    }
}

/// Whether any demonstration was judged, here or by a part that nobody has collected yet, so that it matters for how many.
fn has_judged(folder: &Path) -> bool {
    let begins = |name: &str| name.starts_with("scores_") || name.starts_with("checkpoint_judge");
    let names =
        |folder: &Path| fs::read_dir(folder).into_iter().flatten().filter_map(std::result::Result::ok);
    let holds = |folder: &Path| names(folder).any(|entry| begins(&entry.file_name().to_string_lossy()));
    holds(folder) || names(&folder.join(PARTS)).any(|part| holds(&part.path()))
}

/// Whether a file is about one `keep` without saying by its name about which: that of a part may be about another one than the
/// run is asked for now.
pub(crate) fn is_about_one_keep(name: &str) -> bool {
    ABOUT_ONE.contains(&name)
}

/// Whether a run folder is one of what is asked for now.
pub(crate) fn is_settled(folder: &Path, begun: &Table, values: &Table) -> bool {
    let now = keep(values);
    begun == values && ABOUT_ONE.iter().all(|name| !folder.join(set_aside(name, &now)).exists())
}

/// Makes a run folder one of what is asked for now.
///
/// A kill between two of the steps leaves a folder of one or the other, and the next time goes on from there.
pub(crate) fn settle(folder: &Path, begun: &Table, values: &Table) -> Result<()> {
    let (before, now) = (keep(begun), keep(values));
    undisturbed(|| {
        if before != now {
            for name in ABOUT_ONE {
                rename(&folder.join(name), &folder.join(set_aside(name, &before)))?;
            }
        }
        if begun != values {
            resolved::write(folder, values).map_err(with_way_out)?;
        }
        for name in ABOUT_ONE {
            let (of_run, aside) = (folder.join(name), folder.join(set_aside(name, &now)));
            if aside.exists() {
                rename(&aside, &of_run)?;
            }
        }
        Ok(())
    })
}

/// What [`settle`] would change of the files about one `keep`: the name of each, and the file that holds it, if one does.
pub(crate) fn would_be(folder: &Path, begun: &Table, values: &Table) -> Vec<(&'static str, PathBuf)> {
    let (before, now) = (keep(begun), keep(values));
    let names = ABOUT_ONE.into_iter().filter(|_| before != now);
    names.map(|name| (name, folder.join(set_aside(name, &now)))).collect()
}

fn keep(values: &Table) -> String {
    values.get("keep").and_then(Value::as_str).unwrap_or_default().to_owned()
}

/// `verdict.json` is `verdict_keep_quarter.json` while something else is kept.
fn set_aside(name: &str, keep: &str) -> String {
    let (stem, ending) = name.split_once('.').unwrap_or((name, ""));
    format!("{stem}_keep_{keep}.{ending}")
}

fn rename(from: &Path, to: &Path) -> Result<()> {
    match fs::rename(from, to) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(with_way_out(Error::io("cannot set aside", from, &error)))
        }
        _ => Ok(()),
    }
}

fn with_way_out(error: Error) -> Error {
    error.with_hint(
        "another keep or referee is written into the run folder; `demosift select --dry-run` shows what would be kept and writes nothing",
    )
}
