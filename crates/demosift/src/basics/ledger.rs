//! Where the results of the flow are stored by name.

use std::collections::BTreeMap;

use crate::basics::error::Result;
use crate::basics::part::Part;

/// Stores results and checkpoints by name; the run folder is one.
pub trait Ledger: Send {
    /// Makes sure that nobody else stores into it from here on; what is stored without this claims it by itself.
    ///
    /// # Errors
    /// `is_bad_input` if somebody else does.
    fn claim(&mut self) -> Result<()> {
        Ok(())
    }
    /// What was stored under a name, if anything.
    fn recall(&self, name: &str) -> Result<Option<Vec<u8>>>;
    /// Stores bytes under a name, whole or not at all.
    fn store(&mut self, name: &str, bytes: &[u8]) -> Result<()>;
    /// Forgets what was stored under a name.
    fn forget(&mut self, name: &str) -> Result<()>;

    /// Which part of the run's work is to be done here; none where all of it is.
    fn part(&self) -> Option<Part> {
        None
    }

    /// What the parts of the run have stored under a name, each its own; nothing where a run has no parts.
    ///
    /// A result of theirs is found by [`recall`](Self::recall) too, since it is the same whoever made it; this is for
    /// checkpoints, of which each part has another.
    fn of_parts(&self, name: &str) -> Result<Vec<Vec<u8>>> {
        let _ = name;
        Ok(Vec::new())
    }

    /// What all who work on the run have stored, each by itself and this one first; none where there is one alone.
    ///
    /// [`recall`](Self::recall) finds the first result of a name; this is for results of which another one may be meant.
    ///
    /// # Errors
    /// `is_io` if it cannot be looked for.
    fn each(&self) -> Result<Vec<Box<dyn Ledger>>> {
        Ok(Vec::new())
    }
}

/// A ledger that lasts as long as the process.
#[derive(Debug, Default)]
pub struct InMemory(BTreeMap<String, Vec<u8>>);

impl Ledger for InMemory {
    fn recall(&self, name: &str) -> Result<Option<Vec<u8>>> {
        Ok(self.0.get(name).cloned())
    }

    fn store(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        self.0.insert(name.to_owned(), bytes.to_vec());
        Ok(())
    }

    fn forget(&mut self, name: &str) -> Result<()> {
        self.0.remove(name);
        Ok(())
    }
}
