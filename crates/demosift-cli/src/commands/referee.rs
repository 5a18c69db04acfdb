//! `demosift referee`: what to train on, by which imitator, and whether selecting helps.

use demosift::Result;
use demosift::run::experiment;
use demosift::run::forecast::Goal;
use serde_json::{Value, json};

use super::{goals, kept_in};
use crate::arguments::JobArguments;
use crate::job::{Job, Prior};
use crate::{tables, terminal};

pub(crate) fn run(arguments: &JobArguments) -> Result<()> {
    let mut job = Job::open(arguments, Prior::Needed)?;
    if arguments.run.dry_run {
        return goals::dry_run_each(&mut job, Goal::Verdict, Some(Goal::Referee), &arguments.run);
    }
    goals::each(&mut job, &arguments.run, one)
}

/// The referee of a task with one goal.
fn one(job: &mut Job, json: bool) -> Result<Value> {
    let verdict = job.run(|run| {
        let panel = experiment::panel(run)?;
        let selection = experiment::selection(run, &panel)?;
        experiment::verdict(run, &experiment::worth_training_on(run, &panel, &selection)?)
    })?;
    if json {
        return Ok(json!({
            "verdict": verdict,
            "unit": job.unit(),
            "variant": job.variant(),
            "run_folder": job.folder().path(),
        }));
    }
    terminal::show(&tables::verdict::verdict(&verdict, job.unit()));
    terminal::show(&kept_in(job.folder(), job.variant()));
    Ok(Value::Null)
}
