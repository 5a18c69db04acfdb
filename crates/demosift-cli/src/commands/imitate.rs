//! `demosift imitate`: Subset → LearningCurve.

use demosift::data::demonstration::{DemoId, DemonstrationSet};
use demosift::results::gain;
use demosift::run::experiment;
use demosift::run::forecast::Goal;
use demosift::{Error, Result};
use serde_json::Value;

use super::{dry_run, goals, kept_in, select};
use crate::answers::{self, OfRun};
use crate::arguments::ImitateArguments;
use crate::job::{Job, Prior};
use crate::{console::terminal, tables};

pub(crate) fn run(arguments: &ImitateArguments) -> Result<()> {
    let ids = &arguments.demonstration_ids;
    // The kept demonstrations are those of the ranking; named ones need none.
    let prior = if ids.is_empty() { Prior::Needed } else { Prior::NotNeeded };
    let mut job = Job::open_checked(&arguments.job, prior, |set, _| check(ids, set))?;
    let (run, demos) = (&arguments.job.run, named(ids));
    match (demos.is_empty(), run.dry_run) {
        (true, true) => goals::dry_run_each(&mut job, Goal::Comparison, Some(Goal::OneTraining), run),
        (false, true) => dry_run::of_job(&mut job, Goal::Policy(&part(&demos), &demos), run),
        (true, false) => goals::each(&mut job, run, compare),
        (false, false) => imitate_named(&mut job, &demos, run.json),
    }
}

/// The selected subset beside the whole set.
fn compare(job: &mut Job, json: bool) -> Result<Value> {
    let ids = job.set().ids();
    let (from_subset, from_all) = job.run(|run| {
        let subset = select::selection(run)?.subset;
        let part = experiment::kept_part(run.config);
        let from_subset = experiment::learning_curve(run, &part, &subset.demos)?;
        Ok((from_subset, experiment::learning_curve(run, "all", &ids)?))
    })?;
    if json {
        let found = answers::Imitate {
            kept: &from_subset.demos,
            from_subset: from_subset.outcome,
            from_all: from_all.outcome,
            gain: gain::gain(&from_subset.outcome, &from_all.outcome),
        };
        return Ok(OfRun::new(job, found).value());
    }
    terminal::show(&tables::comparison(job.set(), &from_subset, &from_all, job.unit()));
    terminal::show(&kept_in(job.folder(), job.variant()));
    Ok(Value::Null)
}

fn imitate_named(job: &mut Job, demos: &[DemoId], json: bool) -> Result<()> {
    let curve = job.run(|run| experiment::learning_curve(run, &part(demos), demos))?;
    if json {
        let found = answers::ImitateNamed { demonstrations: demos, outcome: curve.outcome };
        terminal::show_json(&OfRun::new(job, found));
        return Ok(());
    }
    terminal::show(&tables::policies(
        &[(format!("demonstrations {}", tables::list(demos)), &curve)],
        job.unit(),
    ));
    terminal::show(&kept_in(job.folder(), job.variant()));
    Ok(())
}

/// Under which name the policy from these is kept.
fn part(demos: &[DemoId]) -> String {
    demos.iter().fold("demonstrations".to_owned(), |name, demo| format!("{name}_{demo}"))
}

pub(super) fn check(ids: &[usize], set: &DemonstrationSet) -> Result<()> {
    match ids.iter().find(|id| !set.holds(DemoId(**id))) {
        None => Ok(()),
        Some(id) => Err(Error::bad_input(format!(
            "--demonstration-ids {id}: the demonstrations of this set are {}",
            tables::range_of(set)
        ))),
    }
}

/// The ids in ascending order, each once.
pub(super) fn named(ids: &[usize]) -> Vec<DemoId> {
    let mut demos: Vec<DemoId> = ids.iter().copied().map(DemoId).collect();
    demos.sort_unstable();
    demos.dedup();
    demos
}
