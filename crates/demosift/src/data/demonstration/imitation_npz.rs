//! The npz files of `imitation` before 1.0: the steps of all trajectories one after the other.
//!
//! | array | shape | element | |
//! |---|---|---|---|
//! | `obs` | `[Σ(T_i + 1), obs]` | f32 or f64 | each trajectory with its final observation |
//! | `acts` | `[ΣT_i, act]` | f32 or f64 | |
//! | `indices` | `[N − 1]` | integers | where in `acts` the second and every later trajectory begins |
//!
//! Rewards (`rews`) are never read, nor is `infos`, which is a pickle.
//! The final observation of a trajectory is no pair with an action, so no demonstration holds it.

use std::path::Path;

use crate::basics::error::{Error, Result};
use crate::data::demonstration::episode::{Columns, Episode, Format, Source, side_by_side};
use crate::data::demonstration::npz::{self, Npz};
use crate::math::rows::Rows;

/// Reads the trajectories; `columns` names arrays.
///
/// # Errors
/// `is_bad_input` if the file is not of this layout or damaged; `is_io` if it may not be read.
pub(super) fn read_source(path: &Path, columns: &Columns) -> Result<Source> {
    let columns = columns.or("obs", "acts");
    let mut file = npz::open(path)?;
    let observations = table(&mut file, &columns.observations)?;
    let actions = table(&mut file, &columns.actions)?;
    let starts = starts(&file.integers("indices")?.values, actions.len())?;
    let trajectories = starts.len() - 1;
    if observations.len() != actions.len() + trajectories {
        return Err(Error::bad_input(format!(
            "{trajectories} trajectories of {} actions in all need {} observations, one more each, and there are {}",
            actions.len(),
            actions.len() + trajectories,
            observations.len()
        )));
    }
    let cut =
        |table: &Rows, start: usize, end: usize| (start..end).map(|step| table.row(step)).collect::<Rows>();
    let episodes = starts.windows(2).enumerate().map(|(index, ends)| {
        let (start, end) = (ends[0], ends[1]);
        let observations = cut(&observations, start + index, end + index + 1);
        Episode::with_last(index.to_string(), &observations, cut(&actions, start, end))
    });
    Ok(Source::new(Format::ImitationNpz, columns, episodes.collect::<Result<_>>()?))
}

/// Where in the actions each trajectory begins, and the end of the last.
fn starts(indices: &[i64], actions: usize) -> Result<Vec<usize>> {
    let mut starts = vec![0];
    for &index in indices {
        let before = starts[starts.len() - 1];
        match usize::try_from(index) {
            Ok(index) if index > before && index < actions => starts.push(index),
            _ => {
                return Err(Error::bad_input(format!(
                    "'indices' holds {index} after {before}; wanted rising numbers below the {actions} actions"
                )));
            }
        }
    }
    starts.push(actions);
    Ok(starts)
}

fn table(file: &mut Npz, names: &[String]) -> Result<Rows> {
    let parts = names.iter().map(|name| Ok((name.as_str(), npz::table(file, name)?)));
    side_by_side(parts.collect::<Result<Vec<_>>>()?)
}
