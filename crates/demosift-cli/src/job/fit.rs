//! Whether the numbers of a set can be what a task takes: the same cheap look before every run, and where a user asks for it.

use std::path::Path;

use demosift::data::demonstration::Demonstration;
use demosift::data::demonstration::episode::Source;
use demosift::data::demonstration::timing;
use demosift::data::trajectory::StateLog;
use demosift::{Error, Result};
use demosift_mujoco::check::{self, Finding, Presented, Severity};
use demosift_mujoco::mujoco_task::MujocoTask;

use crate::console::terminal;
use crate::job::demonstrations::Said;
use crate::job::states;
use crate::task::Chosen;

/// A set that was read for a task, with all that is known of its numbers.
pub(crate) struct Held<'a> {
    set: Vec<Demonstration>,
    /// As it was recorded, where that is something else.
    recorded: Option<Vec<Demonstration>>,
    states: Option<Vec<StateLog>>,
    source: &'a Source,
    said: &'a Said,
}

impl<'a> Held<'a> {
    /// States that are not of the model of `task`, where one is given, are left out with a note.
    ///
    /// # Errors
    /// If one of the episodes is none to learn from.
    pub(crate) fn of(
        source: &'a Source,
        said: &'a Said,
        path: &Path,
        task: Option<&MujocoTask>,
    ) -> Result<Self> {
        Ok(Self {
            set: source.demonstrations()?,
            recorded: if source.conversion.is_none() { None } else { Some(source.recorded()?) },
            states: states::usable(path, source, task)?,
            source,
            said,
        })
    }

    pub(crate) fn presented(&self) -> Presented<'_> {
        Presented {
            set: &self.set,
            recorded: self.recorded.as_deref().unwrap_or(&self.set),
            states: self.states.as_deref(),
            says: self.source.says.clone(),
            timing: timing::timing(self.source),
            set_file: self.said.set_file.clone(),
        }
    }
}

/// What there is to say of a set beside a task of the same sizes.
pub(crate) fn findings(chosen: &Chosen, held: &Held<'_>) -> Result<Vec<Finding>> {
    check::fit(chosen.task.specification(), chosen.mujoco.as_ref(), &held.presented())
}

/// Stops a run on a set whose numbers cannot be what the task takes, and notes what is odd.
///
/// # Errors
/// `is_bad_input` if so; the hint says what would mend it.
pub(crate) fn check(chosen: &Chosen, source: &Source, said: &Said, path: &Path) -> Result<()> {
    let held = Held::of(source, said, path, chosen.mujoco.as_ref()).map_err(|error| error.at(path))?;
    let findings = findings(chosen, &held)?;
    let of = |severity: Severity| findings.iter().filter(move |finding| finding.severity == severity);
    if of(Severity::Error).next().is_none() {
        of(Severity::Warning).for_each(|finding| {
            let advice = finding.advice.as_ref().map_or_else(String::new, |advice| format!(": {advice}"));
            terminal::note(&format!("{}{advice}", finding.message));
        });
        return Ok(());
    }
    let all = |part: fn(&Finding) -> Option<&str>| {
        of(Severity::Error).filter_map(part).collect::<Vec<_>>().join("; ")
    };
    let message = format!(
        "the set cannot be what the task '{}' takes: {}",
        chosen.task.specification().name,
        all(|finding| Some(&finding.message))
    );
    let advice = all(|finding| finding.advice.as_deref());
    let hint = match lines(&findings) {
        lines if lines.is_empty() => advice,
        lines => format!("{advice}\n{}", where_to_write(&lines, said)),
    };
    Err(Error::bad_input(message).at(path).with_hint(hint))
}

/// The lines of a set.toml that all findings ask for, each key once.
pub(crate) fn lines(findings: &[Finding]) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let key = |line: &str| line.split_once(" = ").map_or_else(|| line.to_owned(), |(key, _)| key.to_owned());
    for line in findings.iter().filter_map(|finding| finding.lines.as_deref()).flat_map(str::lines) {
        if lines.iter().all(|known| key(known) != key(line)) {
            lines.push(line.to_owned());
        }
    }
    lines
}

/// Says where the lines go, and the lines as they are to be written.
pub(crate) fn where_to_write(lines: &[String], said: &Said) -> String {
    let (to, instead) = match &said.path {
        Some(path) => (path, ", in place of what it says of these"),
        None => (&said.place, ""),
    };
    let lines: String = lines.iter().map(|line| format!("\n    {line}")).collect();
    format!("write into {}{instead}:{lines}", to.display())
}
