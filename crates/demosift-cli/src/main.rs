//! The program `demosift`.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(demosift_cli::run(std::env::args_os().collect()))
}
