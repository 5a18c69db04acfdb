//! The npz files that `generate_expert_traj` of stable-baselines writes: the steps of all episodes one after the other.
//!
//! | array | shape | element | |
//! |---|---|---|---|
//! | `obs`, or `observations` | `[N, obs]` | numbers | |
//! | `actions` | `[N, act]` or `[N]` | numbers | |
//! | `episode_starts` | `[N]` | bool | set at the first step of each episode |
//!
//! Returns and rewards are never read. There is no final observation.

use std::path::Path;

use crate::basics::error::{Error, Result};
use crate::data::demonstration::episode::{Columns, Episode, Format, Source, side_by_side};
use crate::data::demonstration::npz::{self, Npz};
use crate::math::rows::Rows;

/// Reads the episodes; `columns` names arrays.
///
/// # Errors
/// `is_bad_input` if the file is not of this layout or damaged; `is_io` if it may not be read.
pub(super) fn read_source(path: &Path, columns: &Columns) -> Result<Source> {
    let mut file = npz::open(path)?;
    // Other recorders of such files write the word in full.
    let names = file.names();
    let has = |name: &str| names.iter().any(|known| known == name);
    let observations = if !has("obs") && has("observations") { "observations" } else { "obs" };
    let columns = columns.or(observations, "actions");
    let observations = table(&mut file, &columns.observations)?;
    let actions = table(&mut file, &columns.actions)?;
    let starts = file.floats("episode_starts")?.values;
    let steps = actions.len();
    if observations.len() != steps || starts.len() != steps {
        return Err(Error::bad_input(format!(
            "there are {} observations, {steps} actions and {} marks in 'episode_starts'; wanted one of each a step",
            observations.len(),
            starts.len()
        )));
    }
    // The first step begins an episode whether it says so or not.
    let mut bounds: Vec<usize> = (1..steps).filter(|&step| starts[step] != 0.0).collect();
    bounds.insert(0, 0);
    bounds.push(steps);
    let episode = |(index, bounds): (usize, &[usize])| {
        let cut = |table: &Rows| (bounds[0]..bounds[1]).map(|step| table.row(step)).collect::<Rows>();
        Episode::new(index.to_string(), cut(&observations), cut(&actions), None)
    };
    let episodes = bounds.windows(2).enumerate().map(episode).collect();
    let not_read = if bounds.len() == 2 && starts.iter().all(|start| *start == 0.0) {
        vec![format!("'episode_starts' is set at no step, so all {steps} steps are one episode.")]
    } else {
        Vec::new()
    };
    Ok(Source { not_read, ..Source::new(Format::StableBaselinesNpz, columns, episodes) })
}

fn table(file: &mut Npz, names: &[String]) -> Result<Rows> {
    let parts = names.iter().map(|name| Ok((name.as_str(), npz::table(file, name)?)));
    side_by_side(parts.collect::<Result<Vec<_>>>()?)
}
