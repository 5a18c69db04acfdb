//! `demosift study`: which judge agrees best with the truth, over many sets and seeds.

use std::path::Path;

use demosift::basics::files;
use demosift::run::study::Only;
use demosift::run::study::compact::Compact;
use demosift::run::study::summary::{self, Summary};
use demosift::{Error, Result};

use crate::answers;
use crate::arguments::StudyArguments;
use crate::console::terminal;
use crate::study::study_cells::{Missing, Results, Studied, read_results, threads};
use crate::study::study_file::{self, Asked, Source};
use crate::tables;

/// The file of results in the folder of a study.
const RESULTS: &str = "study";

pub(crate) fn run(arguments: &StudyArguments) -> Result<()> {
    if arguments.study.extension().is_some_and(|extension| extension == "json") {
        return show_results(arguments);
    }
    let threads = threads(arguments.cells.threads)?;
    let only = arguments.only.clone().unwrap_or_default();
    let opened = study_file::open(&Asked {
        source: Source::At(&arguments.study),
        public: arguments.data.as_deref(),
        only: &only,
        preset: None,
        seeds: None,
    })?;
    let only = &opened.only;
    let out = arguments.out.clone().unwrap_or_else(|| Path::new("runs").join(&opened.study.name));
    let mut studied = Studied::look(&opened, &out, &arguments.cells.from)?;
    if arguments.dry_run {
        studied.gather()?;
        forecast(&studied, only, arguments);
        return Ok(());
    }
    if !arguments.table {
        studied.folder.begin(arguments.cells.part)?;
        studied.make(only, arguments.cells.part, threads)?;
    }
    studied.gather()?;
    let Results { compact, bytes } = studied.results()?;
    let summary = summary::summarize(&compact.study, &compact.finished);
    // Parts would write the same file, each of what it saw.
    if !arguments.table && arguments.cells.part.is_none() {
        studied.folder.store_results(RESULTS, &bytes)?;
    }
    if let Some(path) = &arguments.write {
        files::write_atomically(path, &bytes)?;
    }
    show(&compact, &summary, arguments, Some(studied.folder.path()));
    Ok(())
}

/// `--dry-run`.
fn forecast(studied: &Studied<'_>, only: &Only, arguments: &StudyArguments) {
    let Missing { finished, work, later } = studied.missing(only, arguments.cells.part);
    let kinds = studied.kinds(&work);
    if arguments.json {
        terminal::show_json(&studied.counted(finished, &kinds, later));
        return;
    }
    terminal::show(&tables::study::forecast(&kinds, finished, later, &studied.opened.notes));
    terminal::show(&format!(
        "\nNothing was made. The folder of the study: {}\n",
        studied.folder.path().display()
    ));
}

/// The tables of a file of results.
fn show_results(arguments: &StudyArguments) -> Result<()> {
    let StudyArguments { study: path, data, out, cells, only, dry_run, .. } = arguments;
    let makes = data.is_some() || out.is_some() || cells.are_made() || only.is_some() || *dry_run;
    if makes || arguments.write.is_some() {
        return Err(Error::bad_input("a file of results is only shown, with --table, --markdown or --json")
            .at(path)
            .with_hint("give the study file, NAME.toml, to make cells"));
    }
    let compact = read_results(path)?;
    let summary = summary::summarize(&compact.study, &compact.finished);
    show(&compact, &summary, arguments, None);
    Ok(())
}

fn show(compact: &Compact, summary: &Summary, arguments: &StudyArguments, folder: Option<&Path>) {
    if arguments.json {
        terminal::show_json(&answers::StudyShown {
            study: &compact.study,
            demosift: &compact.demosift,
            notes: &compact.notes,
            summary,
            study_folder: folder,
        });
        return;
    }
    terminal::show(&tables::study::in_full(compact, summary, arguments.markdown));
    if let Some(folder) = folder.filter(|_| !arguments.markdown) {
        terminal::show(&format!("\nThe folder of the study: {}\n", folder.display()));
    }
}
