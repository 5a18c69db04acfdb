//! The only place that talks to the terminal: results on standard output, everything else on standard error.

use std::borrow::Cow;
use std::io::{ErrorKind, Write as _};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use demosift::basics::observer::{Event, Observer};
use demosift::{Error, Result};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};

use crate::files::metrics_file::MetricsFile;

/// The first result that could not be shown, and why.
static NOT_SHOWN: Mutex<Option<Error>> = Mutex::new(None);

fn not_shown(error: Error) {
    NOT_SHOWN.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
}

/// Prints results; whether that went well, [`all_shown`] says at the end.
pub(crate) fn show(text: &str) {
    print(tame(text).as_bytes());
}

/// Prints results as JSON.
pub(crate) fn show_json(value: &impl serde::Serialize) {
    match serde_json::to_value(value) {
        Ok(value) => print(tame_json(&format!("{value:#}\n")).as_bytes()),
        Err(error) => not_shown(Error::bad_input(format!("JSON cannot hold the answer: {error}"))),
    }
}

fn print(bytes: &[u8]) {
    let mut out = std::io::stdout().lock();
    if let Err(source) = out.write_all(bytes).and_then(|()| out.flush()) {
        check_shown(&source).unwrap_or_else(not_shown);
    }
}

/// Whether an error of standard output is none: a reader that has gone away has seen enough.
///
/// # Errors
/// `is_io` for every other one.
pub(crate) fn check_shown(source: &std::io::Error) -> Result<()> {
    match source.kind() {
        ErrorKind::BrokenPipe => Ok(()),
        _ => Err(Error::io("cannot write", Path::new("standard output"), source)),
    }
}

/// Whether all results were shown; a full disk behind `> FILE` must not pass for success.
///
/// # Errors
/// The first that one was not.
pub(crate) fn all_shown() -> Result<()> {
    NOT_SHOWN.lock().unwrap_or_else(PoisonError::into_inner).take().map_or(Ok(()), Err)
}

/// Names come out of files of others, and a terminal obeys some letters: those are shown and not obeyed.
fn tame(text: &str) -> Cow<'_, str> {
    tamed(text, |letter| format!("\\u{{{:x}}}", u32::from(letter)))
}

/// The same in JSON, where such letters only stand within strings.
pub(crate) fn tame_json(text: &str) -> Cow<'_, str> {
    tamed(text, |letter| format!("\\u{:04x}", u32::from(letter)))
}

fn tamed(text: &str, shown: impl Fn(char) -> String) -> Cow<'_, str> {
    // Letters that turn the direction of writing make a name look like another.
    let turns = |letter: char| matches!(letter, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let is_wild = |letter: char| letter.is_control() && !"\n\t".contains(letter) || turns(letter);
    if !text.contains(is_wild) {
        return Cow::Borrowed(text);
    }
    text.chars().map(|letter| if is_wild(letter) { shown(letter) } else { letter.to_string() }).collect()
}

/// Says what went wrong, and what could be done about it.
pub(crate) fn complain(error: &Error) {
    let mut out = std::io::stderr().lock();
    let _ = writeln!(out, "error: {}", tame(&error.to_string()));
    if let Some(hint) = error.hint() {
        let _ = writeln!(out, "hint: {}", tame(hint));
    }
}

/// Says what the user should know although nothing went wrong.
pub(crate) fn note(words: &str) {
    let _ = writeln!(std::io::stderr().lock(), "note: {}", tame(words));
}

/// Says where an interrupted run is, and the command that goes on with it.
pub(crate) fn say_stopped(folder: &Path, command: &str) {
    clear_bar();
    let mut out = std::io::stderr().lock();
    let folder = folder.display().to_string();
    let _ = writeln!(out, "stopped: what is finished is kept in the run folder {}", tame(&folder));
    let _ = writeln!(out, "hint: go on with: {}", tame(command));
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

/// Asks for lines of progress on standard error, for a program that shows a bar of its own; `lines` is what it is set to.
const PROGRESS_VARIABLE: &str = "DEMOSIFT_PROGRESS";

/// Shows a bar for the stage that runs, and writes down what is measured.
///
/// The bar hides itself where standard error is not a terminal.
pub(crate) struct Progress {
    /// A look at something measures nothing.
    metrics: Option<MetricsFile>,
    bar: ProgressBar,
    /// Whether lines are asked for in place of the bar.
    in_lines: bool,
}

impl Progress {
    pub(crate) fn new(metrics: MetricsFile) -> Self {
        Self { metrics: Some(metrics), ..Self::of_bar_only() }
    }

    /// Shows the bar and writes nothing down.
    pub(crate) fn of_bar_only() -> Self {
        let in_lines = std::env::var_os(PROGRESS_VARIABLE).is_some_and(|asked| asked == "lines");
        Self { metrics: None, bar: ProgressBar::hidden(), in_lines }
    }

    /// Clears the bar.
    pub(crate) fn finish(&mut self) {
        self.bar.finish_and_clear();
    }

    fn start(&mut self, stage: &str, done: usize, total: usize) {
        if self.in_lines {
            return progress_line(&json!({ "stage": what(stage), "done": done, "total": total }));
        }
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

/// One line of progress, which no other line looks like.
fn progress_line(told: &Value) {
    let _ = writeln!(std::io::stderr().lock(), "progress: {told}");
}

impl Observer for Progress {
    fn on(&mut self, event: Event<'_>) -> Result<()> {
        match event {
            Event::Started { stage, done, total } => self.start(stage, done, total),
            Event::Advanced { done, .. } if self.in_lines => progress_line(&json!({ "done": done })),
            Event::Advanced { done, .. } => self.bar.set_position(done as u64),
            Event::Measured { stage, part, iteration, numbers } => {
                if let Some(metrics) = &mut self.metrics {
                    metrics.append(stage, part, iteration, numbers)?;
                }
            }
            Event::Checkpoint { .. } | Event::Finished { .. } => {
                if let Some(metrics) = &mut self.metrics {
                    metrics.settle()?;
                }
            }
        }
        Ok(())
    }
}

/// Says something on the way, such as what is done again.
pub(crate) fn say(words: &str) {
    clear_bar();
    let _ = writeln!(std::io::stderr().lock(), "{}", tame(words));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_that_a_terminal_obeys_are_shown() {
        let wild = "demo_\x1b[31m\x1b]0;owned\x07\u{9b}2J\r\u{202e}_1";
        assert_eq!(tame(wild), r"demo_\u{1b}[31m\u{1b}]0;owned\u{7}\u{9b}2J\u{d}\u{202e}_1");
        assert_eq!(tame("rank\tgain ± 0.5\n"), "rank\tgain ± 0.5\n");
        let json = serde_json::json!({ "name": wild }).to_string();
        let tamed = tame_json(&json);
        assert!(!tamed.contains(char::is_control));
        let back: serde_json::Value = serde_json::from_str(&tamed).unwrap();
        assert_eq!(back["name"], wild);
    }
}
