//! Whether recorded observations are what the task would have observed in the recorded states, and if not, what they are.

use demosift::Result;
use demosift::data::demonstration::set_file::{Ranges, SetFile};
use demosift::data::trajectory::StateLog;
use demosift::math::rows::Rows;
use demosift::world::environment::Task as _;

use super::naming::{self, Side};
use super::needed::{Line, straight};
use super::{Finding, first_few, in_first, looked_at};
use crate::model::Joint;
use crate::mujoco_task::MujocoTask;
use crate::replay::Replay;
use crate::task::interval::Interval;

/// Two numbers are the same if they differ by less than this share of the largest of their column, or by less than this.
const SAME: f64 = 1e-4;

/// A number at every step of every demonstration.
struct Column {
    name: String,
    values: Vec<f64>,
}

/// What can be known of the recorded states.
struct Made {
    /// What the task observes, in its order; `None` for a number that the state does not tell.
    observed: Vec<Option<Column>>,
    /// Other numbers that a recorder might have written down.
    others: Vec<Column>,
}

/// A recorded episode with its states.
#[derive(Clone, Copy)]
pub(super) struct Episode<'a> {
    /// As the set is read, `[T, obs]`.
    pub(super) observations: &'a Rows,
    /// As it was recorded, `[T, recorded]`: what a set.toml speaks of.
    pub(super) recorded: &'a Rows,
    pub(super) states: &'a StateLog,
}

/// Holds recorded observations, `[T, obs]`, against what the task observes in the recorded states.
///
/// Of a large set only the first steps are looked at, `most` together, as every column is held in memory several times.
/// Contact wrenches are left out: they are of the physics step before the state, which no recording holds.
///
/// # Errors
/// `is_bad_input` if the states are not of the task's model.
pub(super) fn compare(task: &MujocoTask, episodes: &[Episode<'_>], most: usize) -> Result<Finding> {
    let each = looked_at(episodes.iter().map(|episode| episode.observations.len()), most);
    let recorded = columns_of(episodes, each, |episode| episode.observations);
    let made = make(task, episodes, each)?;
    let fits = recorded.len() == made.observed.len();
    let pairs = recorded.iter().zip(&made.observed).enumerate();
    let wrong: Vec<usize> = pairs
        .filter(|(_, (recorded, made))| {
            made.as_ref().is_some_and(|made| !same(&recorded.values, &made.values))
        })
        .map(|(column, _)| column)
        .collect();
    if fits && wrong.is_empty() {
        let known = made.observed.iter().flatten().count();
        let unknown = made.observed.len() - known;
        let rest =
            if unknown == 0 { String::new() } else { format!(" (but for {unknown} of contact wrenches)") };
        return Ok(Finding::fine(format!(
            "the recorded observations are what the task observes in the recorded states, number by number{rest}{}",
            in_first(each)
        )));
    }
    let all: Vec<usize> = (0..recorded.len()).collect();
    let asked = if fits { &wrong } else { &all };
    let mend = mend(task, &columns_of(episodes, each, |episode| episode.recorded), &made);
    let mut finding = explain(&recorded, &made, Asked { columns: asked, fits, mended: mend.is_some() });
    finding.message += &in_first(each);
    Ok(finding.mended_by(mend))
}

/// Which columns are wrong, and what is known of the set.
#[derive(Clone, Copy)]
struct Asked<'a> {
    columns: &'a [usize],
    /// Whether a recorded observation has as many numbers as one of the task.
    fits: bool,
    /// Whether a set.toml makes all of them right.
    mended: bool,
}

/// What a set.toml would have to say of the observations; `None` if that does not make all numbers right.
fn mend(task: &MujocoTask, recorded: &[Column], made: &Made) -> Option<SetFile> {
    let line = |(at, made): (usize, &Option<Column>)| {
        let own = Line { from: at, factor: 1.0, shift: 0.0 };
        let Some(made) = made else { return (at < recorded.len()).then_some(own) };
        if recorded.get(at).is_some_and(|recorded| same(&recorded.values, &made.values)) {
            return Some(own);
        }
        let through = |from: usize| {
            let column = &recorded[from];
            let points: Vec<(f64, f64)> =
                column.values.iter().copied().zip(made.values.iter().copied()).collect();
            let line = straight(&points)?;
            let read: Vec<f64> = points.iter().map(|(x, _)| line.factor * x + line.shift).collect();
            same(&read, &made.values).then_some(Line { from, factor: line.factor, shift: line.shift })
        };
        // Its own place goes before any other.
        let others = (0..recorded.len()).filter(|from| *from != at);
        (at < recorded.len()).then_some(at).into_iter().chain(others).find_map(through)
    };
    let lines: Vec<Line> = made.observed.iter().enumerate().map(line).collect::<Option<_>>()?;
    let is_twice = |at: usize| lines[..at].iter().any(|line| line.from == lines[at].from);
    if (0..lines.len()).any(is_twice) {
        return None;
    }
    let ranges = task.observation_ranges();
    let ranges = Ranges { controls: &task.specification().control_ranges, observations: &ranges };
    Some(Side::Observations.file(naming::name(&lines, recorded.len(), Side::Observations, ranges)))
}

/// What is wrong with the columns `asked`, and what they seem to be.
fn explain(recorded: &[Column], made: &Made, asked: Asked<'_>) -> Finding {
    let Asked { columns: asked, fits, mended } = asked;
    let what = if fits {
        let names = asked.iter().map(|&column| {
            let name = made.observed[column].as_ref().map_or("", |made| made.name.as_str());
            format!("number {column} should be {name}")
        });
        format!(
            "{} of the {} numbers of the recorded observations are not what the task observes in the recorded states: {}",
            asked.len(),
            recorded.len(),
            first_few(&names.collect::<Vec<_>>())
        )
    } else {
        format!(
            "a recorded observation has {} numbers, and the task observes {}",
            recorded.len(),
            made.observed.len()
        )
    };
    let known: Vec<String> = asked
        .iter()
        .filter_map(|&column| Some(format!("number {column} is {}", made.like(&recorded[column])?)))
        .collect();
    let late = made.observed.iter().flatten().zip(recorded).filter(|(made, _)| varies(&made.values));
    let (count, next) = late.fold((0, 0), |(count, next), (made, recorded)| {
        (count + 1, next + usize::from(follows(&recorded.values, &made.values)))
    });
    let advice = if fits && count > 0 && next * 2 > count {
        "the recorded observations seem to be those after the action; an observation belongs before the action taken on it"
            .to_owned()
    } else if known.is_empty() && mended {
        "they are numbers that the task observes, in other units or places; set.toml can say so".to_owned()
    } else if known.is_empty() {
        "none of them is a position, a velocity or another number that the model tells; see in what order and unit they \
         were recorded"
            .to_owned()
    } else if mended {
        format!("in the recording {}; set.toml can say so", first_few(&known))
    } else {
        format!(
            "in the recording {}; say so in set.toml (order, sign, units, scale), put the parts of `observation` into that \
             order, or name the set's columns with --observation-columns",
            first_few(&known)
        )
    };
    Finding::error(what, advice)
}

impl Made {
    /// The number that a recorded one equals throughout; `None` if there is none, or it tells nothing.
    fn like(&self, recorded: &Column) -> Option<String> {
        let all = || self.observed.iter().flatten().chain(&self.others).filter(|made| varies(&made.values));
        let like = all().find(|made| same(&recorded.values, &made.values)).map(|made| made.name.clone());
        like.or_else(|| all().find_map(|made| clipped(recorded, made)))
    }
}

/// Such as `qvel elbow clipped to [-10, 10]`, if the recorded number is that.
fn clipped(recorded: &Column, made: &Column) -> Option<String> {
    let range = |values: &[f64]| Interval {
        low: values.iter().copied().fold(f64::INFINITY, f64::min),
        high: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
    };
    let (mut clip, made_range) = (range(&recorded.values), range(&made.values));
    let cut: Vec<f64> = made.values.iter().map(|value| clip.clip(*value)).collect();
    if !varies(&recorded.values) || !same(&recorded.values, &cut) {
        return None;
    }
    // Only an end that something was cut off at is one of the range.
    if made_range.low >= clip.low - SAME {
        clip.low = f64::NEG_INFINITY;
    }
    if made_range.high <= clip.high + SAME {
        clip.high = f64::INFINITY;
    }
    Some(format!("{} clipped to {}", made.name, clip.words()))
}

fn varies(values: &[f64]) -> bool {
    values.iter().any(|value| *value != values[0])
}

fn same(recorded: &[f64], made: &[f64]) -> bool {
    let largest = made.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    recorded.iter().zip(made).all(|(recorded, made)| (recorded - made).abs() <= SAME * (1.0 + largest))
}

/// Whether the recorded number is that of the next step, but for the steps at the ends of episodes.
fn follows(recorded: &[f64], made: &[f64]) -> bool {
    let largest = made.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    let is_next = |(recorded, next): &(&f64, &f64)| (*recorded - *next).abs() <= SAME * (1.0 + largest);
    let count = recorded.iter().zip(&made[1..]).filter(is_next).count();
    count * 10 >= (made.len() - 1) * 9
}

/// The first so many rows, or all.
fn head<T>(rows: impl Iterator<Item = T>, each: Option<usize>) -> impl Iterator<Item = T> {
    rows.take(each.unwrap_or(usize::MAX))
}

fn columns_of<'a>(
    episodes: &[Episode<'a>],
    each: Option<usize>,
    rows: fn(&Episode<'a>) -> &'a Rows,
) -> Vec<Column> {
    let width = episodes.first().map_or(0, |episode| rows(episode).width());
    let values = |column: usize| {
        let rows = episodes.iter().flat_map(|episode| head(rows(episode).iter(), each));
        rows.map(|row| f64::from(row[column])).collect()
    };
    (0..width).map(|column| Column { name: format!("number {column}"), values: values(column) }).collect()
}

/// Puts the simulation into every recorded state, and reads off what can be read.
fn make(task: &MujocoTask, episodes: &[Episode<'_>], each: Option<usize>) -> Result<Made> {
    let specification = task.specification();
    let readings = &task.blueprint().observation;
    let told = readings.iter().flat_map(|reading| {
        let told = reading.key() != "contact_wrench";
        let clipped = reading.clip.map_or(String::new(), |clip| format!(" clipped to {}", clip.words()));
        reading.columns(task.model()).into_iter().map(move |name| (name + &clipped, told))
    });
    let mut observed: Vec<Option<Column>> =
        told.map(|(name, told)| told.then_some(Column { name, values: Vec::new() })).collect();
    let mut others = Vec::new();
    let mut observation = vec![0.0; specification.observation_size];
    let mut now = vec![0.0; specification.measurements.len()];
    for episode in episodes {
        let steps = episode.observations.len();
        let mut replay = Replay::new(task, episode.states, steps)?;
        for step in head(0..steps, each) {
            let environment = replay.at(step)?;
            environment.observe(&mut observation, &mut now);
            for (column, value) in observed.iter_mut().zip(&observation) {
                let Some(column) = column else { continue };
                // A state that is set does not know when it was.
                let is_phase = column.name == "phase";
                let phase = step as f64 / specification.horizon as f64;
                column.values.push(if is_phase { phase } else { f64::from(*value) });
            }
        }
    }
    for joint in task.model().joints() {
        others.extend(columns_of_joint(&joint, episodes, each, task));
    }
    Ok(Made { observed, others })
}

/// Positions and velocities of a joint, and what recorders make of an angle.
fn columns_of_joint(
    joint: &Joint,
    episodes: &[Episode<'_>],
    each: Option<usize>,
    task: &MujocoTask,
) -> Vec<Column> {
    let (nq, nv) = (task.model().mujoco().nq() as usize, task.model().mujoco().nv() as usize);
    let column = |at: usize, width: usize, values: fn(&StateLog) -> &Vec<f64>| -> Vec<f64> {
        let rows = episodes.iter().flat_map(|episode| head(values(episode.states).chunks_exact(width), each));
        rows.map(|row| row[at]).collect()
    };
    let qpos = joint
        .qpos
        .clone()
        .zip(joint.columns_of_qpos())
        .map(|(at, name)| Column { name, values: column(at, nq, |states| &states.qpos) });
    let qvel = joint
        .qvel
        .clone()
        .zip(joint.columns_of_qvel())
        .map(|(at, name)| Column { name, values: column(at, nv, |states| &states.qvel) });
    let mut columns: Vec<Column> = qpos.chain(qvel).collect();
    if joint.qpos.len() == 1 {
        let angle = columns[0].values.clone();
        for (what, make) in [
            ("the cosine of", f64::cos as fn(f64) -> f64),
            ("the sine of", f64::sin),
            ("the negative of", |angle| -angle),
            ("in degrees,", f64::to_degrees),
        ] {
            let values = angle.iter().map(|angle| make(*angle)).collect();
            columns.push(Column { name: format!("{what} {}", columns[0].name), values });
        }
    }
    columns
}
