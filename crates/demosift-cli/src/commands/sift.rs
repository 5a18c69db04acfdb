//! `demosift sift`: the whole job.

use demosift::Result;
use demosift::experiment::{self, Sifted};
use serde_json::json;

use super::kept_in;
use crate::arguments::JobArguments;
use crate::job::Job;
use crate::{tables, terminal};

pub(crate) fn run(arguments: &JobArguments) -> Result<()> {
    let mut job = Job::open(arguments)?;
    let sifted = job.run(experiment::sift)?;
    let Sifted { scores, ranking, subset, from_subset, from_all } = &sifted;
    let own = job.own();
    if arguments.run.json {
        terminal::show_json(&json!({
            "ranking": ranking.entries,
            "kept": subset.demos,
            "own": own.scores(),
            "spearman_with_own": own.agreement(ranking),
            "from_subset": from_subset.outcome,
            "from_all": from_all.outcome,
            "unit": job.unit(),
            "run_folder": job.folder().path(),
        }));
        return Ok(());
    }
    terminal::show(&tables::ranking(job.set(), ranking, Some(subset), &own, job.unit()));
    terminal::show(&tables::by_variant::gains(scores, job.variants(), job.unit()));
    terminal::show("\n");
    terminal::show(&tables::comparison(job.set(), from_subset, from_all, job.unit()));
    terminal::show(&kept_in(job.folder()));
    Ok(())
}
