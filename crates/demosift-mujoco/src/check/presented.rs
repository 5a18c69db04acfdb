//! A set as it is held against a task, with what it and the user say of its numbers.

use demosift::data::demonstration::Demonstration;
use demosift::data::demonstration::episode::Says;
use demosift::data::demonstration::set_file::SetFile;
use demosift::data::demonstration::timing::Timing;
use demosift::data::trajectory::StateLog;

/// A set as it is held against a task.
#[derive(Clone, Debug)]
pub struct Presented<'a> {
    /// In the numbers of the task.
    pub set: &'a [Demonstration],
    /// As it was recorded.
    pub recorded: &'a [Demonstration],
    /// The simulator's states of each demonstration, where the set has them.
    pub states: Option<&'a [StateLog]>,
    /// What the set says of its numbers.
    pub says: Says,
    /// What its clock tells.
    pub timing: Option<Timing>,
    /// What the user says of its numbers.
    pub set_file: SetFile,
}

impl<'a> Presented<'a> {
    /// A set of which nothing is said.
    pub fn plain(set: &'a [Demonstration], states: Option<&'a [StateLog]>) -> Self {
        Self { set, recorded: set, states, says: Says::default(), timing: None, set_file: SetFile::default() }
    }
}
