//! `demosift report`: all that a run found, as one page.

use std::path::PathBuf;

use demosift::Result;
use demosift::data::demonstration::DemoId;
use demosift::results::artifact::Artifact;
use demosift::results::data_only::DataOnly;
use demosift::results::report;
use demosift::results::report::{Report, Sources};
use demosift::run::experiment;

use crate::answers::ReportMade;
use crate::arguments::ReportArguments;
use crate::console::terminal;
use crate::job::run_folder;
use crate::job::{Job, Prior};
use crate::report::{page, replay};

/// The report's file in a run folder.
const PAGE: &str = "report.html";

pub(crate) fn run(arguments: &ReportArguments) -> Result<()> {
    run_folder::of_finished(&arguments.run_folder)?;
    let mut job = Job::open(&arguments.job(), Prior::NotNeeded)?;
    if !arguments.json {
        let page = write(&mut job)?;
        terminal::show(&format!("Report: {}\n", page.display()));
        return Ok(());
    }
    let found = gather(&mut job)?;
    // Whoever asks for numbers gets them from a disk that is only read, too.
    let page = match write_found(&mut job, &found) {
        Err(error) if error.is_io() => {
            terminal::note(&format!("the page was not written: {error}"));
            None
        }
        written => Some(written?),
    };
    terminal::show_json(&ReportMade { report: &found.report, page: page.as_deref() });
    Ok(())
}

/// What a page is made of, besides the replay.
struct Found {
    report: Report,
    /// The demonstrations that are looked at, by rank.
    shown: Vec<DemoId>,
    /// Why the demonstrations' own heuristic is not known, where it should be.
    unusable: Option<String>,
}

/// Writes the page into the run folder; returns its file.
pub(super) fn write(job: &mut Job) -> Result<PathBuf> {
    let found = gather(job)?;
    write_found(job, &found)
}

fn gather(job: &mut Job) -> Result<Found> {
    let (panel, data_only, costs) = job.run(|run| {
        for judge in run.config.judges.each() {
            report::judged(run.ledger, *judge)?;
        }
        let data_only = DataOnly::recall(run.ledger, "")?.unwrap_or_default();
        Ok((experiment::panel(run)?, data_only, experiment::costs(run)?))
    })?;
    let beside = job.beside(data_only);
    let report = report::report(&Sources {
        ledger: job.folder(),
        set: job.set(),
        task: job.chosen().task.as_ref(),
        keep: job.keep(),
        kept_part: &job.kept_part(),
        panel: &panel,
        data_only: &beside.data_only,
        own_heuristic: beside.own.as_ref(),
        costs: &costs,
    })?;
    let shown = report::worth_a_look(panel.deciding().ranking, report.k);
    Ok(Found { report, shown, unusable: beside.unusable.map(|why| why.message().to_owned()) })
}

fn write_found(job: &mut Job, found: &Found) -> Result<PathBuf> {
    let replay = replay::of(job, &found.shown)?;
    let mut report = found.report.clone();
    report.curves.retain(|curve| found.shown.contains(&curve.demo));
    let made = page::Made {
        demosift: env!("CARGO_PKG_VERSION"),
        set: page::name_of_set(job.set_path()),
        sha256: job.data().sha256.clone(),
        variant: job.chosen().variant.as_deref(),
        goals: goals(job),
        configuration: run_folder::resolved(job.folder().path())?,
        unusable: found.unusable.as_deref(),
        left_out: job.left_out(),
        numbers: job.numbers_in_words(),
    };
    let html = page::html(&report, &made, &replay);
    let path = job.folder().path().join(PAGE);
    job.store(PAGE, html.as_bytes())?;
    Ok(path)
}

/// The goals of the run with their pages; none where the run is about one.
fn goals(job: &Job) -> Vec<page::Goal> {
    let names = job.variants();
    let page = |name: &String| {
        let page = format!("{name}/{PAGE}");
        job.folder().path().join(&page).exists().then(|| page::link_below(&page))
    };
    let goal = |name: &String| page::Goal { name: name.clone(), page: page(name) };
    if names.len() > 1 { names.iter().map(goal).collect() } else { Vec::new() }
}
