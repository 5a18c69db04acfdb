//! `demosift referee`: what to train on, by which imitator, and whether selecting helps.

use demosift::basics::part::Part;
use demosift::run::experiment::{self, Run};
use demosift::run::forecast::Goal;
use demosift::stages::referee::Verdict;
use demosift::{Error, Result};
use serde_json::Value;

use super::{goals, kept_in, part};
use crate::answers::{self, OfRun};
use crate::arguments::{JobArguments, PartArgument, RefereeArguments};
use crate::job::Job;
use crate::{console::terminal, tables};

pub(crate) fn run(arguments: &RefereeArguments) -> Result<()> {
    let RefereeArguments { job: arguments, part: PartArgument { part } } = arguments;
    match part {
        Some(part) if !arguments.run.dry_run => share(arguments, *part),
        _ => goals::run(arguments, Goal::Verdict, Some(Goal::Referee), one).map(drop),
    }
}

/// What a part of the run trains.
fn share(arguments: &JobArguments, part: Part) -> Result<()> {
    let mut job = Job::open_refereed(arguments, Some(part))?;
    if let [_, _, ..] = job.variants() {
        return Err(Error::bad_config("--part is for one goal, and the task has several")
            .with_hint("say which with --variant; `demosift task check` lists them"));
    }
    let left = part::left(job.run(verdict))?;
    part::done(&job, "referee", "", left.as_slice(), arguments.run.json);
    Ok(())
}

fn verdict(run: &mut Run<'_>) -> Result<Verdict> {
    let panel = experiment::panel(run)?;
    let selection = experiment::selection(run, &panel)?;
    experiment::verdict(run, &experiment::worth_training_on(run, &panel, &selection)?)
}

/// The referee of a task with one goal.
fn one(job: &mut Job, json: bool) -> Result<Value> {
    let verdict = job.run(verdict)?;
    if json {
        return Ok(OfRun::new(job, answers::Referee { verdict: &verdict }).value());
    }
    terminal::show(&tables::verdict::verdict(&verdict, job.unit()));
    terminal::show(&kept_in(job.folder(), job.variant()));
    Ok(Value::Null)
}
