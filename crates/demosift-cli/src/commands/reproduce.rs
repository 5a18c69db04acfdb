//! `demosift reproduce`: the paper's experiments, each with its figures, its numbers and a page that says what holds here.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use demosift::basics::files;
use demosift::results::figure;
use demosift::run::study::compact::{self, Compact};
use demosift::run::study::{Only, claims, draw, pools, summary as tables_of, told};
use demosift::{Error, Result};

use crate::answers;
use crate::arguments::{PresetName, ReproduceArguments};
use crate::console::terminal;
use crate::files::writing::undisturbed;
use crate::study::reproduce_page::{Made, Page, Shown, Summarized, summary};
use crate::study::study_cells::{Missing, Results, Studied, read_results, threads};
use crate::study::study_file::{self, Asked, Source};
use crate::study::{experiments, in_short};
use crate::tables;

/// Where the sets lie in a checkout.
const DATA: &str = "data";

pub(crate) fn run(arguments: &ReproduceArguments) -> Result<()> {
    let path = Path::new(&arguments.experiment);
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("json") => return summarize(arguments, &[draw_again(arguments, path)?]),
        Some("toml") => return reproduce(arguments, &[Source::At(path)]),
        _ => {}
    }
    let data = arguments.data.clone().unwrap_or_else(|| PathBuf::from(DATA));
    let named = match experiments::named(&arguments.experiment) {
        // A name means the experiment, whatever lies in this folder.
        Err(_) if path.is_dir() => return draw_folder(arguments, path),
        named => named?,
    };
    if !data.is_dir() {
        return Err(Error::bad_input("the folder of the demonstration sets is not there")
            .at(&data)
            .with_hint("call it in a checkout of demosift, or give its folder data: --data DIR"));
    }
    let sources: Vec<Source<'_>> = named
        .iter()
        .map(|experiment| Source::BuiltIn { name: experiment.name, text: experiment.text, sets: &data })
        .collect();
    reproduce(arguments, &sources)
}

fn reproduce(arguments: &ReproduceArguments, sources: &[Source<'_>]) -> Result<()> {
    check_pages(arguments, sources.len())?;
    let (mut counted, mut all) = (BTreeSet::new(), Vec::new());
    for source in sources {
        all.extend(one(arguments, *source, &mut counted)?);
    }
    summarize(arguments, &all)
}

/// The summary, if it is asked for.
fn summarize(arguments: &ReproduceArguments, all: &[Summarized]) -> Result<()> {
    let Some(path) = &arguments.summary else { return Ok(()) };
    undisturbed(|| files::write_atomically(path, summary(all).as_bytes()))
}

/// Makes one experiment, or counts its cells, of which `counted` have been counted already.
fn one(
    arguments: &ReproduceArguments,
    source: Source<'_>,
    counted: &mut BTreeSet<String>,
) -> Result<Option<Summarized>> {
    let threads = threads(arguments.cells.threads)?;
    if arguments.seeds == Some(0) {
        return Err(Error::bad_config("--seeds 0: must be at least 1"));
    }
    let only = arguments.only.clone().unwrap_or_default();
    let opened = study_file::open(&Asked {
        source,
        public: arguments.data.as_deref(),
        only: &only,
        preset: arguments.preset.map(PresetName::name),
        seeds: arguments.seeds,
    })?;
    let only = &opened.only;
    if opened.study.drawn.is_nothing() {
        return Err(Error::bad_input(
            "this study draws nothing and claims nothing, so there is nothing to reproduce",
        )
        .at(Path::new(&arguments.experiment))
        .with_hint("make it with demosift study, or add [[figures]] (docs/studies.md)"));
    }
    let preset = opened.study.drawn.preset.clone().unwrap_or_else(|| "standard".to_owned());
    let out = arguments.out.clone().unwrap_or_else(|| Path::new("runs/reproduce").join(preset));
    let mut studied = Studied::look(&opened, &out, &arguments.cells.from)?;
    if arguments.dry_run {
        studied.gather()?;
        forecast(&studied, only, arguments, counted);
        return Ok(None);
    }
    if !arguments.table {
        studied.folder.begin(arguments.cells.part)?;
        studied.make(only, arguments.cells.part, threads)?;
    }
    studied.gather()?;
    let results = studied.results()?;
    let beside = out.join(format!("{}.md", results.compact.study.name));
    // Where only what is there is shown, nothing is written that is not asked for; and parts would write the same files.
    let page = match (page_of(arguments, &results.compact), arguments.table) {
        (Some(page), _) => Some(page),
        (None, _) if arguments.cells.part.is_some() => None,
        (None, true) if !out.is_dir() => None,
        (None, _) => Some(beside),
    };
    tell(arguments, &results, page.as_deref()).map(Some)
}

/// Whether each of so many experiments has a page of its own.
fn check_pages(arguments: &ReproduceArguments, experiments: usize) -> Result<()> {
    match arguments.page.as_ref().filter(|page| experiments > 1 && is_page(page)) {
        Some(page) => {
            Err(Error::bad_input("several experiments have a page each").at(page).with_hint("give a folder"))
        }
        None => Ok(()),
    }
}

fn is_page(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "md")
}

/// The page that is asked for.
fn page_of(arguments: &ReproduceArguments, compact: &Compact) -> Option<PathBuf> {
    let page = arguments.page.as_ref()?;
    Some(if is_page(page) { page.clone() } else { page.join(format!("{}.md", compact.study.name)) })
}

/// All experiments whose results lie in a folder, and then all other studies that draw or claim something.
fn draw_folder(arguments: &ReproduceArguments, folder: &Path) -> Result<()> {
    let results = experiments::EXPERIMENTS.iter().map(|of| folder.join(format!("{}.json", of.name)));
    let mut results: Vec<PathBuf> = results.filter(|path| path.is_file()).collect();
    let entries = std::fs::read_dir(folder).map_err(|error| Error::io("cannot read", folder, &error))?;
    let beside = entries.flatten().map(|entry| entry.path());
    let mut others: Vec<PathBuf> = beside.filter(|path| !results.contains(path) && draws(path)).collect();
    others.sort();
    results.extend(others);
    if results.is_empty() {
        return Err(
            Error::bad_input("the folder holds no results of an experiment, such as fig3.json").at(folder)
        );
    }
    check_pages(arguments, results.len())?;
    let all = results.iter().map(|path| draw_again(arguments, path)).collect::<Result<Vec<_>>>()?;
    summarize(arguments, &all)
}

/// Whether it is a file of results, and not just of cells; other files of a folder say other things.
fn draws(path: &Path) -> bool {
    let is_named_so = path.extension().is_some_and(|extension| extension == "json");
    is_named_so && read_results(path).is_ok_and(|compact| !compact.study.drawn.is_nothing())
}

/// A file of results is drawn on any machine, without the sets.
fn draw_again(arguments: &ReproduceArguments, path: &Path) -> Result<Summarized> {
    let ReproduceArguments { data, out, cells, only, dry_run, preset, seeds, .. } = arguments;
    let making = [
        ("--data", data.is_some()),
        ("--out", out.is_some()),
        ("--from", !cells.from.is_empty()),
        ("--part", cells.part.is_some()),
        ("--only", only.is_some()),
        ("--dry-run", *dry_run),
        ("--preset", preset.is_some()),
        ("--seeds", seeds.is_some()),
    ];
    if let Some((option, _)) = making.into_iter().find(|(_, is_given)| *is_given) {
        let what = format!("{option} is about making cells, and a file of results is only drawn");
        return Err(Error::bad_input(what).at(path).with_hint(
            "leave it out: --page says where the page is written; or give the name of an experiment, or the study file, \
             NAME.toml, to make cells",
        ));
    }
    let compact = read_results(path)?;
    let bytes = compact::write(&compact, &pools::asked(&compact.study, &compact.finished));
    let page = page_of(arguments, &compact);
    tell(arguments, &Results { compact, bytes }, page.as_deref())
}

/// Shows what was found, and writes the page with all that belongs to it.
fn tell(arguments: &ReproduceArguments, results: &Results, page: Option<&Path>) -> Result<Summarized> {
    let Results { compact, bytes } = results;
    let study = &compact.study;
    let told = told::tell(study, &compact.finished);
    let decided = claims::decide(study, &compact.finished);
    let summarized = tables_of::summarize(study, &compact.finished);
    let shown = Shown { compact, told: &told, summary: &summarized, decided: &decided };
    if let Some(page) = page {
        let folder = page.parent().unwrap_or(Path::new(""));
        let write =
            |name: &str, bytes: &[u8]| undisturbed(|| files::write_atomically(&folder.join(name), bytes));
        std::fs::create_dir_all(if folder.as_os_str().is_empty() { Path::new(".") } else { folder })
            .map_err(|error| Error::io("cannot make the folder of the page", folder, &error))?;
        for drawn in &study.drawn.figures {
            let grid = draw::draw(study, drawn, &compact.finished);
            write(&format!("{}.svg", drawn.name), figure::svg(&grid).as_bytes())?;
            write(&format!("{}.csv", drawn.name), figure::csv(&grid).as_bytes())?;
        }
        write(&format!("{}.json", study.name), bytes)?;
        let made = Made { commit: arguments.commit.as_deref(), machine: arguments.machine.as_deref() };
        let text = Page { shown: &shown, made }.text();
        undisturbed(|| files::write_atomically(page, text.as_bytes()))?;
    }
    if arguments.json {
        terminal::show_json(&answers::Reproduced {
            experiment: &study.name,
            preset: study.drawn.preset.as_deref(),
            partial: told.is_partial(),
            told: &told,
            claims: &decided,
            failures: &compact.finished.failures(),
            notes: &compact.notes,
            page,
        });
    } else {
        terminal::show(&shown.plainly());
        if let Some(page) = page {
            terminal::show(&format!("\nThe page, with its figures beside it: {}\n", page.display()));
        }
    }
    let (title, is_partial) = (shown.title(), told.is_partial());
    let in_short = in_short::lines(&told, &summarized);
    Ok(Summarized { name: study.name.clone(), title, is_partial, decided, in_short })
}

/// `--dry-run`; what an earlier experiment counts is not counted again.
fn forecast(
    studied: &Studied<'_>,
    only: &Only,
    arguments: &ReproduceArguments,
    counted: &mut BTreeSet<String>,
) {
    let study = &studied.opened.study;
    let Missing { finished, mut work, later } = studied.missing(only, arguments.cells.part);
    work.retain(|work| counted.insert(work.name()));
    let kinds = studied.kinds(&work);
    if arguments.json {
        terminal::show_json(&studied.counted(finished, &kinds, later));
        return;
    }
    let title = study.drawn.title.as_ref().unwrap_or(&study.name);
    let told = tables::study::forecast(&kinds, finished, later, &studied.opened.notes);
    terminal::show(&format!("{title}\n{told}\n"));
    if arguments.experiment != experiments::ALL {
        let folder = studied.folder.path().display();
        terminal::show(&format!("Nothing was made. The folder of the cells: {folder}\n"));
    }
}
