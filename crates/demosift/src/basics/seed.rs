//! Randomness as an argument that is consumed.
//!
//! A [`Seed`] is split by name and index into seeds of its own for every part of a run.
//! What a part draws therefore does not depend on what other parts drew, on the order in which they ran,
//! or on the number of threads.

use rand::SeedableRng;
use sha2::{Digest, Sha256};

/// The generator that a seed becomes: portable, the same numbers on every machine.
pub type Rng = rand_chacha::ChaCha8Rng;

/// A splittable seed; use consumes it, so that no two draws share one by accident.
///
/// ```
/// use demosift::basics::seed::Seed;
///
/// let run = Seed::new(7);
/// let third_episode = run.of("judge").at(2);
/// assert_eq!(third_episode, Seed::new(7).of("judge").at(2)); // whatever else was drawn
/// ```
#[derive(Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Seed([u8; 32]);

impl Seed {
    /// The root of a run's randomness.
    pub fn new(number: u64) -> Self {
        let mut bytes = [0; 32];
        bytes[..8].copy_from_slice(&number.to_le_bytes());
        Self(bytes)
    }

    /// The seed of the part called `name`.
    #[must_use]
    pub fn of(&self, name: &str) -> Self {
        self.split(name.as_bytes())
    }

    /// The seed of the part with this index.
    #[must_use]
    pub fn at(&self, index: usize) -> Self {
        self.split(&(index as u64).to_le_bytes())
    }

    /// `count` seeds, one each for the parts `0..count`.
    #[must_use]
    pub fn many(self, count: usize) -> Vec<Self> {
        (0..count).map(|index| self.at(index)).collect()
    }

    /// The generator of this seed.
    pub fn into_rng(self) -> Rng {
        Rng::from_seed(self.0)
    }

    fn split(&self, part: &[u8]) -> Self {
        let mut hash = Sha256::new();
        hash.update(self.0);
        hash.update(part);
        Self(hash.finalize().into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng as _;

    #[test]
    fn parts_are_independent_of_order_and_differ() {
        let root = Seed::new(7);
        let late = root.of("judge").at(3).into_rng().next_u64();
        let _ = root.of("meta_train").into_rng().next_u64();
        assert_eq!(late, Seed::new(7).of("judge").at(3).into_rng().next_u64());
        assert_ne!(late, root.of("judge").at(4).into_rng().next_u64());
        assert_ne!(root.at(1), root.of("1"));
    }
}
