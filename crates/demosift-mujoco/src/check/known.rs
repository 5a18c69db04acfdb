//! What observations tell of the simulator's states, and which of their numbers are clipped and so not known.

use demosift::data::demonstration::Demonstration;
use demosift::data::trajectory::StateLog;
use demosift::math::rows::Rows;

use super::Finding;
use crate::mujoco_task::MujocoTask;
use crate::task::interval::Interval;
use crate::task::observation::{Reading, What};

/// A number that comes back to the very same extreme so often in one episode is cut off there.
const RETURNS: usize = 3;

/// Which numbers of recorded states are known.
#[derive(Clone, Debug)]
pub(super) struct Known {
    /// Positions that were not recorded.
    pub(super) hidden: Vec<usize>,
    /// Where each position is known, `[nq]`; at the ends and beyond it is not.
    qpos: Vec<Interval>,
    /// The same of velocities, `[nv]`.
    qvel: Vec<Interval>,
}

/// Positions, or velocities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Numbers {
    Qpos,
    Qvel,
}

/// States that were made of observations.
pub(super) struct Made {
    pub(super) states: Vec<StateLog>,
    pub(super) known: Known,
}

/// What recorded observations are clipped to.
#[derive(Debug, Default)]
pub(super) struct Clipping {
    /// One entry for each reading of the task, as far as it is clipped.
    ranges: Vec<Option<Interval>>,
    pub(super) findings: Vec<Finding>,
}

impl Known {
    /// Every number of a state of the task.
    pub(super) fn all(task: &MujocoTask) -> Self {
        let model = task.model().mujoco();
        let everything = |count: i64| vec![Interval::EVERYTHING; count as usize];
        Self { hidden: Vec::new(), qpos: everything(model.nq()), qvel: everything(model.nv()) }
    }

    pub(super) fn is_all(&self) -> bool {
        self.hidden.is_empty() && !self.is_clipped()
    }

    fn is_clipped(&self) -> bool {
        self.qpos.iter().chain(&self.qvel).any(|range| *range != Interval::EVERYTHING)
    }

    /// Whether a number of a state is known, by its address.
    pub(super) fn has(&self, numbers: Numbers, at: usize, value: f64) -> bool {
        match numbers {
            Numbers::Qpos => !self.hidden.contains(&at) && self.qpos[at].holds(value),
            Numbers::Qvel => self.qvel[at].holds(value),
        }
    }

    /// Whether all that matters of a state is known.
    pub(super) fn is_whole(&self, qpos: &[f64], qvel: &[f64]) -> bool {
        let within = |ranges: &[Interval], values: &[f64]| {
            ranges.iter().zip(values).all(|(range, value)| range.holds(*value))
        };
        within(&self.qpos, qpos) && within(&self.qvel, qvel)
    }

    /// Where states come from, and how much of them is missing.
    pub(super) fn found(&self, states: &[StateLog]) -> Finding {
        let but = if self.hidden.is_empty() { "" } else { " that matters" };
        let said = format!(
            "the task observes every position{but} and velocity, so states are taken from the observations"
        );
        if !self.is_clipped() {
            return Finding::fine(said);
        }
        let (nq, nv) = (self.qpos.len(), self.qvel.len());
        let rows = states.iter().flat_map(|log| log.qpos.chunks_exact(nq).zip(log.qvel.chunks_exact(nv)));
        let whole = rows.clone().filter(|(qpos, qvel)| self.is_whole(qpos, qvel)).count();
        let share = 100.0 * (1.0 - whole as f64 / rows.count().max(1) as f64);
        if whole == 0 {
            return Finding::warning(
                format!("{said}; each of them has a clipped number, so nothing can be played again"),
                "record `qpos` and `qvel` beside the observations, if you can: docs/formats.md says where",
            );
        }
        Finding::fine(format!(
            "{said}; {share:.0} % of them have a clipped number, which is not known: steps from these are left out, and of \
             the others the numbers that are not clipped are compared"
        ))
    }
}

impl Clipping {
    /// What the task says, whatever the numbers show.
    pub(super) fn by_task(task: &MujocoTask) -> Self {
        let ranges = task.blueprint().observation.iter().map(|reading| reading.clip.map(as_recorded));
        Self { ranges: ranges.collect(), findings: Vec::new() }
    }
}

/// The numbers were recorded as f32.
fn as_recorded(range: Interval) -> Interval {
    Interval { low: f64::from(range.low as f32), high: f64::from(range.high as f32) }
}

/// What each part of recorded observations is clipped to: what the task says, or what the numbers themselves show.
pub(super) fn clipping(task: &MujocoTask, set: &[Demonstration]) -> Clipping {
    let mut clipping = Clipping::default();
    let mut first = 0;
    for reading in &task.blueprint().observation {
        let columns = first..first + reading.width();
        first = columns.end;
        let extremes = extremes(set, columns);
        let shown = extremes.shown.filter(|_| can_be_clipped(reading));
        if let (Some(clip), false) = (reading.clip, extremes.is_within(reading.clip)) {
            clipping.findings.push(Finding::error(
                format!(
                    "recorded numbers of {} go from {:.4} to {:.4}, and the task clips them to {}",
                    reading.key(),
                    extremes.all.low,
                    extremes.all.high,
                    clip.words()
                ),
                "an agent can never show what was recorded: leave `clip` away, or clip the recorded numbers too",
            ));
        }
        if let (None, Some(shown)) = (reading.clip, shown) {
            clipping.findings.push(Finding::warning(
                format!("recorded numbers of {} look clipped to {}, and the task does not clip them", reading.key(), shown.words()),
                format!(
                    "an agent would show what no demonstration can: add clip = {} to that part of `observation`",
                    shown.words()
                ),
            ));
        }
        clipping.ranges.push(reading.clip.or(shown).map(as_recorded));
    }
    clipping
}

/// Speeds and forces are clipped for learning. A position that comes back to the same extreme may stand at a stop.
fn can_be_clipped(reading: &Reading) -> bool {
    matches!(reading.what, What::Qvel(_) | What::Velocity(..) | What::ContactWrench(..))
}

/// How far the numbers of some columns go.
struct Extremes {
    all: Interval,
    /// The extremes that the numbers come back to as if cut off there; an end where they do not is infinite.
    shown: Option<Interval>,
}

impl Extremes {
    fn is_within(&self, clip: Option<Interval>) -> bool {
        clip.is_none_or(|clip| {
            self.all.low >= f64::from(clip.low as f32) && self.all.high <= f64::from(clip.high as f32)
        })
    }
}

fn extremes(set: &[Demonstration], columns: std::ops::Range<usize>) -> Extremes {
    let rows = set.iter().flat_map(|one| one.observations().iter());
    let numbers = rows.flat_map(|row| &row[columns.clone()]).copied();
    let (low, high) = numbers
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), number| (low.min(number), high.max(number)));
    let returns_to = |extreme: f32| {
        // Forces are often 0, and nothing is cut off there.
        extreme != 0.0
            && set.iter().any(|one| {
                columns.clone().any(|at| times_reached(one.observations(), at, extreme) >= RETURNS)
            })
    };
    let shown = Interval {
        low: if returns_to(low) { f64::from(low) } else { f64::NEG_INFINITY },
        high: if returns_to(high) { f64::from(high) } else { f64::INFINITY },
    };
    Extremes {
        all: Interval { low: low.into(), high: high.into() },
        shown: (shown != Interval::EVERYTHING && low < high).then_some(shown),
    }
}

/// How many times a number comes to be exactly this.
fn times_reached(rows: &Rows, column: usize, extreme: f32) -> usize {
    let is_there = |row: usize| rows.row(row)[column] == extreme;
    (0..rows.len()).filter(|&row| is_there(row) && (row == 0 || !is_there(row - 1))).count()
}

/// The states out of observations that hold every velocity, and every position but those that only say where something stands.
///
/// Where on the floor a robot stands does not matter to the physics: a runner runs everywhere alike. Unknown such places are 0;
/// where any other position is unknown, so are the states.
pub(super) fn states_in_observations(
    task: &MujocoTask,
    set: &[Demonstration],
    clipping: &Clipping,
) -> Option<Made> {
    let mut known = Known::all(task);
    let (mut qpos, mut qvel) = (vec![None; known.qpos.len()], vec![None; known.qvel.len()]);
    let mut first = 0;
    for (reading, clip) in task.blueprint().observation.iter().zip(&clipping.ranges) {
        let taken = match &reading.what {
            What::Qpos(range) => Some((range, &mut qpos, &mut known.qpos)),
            What::Qvel(range) => Some((range, &mut qvel, &mut known.qvel)),
            _ => None,
        };
        if let Some((range, columns, ranges)) = taken {
            for (offset, at) in range.clone().enumerate() {
                columns[at] = Some(first + offset);
                ranges[at] = clip.unwrap_or(Interval::EVERYTHING);
            }
        }
        first += reading.width();
    }
    known.hidden = (0..qpos.len()).filter(|at| qpos[*at].is_none()).collect();
    let places = task.model().places();
    let tells_enough = known.hidden.len() < qpos.len() && !qvel.contains(&None);
    if !tells_enough || !known.hidden.iter().all(|at| places.contains(at)) {
        return None;
    }
    let pick = |rows: &Rows, columns: &[Option<usize>]| -> Vec<f64> {
        let number =
            |row: &[f32], column: &Option<usize>| column.map_or(0.0, |column| f64::from(row[column]));
        rows.iter()
            .flat_map(|row| columns.iter().map(|column| number(row, column)).collect::<Vec<_>>())
            .collect()
    };
    let states = set.iter().map(|demonstration| {
        let rows = demonstration.observations();
        StateLog { qpos: pick(rows, &qpos), qvel: pick(rows, &qvel) }
    });
    Some(Made { states: states.collect(), known })
}
