//! Whether a task is fit to learn in, and whether demonstrations fit it: what `demosift task check` finds out.
//!
//! Three looks, one function each: what the task is made of ([`look`]), what random actions do in it ([`play`]), and
//! what becomes of recorded demonstrations in it ([`compare`]).
//! Each returns what it saw and its [`Finding`]s: what is wrong, odd, or as it should be, in words.
//! Nothing here ranks anything, and nothing that ranks reads any of it.

mod columns;
mod comparison;
mod dynamics;
mod explained;
mod fit;
mod known;
mod lengths;
mod mending;
mod naming;
mod needed;
mod play;
mod presented;
mod reach;
mod recorded;
mod seen;

pub use demosift::basics::counting::counted as several;
use demosift::data::demonstration::set_file::SetFile;
use serde::Serialize;

pub use comparison::{Compared, Recorded, StatesFrom};
pub use dynamics::Drift;
pub use explained::percent_missed;
pub use fit::fit;
pub use play::{Range, Tried, play};
pub use presented::Presented;
pub use recorded::{compare, compare_presented};
pub use seen::{Actuator, Measured, Part, Seen, look};

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Nothing that is learned here would mean anything.
    Error,
    /// It may be meant, and often is a mistake.
    Warning,
    /// As it should be.
    Fine,
}

/// One thing that was found out.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// What was found.
    pub message: String,
    /// What to do about it; `None` where nothing is to be done.
    pub advice: Option<String>,
    /// Lines of the set's `set.toml` that would mend it, where such do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lines: Option<String>,
}

impl Finding {
    fn error(message: impl Into<String>, advice: impl Into<String>) -> Self {
        Self { severity: Severity::Error, message: message.into(), advice: Some(advice.into()), lines: None }
    }

    fn warning(message: impl Into<String>, advice: impl Into<String>) -> Self {
        Self {
            severity: Severity::Warning,
            message: message.into(),
            advice: Some(advice.into()),
            lines: None,
        }
    }

    /// The same with what the set's `set.toml` would have to say.
    fn mended_by(self, file: Option<SetFile>) -> Self {
        Self { lines: file.map(|file| file.to_string()), ..self }
    }

    fn fine(message: impl Into<String>) -> Self {
        Self { severity: Severity::Fine, message: message.into(), advice: None, lines: None }
    }
}

/// How many findings are of a severity.
pub fn count(findings: &[Finding], severity: Severity) -> usize {
    findings.iter().filter(|finding| finding.severity == severity).count()
}

/// Steps of a set that are looked at one by one: a recording that is wrong is so from its beginning.
const LOOKED_AT: usize = 20_000;

/// How many steps of each demonstration are looked at, evenly over all, so that they are `most` together; `None` if all of them
/// are.
fn looked_at(lengths: impl ExactSizeIterator<Item = usize>, most: usize) -> Option<usize> {
    let count = lengths.len();
    (lengths.sum::<usize>() > most).then(|| (most / count).max(1))
}

/// What a finding says of that, such as ` (of the first 2 steps of each demonstration)`.
fn in_first(steps: Option<usize>) -> String {
    steps.map_or(String::new(), |steps| {
        format!(" (of the first {} of each demonstration)", several(steps, "step"))
    })
}

/// The first few of a list, and how many more there are.
fn first_few(names: &[String]) -> String {
    const FEW: usize = 6;
    let shown = names.iter().take(FEW).cloned().collect::<Vec<_>>().join(", ");
    match names.len().saturating_sub(FEW) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}
