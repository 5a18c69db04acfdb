//! The npz files from which the GAIL of `baselines` learns.
//!
//! | array | shape | element | |
//! |---|---|---|---|
//! | `obs` | `[N, L, obs]` | f32 or f64 | N episodes of L steps |
//! | `acs` | `[N, L, act]` | f32 or f64 | |
//!
//! Returns (`ep_rets`) and rewards (`rews`) are never read.
//! There is no final observation and no length: an episode that was padded to L steps keeps its padding.
//! Files whose episodes differ in length hold Python objects and are not read.

use std::path::Path;

use crate::basics::error::{Error, Result};
use crate::data::demonstration::episode::{Columns, Episode, Format, Source, side_by_side};
use crate::data::demonstration::named::Named;
use crate::data::demonstration::npz::{self, Array};
use crate::math::rows::Rows;

/// Reads the episodes; `columns` names arrays.
///
/// # Errors
/// `is_bad_input` if the file is not of this layout or damaged; `is_io` if it may not be read.
pub(super) fn read_source(path: &Path, columns: &Columns) -> Result<Source> {
    let columns = columns.or("obs", "acs");
    let mut file = npz::open(path)?;
    let mut episodes_of = |names: &[String]| -> Result<Vec<Rows>> {
        let parts = names.iter().map(|name| {
            let named = Named::new(name);
            let episodes = split(named.column, file.floats(named.column)?)?;
            episodes.into_iter().map(|episode| named.part_of(episode)).collect()
        });
        let parts: Vec<Vec<Rows>> = parts.collect::<Result<_>>()?;
        let count = parts.first().map_or(0, Vec::len);
        for (name, part) in names.iter().zip(&parts) {
            if part.len() != count {
                return Err(Error::bad_input(format!(
                    "'{}' has {count} episodes but '{name}' has {}; both must have the same",
                    names[0],
                    part.len()
                )));
            }
        }
        let episode = |index: usize| {
            let tables: Vec<(&str, Rows)> =
                names.iter().zip(&parts).map(|(name, part)| (name.as_str(), part[index].clone())).collect();
            side_by_side(tables)
        };
        (0..count).map(episode).collect()
    };
    let observations = episodes_of(&columns.observations)?;
    let actions = episodes_of(&columns.actions)?;
    if observations.len() != actions.len() {
        return Err(Error::bad_input(format!(
            "'{}' has {} episodes but '{}' has {}; both must have the same",
            columns.observations[0],
            observations.len(),
            columns.actions[0],
            actions.len()
        )));
    }
    let episodes =
        observations.into_iter().zip(actions).enumerate().map(|(index, (observations, actions))| {
            Episode::new(index.to_string(), observations, actions, None)
        });
    Ok(Source::new(Format::BaselinesNpz, columns, episodes.collect()))
}

/// One table an episode.
fn split(name: &str, array: Array<f32>) -> Result<Vec<Rows>> {
    // With no extent of 0 the product cannot overflow: there are as many elements.
    let &[1..=usize::MAX, steps @ 1..=usize::MAX, width @ 1..=usize::MAX] = array.shape.as_slice() else {
        return Err(Error::bad_input(format!(
            "'{name}' has shape {:?}; wanted [episodes, steps, numbers a step], at least one of each",
            array.shape
        )));
    };
    array.values.chunks_exact(steps * width).map(|flat| Rows::from_flat(flat.to_vec(), width)).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

    use super::*;

    #[test]
    fn an_extent_of_nothing_is_refused_whatever_the_others_claim() {
        for shape in [[0, 1 << 32, 1 << 32], [1, 0, 2], [1, 2, 0]] {
            let error = split("obs", Array { values: Vec::new(), shape: shape.to_vec() }).unwrap_err();
            assert!(error.is_bad_input() && error.to_string().contains("at least one of each"), "{error}");
        }
    }
}
