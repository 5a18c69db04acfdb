//! `demosift judge`: MetaPrior → ScoreTable.

use demosift::experiment;
use demosift::{Result, select};
use serde_json::json;

use super::kept_in;
use crate::arguments::JobArguments;
use crate::job::Job;
use crate::{tables, terminal};

pub(crate) fn run(arguments: &JobArguments) -> Result<()> {
    let mut job = Job::open(arguments)?;
    let scores = job.run(|run| {
        let prior = experiment::prior(run)?;
        experiment::scores(run, &prior)
    })?;
    let (ranking, own) = (select::rank(&scores), job.own());
    if arguments.run.json {
        terminal::show_json(&json!({
            "scores": scores,
            "own": own.scores(),
            "spearman_with_own": own.agreement(&ranking),
            "unit": job.unit(),
            "run_folder": job.folder().path(),
        }));
        return Ok(());
    }
    terminal::show(&tables::ranking(job.set(), &ranking, None, &own, job.unit()));
    terminal::show(&tables::by_variant::gains(&scores, job.variants(), job.unit()));
    terminal::show(&kept_in(job.folder()));
    Ok(())
}
