//! `demosift meta-train`: DemonstrationSet → MetaPrior, by the method that is asked for.

use demosift::Result;
use demosift::run::experiment;
use demosift::run::forecast::Goal;
use demosift::stages::method::Method;

use super::{dry_run, kept_in};
use crate::answers::{self, OfRun};
use crate::arguments::JobArguments;
use crate::console::terminal;
use crate::job::{Job, Prior};
use crate::tables::costs;

pub(crate) fn run(arguments: &JobArguments) -> Result<()> {
    let mut job = Job::open(arguments, Prior::Needed)?;
    if arguments.run.dry_run {
        return dry_run::of_job(&mut job, Goal::Prior, &arguments.run);
    }
    job.run(experiment::prior)?;
    let costs = job.costs()?;
    if arguments.run.json {
        let found = answers::MetaTrain { costs: answers::Spending::of(&costs) };
        terminal::show_json(&OfRun::new(&job, found));
    } else {
        terminal::show(&format!("{}\n", what_came_of_it(job.method())));
        terminal::show(&costs::played(&costs));
        terminal::show(&kept_in(job.folder(), job.variant()));
    }
    Ok(())
}

fn what_came_of_it(method: Method) -> &'static str {
    match method {
        Method::Maml | Method::MamlMi => {
            "The policy can now imitate each demonstration of the set within a few updates."
        }
        Method::AvgFineTune => {
            "The policy imitates the entire set, and can be fine-tuned toward each demonstration."
        }
        Method::FromScratch => "The policy is untrained; this method spends everything on judging.",
    }
}
