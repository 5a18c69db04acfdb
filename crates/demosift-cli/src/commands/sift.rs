//! `demosift sift`: the whole job.

use demosift::Result;
use demosift::run::experiment::{self, Selection, Sifted};
use demosift::run::forecast::Goal;
use demosift::stages::method::Costs;
use demosift::stages::subset_selection::Weighing;
use serde_json::Value;

use super::{goals, judge, kept_in, report, select};
use crate::answers::{self, OfRun};
use crate::arguments::JobArguments;
use crate::job::Job;
use crate::job::own_heuristic::Beside;
use crate::tables::judgment::{self, Judgment, Kept};
use crate::tables::{costs, weights};
use crate::{console::terminal, tables};

pub(crate) fn run(arguments: &JobArguments) -> Result<()> {
    let mut job = goals::run(arguments, Goal::Verdict, Some(Goal::Referee), one)?;
    if job.variants().len() > 1 && !arguments.run.dry_run {
        // That of the whole leads to those of the goals.
        let page = report::write(&mut job)?;
        if !arguments.run.json {
            terminal::show(&format!("\nReport of all goals: {}\n", page.display()));
        }
    }
    Ok(())
}

/// The job of a task with one goal.
fn one(job: &mut Job, json: bool) -> Result<Value> {
    judge::first_then_all(job, json)?;
    let sifted = job.run(experiment::sift)?;
    let (weighing, costs) = (select::weighing(job)?, job.costs()?);
    let beside = job.beside(sifted.data_only.clone());
    if json {
        let Sifted { panel, selection, verdict, .. } = &sifted;
        let page = report::write(job)?;
        let found = answers::Sift {
            selected: answers::Select::new(selection, weighing.as_ref(), &costs),
            columns: answers::Columns::new(&selection.ranking, &beside),
            judges: panel,
            verdict,
            report: &page,
        };
        return Ok(OfRun::new(job, found).value());
    }
    show(job, &sifted, weighing.as_ref(), &beside, &costs);
    // After the tables, which took hours and are worth having even if the page cannot be written.
    let page = report::write(job)?;
    terminal::show(&format!("\nReport: {}", page.display()));
    terminal::show(&kept_in(job.folder(), job.variant()));
    Ok(Value::Null)
}

/// The tables of the whole job.
fn show(job: &Job, sifted: &Sifted, weighing: Option<&Weighing>, beside: &Beside, costs: &Costs) {
    let Sifted { panel, selection, verdict, .. } = sifted;
    let Selection { ranking, uncertainty, subset } = selection;
    let judgment = Judgment { set: job.set(), ranking, uncertainty, unit: job.unit(), k: job.k() };
    let kept = Kept { subset, keep: job.keep() };
    if judge::is_shown_already(panel) {
        terminal::show(&judgment::kept(&judgment, kept));
    } else {
        terminal::show(&judgment::ranking(&judgment, Some(kept)));
    }
    terminal::show(&tables::panel::judges(panel, job.unit()));
    terminal::show(&weighing.map_or(String::new(), |weighing| format!("\n{}", weights::trends(weighing))));
    terminal::show(&judgment::beside(ranking, beside));
    terminal::show("\n");
    terminal::show(&tables::verdict::verdict(verdict, job.unit()));
    terminal::show(&costs::played(costs));
}
