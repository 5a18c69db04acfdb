//! The subcommands: each brings a run folder up to its result and shows it.

mod completions;
mod convert;
mod dry_run;
mod export;
mod goals;
mod imitate;
mod inspect;
mod judge;
mod meta_train;
mod oracle;
mod part;
mod play;
pub(crate) mod record;
mod referee;
mod report;
mod reproduce;
mod select;
mod sift;
mod standing;
mod study;
mod task;
mod tasks;
mod weigh;

use demosift::Result;

use crate::arguments::Command;
use crate::job::run_folder::RunFolder;

pub(crate) fn run(command: Command) -> Result<()> {
    match command {
        Command::Sift(arguments) => sift::run(&arguments),
        Command::Record(arguments) => record::run(&arguments),
        Command::MetaTrain(arguments) => meta_train::run(&arguments),
        Command::Judge(arguments) => judge::run(&arguments),
        Command::Select(arguments) => select::run(&arguments),
        Command::Weigh(arguments) => weigh::run(&arguments),
        Command::Referee(arguments) => referee::run(&arguments),
        Command::Imitate(arguments) => imitate::run(&arguments),
        Command::Oracle(arguments) => oracle::run(&arguments),
        Command::Study(arguments) => study::run(&arguments),
        Command::Reproduce(arguments) => reproduce::run(&arguments),
        Command::Play(arguments) => play::run(&arguments),
        Command::Inspect(arguments) => inspect::run(&arguments),
        Command::Convert(arguments) => convert::run(&arguments),
        Command::Export(arguments) => export::run(&arguments),
        Command::Report(arguments) => report::run(&arguments),
        Command::Task(command) => task::run(&command),
        Command::Tasks(arguments) => {
            tasks::run(&arguments);
            Ok(())
        }
        Command::Completions(arguments) => {
            completions::run(&arguments);
            Ok(())
        }
    }
}

/// Where everything is kept, and which goal it is about where that is one of several; the last line of a result.
fn kept_in(folder: &RunFolder, variant: Option<&str>) -> String {
    let about = variant.map_or(String::new(), |variant| format!(", about {variant} alone"));
    format!("\nRun folder: {}{about}\n", folder.path().display())
}
