//! `demosift referee`: what to train on, by which imitator, and whether selecting helps.

use demosift::forecast::Goal;
use demosift::{Result, experiment};
use serde_json::json;

use super::{dry_run, kept_in};
use crate::arguments::JobArguments;
use crate::job::{Job, Prior};
use crate::{tables, terminal};

pub(crate) fn run(arguments: &JobArguments) -> Result<()> {
    let mut job = Job::open(arguments, Prior::Needed)?;
    if arguments.run.dry_run {
        return dry_run::of_job(&mut job, Goal::Verdict, &arguments.run);
    }
    let verdict = job.run(|run| {
        let panel = experiment::panel(run)?;
        let selection = experiment::selection(run, &panel)?;
        experiment::verdict(run, &experiment::worth_training_on(run, &panel, &selection)?)
    })?;
    if arguments.run.json {
        terminal::show_json(&json!({
            "verdict": verdict,
            "unit": job.unit(),
            "variant": job.variant(),
            "run_folder": job.folder().path(),
        }));
        return Ok(());
    }
    terminal::show(&tables::verdict::verdict(&verdict, job.unit()));
    terminal::show(&kept_in(job.folder(), job.variant()));
    Ok(())
}
