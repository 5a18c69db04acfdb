//! `demosift tasks`: which tasks come with demosift.

use crate::arguments::TasksArguments;
use crate::{console::terminal, task};

pub(crate) fn run(arguments: &TasksArguments) {
    let names = task::names();
    if arguments.json {
        terminal::show_json(&names);
    } else {
        terminal::show(&names.iter().map(|name| format!("{name}\n")).collect::<String>());
    }
}
