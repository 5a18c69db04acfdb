//! The `demosift` command: which demonstrations should your agent learn from?
//!
//! It is a library of one function, so that the wheel for Python has the same command as the program.

mod answers;
mod arguments;
mod asked_again;
mod commands;
mod configuration;
mod demonstrations;
mod event_file;
mod examples;
mod experiments;
mod fit;
mod given_prior;
mod interruption;
mod job;
mod lock;
mod metrics_file;
mod own_heuristic;
mod picture_folder;
mod report;
mod reproduce_page;
mod resolved;
mod run_folder;
mod simulator;
mod study_cells;
mod study_file;
mod study_folder;
mod tables;
mod task;
mod terminal;
mod version;
mod writing;

use std::ffi::OsString;

use clap::Parser as _;
use demosift::Error;

/// The user can mend it: wrong data, arguments or configuration, a full disk.
const USER_MISTAKE: u8 = 2;
/// The run went wrong.
const FAILURE: u8 = 1;

/// Runs the command as it was typed, the name of the program first, and returns its exit code.
///
/// Once a process: it answers Ctrl-C from then on, and sets up the threads.
pub fn run(typed: Vec<OsString>) -> u8 {
    let command = match arguments::Demosift::try_parse_from(&typed) {
        Ok(parsed) => parsed.command,
        Err(error) => {
            // Help and version are asked for, everything else is a mistake; clap knows where each is printed.
            let printed = error.print().or_else(|source| terminal::check_shown(&source));
            return match printed {
                Ok(()) if error.use_stderr() => USER_MISTAKE,
                Ok(()) => 0,
                Err(error) => told(&error),
            };
        }
    };
    interruption::listen(typed, command.goes_on());
    match commands::run(command).and_then(|()| terminal::all_shown()) {
        Ok(()) => 0,
        Err(error) => told(&error),
    }
}

fn told(error: &Error) -> u8 {
    terminal::complain(error);
    exit_code(error)
}

fn exit_code(error: &Error) -> u8 {
    if error.is_bad_input() || error.is_bad_config() || error.is_io() { USER_MISTAKE } else { FAILURE }
}
