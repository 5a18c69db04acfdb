//! The only place that talks to the terminal: results on standard output, everything else on standard error.

use std::io::Write as _;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use demosift::basics::observer::{Event, Observer};
use demosift::{Error, Result};
use indicatif::{ProgressBar, ProgressStyle};

use crate::metrics_file::MetricsFile;

/// Prints results; a reader that has gone away has seen enough.
pub(crate) fn show(text: &str) {
    let mut out = std::io::stdout().lock();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}

/// Prints results as JSON.
pub(crate) fn show_json(value: &impl serde::Serialize) {
    let value = serde_json::to_value(value).expect("plain data always serializes");
    show(&format!("{value:#}\n"));
}

/// Says what went wrong, and what could be done about it.
pub(crate) fn complain(error: &Error) {
    let mut out = std::io::stderr().lock();
    let _ = writeln!(out, "error: {error}");
    if let Some(hint) = error.hint() {
        let _ = writeln!(out, "hint: {hint}");
    }
}

/// Says what the user should know although nothing went wrong.
pub(crate) fn note(words: &str) {
    let _ = writeln!(std::io::stderr().lock(), "note: {words}");
}

/// Says where an interrupted run is, and the command that goes on with it.
pub(crate) fn say_stopped(folder: &Path, command: &str) {
    clear_bar();
    let mut out = std::io::stderr().lock();
    let _ = writeln!(out, "stopped: what is finished is kept in the run folder {}", folder.display());
    let _ = writeln!(out, "hint: go on with: {command}");
}

/// Says that a command was interrupted which keeps nothing.
pub(crate) fn say_stopped_only() {
    clear_bar();
    let _ = writeln!(std::io::stderr().lock(), "stopped");
}

/// The bar that is shown now, for an interruption to clear.
static SHOWN: Mutex<Option<ProgressBar>> = Mutex::new(None);

fn clear_bar() {
    if let Some(bar) = SHOWN.lock().unwrap_or_else(PoisonError::into_inner).take() {
        bar.finish_and_clear();
    }
}

/// Shows a bar for the stage that runs, and writes down what is measured.
///
/// The bar hides itself where standard error is not a terminal.
pub(crate) struct Progress {
    /// A look at something measures nothing.
    metrics: Option<MetricsFile>,
    bar: ProgressBar,
    failed: Option<Error>,
}

impl Progress {
    pub(crate) fn new(metrics: MetricsFile) -> Self {
        Self { metrics: Some(metrics), ..Self::of_bar_only() }
    }

    /// Shows the bar and writes nothing down.
    pub(crate) fn of_bar_only() -> Self {
        Self { metrics: None, bar: ProgressBar::hidden(), failed: None }
    }

    /// Clears the bar; the error is the first that writing the measurements met.
    pub(crate) fn finish(&mut self) -> Result<()> {
        self.bar.finish_and_clear();
        self.failed.take().map_or(Ok(()), Err)
    }

    fn start(&mut self, stage: &str, done: usize, total: usize) {
        self.bar.finish_and_clear();
        let style =
            ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len}, {elapsed} so far, {eta} left")
                .expect("the template is ours");
        self.bar = ProgressBar::new(total as u64).with_style(style).with_message(what(stage));
        *SHOWN.lock().unwrap_or_else(PoisonError::into_inner) = Some(self.bar.clone());
        self.bar.set_position(done as u64);
        self.bar.reset_eta();
        self.bar.enable_steady_tick(Duration::from_millis(500));
    }
}

impl Observer for Progress {
    fn on(&mut self, event: Event<'_>) {
        match event {
            Event::Started { stage, done, total } => self.start(stage, done, total),
            Event::Advanced { done, .. } => self.bar.set_position(done as u64),
            Event::Measured { stage, part, iteration, numbers } => {
                let metrics = self.metrics.as_mut();
                if let Some(Err(error)) = metrics.map(|file| file.append(stage, part, iteration, numbers)) {
                    self.failed.get_or_insert(error);
                }
            }
            Event::Checkpoint { .. } => {}
        }
    }
}

/// Says something on the way, such as what is done anew.
pub(crate) fn say(words: &str) {
    clear_bar();
    let _ = writeln!(std::io::stderr().lock(), "{words}");
}

/// Shows how many cells of a study are made; the bar and the time left go by what each costs.
pub(crate) struct StudyProgress {
    bar: ProgressBar,
    made: AtomicUsize,
    cells: usize,
}

impl StudyProgress {
    /// So many cells, which cost so much together.
    pub(crate) fn new(cells: usize, cost: u64) -> Self {
        let style = ProgressStyle::with_template("{msg} {wide_bar} {elapsed} so far, {eta} left")
            .expect("the template is ours");
        let bar = ProgressBar::new(cost).with_style(style).with_message(format!("cell 0 of {cells}"));
        *SHOWN.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar.clone());
        bar.enable_steady_tick(Duration::from_millis(500));
        Self { bar, made: AtomicUsize::new(0), cells }
    }

    /// A cell is made.
    pub(crate) fn advance(&self, cost: u64) {
        let made = 1 + self.made.fetch_add(1, Ordering::Relaxed);
        self.bar.set_message(format!("cell {made} of {}", self.cells));
        self.bar.inc(cost);
    }

    /// Clears the bar.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// A stage in words.
fn what(stage: &str) -> String {
    match stage {
        "meta_train" => "learning to imitate",
        "pre_train" => "imitating the entire set",
        "subset_selection" => "weighing demonstrations",
        "judge" => "judging demonstrations",
        "imitate" => "imitating from scratch",
        "referee" => "training final policies",
        "demonstrator" => "training the demonstrator",
        "film" => "taking pictures",
        other => other,
    }
    .to_owned()
}
