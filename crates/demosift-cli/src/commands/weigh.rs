//! `demosift weigh`: MetaPrior → Weighing.

use demosift::Result;
use demosift::run::experiment::{self, Config};
use demosift::run::forecast::Goal;

use super::{dry_run, kept_in};
use crate::answers::{self, OfRun};
use crate::arguments::JobArguments;
use crate::console::terminal;
use crate::job::{Job, Prior};
use crate::tables::{costs, weights};

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
        let costs = answers::Spending::of(&costs);
        let found = answers::Weigh { kept: &weighing.demos, weighing: &weighing, costs };
        terminal::show_json(&OfRun::new(&job, found));
        return Ok(());
    }
    terminal::show(&weights::trends(&weighing));
    terminal::show(&costs::played(&costs));
    terminal::show(&kept_in(job.folder(), job.variant()));
    Ok(())
}
