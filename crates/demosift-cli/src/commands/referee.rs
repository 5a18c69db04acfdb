//! `demosift referee`: what to train on, by which imitator, and whether selecting helps.

use demosift::Result;
use demosift::run::experiment;
use demosift::run::forecast::Goal;
use serde_json::Value;

use super::{goals, kept_in};
use crate::answers::{self, OfRun};
use crate::arguments::JobArguments;
use crate::job::Job;
use crate::{console::terminal, tables};

pub(crate) fn run(arguments: &JobArguments) -> Result<()> {
    goals::run(arguments, Goal::Verdict, Some(Goal::Referee), one).map(drop)
}

/// The referee of a task with one goal.
fn one(job: &mut Job, json: bool) -> Result<Value> {
    let verdict = job.run(|run| {
        let panel = experiment::panel(run)?;
        let selection = experiment::selection(run, &panel)?;
        experiment::verdict(run, &experiment::worth_training_on(run, &panel, &selection)?)
    })?;
    if json {
        return Ok(OfRun::new(job, answers::Referee { verdict: &verdict }).value());
    }
    terminal::show(&tables::verdict::verdict(&verdict, job.unit()));
    terminal::show(&kept_in(job.folder(), job.variant()));
    Ok(Value::Null)
}
