//! Presets, judges and methods as they are typed.

use clap::ValueEnum;
use demosift::run::preset::Preset;
use demosift::stages::method::Method;

/// [`demosift::run::preset::Preset`] as it is typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PresetName {
    /// Minutes: proves that it runs, and ranks roughly
    Quick,
    /// Minutes to an hour for a set of ten: several times as much, for a ranking to act on
    Standard,
    /// The paper's values
    Paper,
}

impl From<PresetName> for Preset {
    fn from(name: PresetName) -> Self {
        match name {
            PresetName::Quick => Self::Quick,
            PresetName::Standard => Self::Standard,
            PresetName::Paper => Self::Paper,
        }
    }
}

/// [`demosift::results::panel::Judges`] as it is typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum JudgesName {
    /// Clone each demonstration from scratch, several times
    Cloning,
    /// Adapt what was learned from the whole set, as the paper does
    Paper,
    /// Cloning first, then the paper's
    Both,
    /// Your own trainer alone, on each demonstration by itself: it needs --trainer
    Trainer,
}

impl JudgesName {
    /// As a configuration names them.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Cloning => "cloning",
            Self::Paper => "paper",
            Self::Both => "both",
            Self::Trainer => "trainer",
        }
    }
}

/// [`demosift::stages::method::Method`] as it is typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum MethodName {
    /// Meta-learn to imitate any demonstration of the set
    Maml,
    /// The same, regularized so that behavior tells which demonstration was imitated
    MamlMi,
    /// Imitate the entire set first, then fine-tune toward each demonstration
    AvgFineTune,
    /// Prepare nothing: imitate each demonstration from an untrained policy, for longer
    FromScratch,
}

impl From<MethodName> for Method {
    fn from(name: MethodName) -> Self {
        match name {
            MethodName::Maml => Self::Maml,
            MethodName::MamlMi => Self::MamlMi,
            MethodName::AvgFineTune => Self::AvgFineTune,
            MethodName::FromScratch => Self::FromScratch,
        }
    }
}
