//! A task of several goals: Eq. 9 picks per goal, so what follows judging is done for each goal by itself, in a folder of its
//! own within that of the run.

use demosift::Result;
use demosift::run::experiment;
use demosift::run::forecast::{self, Goal};
use serde_json::{Value, json};

use super::{dry_run, judge};
use crate::arguments::RunArguments;
use crate::job::Job;
use crate::tables::by_variant;
use crate::terminal;

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
        let scores = job.run(|run| experiment::scores(run, panel.decides))?;
        terminal::show(&by_variant::gains(&scores, &goals, job.unit()));
    }
    let mut found = Vec::new();
    for goal in &goals {
        if !arguments.json {
            terminal::show(&format!("\nGoal {goal}\n\n"));
        }
        found.push(one(&mut job.for_goal(goal, false)?, arguments.json)?);
    }
    if arguments.json {
        terminal::show_json(&json!({
            "goals": goals.iter().cloned().zip(found).collect::<serde_json::Map<_, _>>(),
            "judges": panel,
            "run_folder": job.folder().path(),
        }));
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
    Ok(())
}
