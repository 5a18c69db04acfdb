//! `demosift completions`: what makes a shell complete the command.

use clap::CommandFactory as _;

use crate::arguments::{CompletionsArguments, Demosift};
use crate::console::terminal;

pub(crate) fn run(arguments: &CompletionsArguments) {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut Demosift::command(), "demosift", &mut script);
    terminal::show(&String::from_utf8_lossy(&script));
}
