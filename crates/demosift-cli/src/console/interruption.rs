//! Ctrl-C: a run stops at once, and says how it goes on.
//!
//! Nothing has to be finished first, as every file of a run is written whole or not at all, and its last checkpoint is never
//! far back.
//! Only a write that is under way is let through, so that nothing half-written lies about; a second Ctrl-C does not wait.
//!
//! The exception is a folder of pictures, which is written for as long as they are rendered: its hidden folder stays, and goes
//! away when the same pictures are made again.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use signal_hook::{flag, low_level};

use crate::console::quoting::quoted;
use crate::{console::terminal, files::lock as locks, files::writing};

/// The run folder, once there is one.
static FOLDER: Mutex<Option<PathBuf>> = Mutex::new(None);

/// What a shell reports of a process that a signal ended is this more than the signal's number.
const SIGNALED: i32 = 128;

/// How a command goes on where it was interrupted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum GoesOn {
    /// It keeps nothing.
    Never,
    /// With `--resume`.
    WithResume,
    /// The same line does not do again what is finished.
    ByItself,
}

/// From here on Ctrl-C and SIGTERM end the process as described above.
///
/// Where the system refuses, they end it at once and without a word, which a run survives just as well.
pub(crate) fn listen(typed: Vec<OsString>, goes_on: GoesOn) {
    // The thread that ends the process in order must exist before the default way to end it is replaced.
    let listener = Signals::new([SIGINT, SIGTERM]).and_then(|mut signals| {
        let wait = move || signals.forever().take(1).for_each(|signal| stop(signal, &typed, goes_on));
        thread::Builder::new().name("interruption".to_owned()).spawn(wait)
    });
    let again = Arc::new(AtomicBool::new(listener.is_err()));
    for signal in [SIGINT, SIGTERM] {
        // In this order: the first signal finds the flag down and raises it, the second finds it raised.
        let _ = flag::register_conditional_shutdown(signal, SIGNALED + signal, Arc::clone(&again));
        let _ = flag::register(signal, Arc::clone(&again));
    }
}

/// Where the run is that the interruption should name.
pub(crate) fn run_is_in(folder: &Path) {
    *lock(&FOLDER) = Some(folder.to_owned());
}

fn stop(signal: i32, typed: &[OsString], goes_on: GoesOn) {
    // Never given back: from here on nothing more is written.
    let _writing = writing::hold();
    let folder = lock(&FOLDER);
    match folder.as_deref() {
        Some(folder) if goes_on != GoesOn::Never => {
            // A path need not be UTF-8, and a panic here would be shown to nobody.
            let typed = typed.iter().map(|word| word.to_string_lossy().into_owned());
            terminal::say_stopped(folder, &command_to_go_on(typed, goes_on));
        }
        _ => terminal::say_stopped_only(),
    }
    locks::give_all_back();
    // Workers end with this process by themselves, and what they have started does not.
    demosift_gymnasium::end_all();
    // Not through destructors: other threads still work on what these would take away.
    low_level::exit(SIGNALED + signal);
}

/// The command as it was typed, going on.
fn command_to_go_on(typed: impl Iterator<Item = String>, goes_on: GoesOn) -> String {
    let mut words: Vec<String> = typed.map(|word| quoted(&word)).collect();
    // What stands behind it is no option, whatever it looks like.
    let options = words.iter().position(|word| word == "--").unwrap_or(words.len());
    if goes_on == GoesOn::WithResume && !words[..options].iter().any(|word| word == "--resume") {
        words.insert(options, "--resume".to_owned());
    }
    words.join(" ")
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_that_goes_on_can_be_pasted_into_a_shell() {
        let typed = ["demosift", "sift", "my set", "--set", "imitate.update.alphas=[1, 2]"];
        assert_eq!(
            command_to_go_on(typed.into_iter().map(str::to_owned), GoesOn::WithResume),
            "demosift sift 'my set' --set 'imitate.update.alphas=[1, 2]' --resume"
        );
        let typed = ["demosift", "judge", "--resume", "--out", "it's", ""];
        assert_eq!(
            command_to_go_on(typed.into_iter().map(str::to_owned), GoesOn::WithResume),
            r"demosift judge --resume --out 'it'\''s' ''"
        );
    }

    #[test]
    fn a_study_goes_on_by_the_same_line() {
        let typed = ["demosift", "study", "verdict.toml"];
        assert_eq!(
            command_to_go_on(typed.into_iter().map(str::to_owned), GoesOn::ByItself),
            "demosift study verdict.toml"
        );
    }

    #[test]
    fn an_option_stands_before_what_can_be_none() {
        let typed = ["demosift", "sift", "--out", "run", "--", "--resume"];
        assert_eq!(
            command_to_go_on(typed.into_iter().map(str::to_owned), GoesOn::WithResume),
            "demosift sift --out run --resume -- --resume"
        );
    }
}
