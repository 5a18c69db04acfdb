//! The `demosift` command: which demonstrations should your agent learn from?

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

use std::process::ExitCode;

use clap::Parser as _;
use demosift::Error;

use console::{interruption, terminal};

/// The user can mend it: wrong data, arguments or configuration, a full disk.
const USER_MISTAKE: u8 = 2;
/// The run went wrong.
const FAILURE: u8 = 1;

fn main() -> ExitCode {
    let typed = match arguments::Demosift::try_parse() {
        Ok(typed) => typed,
        Err(error) => {
            // Help and version are asked for, everything else is a mistake; clap knows where each is printed.
            let printed = error.print().or_else(|source| terminal::check_shown(&source));
            return match printed {
                Ok(()) => ExitCode::from(if error.use_stderr() { USER_MISTAKE } else { 0 }),
                Err(error) => told(&error),
            };
        }
    };
    interruption::listen(typed.command.goes_on());
    match commands::run(typed.command).and_then(|()| terminal::all_shown()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => told(&error),
    }
}

fn told(error: &Error) -> ExitCode {
    terminal::complain(error);
    ExitCode::from(exit_code(error))
}

fn exit_code(error: &Error) -> u8 {
    if error.is_bad_input() || error.is_bad_config() || error.is_io() { USER_MISTAKE } else { FAILURE }
}
