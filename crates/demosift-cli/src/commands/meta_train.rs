//! `demosift meta-train`: DemonstrationSet → MetaPrior.

use demosift::Result;
use demosift::experiment;
use serde_json::json;

use super::kept_in;
use crate::arguments::JobArguments;
use crate::job::Job;
use crate::terminal;

pub(crate) fn run(arguments: &JobArguments) -> Result<()> {
    let mut job = Job::open(arguments)?;
    job.run(experiment::prior)?;
    if arguments.run.json {
        terminal::show_json(&json!({ "run_folder": job.folder().path() }));
    } else {
        terminal::show("The policy can now imitate each demonstration of the set within a few updates.\n");
        terminal::show(&kept_in(job.folder()));
    }
    Ok(())
}
