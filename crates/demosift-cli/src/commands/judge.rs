//! `demosift judge`: MetaPrior → ScoreTable.

use demosift::results::panel::{Judge, Judges, Order, Panel};
use demosift::run::experiment;
use demosift::run::forecast::Goal;
use demosift::stages::judge::ScoreTable;
use demosift::{Error, Result};

use super::{dry_run, kept_in, part, standing};
use crate::answers::{self, OfRun};
use crate::arguments::{JudgeArguments, PartArgument};
use crate::job::{Job, Prior};
use crate::tables::by_variant;
use crate::tables::costs;
use crate::tables::judgment::{self, Judgment};
use crate::{console::terminal, tables};

pub(crate) fn run(arguments: &JudgeArguments) -> Result<()> {
    let JudgeArguments { job: arguments, prior, part: PartArgument { part } } = arguments;
    match (prior, part) {
        (Some(_), Some(part)) => {
            return Err(Error::bad_config(format!(
                "--part {part} and --prior do not go together: what is judged from the prior of an earlier run is not shared out"
            ))
            .with_hint("leave --part away; to share them out, judge some with --episodes on each machine"));
        }
        (Some(prior), None) => return standing::run(arguments, prior),
        _ => {}
    }
    let mut job = Job::open_part(arguments, Prior::Needed, *part)?;
    if arguments.run.dry_run {
        return dry_run::of_job(&mut job, Goal::Scores, &arguments.run);
    }
    if part.is_some() {
        return share(&mut job, arguments.run.json);
    }
    let panel = first_then_all(&mut job, arguments.run.json)?;
    let (tables, data_only) = job.run(|run| {
        let tables = run.config.judges.each().iter().map(|judge| experiment::scores(run, *judge));
        Ok((tables.collect::<Result<Vec<_>>>()?, experiment::data_only(run)?))
    })?;
    let costs = job.costs()?;
    let (Order { ranking, uncertainty }, beside) = (panel.deciding(), job.beside(data_only));
    let found = || panel.opinions.iter().zip(&tables);
    if arguments.run.json {
        let answer = answers::Judge {
            judges: found()
                .map(|(opinion, scores)| {
                    answers::OfJudge::new(opinion, scores, panel.places_above(opinion, job.k()))
                })
                .collect(),
            decides: panel.decides,
            together: panel.together.as_ref(),
            agreement: panel.agreement,
            disagreements: &panel.disagreements,
            columns: answers::Columns::new(ranking, &beside),
            costs: answers::Spending::of(&costs),
        };
        terminal::show_json(&OfRun::new(&job, answer));
        return Ok(());
    }
    let judgment = Judgment { set: job.set(), ranking, uncertainty, unit: job.unit(), k: job.k() };
    if !is_shown_already(&panel) {
        terminal::show(&judgment::ranking(&judgment, None));
    }
    let deciding: Vec<_> =
        found().filter(|(opinion, _)| panel.decides.each().contains(&opinion.judge)).collect();
    let scores: Vec<&ScoreTable> = deciding.iter().map(|(_, scores)| *scores).collect();
    terminal::show(&by_variant::gains(&scores, job.variants(), job.unit()));
    for (opinion, scores) in deciding {
        terminal::show(&judgment::distance(scores, opinion.judge));
    }
    terminal::show(&tables::panel::judges(&panel, job.unit()));
    terminal::show(&judgment::beside(ranking, &beside));
    terminal::show(&costs::played(&costs));
    terminal::show(&kept_in(job.folder(), job.variant()));
    Ok(())
}

/// What a part of the run judges, judge by judge: where one waits for other parts, the next does not.
fn share(job: &mut Job, json: bool) -> Result<()> {
    let judges = job.run(|run| Ok(run.config.judges.each()))?;
    let mut left = Vec::new();
    for judge in judges {
        let scores = job.run(|run| experiment::scores(run, *judge));
        left.extend(part::left(scores)?.map(|left| format!("{left} by {}", tables::panel::in_words(*judge))));
    }
    part::done(job, "judge", "", &left, json);
    Ok(())
}

/// Whether [`first_then_all`] has shown the ranking that decides.
pub(super) fn is_shown_already(panel: &Panel) -> bool {
    panel.opinions.len() > 1 && panel.decides == Judges::Cloning
}

/// What all judges say; the table of the one that is done within seconds stands on the screen before the others begin.
pub(super) fn first_then_all(job: &mut Job, json: bool) -> Result<Panel> {
    let several = job.run(|run| Ok(run.config.judges.each().len() > 1))?;
    if several && !json {
        let first = job.run(|run| experiment::opinion(run, Judge::Cloning))?;
        let judgment = Judgment {
            set: job.set(),
            ranking: &first.ranking,
            uncertainty: &first.uncertainty,
            unit: job.unit(),
            k: job.k(),
        };
        terminal::show(&format!(
            "First, by cloning alone; the judge of the paper follows.\n\n{}\n",
            judgment::ranking(&judgment, None)
        ));
    }
    job.run(experiment::panel)
}
