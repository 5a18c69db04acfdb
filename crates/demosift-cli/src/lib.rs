//! The `demosift` command: which demonstrations should your agent learn from?
//!
//! It is a library of one function, so that the wheel for Python has the same command as the program.

mod answers;
mod arguments;
mod commands;
mod configuration;
mod console;
mod files;
mod job;
mod report;
mod study;
mod tables;
mod task;

use std::ffi::OsString;

use clap::Parser as _;
use demosift::Error;

use console::{interruption, terminal};

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
