//! `demosift judge`: MetaPrior → ScoreTable.

use demosift::experiment;
use demosift::forecast::Goal;
use demosift::{Result, select};
use serde_json::json;

use super::{dry_run, kept_in};
use crate::arguments::JobArguments;
use crate::job::{Job, Prior};
use crate::tables::by_variant;
use crate::tables::costs;
use crate::tables::judgment::{self, Judgment};
use crate::terminal;

pub(crate) fn run(arguments: &JobArguments) -> Result<()> {
    let mut job = Job::open(arguments, Prior::Needed)?;
    if arguments.run.dry_run {
        return dry_run::of_job(&mut job, Goal::Scores, &arguments.run);
    }
    let (scores, uncertainty, data_only) = job.run(|run| {
        let prior = experiment::prior(run)?;
        let scores = experiment::scores(run, &prior)?;
        let uncertainty = experiment::doubts(run, &scores)?;
        Ok((scores, uncertainty, experiment::data_only(run)?))
    })?;
    let costs = job.costs()?;
    let (ranking, beside) = (select::rank(&scores), job.beside(data_only));
    if arguments.run.json {
        terminal::show_json(&json!({
            "scores": scores,
            "adapted_behaviors_distance": scores.adapted_behaviors_distance(),
            "uncertainty": uncertainty,
            "caveat": uncertainty.caveat(),
            "data_only": judgment::data_only_json(&ranking, &beside.data_only),
            "costs": costs::as_json(&costs),
            "unit": job.unit(),
            "variant": job.variant(),
            "run_folder": job.folder().path(),
        }));
        return Ok(());
    }
    let judgment =
        Judgment { set: job.set(), ranking: &ranking, uncertainty: &uncertainty, unit: job.unit() };
    terminal::show(&judgment::ranking(&judgment, None));
    terminal::show(&by_variant::gains(&scores, job.variants(), job.unit()));
    terminal::show(&judgment::distance(&scores));
    terminal::show(&judgment::beside(&ranking, &beside));
    terminal::show(&costs::played(&costs));
    terminal::show(&kept_in(job.folder(), job.variant()));
    Ok(())
}
