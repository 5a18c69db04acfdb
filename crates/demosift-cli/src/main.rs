//! The `demosift` command: which demonstrations should your agent learn from?

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

use std::process::ExitCode;

use clap::Parser as _;
use demosift::Error;

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
