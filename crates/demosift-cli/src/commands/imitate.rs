//! `demosift imitate`: Subset → LearningCurve.

use demosift::basics::files;
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

/// How the names of policies begin that are from named demonstrations.
pub(super) const NAMED: &str = "demonstrations";

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

/// A longer name is no name of a file any more, with what stands around it: 255 bytes are the most that a disk takes.
const LONGEST_PART: usize = 200;

/// Under which name the policy from these is kept: by their numbers, or of many by how many and a hash of their numbers.
fn part(demos: &[DemoId]) -> String {
    let numbers: Vec<String> = demos.iter().map(ToString::to_string).collect();
    let named = format!("{NAMED}_{}", numbers.join("_"));
    if named.len() <= LONGEST_PART {
        return named;
    }
    let hash = files::sha256_of(numbers.join(",").as_bytes());
    format!("{NAMED}_{}_of_{}", demos.len(), &hash[..8])
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_are_kept_under_a_name_that_a_file_may_have() {
        let of = |count: usize| part(&(0..count).map(DemoId).collect::<Vec<_>>());
        assert_eq!(of(3), "demonstrations_0_1_2");
        assert!(of(60).ends_with("_58_59"), "{}", of(60));
        let (many, more) = (of(70), of(71));
        assert!(many.starts_with("demonstrations_70_of_") && many.len() == 29, "{many}");
        assert!(more.starts_with("demonstrations_71_of_") && more[21..] != many[21..], "{more}");
        let others = part(&(1..71).map(DemoId).collect::<Vec<_>>());
        assert_ne!(others, many);
    }
}
