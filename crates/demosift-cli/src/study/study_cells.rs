//! Making the cells of a study, and reading those that are there.
//!
//! Cells are shared over threads whole, each on a pool of one thread, so that a processor's time is a cell's own.
//! What depends on finished cells, such as trainings on what was kept, is asked for once they are there.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use demosift::basics::files;
use demosift::basics::part::Part;
use demosift::run::study::compact::{self, Compact};
use demosift::run::study::make::{self, Means, PriorOf};
use demosift::run::study::{Cell, Fingerprint, Finished, Found, Only, Work, pools, told};
use demosift::{Error, Result};
use rustix::time::{ClockId, clock_gettime};

use crate::answers::StudyDryRun;
use crate::console::terminal::{self, StudyProgress};
use crate::job;
use crate::study::study_file::{Opened, OpenedSet};
use crate::study::study_folder::{Recalled, StudyFolder, fingerprint};
use crate::tables::study::{self as table, Kind};

/// A study with what is finished of it.
pub(crate) struct Studied<'o> {
    pub(crate) opened: &'o Opened,
    pub(crate) folder: StudyFolder,
    /// What earlier files of results hold.
    earlier: Vec<Finished>,
    finished: Finished,
    /// Cells that are there and of something else, each with what.
    not_believed: Vec<(Work, &'static str)>,
}

/// What of a study's work is still to be made.
pub(crate) struct Missing {
    /// Cells that are there.
    pub(crate) finished: usize,
    /// The others.
    pub(crate) work: Vec<Work>,
    /// Trainings that cannot be named yet, at most.
    pub(crate) later: usize,
}

impl<'o> Studied<'o> {
    /// Looks into a folder that need not be there, and into files of earlier results.
    pub(crate) fn look(opened: &'o Opened, out: &Path, from: &[PathBuf]) -> Result<Self> {
        let earlier = from.iter().map(|path| Ok(read_results(path)?.finished));
        Ok(Self {
            folder: StudyFolder::look(out.to_owned())?,
            earlier: earlier.collect::<Result<_>>()?,
            finished: Finished::default(),
            not_believed: Vec::new(),
            opened,
        })
    }

    /// Reads all finished cells, also those that depend on others.
    pub(crate) fn gather(&mut self) -> Result<()> {
        self.forget_what_lacks_a_curve();
        loop {
            let mut found = false;
            for work in self.opened.study.work(&self.finished) {
                if self.finished.holds(&work) || self.not_believed.iter().any(|(of, _)| *of == work) {
                    continue;
                }
                let wanted = self.fingerprint(&work);
                let is_of_use = |cell: &&Cell| {
                    cell.fingerprint == wanted && self.opened.study.has_all_to_show(cell, &self.finished)
                };
                let handed_on = self.earlier.iter().filter_map(|of| of.cell(&work)).find(is_of_use);
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

    /// What is kept may have turned out since to be what a cell of an earlier file was trained on, whose curve is then drawn.
    fn forget_what_lacks_a_curve(&mut self) {
        let earlier = self.earlier.iter().flat_map(Finished::cells);
        let handed_on = earlier.filter_map(|cell| self.finished.cell(&cell.work));
        let lacking = handed_on.filter(|cell| !self.opened.study.has_all_to_show(cell, &self.finished));
        let lacking: Vec<Work> = lacking.map(|cell| cell.work.clone()).collect();
        lacking.iter().for_each(|work| self.finished.forget(work));
    }

    /// What `--dry-run` answers.
    pub(crate) fn counted<'a>(
        &'a self,
        finished: usize,
        missing: &'a [Kind],
        later: usize,
    ) -> StudyDryRun<'a> {
        StudyDryRun {
            study: &self.opened.study.name,
            dry_run: true,
            finished,
            missing,
            trainings_that_depend_on_them_at_most: later,
            notes: &self.opened.notes,
            study_folder: self.folder.path(),
        }
    }

    fn set_of(&self, work: &Work) -> &'o OpenedSet {
        let place = self.opened.study.sets.iter().position(|set| set.name == work.set());
        &self.opened.sets[place.expect("the work is that of the study")]
    }

    /// The set on which the prior is learned that a set is judged from, where that is another.
    fn lender_of(&self, work: &Work) -> Option<&'o OpenedSet> {
        let name = self.opened.study.lender(work)?;
        let place = self.opened.study.sets.iter().position(|set| set.name == name)?;
        self.opened.sets.get(place)
    }

    fn fingerprint(&self, work: &Work) -> Fingerprint {
        fingerprint(work, self.set_of(work), self.lender_of(work))
    }

    /// Makes all that is missing, in as many waves as it takes until nothing new is asked for.
    pub(crate) fn make(&mut self, only: &Only, part: Option<Part>, threads: usize) -> Result<()> {
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
                "{count} cells of {} are of {first}, so they are made again; the old ones are kept in cells/set_aside",
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
        let cell = Cell { work: work.clone(), found, fingerprint: self.fingerprint(work) };
        self.folder.store(&cell)?;
        Ok(cell)
    }

    fn found(&self, work: &Work) -> Result<Found> {
        let means = self.means(work);
        match work {
            Work::Judging { seed, .. } => {
                make::judging(&means, *seed, &mut processor_seconds).map(Found::Judging)
            }
            Work::Weighing { seed, .. } => {
                make::weighing(&means, *seed, &mut processor_seconds).map(Found::Weighing)
            }
            Work::Training { demos, imitator, seed, .. } => {
                make::training(&means, demos, *imitator, *seed, &mut processor_seconds).map(Found::Training)
            }
        }
    }

    fn means(&self, work: &Work) -> Means<'o> {
        let opened = self.set_of(work);
        let (config, prior) = match work {
            Work::Judging { method, .. } | Work::Weighing { method, .. } => {
                let of =
                    |lender: &'o OpenedSet| PriorOf { set: &lender.set, config: lender.of_method(method) };
                (opened.of_method(method), self.lender_of(work).map(of))
            }
            Work::Training { .. } => (&opened.training, None),
        };
        Means { set: &opened.set, task: opened.chosen.task.as_ref(), config, prior }
    }

    /// Environment steps of some work.
    fn planned(&self, work: &Work) -> u64 {
        match work {
            Work::Judging { .. } => make::planned_judging(&self.means(work)),
            // What is wrong with it is told when it is made.
            Work::Weighing { .. } => make::planned_weighing(&self.means(work)).unwrap_or(0),
            Work::Training { imitator, .. } => make::planned_training(&self.means(work), *imitator),
        }
    }

    /// What is not there yet.
    pub(crate) fn missing(&self, only: &Only, part: Option<Part>) -> Missing {
        let study = &self.opened.study;
        let from_start = study.work_only(only, &Finished::default());
        let mut work = study.work_only(only, &self.finished);
        let finished = work.iter().filter(|work| self.finished.holds(work)).count();
        work.retain(|work| !self.finished.holds(work) && is_of_part(part, work, &from_start));
        Missing { finished, work, later: study.most_unknown_trainings(only, &self.finished) }
    }

    /// Work by its kind, with what it costs.
    pub(crate) fn kinds(&self, work: &[Work]) -> Vec<Kind> {
        let mut kinds: Vec<Kind> = Vec::new();
        for work in work {
            let (name, steps) = (table::kind(work), self.planned(work));
            match kinds.iter_mut().find(|kind| kind.name == name) {
                Some(kind) => {
                    (kind.cells, kind.environment_steps) = (kind.cells + 1, kind.environment_steps + steps)
                }
                None => kinds.push(Kind { name, cells: 1, environment_steps: steps, processor_hours: None }),
            }
        }
        for kind in &mut kinds {
            let alike = self.finished.cells().filter(|cell| table::kind(&cell.work) == kind.name);
            kind.processor_hours = told::hours_at_the_pace_of(alike, kind.environment_steps);
        }
        kinds
    }

    /// All that is finished as a file of results, and what that file says, to the last digit.
    pub(crate) fn results(&self) -> Result<Results> {
        let mut notes = self.opened.notes.clone();
        if let Some((_, what)) = self.not_believed.first() {
            notes.push(format!(
                "{} cells are not believed, since they are of {what}.",
                self.not_believed.len()
            ));
        }
        let (study, finished) = (self.opened.study.clone(), self.finished.clone());
        let compact = Compact { demosift: env!("CARGO_PKG_VERSION").to_owned(), study, notes, finished };
        let bytes = compact::write(&compact, &pools::asked(&compact.study, &compact.finished));
        Ok(Results { compact: compact::read(&bytes)?, bytes })
    }
}

/// A file of results, read and as it is written.
pub(crate) struct Results {
    pub(crate) compact: Compact,
    pub(crate) bytes: Vec<u8>,
}

/// Whether a part makes some work: of what can be named from the start every n-th; of the rest, which comes to be named at
/// different times on different machines, an n-th by name.
fn is_of_part(part: Option<Part>, work: &Work, from_start: &[Work]) -> bool {
    let Some(part) = part else { return true };
    let place = from_start.iter().position(|other| other == work).unwrap_or_else(|| {
        let hash = files::sha256_of(work.name().as_bytes());
        usize::from_str_radix(&hash[..8], 16).expect("a hash is hexadecimal")
    });
    part.takes(place)
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

/// How many threads are asked for.
pub(crate) fn threads(asked: Option<usize>) -> Result<usize> {
    match asked {
        Some(count) => job::threads::check(count).map(|()| count),
        None => Ok(std::thread::available_parallelism().map_or(1, usize::from)),
    }
}

/// What an earlier study found.
pub(crate) fn read_results(path: &Path) -> Result<Compact> {
    if !path.exists() {
        return Err(Error::bad_input("the file of results does not exist").at(path));
    }
    let bytes = files::read(path)?;
    compact::read(&bytes).map_err(|error| error.at(path))
}
