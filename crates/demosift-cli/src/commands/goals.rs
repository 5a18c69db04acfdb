//! A task of several goals: Eq. 9 picks per goal, so what follows judging is done for each goal by itself, in a folder of its
//! own within that of the run.

use demosift::Result;
use demosift::run::experiment;
use demosift::run::forecast::{self, Goal};
use serde_json::Value;

use super::{dry_run, judge};
use crate::answers::Goals;
use crate::arguments::{JobArguments, RunArguments};
use crate::console::terminal;
use crate::job::{Job, Prior};
use crate::tables::by_variant;

/// The head of a command that does `one` for each goal: opens the job and does it, or says what it would cost; `whole` is what
/// would be done of a task with one goal, and `after` what for each of several.
pub(super) fn run(
    arguments: &JobArguments,
    whole: Goal<'_>,
    after: Option<Goal<'_>>,
    one: impl FnMut(&mut Job, bool) -> Result<Value>,
) -> Result<Job> {
    let mut job = match whole {
        Goal::Verdict => Job::open_refereed(arguments, None)?,
        _ => Job::open(arguments, Prior::Needed)?,
    };
    match arguments.run.dry_run {
        true => dry_run_each(&mut job, whole, after, &arguments.run)?,
        false => each(&mut job, &arguments.run, one)?,
    }
    Ok(job)
}

/// Does `one` with the job, or with that of each of its goals where there are several, after they were judged together.
///
/// `one` shows what it found, or returns it where JSON is asked for.
pub(super) fn each(
    job: &mut Job,
    arguments: &RunArguments,
    mut one: impl FnMut(&mut Job, bool) -> Result<Value>,
) -> Result<()> {
    let goals = job.variants().to_vec();
    if goals.len() < 2 {
        let found = one(job, arguments.json)?;
        if arguments.json {
            terminal::show_json(&found);
        }
        return Ok(());
    }
    let panel = judge::first_then_all(job, arguments.json)?;
    if !arguments.json {
        let scores = job.run(|run| {
            let deciding = panel.decides.each().iter();
            deciding.map(|judge| experiment::scores(run, *judge)).collect::<Result<Vec<_>>>()
        })?;
        let scores: Vec<_> = scores.iter().collect();
        terminal::show(&by_variant::gains(&scores, &goals, job.unit()));
    }
    let mut found = Vec::new();
    for goal in &goals {
        if !arguments.json {
            terminal::show(&format!("\nGoal {goal}\n\n"));
        }
        found.push(one(&mut job.for_goal(goal, arguments.dry_run)?, arguments.json)?);
    }
    if arguments.json {
        let goals = goals.iter().cloned().zip(found).collect();
        terminal::show_json(&Goals { goals, judges: &panel, run_folder: job.folder().path() });
    }
    Ok(())
}

/// What that costs; `after` is what is done for each goal.
pub(super) fn dry_run_each(
    job: &mut Job,
    whole: Goal<'_>,
    after: Option<Goal<'_>>,
    arguments: &RunArguments,
) -> Result<()> {
    let goals = job.variants().to_vec();
    if goals.len() < 2 {
        return dry_run::of_job(job, whole, arguments);
    }
    let mut clock = dry_run::clock();
    let mut all = job.run(|run| forecast::forecast(run, Goal::Scores, &mut clock))?;
    if let Some(after) = after {
        for goal in &goals {
            let mut goal = job.for_goal(goal, true)?;
            all = all.and(goal.run(|run| forecast::forecast(run, after, &mut clock))?);
        }
    }
    dry_run::show(&all, job.chosen().task.as_ref(), job.folder().path(), arguments);
    dry_run::about_near_cut(job, &all, arguments)
}
