//! How progress leaves the library: events go out, and nothing comes back in but that one could not be taken.

use serde::Serialize;

use crate::basics::error::Result;

/// Receives a run's progress; called by one thread at a time.
pub trait Observer: Send {
    /// One thing happened.
    ///
    /// # Errors
    /// That the event could not be taken, such as a measurement on a full disk: the stage stops at once, and what it stored
    /// before stays.
    fn on(&mut self, event: Event<'_>) -> Result<()>;
}

/// What an observer receives.
#[derive(Debug)]
pub enum Event<'a> {
    /// A stage begins; it will take `total` units of work, of which `done` are finished (after a resume).
    Started {
        /// The stage, such as `meta_train`.
        stage: &'static str,
        /// Units of work finished before.
        done: usize,
        /// Units of work in all.
        total: usize,
    },
    /// `done` units of the stage's work are finished.
    Advanced {
        /// The stage.
        stage: &'static str,
        /// Units of work finished.
        done: usize,
    },
    /// Numbers worth storing, one row per call.
    Measured {
        /// The stage.
        stage: &'static str,
        /// Which part of the stage, such as a demonstration; empty if there is one only.
        part: &'a str,
        /// Iteration within the part.
        iteration: usize,
        /// Name and value of each number, in a fixed order for a stage.
        numbers: &'a [(&'static str, f64)],
    },
    /// The state from which the stage could go on; the observer may write it down.
    Checkpoint {
        /// The stage.
        stage: &'static str,
        /// Which part of the stage, such as a demonstration; empty if there is one only.
        part: &'a str,
        /// The state, to be written by [`crate::results::artifact`].
        state: &'a dyn Snapshot,
    },
    /// All of a stage's part is done, and its result is stored next: an observer that holds something back writes it down now.
    Finished {
        /// The stage.
        stage: &'a str,
    },
}

/// Whether something that happens every so often is due when so much is done; every 0 is every 1.
pub fn is_due(done: usize, every: usize) -> bool {
    done.is_multiple_of(every.max(1))
}

/// How often [`is_due`] says so before so much is done, from 0 on.
pub fn times_due(total: usize, every: usize) -> usize {
    total.div_ceil(every.max(1))
}

/// A state that can be written down; everything that is [`Serialize`] is one.
pub trait Snapshot: std::fmt::Debug + Sync {
    /// The state as bytes.
    fn to_bytes(&self) -> Vec<u8>;
}

impl<T: Serialize + std::fmt::Debug + Sync> Snapshot for T {
    fn to_bytes(&self) -> Vec<u8> {
        postcard::to_allocvec(self).expect("plain data always serializes")
    }
}

/// Hears and forgets.
#[derive(Debug, Default)]
pub struct Silent;

impl Observer for Silent {
    fn on(&mut self, _: Event<'_>) -> Result<()> {
        Ok(())
    }
}
