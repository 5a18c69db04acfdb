//! The policies of a run as ONNX. Runs write them by themselves; this is for those of before they did, and for a folder
//! with nothing else in it.

use std::path::Path;

use demosift::basics::files;
use demosift::results::artifact::onnx;
use demosift::{Error, Result};

use super::{folder, in_folder_of_goal};
use crate::arguments::ExportArguments;
use crate::commands::play::read_policy;
use crate::files::writing::undisturbed;
use crate::{console::terminal, job::run_folder, task};

pub(super) fn run(arguments: &ExportArguments) -> Result<()> {
    let out = folder(arguments)?;
    let (identity, _) = run_folder::of_finished(&arguments.run)?;
    let chosen = task::of_run(&identity.task, identity.environment())?;
    identity.check_unchanged(&chosen).map_err(|error| error.at(&arguments.run))?;
    let specification = chosen.task.specification();
    let names = names(&arguments.run)?;
    if names.is_empty() {
        let without = Error::bad_input("this run has trained no policies yet").at(&arguments.run);
        return Err(without.with_hint(in_folder_of_goal(&arguments.run).unwrap_or_else(|| {
            "demosift imitate --resume --out RUN trains one on the kept demonstrations, and one on all"
                .to_owned()
        })));
    }
    let files_of = |ending: &str| names.iter().map(|name| format!("{name}.{ending}")).collect::<Vec<_>>();
    let read = files_of("safetensors");
    let written = read.iter().map(|name| {
        let policy = read_policy(&arguments.run.join(name), specification)?;
        Ok(onnx::write_policy(&policy, specification))
    });
    let written = written.collect::<Result<Vec<_>>>()?;
    let named = files_of("onnx");
    let contents: Vec<_> = named.iter().map(String::as_str).zip(written).collect();
    undisturbed(|| files::write_folder(&out, &contents))?;
    let policies = if names.len() == 1 { "policy" } else { "policies" };
    terminal::show(&format!("{} {policies}: {}\n", names.len(), out.display()));
    Ok(())
}

/// The names of the files `policy_*.safetensors`, without what comes after the dot.
pub(super) fn names(run: &Path) -> Result<Vec<String>> {
    let failed = |error: std::io::Error| Error::io("cannot look into the run folder", run, &error);
    let mut names = Vec::new();
    for entry in std::fs::read_dir(run).map_err(failed)? {
        let name = entry.map_err(failed)?.file_name().to_string_lossy().into_owned();
        let policy = name.strip_suffix(".safetensors").filter(|name| name.starts_with("policy_"));
        names.extend(policy.map(str::to_owned));
    }
    names.sort();
    Ok(names)
}
