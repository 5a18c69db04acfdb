//! `demosift select`: ScoreTable → Ranking, Uncertainty, Subset.

use demosift::Result;
use demosift::results::artifact::Artifact;
use demosift::run::experiment::{self, Run, Selection};
use demosift::run::forecast::{self, Goal};
use demosift::stages::select::Keep;
use demosift::stages::subset_selection::Weighing;
use serde_json::Value;

use super::{goals, kept_in};
use crate::answers::{self, OfRun};
use crate::arguments::JobArguments;
use crate::console::terminal;
use crate::job::{Job, Prior};
use crate::tables::judgment::{self, Judgment, Kept};
use crate::tables::{costs, weights};

pub(crate) fn run(arguments: &JobArguments) -> Result<()> {
    let run = &arguments.run;
    let mut job = Job::open(arguments, Prior::Needed)?;
    if !run.dry_run {
        return goals::each(&mut job, run, one);
    }
    if job.run(|run| Ok(forecast::planned(run, Goal::Selection)?.is_empty()))? {
        // There is nothing to forecast, and what would be kept can be said without writing it.
        goals::each(&mut job, run, one)?;
        terminal::note("nothing was written");
        return Ok(());
    }
    goals::dry_run_each(&mut job, Goal::Selection, None, run)
}

/// The selection of a task with one goal.
fn one(job: &mut Job, json: bool) -> Result<Value> {
    let selection = job.run(selection)?;
    let (weighing, costs) = (weighing(job)?, job.costs()?);
    if json {
        let found = answers::Select::new(&selection, weighing.as_ref(), &costs);
        return Ok(OfRun::new(job, found).value());
    }
    let Selection { ranking, uncertainty, subset } = &selection;
    let judgment = Judgment { set: job.set(), ranking, uncertainty, unit: job.unit(), k: job.k() };
    let kept = Kept { subset, keep: job.keep() };
    terminal::show(&judgment::ranking(&judgment, Some(kept)));
    terminal::show(&weighing.map_or(String::new(), |weighing| format!("\n{}", weights::trends(&weighing))));
    terminal::show(&costs::played(&costs));
    terminal::show(&kept_in(job.folder(), job.variant()));
    Ok(Value::Null)
}

/// All arrows up to the selection.
pub(super) fn selection(run: &mut Run<'_>) -> Result<Selection> {
    let panel = experiment::panel(run)?;
    experiment::selection(run, &panel)
}

/// How the demonstrations were weighed, where the subset is chosen by weights.
pub(super) fn weighing(job: &mut Job) -> Result<Option<Weighing>> {
    match job.keep() {
        Keep::Weights => job.run(|run| Weighing::recall(run.ledger, "")),
        _ => Ok(None),
    }
}
