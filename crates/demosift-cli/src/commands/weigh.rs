//! `demosift weigh`: MetaPrior → Weighing.

use demosift::Result;
use demosift::run::experiment::{self, Config};
use demosift::run::forecast::Goal;
use serde_json::json;

use super::{dry_run, kept_in};
use crate::arguments::JobArguments;
use crate::job::{Job, Prior};
use crate::tables::{costs, weights};
use crate::terminal;

pub(crate) fn run(arguments: &JobArguments) -> Result<()> {
    let check = |_: &_, config: &Config| experiment::check_has_weights(config.method);
    let mut job = Job::open_checked(arguments, Prior::Needed, check)?;
    if arguments.run.dry_run {
        return dry_run::of_job(&mut job, Goal::Weighing, &arguments.run);
    }
    let weighing = job.run(|run| {
        let prior = experiment::prior(run)?;
        experiment::weighing(run, &prior)
    })?;
    let costs = job.costs()?;
    if arguments.run.json {
        terminal::show_json(&json!({
            "weighing": weighing,
            "kept": weighing.demos,
            "costs": costs::as_json(&costs),
            "unit": job.unit(),
            "variant": job.variant(),
            "run_folder": job.folder().path(),
        }));
        return Ok(());
    }
    terminal::show(&weights::trends(&weighing));
    terminal::show(&costs::played(&costs));
    terminal::show(&kept_in(job.folder(), job.variant()));
    Ok(())
}
