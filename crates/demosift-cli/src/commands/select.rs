//! `demosift select`: ScoreTable → Ranking, Subset.

use demosift::Result;
use demosift::experiment::{self, Run};
use demosift::select::{Ranking, Subset};
use serde_json::json;

use super::kept_in;
use crate::arguments::JobArguments;
use crate::job::Job;
use crate::{tables, terminal};

pub(crate) fn run(arguments: &JobArguments) -> Result<()> {
    let mut job = Job::open(arguments)?;
    let (ranking, subset) = job.run(selection)?;
    let own = job.own();
    if arguments.run.json {
        terminal::show_json(&json!({
            "ranking": ranking.entries,
            "kept": subset.demos,
            "own": own.scores(),
            "spearman_with_own": own.agreement(&ranking),
            "unit": job.unit(),
            "run_folder": job.folder().path(),
        }));
        return Ok(());
    }
    terminal::show(&tables::ranking(job.set(), &ranking, Some(&subset), &own, job.unit()));
    terminal::show(&kept_in(job.folder()));
    Ok(())
}

/// All arrows up to the selection.
pub(super) fn selection(run: &mut Run<'_>) -> Result<(Ranking, Subset)> {
    let prior = experiment::prior(run)?;
    let scores = experiment::scores(run, &prior)?;
    experiment::selection(run, &scores)
}
