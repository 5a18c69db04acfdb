//! The D4RL layout in HDF5: flat tables, one row a step, episodes marked by their last step.
//!
//! | dataset | shape | element | |
//! |---|---|---|---|
//! | `observations` | `[N, obs]` | numbers | |
//! | `actions` | `[N, act]` | numbers | |
//! | `terminals`, `timeouts` | `[N]` | bool or number | at least one of the two; an episode ends where either is set |
//! | `episode_terminals` | `[N]` | bool or number | of d3rlpy, which marks every end there |
//! | `infos/qpos`, `infos/qvel` | `[N, nq]`, `[N, nv]` | f32 or f64 | optional; for replays, see [`read_states`] |
//!
//! The files that SAIL and VILD record are the same by other names: `expert_states`, `expert_actions`, and `expert_masks`, which
//! is 0 at the last step of each episode.
//!
//! Rewards are never read: what judges must not see them.
//! The simulator's states come by a door of their own, since a score could be worked out from them.

use std::path::Path;

use hdf5_pure::{EnumTypeBuilder, FileBuilder, Group};

use crate::basics::error::{Error, Result};
use crate::basics::files;
use crate::data::demonstration::DemonstrationSet;
use crate::data::demonstration::episode::{self, Columns, Format, Source};
use crate::data::demonstration::hdf5::{self, check_size, damaged, find, flags};
use crate::math::rows::Rows;

mod states;

pub use states::read_states;

const LAYOUT_HINT: &str = "a D4RL file holds 'observations' [N, obs] and 'actions' [N, act] of numbers, \
                           and 'terminals' [N] or 'timeouts' [N] that mark the last step of each episode";

/// Reads the demonstrations of a file, in file order.
///
/// A last episode without a marked end is dropped, as D4RL's own loader does.
///
/// # Errors
/// `is_bad_input` if the file is not of this layout, damaged, holds a number that is not finite, or holds fewer than
/// two complete episodes; `is_io` if it may not be read.
pub fn read(path: &Path) -> Result<DemonstrationSet> {
    let source = read_source(path, &Columns::default()).and_then(|source| source.set());
    source.map_err(|error| error.at(path))
}

/// Reads the episodes; `columns` names datasets.
///
/// # Errors
/// As [`read`], but for numbers that are not finite and episodes that are too few.
pub(super) fn read_source(path: &Path, columns: &Columns) -> Result<Source> {
    let hdf5::Opened { file, file_len } = hdf5::open(path)?;
    let root = file.root();
    let is_of_experts = find(&root, "expert_states")?.is_some() && find(&root, "observations")?.is_none();
    let columns = match is_of_experts {
        true => columns.or("expert_states", "expert_actions"),
        false => columns.or("observations", "actions"),
    };
    let read = |names: &[String]| {
        hdf5::read_columns(&root, names, file_len).map_err(|error| {
            let option = hdf5::option_below(&root);
            error.with_hint(format!("{LAYOUT_HINT}; if it does, {option}"))
        })
    };
    let observations = read(&columns.observations)?;
    let actions = read(&columns.actions)?;
    let steps = observations.len();
    if actions.len() != steps {
        return Err(Error::bad_input(format!(
            "'{}' has {steps} rows but '{}' has {}; both must have one row a step",
            columns.observations[0],
            columns.actions[0],
            actions.len()
        )));
    }
    let Ends { ends, not_read } = read_ends(&root, steps, file_len)?;
    let complete = ends.last().copied().unwrap_or(0);
    // A large set is in memory twice while it is split, and need not be there as a file too.
    drop(root);
    drop(file);
    let episodes = split(observations, actions, &ends);
    Ok(Source { dropped_steps: steps - complete, not_read, ..Source::new(Format::D4rl, columns, episodes) })
}

/// Where episodes end.
struct Ends {
    /// The rows after which one does, at least one.
    ends: Vec<usize>,
    /// What is to be said of the marks, in words.
    not_read: Vec<String>,
}

fn read_ends(root: &Group, steps: usize, file_len: u64) -> Result<Ends> {
    let marks = |name: &str| read_marks(root, name, steps, file_len);
    let (mut terminals, timeouts) = (marks("terminals")?, marks("timeouts")?);
    let others = [
        marks("episode_terminals")?,
        marks("expert_masks")?.map(|masks| masks.into_iter().map(|goes_on| !goes_on).collect::<Vec<bool>>()),
    ];
    let mut not_read = Vec::new();
    // Nobody begins anew twice in a row: these marks were made afterward, where a goal was near, as in antmaze.
    let runs_on = |marks: &[bool]| marks.windows(2).any(|pair| pair[0] && pair[1]);
    if terminals.as_ref().is_some_and(|marks| runs_on(marks))
        && timeouts.as_ref().is_some_and(|marks| marks.contains(&true))
    {
        not_read.push(
            "'terminals' is set at several steps in a row, so it marks no ends: episodes end where 'timeouts' is set."
                .to_owned(),
        );
        terminals = None;
    }
    let all: Vec<&Vec<bool>> = [&terminals, &timeouts].into_iter().chain(&others).flatten().collect();
    let is_end = |step: &usize| all.iter().any(|marks| marks[*step]);
    let ends: Vec<usize> = (0..steps).filter(is_end).map(|step| step + 1).collect();
    if ends.is_empty() {
        return Err(no_complete_episode(steps, terminals.is_some(), timeouts.is_some()));
    }
    if terminals.is_some() && timeouts.is_none() && others.iter().all(Option::is_none) {
        let starts = std::iter::once(0).chain(ends.iter().copied());
        let longest = starts.zip(&ends).map(|(start, end)| end - start).max().unwrap_or(0);
        not_read.push(format!(
            "There is no 'timeouts', so an episode that ran out of time goes on into the next; the longest has {longest} steps."
        ));
    }
    Ok(Ends { ends, not_read })
}

/// One flag a step, or `None` if the file has no such dataset.
fn read_marks(root: &Group, name: &str, steps: usize, file_len: u64) -> Result<Option<Vec<bool>>> {
    let Some(dataset) = find(root, name)? else {
        return Ok(None);
    };
    let shape = dataset.shape().map_err(damaged)?;
    // Some recorders keep a column of one.
    if !matches!(shape.as_slice(), [_] | [_, 1]) {
        return Err(Error::bad_input(format!(
            "'{name}' has shape {shape:?}; wanted one flag a step, [{steps}]"
        ))
        .with_hint(LAYOUT_HINT));
    }
    if shape[0] != steps as u64 {
        return Err(Error::bad_input(format!(
            "'{name}' has {} entries but 'observations' has {steps} rows; both must have one per step",
            shape[0]
        )));
    }
    check_size(&dataset, name, &shape, file_len)?;
    flags(&dataset, name).map(Some)
}

fn no_complete_episode(steps: usize, has_terminals: bool, has_timeouts: bool) -> Error {
    let found = match (has_terminals, has_timeouts) {
        (false, false) => "it has neither 'terminals' nor 'timeouts'".to_owned(),
        (true, false) => format!("'terminals' is set at none of {steps} steps, and there is no 'timeouts'"),
        (false, true) => format!("'timeouts' is set at none of {steps} steps, and there is no 'terminals'"),
        (true, true) => format!("neither 'terminals' nor 'timeouts' is set at any of {steps} steps"),
    };
    Error::bad_input(format!("the file holds no complete episode: {found}"))
        .with_hint(
            "set 'timeouts' or 'terminals' at the last step of each episode; where every episode ran out of time, after 1000 steps \
             for example: import h5py, numpy; f = h5py.File(\"SET\", \"r+\"); n = len(f[\"actions\"]); \
             f[\"timeouts\"] = numpy.arange(1, n + 1) % 1000 == 0; f.close()",
        )
}

/// Cuts the tables after each of `ends`.
fn split(observations: Rows, actions: Rows, ends: &[usize]) -> Vec<episode::Episode> {
    let starts = || std::iter::once(0).chain(ends.iter().copied());
    // One table after the other, so that the first is gone when the second is split.
    let [observations, actions] = [observations, actions]
        .map(|table| starts().zip(ends).map(|(start, &end)| cut(&table, start, end)).collect::<Vec<_>>());
    let both = observations.into_iter().zip(actions).enumerate();
    both.map(|(index, (observations, actions))| {
        episode::Episode::new(index.to_string(), observations, actions, None)
    })
    .collect()
}

fn cut(table: &Rows, start: usize, end: usize) -> Rows {
    (start..end).map(|step| table.row(step)).collect()
}

/// An episode to be written: what a demonstrator did, and from which simulator states.
#[derive(Clone, Copy, Debug)]
pub struct Episode<'a> {
    /// Observations, `[T, obs]`.
    pub observations: &'a Rows,
    /// The actions taken on them, `[T, act]`.
    pub actions: &'a Rows,
    /// The simulator's states, for replay; all episodes of a file have them or none.
    pub states: Option<States<'a>>,
    /// Whether the task ended the episode; otherwise it ran to the horizon.
    pub terminated: bool,
}

/// Simulator states of an episode, one row a step.
#[derive(Clone, Copy, Debug)]
pub struct States<'a> {
    /// Generalized positions, `[T, nq]`, row after row.
    pub qpos: &'a [f64],
    /// Generalized velocities, `[T, nv]`, row after row.
    pub qvel: &'a [f64],
}

/// Writes episodes to one file, which appears whole or not at all.
///
/// # Errors
/// `is_bad_input` if the episodes do not fit each other; `is_io` if the file cannot be written.
pub fn write(path: &Path, episodes: &[Episode<'_>]) -> Result<()> {
    let bytes = encode(episodes).map_err(|error| error.at(path))?;
    files::write_atomically(path, &bytes)
}

fn encode(episodes: &[Episode<'_>]) -> Result<Vec<u8>> {
    let sizes = check_episodes(episodes)?;
    let mut file = FileBuilder::new();
    add_rows(&mut file, "observations", episodes, |episode| episode.observations);
    add_rows(&mut file, "actions", episodes, |episode| episode.actions);
    add_marks(&mut file, "terminals", episodes, |episode| episode.terminated)?;
    add_marks(&mut file, "timeouts", episodes, |episode| !episode.terminated)?;
    if sizes.qpos > 0 && sizes.qvel > 0 {
        let states: Vec<States<'_>> = episodes.iter().filter_map(|episode| episode.states).collect();
        let qpos: Vec<f64> = states.iter().flat_map(|states| states.qpos).copied().collect();
        let qvel: Vec<f64> = states.iter().flat_map(|states| states.qvel).copied().collect();
        let mut infos = file.create_group("infos");
        for (name, values, width) in [("qpos", qpos, sizes.qpos), ("qvel", qvel, sizes.qvel)] {
            let shape = [total_steps(episodes) as u64, width as u64];
            let dataset = infos.create_dataset(name).with_f64_data(&values).with_shape(&shape);
            dataset.with_chunks(&shape).with_shuffle().with_deflate(6);
        }
        file.add_group(infos.finish());
    }
    file.finish().map_err(cannot_encode)
}

fn total_steps(episodes: &[Episode<'_>]) -> usize {
    episodes.iter().map(|episode| episode.actions.len()).sum()
}

fn add_rows(
    file: &mut FileBuilder,
    name: &str,
    episodes: &[Episode<'_>],
    part: impl for<'a> Fn(&Episode<'a>) -> &'a Rows,
) {
    let values: Vec<f32> = episodes.iter().flat_map(|episode| part(episode).flat().iter().copied()).collect();
    let shape = [total_steps(episodes) as u64, part(&episodes[0]).width() as u64];
    let dataset = file.create_dataset(name).with_f32_data(&values).with_shape(&shape);
    dataset.with_chunks(&shape).with_shuffle().with_deflate(6);
}

/// One flag a step, set at the last step of the episodes that `ended` this way; stored as h5py stores bool.
fn add_marks(
    file: &mut FileBuilder,
    name: &str,
    episodes: &[Episode<'_>],
    ended: impl Fn(&Episode<'_>) -> bool,
) -> Result<()> {
    let boolean = EnumTypeBuilder::u8_based().u8_value("FALSE", 0).u8_value("TRUE", 1).build();
    let mut marks = vec![0; total_steps(episodes)];
    let mut last = 0;
    for episode in episodes {
        last += episode.actions.len();
        marks[last - 1] = u8::from(ended(episode));
    }
    file.create_dataset(name).with_enum_u8_data(boolean.map_err(cannot_encode)?, &marks);
    Ok(())
}

fn cannot_encode(source: impl std::fmt::Display) -> Error {
    Error::bad_input(format!("the episodes cannot be stored as HDF5: {source}"))
}

fn check_episodes(episodes: &[Episode<'_>]) -> Result<Sizes> {
    let Some(first) = episodes.first() else {
        return Err(Error::bad_input("no episode to write; at least 1 is needed"));
    };
    let sizes = sizes_of(first)?;
    for (index, episode) in episodes.iter().enumerate() {
        let found = sizes_of(episode).map_err(|error| error.during(&format!("episode {index}")))?;
        if found != sizes {
            return Err(Error::bad_input(format!(
                "a step of episode {index} has {found:?}, but one of episode 0 has {sizes:?}"
            )));
        }
    }
    Ok(sizes)
}

/// Numbers a step of each part; states that are not there have none.
#[derive(Debug, PartialEq)]
struct Sizes {
    observations: usize,
    actions: usize,
    qpos: usize,
    qvel: usize,
}

fn sizes_of(episode: &Episode<'_>) -> Result<Sizes> {
    let steps = episode.actions.len();
    if steps == 0 || episode.observations.len() != steps {
        return Err(Error::bad_input(format!(
            "an episode needs as many observations as actions and at least one, got {} and {steps}",
            episode.observations.len()
        )));
    }
    let States { qpos, qvel } = episode.states.unwrap_or(States { qpos: &[], qvel: &[] });
    for (name, values) in [("qpos", qpos), ("qvel", qvel)] {
        if !values.len().is_multiple_of(steps) {
            return Err(Error::bad_input(format!(
                "{} numbers of {name} do not make rows for {steps} steps",
                values.len()
            )));
        }
    }
    Ok(Sizes {
        observations: episode.observations.width(),
        actions: episode.actions.width(),
        qpos: qpos.len() / steps,
        qvel: qvel.len() / steps,
    })
}

#[cfg(test)]
mod tests;
