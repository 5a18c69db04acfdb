//! Who imitates a demonstration in a unit of judging.

use std::fmt;

use crate::learning::adapt::InnerUpdate;
use crate::world::trainer::{Trainer, TrainerIdentity};

/// How a demonstration is imitated.
#[derive(Clone, Copy)]
pub enum Imitating<'a> {
    /// By updates of ours, from where the trial starts.
    Updates(&'a InnerUpdate),
    /// By somebody else's trainer, from nothing. Its policies live in the trainer: they are played, and not kept.
    Trainer(&'a dyn Trainer),
}

impl<'a> Imitating<'a> {
    /// The update, where it is ours.
    pub(super) fn inner(self) -> Option<&'a InnerUpdate> {
        match self {
            Self::Updates(inner) => Some(inner),
            Self::Trainer(_) => None,
        }
    }

    /// Which trainer imitates, where it is not ours.
    pub fn trainer(self) -> Option<&'a TrainerIdentity> {
        match self {
            Self::Updates(_) => None,
            Self::Trainer(trainer) => Some(trainer.identity()),
        }
    }
}

impl fmt::Debug for Imitating<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Updates(inner) => out.debug_tuple("Updates").field(inner).finish(),
            Self::Trainer(trainer) => out.debug_tuple("Trainer").field(trainer.identity()).finish(),
        }
    }
}
