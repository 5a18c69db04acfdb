//! `--dry-run`: what a command would cost, without doing it; the run folder is read and never written.

use std::path::Path;
use std::time::Instant;

use demosift::Result;
use demosift::results::panel::Judge;
use demosift::run::experiment;
use demosift::run::forecast::{self, Forecast, Goal};
use demosift::world::environment::Task;

use crate::answers::DryRun;
use crate::arguments::RunArguments;
use crate::console::terminal;
use crate::job::Job;
use crate::tables;

/// What counting cannot know.
const EARLY: &str = "Episodes of this task may end early, and the steps are counted as if none did: learning plays about as \
                     many in more episodes, and evaluations will play fewer.";

/// Shows what a job has still to do until a goal is reached.
pub(super) fn of_job(job: &mut Job, goal: Goal<'_>, arguments: &RunArguments) -> Result<()> {
    let forecast = job.run(|run| forecast::forecast(run, goal, &mut clock()))?;
    show(&forecast, job.chosen().task.as_ref(), job.folder().path(), arguments);
    about_near_cut(job, &forecast, arguments)
}

/// Says where the judge of the paper will judge a part of the set alone.
pub(super) fn about_near_cut(job: &mut Job, forecast: &Forecast, arguments: &RunArguments) -> Result<()> {
    let judge = Judge::Paper;
    let judged = job.run(|run| Ok(experiment::how_many(run.config, run.set, judge)))?;
    let all = job.set().len();
    if judged < all && forecast.has_to_judge(judge) && !arguments.json {
        terminal::show(&format!("\n{}\n", tables::wrapped(&tables::panel::will_judge(judged, all))));
    }
    Ok(())
}

/// Seconds from now on.
pub(super) fn clock() -> impl FnMut() -> f64 {
    let start = Instant::now();
    move || start.elapsed().as_secs_f64()
}

/// Shows a forecast of a run with a task.
pub(super) fn show(forecast: &Forecast, task: &dyn Task, folder: &Path, arguments: &RunArguments) {
    let threads = rayon::current_num_threads();
    if arguments.json {
        let episodes_may_end_early = task.may_end_early();
        let run_folder = folder;
        let goals = match &task.specification().variants[..] {
            [_] => &[],
            several => several,
        };
        terminal::show_json(&DryRun {
            forecast,
            dry_run: true,
            episodes_may_end_early,
            threads,
            goals,
            run_folder,
        });
        return;
    }
    terminal::show(&tables::forecast::in_words(forecast, threads));
    if task.may_end_early() && !forecast.stages.is_empty() {
        terminal::show(&format!("\n{}\n", tables::wrapped(EARLY)));
    }
    terminal::show(&format!("\nNothing was written. The run folder: {}\n", folder.display()));
}
