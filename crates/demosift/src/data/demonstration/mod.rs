//! Demonstrations and sets of them: state-action pairs, nothing else.
//!
//! A demonstration has no reward, stage or origin, so nothing that judges can learn where it came from.

mod aloha;
mod baselines_npz;
pub mod choice;
mod conversion;
pub mod d4rl;
pub mod episode;
mod hdf5;
mod imitation_npz;
pub mod inspection;
pub mod lerobot;
pub mod listing;
pub mod minari;
mod named;
mod npz;
pub mod numbers;
pub mod open;
mod parquet_pages;
mod parquet_ragged;
mod parquet_table;
mod parquet_writing;
mod parquet_zstd;
pub mod pointer;
pub mod robomimic;
pub mod set_file;
mod stable_baselines_npz;
pub mod timing;
mod zstd;

use crate::basics::error::{Error, Result};
use crate::math::rows::Rows;

/// Which demonstration of a set: its position in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DemoId(pub usize);

impl std::fmt::Display for DemoId {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(out)
    }
}

/// v_i: the state-action pairs of one episode that somebody showed (§3).
#[derive(Clone, Debug, PartialEq)]
pub struct Demonstration {
    observations: Rows,
    actions: Rows,
}

/// Numbers beyond this cannot be squared in 32 bits.
const LARGEST: f32 = 1e18;

impl Demonstration {
    /// Observations `[T, obs]` and the actions `[T, act]` taken on them; all finite, at least one pair.
    pub fn new(observations: Rows, actions: Rows) -> Result<Self> {
        Self::check(&observations, &actions)?;
        Ok(Self { observations, actions })
    }

    /// Whether these make a demonstration.
    fn check(observations: &Rows, actions: &Rows) -> Result<()> {
        if actions.is_empty() {
            return Err(Error::bad_input("a demonstration needs at least one state-action pair, got none"));
        }
        if observations.len() != actions.len() {
            return Err(Error::bad_input(format!(
                "a demonstration needs as many observations as actions, got {} and {}",
                observations.len(),
                actions.len()
            )));
        }
        for (what, rows) in [("observation", observations), ("action", actions)] {
            if let Some((step, column)) = rows.first_not_finite() {
                let value = rows.row(step)[column];
                let beyond =
                    if value.is_infinite() { " (or is beyond 3.4e38, the largest of 32 bits)" } else { "" };
                return Err(Error::bad_input(format!(
                    "{what} {column} at step {step} is {value}{beyond}, and must be a finite number"
                )));
            }
            let too_large = |row: &[f32]| row.iter().position(|value| value.abs() > LARGEST);
            let found = rows.iter().enumerate().find_map(|(step, row)| Some((step, too_large(row)?)));
            if let Some((step, column)) = found {
                return Err(Error::bad_input(format!(
                    "{what} {column} at step {step} is {:e}, and must be from -{LARGEST:e} to {LARGEST:e}: no robot has such \
                     numbers, and their squares are infinite",
                    rows.row(step)[column]
                )));
            }
        }
        Ok(())
    }

    /// Number of pairs, T.
    pub fn steps(&self) -> usize {
        self.actions.len()
    }

    /// Observations, `[T, obs]`.
    pub fn observations(&self) -> &Rows {
        &self.observations
    }

    /// Actions, `[T, act]`, as they were recorded; some recorders do not clip them to [−1, 1].
    pub fn actions(&self) -> &Rows {
        &self.actions
    }
}

/// Refuses demonstrations that differ in the size of an observation or of an action.
fn check_sizes(ids: &[DemoId], demonstrations: &[Demonstration]) -> Result<()> {
    let sizes = |of: &Demonstration| (of.observations.width(), of.actions.width());
    let Some(wanted) = demonstrations.first().map(sizes) else { return Ok(()) };
    for (id, found) in ids.iter().zip(demonstrations.iter().map(sizes)) {
        if found != wanted {
            return Err(Error::bad_input(format!(
                "demonstration {id} has {} observations and {} actions a step, but demonstration {} has {} and {}",
                found.0, found.1, ids[0], wanted.0, wanted.1
            ))
            .with_hint("leave out those of another size than most by --skip-bad, or any by their numbers, --without"));
        }
    }
    Ok(())
}

/// V: demonstrations of one observation size and one action size (§3), at least one.
#[derive(Clone, Debug, PartialEq)]
pub struct DemonstrationSet {
    demonstrations: Vec<Demonstration>,
    /// Ascending; not all positions of the file where only some of its episodes were chosen.
    ids: Vec<DemoId>,
}

/// How large a set is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// How many demonstrations.
    pub demonstrations: usize,
    /// Steps of the longest.
    pub longest: usize,
}

impl DemonstrationSet {
    /// How large it is.
    pub fn extent(&self) -> Extent {
        let longest = self.iter().map(|(_, demonstration)| demonstration.steps()).max().unwrap_or(0);
        Extent { demonstrations: self.len(), longest }
    }

    /// Checks that the demonstrations fit each other.
    pub fn new(demonstrations: Vec<Demonstration>) -> Result<Self> {
        let ids = (0..demonstrations.len()).map(DemoId).collect();
        Self::chosen(ids, demonstrations)
    }

    /// The same for some episodes of a file, which keep their positions in it; `ids` ascend, one each demonstration.
    ///
    /// # Panics
    /// If they do not: a bug of the caller.
    pub fn chosen(ids: Vec<DemoId>, demonstrations: Vec<Demonstration>) -> Result<Self> {
        assert_eq!(ids.len(), demonstrations.len(), "an id for each demonstration");
        assert!(ids.is_sorted_by(|one, next| one < next), "ids ascend");
        if demonstrations.is_empty() {
            return Err(Error::bad_input(
                "the set holds no demonstration; at least 2 are needed to choose from",
            ));
        }
        check_sizes(&ids, &demonstrations)?;
        Ok(Self { demonstrations, ids })
    }

    /// Whether there are several to choose from.
    ///
    /// # Errors
    /// `is_bad_input` if there is one.
    pub fn check_several(&self) -> Result<()> {
        match self.len() {
            1 => Err(Error::bad_input("the set holds 1 demonstration; at least 2 are needed to choose from")),
            _ => Ok(()),
        }
    }

    /// Number of demonstrations, n.
    #[allow(clippy::len_without_is_empty, reason = "a set is never empty")]
    pub fn len(&self) -> usize {
        self.demonstrations.len()
    }

    /// Numbers in an observation.
    pub fn observation_size(&self) -> usize {
        self.demonstrations[0].observations.width()
    }

    /// Numbers in an action.
    pub fn action_size(&self) -> usize {
        self.demonstrations[0].actions.width()
    }

    /// One demonstration.
    ///
    /// # Panics
    /// If the id is not of this set: a bug of the caller.
    pub fn get(&self, id: DemoId) -> &Demonstration {
        &self.demonstrations[self.ids.binary_search(&id).expect("the id is of this set")]
    }

    /// Whether a demonstration is of this set.
    pub fn holds(&self, id: DemoId) -> bool {
        self.ids.binary_search(&id).is_ok()
    }

    /// Positions of the file up to the last demonstration, whether their episodes are of this set or not.
    pub fn positions(&self) -> usize {
        self.ids.last().map_or(0, |last| last.0 + 1)
    }

    /// One value each position of the file up to the last demonstration, so that an id finds its own: `absent` for those that
    /// are not of this set.
    pub fn by_position<T: Clone>(&self, absent: T, values: impl IntoIterator<Item = T>) -> Vec<T> {
        let mut all = vec![absent; self.positions()];
        self.ids.iter().zip(values).for_each(|(id, value)| all[id.0] = value);
        all
    }

    /// The demonstrations with their ids, in file order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (DemoId, &Demonstration)> {
        self.ids.iter().copied().zip(&self.demonstrations)
    }

    /// All ids, in file order.
    pub fn ids(&self) -> Vec<DemoId> {
        self.ids.clone()
    }
}
