//! The D4RL layout in HDF5: flat tables, one row a step, episodes marked by their last step.
//!
//! | dataset | shape | element | |
//! |---|---|---|---|
//! | `observations` | `[N, obs]` | f32 or f64 | |
//! | `actions` | `[N, act]` | f32 or f64 | |
//! | `terminals`, `timeouts` | `[N]` | bool or number | at least one of the two; an episode ends where either is set |
//! | `infos/qpos`, `infos/qvel` | `[N, nq]`, `[N, nv]` | f32 or f64 | optional; for replays, see [`read_states`] |
//!
//! Rewards are never read: what judges must not see them.
//! The simulator's states come by a door of their own, since a score could be worked out from them.

use std::path::Path;

use hdf5_pure::{DType, Dataset, EnumTypeBuilder, File, FileBuilder, Group, Layout};

use crate::demonstration::{Demonstration, DemonstrationSet};
use crate::error::{Error, Result};
use crate::files;
use crate::rows::Rows;

mod states;

pub use states::read_states;

/// Deflate cannot shrink bytes further than this (its longest match costs at least two bits).
const MOST_COMPRESSION: u64 = 1032;

const LAYOUT_HINT: &str = "a D4RL file holds 'observations' [N, obs] and 'actions' [N, act] of f32 or f64, \
                           and 'terminals' [N] or 'timeouts' [N] that mark the last step of each episode";

/// Reads the demonstrations of a file, in file order.
///
/// A last episode without a marked end is dropped, as D4RL's own loader does.
///
/// # Errors
/// `is_bad_input` if the file is not of this layout, damaged, holds a number that is not finite, or holds fewer than
/// two complete episodes; `is_io` if it may not be read.
pub fn read(path: &Path) -> Result<DemonstrationSet> {
    read_set(path).map_err(|error| error.at(path))
}

fn read_set(path: &Path) -> Result<DemonstrationSet> {
    let file_len = length_of(path)?;
    let file = File::open_streaming(path).map_err(damaged)?;
    let root = file.root();
    let observations = read_table(&root, "observations", file_len)?;
    let actions = read_table(&root, "actions", file_len)?;
    let steps = observations.len();
    if actions.len() != steps {
        return Err(Error::bad_input(format!(
            "'observations' has {steps} rows but 'actions' has {}; both must have one row a step",
            actions.len()
        )));
    }
    split(&observations, &actions, &read_ends(&root, steps, file_len)?)
}

/// The rows after which an episode ends, at least one.
fn read_ends(root: &Group, steps: usize, file_len: u64) -> Result<Vec<usize>> {
    let terminals = read_marks(root, "terminals", steps, file_len)?;
    let timeouts = read_marks(root, "timeouts", steps, file_len)?;
    let ends: Vec<usize> = (0..steps)
        .filter(|&step| [&terminals, &timeouts].into_iter().flatten().any(|marks| marks[step]))
        .map(|step| step + 1)
        .collect();
    if ends.is_empty() {
        return Err(no_complete_episode(steps, terminals.is_some(), timeouts.is_some()));
    }
    Ok(ends)
}

/// The file's length in bytes, after the checks that need no parsing.
fn length_of(path: &Path) -> Result<u64> {
    let metadata = std::fs::metadata(path).map_err(|source| match source.kind() {
        std::io::ErrorKind::NotFound => {
            Error::bad_input("the demonstration file does not exist").with_hint("check the path")
        }
        _ => Error::io("cannot read the demonstrations", path, &source),
    })?;
    if !metadata.is_file() {
        return Err(Error::bad_input("not a file; wanted an HDF5 file in D4RL layout").with_hint(LAYOUT_HINT));
    }
    if metadata.len() == 0 {
        return Err(Error::bad_input("the file is empty; wanted an HDF5 file in D4RL layout")
            .with_hint("was it copied or downloaded completely?"));
    }
    match hdf5_pure::is_hdf5(path) {
        Ok(true) => Ok(metadata.len()),
        Ok(false) => Err(Error::bad_input("not an HDF5 file: its signature is missing")
            .with_hint("demonstrations are read from HDF5 files in D4RL layout")),
        Err(source) => Err(Error::io("cannot read the demonstrations", path, &source)),
    }
}

fn damaged(source: hdf5_pure::Error) -> Error {
    Error::bad_input(format!("the HDF5 file is damaged or truncated: {source}"))
        .with_hint("was it copied or downloaded completely?")
}

/// A two-dimensional dataset of floats.
fn read_table(root: &Group, name: &str, file_len: u64) -> Result<Rows> {
    let Some(dataset) = find(root, name)? else {
        return Err(missing(root, name)?);
    };
    let (_, width) = check_table(&dataset, name, file_len)?;
    let values = dataset.read_f32().map_err(damaged)?;
    Rows::from_flat(values, width).map_err(|error| error.during(name))
}

/// Steps and numbers a step of a two-dimensional dataset of floats that the file can hold.
fn check_table(dataset: &Dataset, name: &str, file_len: u64) -> Result<(usize, usize)> {
    let shape = dataset.shape().map_err(damaged)?;
    let &[steps, width @ 1..=u64::MAX] = shape.as_slice() else {
        return Err(Error::bad_input(format!(
            "'{name}' has shape {shape:?}; wanted two dimensions, [steps, numbers a step], of at least one number"
        ))
        .with_hint(LAYOUT_HINT));
    };
    let element = dataset.dtype().map_err(damaged)?;
    if !matches!(element, DType::F32 | DType::F64) {
        return Err(Error::bad_input(format!(
            "'{name}' holds elements of type {element}; wanted f32 or f64"
        )));
    }
    check_size(dataset, name, &shape, file_len)?;
    match (usize::try_from(steps), usize::try_from(width)) {
        (Ok(steps), Ok(width)) => Ok((steps, width)),
        _ => Err(Error::bad_input(format!("'{name}' of shape {shape:?} is too large for this machine"))),
    }
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
            "'{name}' has {} entries but 'observations' has {steps} rows; both must have one a step",
            shape[0]
        )));
    }
    check_size(&dataset, name, &shape, file_len)?;
    flags(&dataset, name).map(Some)
}

/// The elements as flags: everything but zero is true.
fn flags(dataset: &Dataset, name: &str) -> Result<Vec<bool>> {
    match dataset.dtype().map_err(damaged)? {
        DType::F32 | DType::F64 => {
            Ok(dataset.read_f64().map_err(damaged)?.iter().map(|&value| value != 0.0).collect())
        }
        DType::Enum(_)
        | DType::I8
        | DType::I16
        | DType::I32
        | DType::I64
        | DType::U8
        | DType::U16
        | DType::U32
        | DType::U64 => {
            let size = usize::try_from(dataset.element_size().map_err(damaged)?.max(1))
                .map_err(|_| Error::bad_input(format!("'{name}' has elements that are too large")))?;
            let bytes = dataset.read_raw().map_err(damaged)?;
            Ok(bytes.chunks_exact(size).map(|element| element.iter().any(|&byte| byte != 0)).collect())
        }
        other => {
            Err(Error::bad_input(format!("'{name}' holds elements of type {other}; wanted bool or a number")))
        }
    }
}

/// Refuses a dataset that claims more bytes than the file can hold, before memory is asked for.
fn check_size(dataset: &Dataset, name: &str, shape: &[u64], file_len: u64) -> Result<()> {
    let element = dataset.element_size().map_err(damaged)?;
    let bytes_of = |extents: &[u64]| extents.iter().try_fold(element, |bytes, &len| bytes.checked_mul(len));
    let filtered = !dataset.filters().is_empty();
    let most = if filtered { file_len.saturating_mul(MOST_COMPRESSION) } else { file_len };
    let chunk = match dataset.layout().map_err(damaged)? {
        Layout::Chunked { chunk_shape, .. } => bytes_of(&chunk_shape),
        _ => Some(0),
    };
    // A chunk may hang over the edge of its dataset, but not by more than the file could hold either.
    match (bytes_of(shape), chunk) {
        (Some(bytes), Some(chunk)) if bytes <= most && (chunk <= most || filtered && chunk <= 1 << 26) => {
            Ok(())
        }
        _ => Err(Error::bad_input(format!(
            "'{name}' claims shape {shape:?}, more than a file of {file_len} bytes can hold"
        ))
        .with_hint("the file is damaged or was not copied completely")),
    }
}

fn find(root: &Group, name: &str) -> Result<Option<Dataset>> {
    if !root.datasets().map_err(damaged)?.iter().any(|known| known == name) {
        return Ok(None);
    }
    root.dataset(name).map(Some).map_err(damaged)
}

fn missing(root: &Group, name: &str) -> Result<Error> {
    let mut known = root.datasets().map_err(damaged)?;
    known.extend(root.groups().map_err(damaged)?.into_iter().map(|group| group + "/"));
    known.sort();
    let known = if known.is_empty() { "nothing".to_owned() } else { known.join(", ") };
    Ok(Error::bad_input(format!("there is no dataset '{name}'; the file holds: {known}"))
        .with_hint(LAYOUT_HINT))
}

fn no_complete_episode(steps: usize, has_terminals: bool, has_timeouts: bool) -> Error {
    let found = match (has_terminals, has_timeouts) {
        (false, false) => "it has neither 'terminals' nor 'timeouts'".to_owned(),
        (true, false) => format!("'terminals' is set at none of {steps} steps, and there is no 'timeouts'"),
        (false, true) => format!("'timeouts' is set at none of {steps} steps, and there is no 'terminals'"),
        (true, true) => format!("neither 'terminals' nor 'timeouts' is set at any of {steps} steps"),
    };
    Error::bad_input(format!("the file holds no complete episode: {found}"))
        .with_hint("set 'timeouts' or 'terminals' at the last step of each episode")
}

/// Cuts the tables after each of `ends`.
fn split(observations: &Rows, actions: &Rows, ends: &[usize]) -> Result<DemonstrationSet> {
    let starts = std::iter::once(0).chain(ends.iter().copied());
    let demonstrations = starts
        .zip(ends)
        .enumerate()
        .map(|(episode, (start, &end))| {
            Demonstration::new(cut(observations, start, end), cut(actions, start, end))
                .map_err(|error| error.during(&format!("episode {episode}")))
        })
        .collect::<Result<_>>()?;
    DemonstrationSet::new(demonstrations)
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
