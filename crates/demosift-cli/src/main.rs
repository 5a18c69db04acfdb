//! The `demosift` command: which demonstrations should your agent learn from?

mod answers;
mod arguments;
mod commands;
mod configuration;
mod demonstrations;
mod event_file;
mod examples;
mod given_prior;
mod interruption;
mod job;
mod metrics_file;
mod own_heuristic;
mod picture_folder;
mod report;
mod run_folder;
mod simulator;
mod study_file;
mod study_folder;
mod tables;
mod task;
mod terminal;
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
            // A reader that has gone away has seen enough.
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { USER_MISTAKE } else { 0 });
        }
    };
    interruption::listen(typed.command.goes_on());
    match commands::run(typed.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            terminal::complain(&error);
            ExitCode::from(exit_code(&error))
        }
    }
}

fn exit_code(error: &Error) -> u8 {
    if error.is_bad_input() || error.is_bad_config() || error.is_io() { USER_MISTAKE } else { FAILURE }
}
