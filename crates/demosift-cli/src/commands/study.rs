//! `demosift study`: which judge agrees best with the truth, over many sets and seeds.
//!
//! Cells are shared over threads whole, each on a pool of one thread, so that a processor's time is a cell's own.
//! What depends on finished cells, such as trainings on what was kept, is asked for once they are there.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use demosift::basics::files;
use demosift::run::study::compact::{self, Compact};
use demosift::run::study::make::{self, Means};
use demosift::run::study::pools;
use demosift::run::study::summary::{self, Summary};
use demosift::run::study::{Cell, Finished, Found, Only, Work};
use demosift::{Error, Result};
use rustix::time::{ClockId, clock_gettime};

use crate::answers;
use crate::arguments::{Part, StudyArguments};
use crate::job;
use crate::study_file::{self, Opened, OpenedSet};
use crate::study_folder::{Recalled, StudyFolder, fingerprint};
use crate::tables;
use crate::terminal::{self, StudyProgress};

pub(crate) fn run(arguments: &StudyArguments) -> Result<()> {
    if arguments.study.extension().is_some_and(|extension| extension == "json") {
        return show_results(arguments);
    }
    let threads = threads(arguments.threads)?;
    let only = arguments.only.as_ref().map_or(Only::default(), |only| only.0.clone());
    let opened = study_file::open(&arguments.study, arguments.data.as_deref(), &only)?;
    // The study is about the sets that are asked for and there.
    let only = Only { sets: None, ..only };
    opened.study.check_only(&only).map_err(|error| error.at(&arguments.study))?;
    let out = arguments.out.clone().unwrap_or_else(|| Path::new("runs").join(&opened.study.name));
    let mut studied = Studied {
        folder: StudyFolder::look(out)?,
        earlier: arguments.from.as_deref().map_or(Ok(Finished::default()), earlier)?,
        finished: Finished::default(),
        not_believed: Vec::new(),
        opened: &opened,
    };
    if arguments.dry_run {
        studied.gather()?;
        forecast(&studied, &only, arguments);
        return Ok(());
    }
    if !arguments.table {
        studied.folder.begin(arguments.part)?;
        studied.make(&only, arguments.part, threads)?;
    }
    studied.gather()?;
    studied.tell(arguments)
}

fn threads(asked: Option<usize>) -> Result<usize> {
    match asked {
        Some(count) => job::check_threads(count).map(|()| count),
        None => Ok(std::thread::available_parallelism().map_or(1, usize::from)),
    }
}

/// A study with what is finished of it.
struct Studied<'o> {
    opened: &'o Opened,
    folder: StudyFolder,
    /// What an earlier file of results holds.
    earlier: Finished,
    finished: Finished,
    /// Cells that are there and of something else, each with what.
    not_believed: Vec<(Work, &'static str)>,
}

impl Studied<'_> {
    /// Reads all finished cells, also those that depend on others.
    fn gather(&mut self) -> Result<()> {
        loop {
            let mut found = false;
            for work in self.opened.study.work(&self.finished) {
                if self.finished.holds(&work) || self.not_believed.iter().any(|(of, _)| *of == work) {
                    continue;
                }
                let wanted = fingerprint(&work, self.set_of(&work));
                let handed_on = self.earlier.cell(&work).filter(|cell| cell.fingerprint == wanted);
                match (self.folder.recall(&work, &wanted)?, handed_on) {
                    (Recalled::Cell(cell), _) => self.finished.add(*cell),
                    (_, Some(cell)) => self.finished.add(cell.clone()),
                    (Recalled::NotBelieved(what), None) => {
                        self.not_believed.push((work, what));
                        continue;
                    }
                    (Recalled::Nothing, None) => continue,
                }
                found = true;
            }
            if !found {
                return Ok(());
            }
        }
    }

    fn set_of(&self, work: &Work) -> &OpenedSet {
        let place = self.opened.study.sets.iter().position(|set| set.name == work.set());
        &self.opened.sets[place.expect("the work is that of the study")]
    }

    /// Makes all that is missing, in as many waves as it takes until nothing new is asked for.
    fn make(&mut self, only: &Only, part: Option<Part>, threads: usize) -> Result<()> {
        let study = &self.opened.study;
        let from_start = study.work_only(only, &Finished::default());
        loop {
            self.gather()?;
            let mut missing = study.work_only(only, &self.finished);
            missing.retain(|work| !self.finished.holds(work) && is_of_part(part, work, &from_start));
            if missing.is_empty() {
                return Ok(());
            }
            self.make_room(&missing)?;
            for cell in self.make_all(&missing, threads)? {
                self.finished.add(cell);
            }
        }
    }

    /// Sets cells aside that are not believed, and says so.
    fn make_room(&mut self, missing: &[Work]) -> Result<()> {
        let in_the_way = |work: &Work| missing.contains(work);
        let (mut count, mut first) = (0, "");
        for (work, what) in self.not_believed.iter().filter(|(work, _)| in_the_way(work)) {
            self.folder.set_aside(work)?;
            (count, first) = (count + 1, if count == 0 { what } else { first });
        }
        self.not_believed.retain(|(work, _)| !in_the_way(work));
        if count > 0 {
            terminal::say(&format!(
                "{count} cells of {} are of {first}, so they are made anew; the old ones are kept in cells/set_aside",
                self.folder.path().display()
            ));
        }
        Ok(())
    }

    fn make_all(&self, missing: &[Work], threads: usize) -> Result<Vec<Cell>> {
        let next = AtomicUsize::new(0);
        let stop = AtomicBool::new(false);
        let weights: Vec<u64> = missing.iter().map(|work| weight(self.planned(work))).collect();
        let progress = StudyProgress::new(missing.len(), weights.iter().sum());
        let made: Mutex<Vec<Result<Cell>>> = Mutex::new(Vec::new());
        let work_through = || {
            while !stop.load(Ordering::Relaxed) {
                let index = next.fetch_add(1, Ordering::Relaxed);
                let Some(work) = missing.get(index) else { break };
                let cell = self.make_alone(work);
                if cell.is_err() {
                    stop.store(true, Ordering::Relaxed);
                }
                progress.advance(weights[index]);
                made.lock().unwrap_or_else(PoisonError::into_inner).push(cell);
            }
        };
        std::thread::scope(|scope| {
            (0..threads.min(missing.len())).for_each(|_| {
                scope.spawn(work_through);
            });
        });
        progress.finish();
        made.into_inner().unwrap_or_else(PoisonError::into_inner).into_iter().collect()
    }

    /// Makes a cell on a thread of its own and keeps it.
    fn make_alone(&self, work: &Work) -> Result<Cell> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .map_err(|error| Error::bad_config(format!("cannot start a thread: {error}")))?;
        let found = match pool.install(|| self.found(work)) {
            // The same would come of it again.
            Err(error) if error.is_diverged() || error.is_simulation() => Found::Failed(error.to_string()),
            found => found.map_err(|error| error.during(&work.name()))?,
        };
        let cell = Cell { work: work.clone(), found, fingerprint: fingerprint(work, self.set_of(work)) };
        self.folder.store(&cell)?;
        Ok(cell)
    }

    fn found(&self, work: &Work) -> Result<Found> {
        let means = self.means(work);
        match work {
            Work::Judging { seed, .. } => {
                make::judging(&means, *seed, &mut processor_seconds).map(Found::Judging)
            }
            Work::Training { demos, imitator, seed, .. } => {
                make::training(&means, demos, *imitator, *seed, &mut processor_seconds).map(Found::Training)
            }
        }
    }

    fn means(&self, work: &Work) -> Means<'_> {
        let opened = self.set_of(work);
        let config = match work {
            Work::Judging { method, .. } => opened.of_method(method),
            Work::Training { .. } => &opened.training,
        };
        Means { set: &opened.set, task: opened.chosen.task.as_ref(), config }
    }

    /// Environment steps of some work.
    fn planned(&self, work: &Work) -> u64 {
        match work {
            Work::Judging { .. } => make::planned_judging(&self.means(work)),
            Work::Training { imitator, .. } => make::planned_training(&self.means(work), *imitator),
        }
    }

    /// Keeps the results and shows them.
    fn tell(self, arguments: &StudyArguments) -> Result<()> {
        let mut notes = self.opened.notes.clone();
        if let Some((_, what)) = self.not_believed.first() {
            notes.push(format!(
                "{} cells are not believed, since they are of {what}.",
                self.not_believed.len()
            ));
        }
        let (study, finished) = (self.opened.study.clone(), self.finished);
        let compact = Compact { demosift: env!("CARGO_PKG_VERSION").to_owned(), study, notes, finished };
        let bytes = compact::write(&compact, &pools::asked(&compact.study, &compact.finished));
        // What is shown is what the file says, to the last digit.
        let compact = compact::read(&bytes)?;
        let summary = summary::summarize(&compact.study, &compact.finished);
        if !arguments.table {
            self.folder.store_results(&bytes)?;
        }
        if let Some(path) = &arguments.write {
            files::write_atomically(path, &bytes)?;
        }
        show(&compact, &summary, arguments, Some(self.folder.path()));
        Ok(())
    }
}

/// Whether a part makes some work: of what can be named from the start every n-th; of the rest, which comes to be named at
/// different times on different machines, an n-th by name.
fn is_of_part(part: Option<Part>, work: &Work, from_start: &[Work]) -> bool {
    let Some(Part { index, of }) = part else { return true };
    let place = from_start.iter().position(|other| other == work).unwrap_or_else(|| {
        let hash = files::sha256_of(work.name().as_bytes());
        usize::from_str_radix(&hash[..8], 16).expect("a hash is hexadecimal")
    });
    place % of == index
}

/// How much of the bar a cell is; cloning plays little, yet takes its time.
fn weight(environment_steps: u64) -> u64 {
    environment_steps + 5000
}

/// Seconds that a processor has worked for this thread.
fn processor_seconds() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// `--dry-run`.
fn forecast(studied: &Studied<'_>, only: &Only, arguments: &StudyArguments) {
    let study = &studied.opened.study;
    let from_start = study.work_only(only, &Finished::default());
    let mut missing = study.work_only(only, &studied.finished);
    let there = missing.iter().filter(|work| studied.finished.holds(work)).count();
    missing.retain(|work| !studied.finished.holds(work) && is_of_part(arguments.part, work, &from_start));
    let mut kinds: Vec<tables::study::Kind> = Vec::new();
    for work in &missing {
        let (name, steps) = (tables::study::kind(work), studied.planned(work));
        match kinds.iter_mut().find(|kind| kind.name == name) {
            Some(kind) => {
                (kind.cells, kind.environment_steps) = (kind.cells + 1, kind.environment_steps + steps)
            }
            None => kinds.push(tables::study::Kind { name, cells: 1, environment_steps: steps }),
        }
    }
    let later = study.most_unknown_trainings(only, &studied.finished);
    if arguments.json {
        terminal::show_json(&answers::StudyDryRun {
            study: &study.name,
            dry_run: true,
            finished: there,
            missing: &kinds,
            trainings_that_depend_on_them_at_most: later,
            notes: &studied.opened.notes,
            study_folder: studied.folder.path(),
        });
        return;
    }
    terminal::show(&tables::study::forecast(&kinds, there, later, &studied.opened.notes));
    terminal::show(&format!(
        "\nNothing was made. The folder of the study: {}\n",
        studied.folder.path().display()
    ));
}

/// The cells of a file of results.
fn earlier(path: &Path) -> Result<Finished> {
    Ok(read_results(path)?.finished)
}

fn read_results(path: &Path) -> Result<Compact> {
    let bytes = std::fs::read(path).map_err(|source| match source.kind() {
        std::io::ErrorKind::NotFound => Error::bad_input("the file of results does not exist").at(path),
        _ => Error::io("cannot read the results", path, &source),
    })?;
    compact::read(&bytes).map_err(|error| error.at(path))
}

/// The tables of a file of results.
fn show_results(arguments: &StudyArguments) -> Result<()> {
    let StudyArguments { study: path, data, out, part, only, dry_run, from, .. } = arguments;
    let makes =
        data.is_some() || out.is_some() || part.is_some() || only.is_some() || from.is_some() || *dry_run;
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
