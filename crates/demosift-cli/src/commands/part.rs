//! A part of a run's work, on one of several machines that share its folder.

use demosift::Result;

use crate::answers::PartDone;
use crate::console::quoting::quoted_path;
use crate::console::terminal;
use crate::job::Job;

/// What other parts have to do, in words, if they have not done it; all other errors stay errors.
pub(super) fn left<T>(outcome: Result<T>) -> Result<Option<String>> {
    match outcome {
        Ok(_) => Ok(None),
        Err(error) if error.is_left_to_others() => Ok(Some(error.message().to_owned())),
        Err(error) => Err(error),
    }
}

/// Says that the part is done, and what is left to others; `options` are those of the command that the run does not know.
pub(super) fn done(job: &Job, command: &str, options: &str, left: &[String], json: bool) {
    let Some(part) = job.part() else { return };
    let run_folder = job.folder().path();
    if json {
        terminal::show_json(&PartDone { part: part.to_string(), left, run_folder });
        return;
    }
    let state = match left {
        [] => "and so are all others".to_owned(),
        left => left.join(", "),
    };
    terminal::show(&format!(
        "Part {part} is done; {state}.\n\nThe results of all parts: demosift {command} --out {} --resume{options}\n",
        quoted_path(run_folder)
    ));
}
