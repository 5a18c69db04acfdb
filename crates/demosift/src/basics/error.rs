//! One opaque error for the whole library.

use std::fmt;
use std::path::{Path, PathBuf};

/// The library's result type.
pub type Result<T> = std::result::Result<T, Error>;

/// Says what was wrong, the value, what would have been right, and the path last.
///
/// Ask for its kind with the predicates; the message is for people.
#[derive(Debug)]
pub struct Error(Box<Inner>);

#[derive(Debug)]
struct Inner {
    kind: Kind,
    message: String,
    path: Option<PathBuf>,
    hint: Option<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    BadInput,
    BadConfig,
    Diverged,
    Io,
    Simulation,
    LeftToOthers,
}

impl Error {
    /// The data or an argument that the user gave is wrong.
    pub fn bad_input(message: impl Into<String>) -> Self {
        Self::new(Kind::BadInput, message.into())
    }

    /// A configuration value is wrong or does not fit the others.
    pub fn bad_config(message: impl Into<String>) -> Self {
        Self::new(Kind::BadConfig, message.into())
    }

    /// A number became NaN or infinite during learning; the message names stage and iteration.
    pub fn diverged(message: impl Into<String>) -> Self {
        Self::new(Kind::Diverged, message.into())
    }

    /// Reading or writing failed.
    pub fn io(action: &str, path: &Path, source: &std::io::Error) -> Self {
        Self::new(Kind::Io, format!("{action}: {source}")).at(path)
    }

    /// The simulator could not be set up or went wrong.
    pub fn simulation(message: impl Into<String>) -> Self {
        Self::new(Kind::Simulation, message.into())
    }

    /// The rest is the work of other parts of the run, which have not finished it; nothing is wrong.
    pub fn left_to_others(message: impl Into<String>) -> Self {
        Self::new(Kind::LeftToOthers, message.into())
    }

    fn new(kind: Kind, message: String) -> Self {
        Self(Box::new(Inner { kind, message, path: None, hint: None }))
    }

    /// Adds the file that the error is about.
    #[must_use]
    pub fn at(mut self, path: &Path) -> Self {
        self.0.path.get_or_insert_with(|| path.to_owned());
        self
    }

    /// Adds what the user could do about it.
    #[must_use]
    pub fn with_hint(mut self, hint: impl Into<String>) -> Self {
        self.0.hint.get_or_insert_with(|| hint.into());
        self
    }

    /// Puts the stage that failed before the message.
    #[must_use]
    pub fn during(mut self, stage: &str) -> Self {
        self.0.message = format!("{stage}: {}", self.0.message);
        self
    }

    /// What was wrong, without the file that it is about: for what is passed on to others.
    pub fn message(&self) -> &str {
        &self.0.message
    }

    /// What the user could do about it, if there is something to say.
    pub fn hint(&self) -> Option<&str> {
        self.0.hint.as_deref()
    }

    /// Whether the user's data or argument was wrong.
    pub fn is_bad_input(&self) -> bool {
        self.0.kind == Kind::BadInput
    }

    /// Whether a configuration value was wrong.
    pub fn is_bad_config(&self) -> bool {
        self.0.kind == Kind::BadConfig
    }

    /// Whether learning diverged.
    pub fn is_diverged(&self) -> bool {
        self.0.kind == Kind::Diverged
    }

    /// Whether reading or writing failed.
    pub fn is_io(&self) -> bool {
        self.0.kind == Kind::Io
    }

    /// Whether what is missing is the work of other parts of the run.
    pub fn is_left_to_others(&self) -> bool {
        self.0.kind == Kind::LeftToOthers
    }

    /// Whether the simulator failed.
    pub fn is_simulation(&self) -> bool {
        self.0.kind == Kind::Simulation
    }
}

impl fmt::Display for Error {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}", self.0.message)?;
        match &self.0.path {
            Some(path) => write!(out, ": {}", path.display()),
            None => Ok(()),
        }
    }
}

impl std::error::Error for Error {}
