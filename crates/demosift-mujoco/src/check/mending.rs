//! What would make recorded actions lead through the recorded states: another order, sign, unit, scale or offset of the
//! numbers of a set, as lines of its `set.toml`.
//!
//! Where the set holds the simulator's states, only its actions are in doubt.
//! Where states are taken from observations, these are tried in other orders, units and signs first, and a try is worth
//! something only if some action leads from each state to the next.

use demosift::Result;
use demosift::data::demonstration::Demonstration;
use demosift::data::demonstration::set_file::{Each, Meaning, Ranges, SetFile, Unit, Units};
use demosift::data::trajectory::StateLog;
use demosift::math::rows::Rows;
use demosift::world::environment::Task as _;

use super::dynamics::{self, Episode};
use super::explained::Explained;
use super::known::{self, Clipping, Known, Made};
use super::naming::{self, Side};
use super::needed::{self, Budget, Line};
use crate::environment::MujocoEnvironment;
use crate::mujoco_task::MujocoTask;
use crate::task::observation::{Number, Reading};

/// Steps that an explanation is tried on.
const TRIED: usize = 100;
/// Steps that it is tried on first.
const TRIED_FIRST: usize = 10;
/// Steps of the physics that may be played to find an explanation: seconds of a humanoid, and less of anything else.
const MOST_PHYSICS_STEPS: u64 = 100_000;
/// Parts of an observation that are tried in every order.
const MOST_PARTS: usize = 4;
/// What a less simple explanation may leave of what the one before it leaves.
const CLEARLY: f64 = 0.5;
/// Joints of which each pair is tried exchanged.
const MOST_JOINTS: usize = 8;

/// Steps of a set, spread evenly over it: episodes of two states each.
struct Sample {
    pairs: Vec<Demonstration>,
    states: Option<Vec<StateLog>>,
}

/// A way to read the set that was tried.
struct Tried {
    made: Made,
    pairs: Vec<Demonstration>,
}

/// What the numbers of a recorded set seem to be; `None` if nothing that is tried makes them lead where they led, or they do
/// so as they are.
///
/// # Errors
/// If a simulation cannot be set up.
pub(super) fn explain(
    task: &MujocoTask,
    set: &[Demonstration],
    states: Option<&[StateLog]>,
) -> Result<Option<Explained>> {
    let Some(widths) = set.first().map(|one| (one.observations().width(), one.actions().width())) else {
        return Ok(None);
    };
    let mut environment = task.mujoco_environment()?;
    let (few, many) = (sample(set, states, TRIED_FIRST), sample(set, states, TRIED));
    let observed = task.specification().observation_size;
    let candidates = match states {
        Some(_) => vec![Meaning::default()],
        None if widths.0 == observed => observations(task),
        None => Vec::new(),
    };
    let mut best: Option<Explained> = None;
    let mut budget = Budget { physics_steps: MOST_PHYSICS_STEPS };
    for candidate in candidates {
        // What is said first is simpler.
        if best.as_ref().is_some_and(|best| dynamics::is_same_physics(best.missed)) {
            break;
        }
        let file = Side::Observations.file(candidate.clone());
        let leads_somewhere = match read(task, &few, &file) {
            Some(tried) => needed::needed(&mut environment, &episodes(&tried), &mut budget)?.is_some(),
            None => false,
        };
        if !leads_somewhere {
            continue;
        }
        for mend in actions_for(&mut environment, task, &many, &candidate)? {
            let Some(missed) = missed(&mut environment, task, &many, &mend)? else { continue };
            let is_named = mend.actions.scale.is_none() && mend.actions.offset.is_none();
            let is_enough = dynamics::is_same_physics(missed) || is_named && dynamics::is_same_body(missed);
            let is_better = best
                .as_ref()
                .is_none_or(|best| missed < CLEARLY * best.missed && !dynamics::is_same_physics(best.missed));
            if is_enough && is_better && !mend.is_none() {
                best = Some(Explained { words: in_words(&mend), missed, mend: Some(mend) });
            }
        }
    }
    Ok(best)
}

fn in_words(mend: &SetFile) -> String {
    let sides = [Side::Observations, Side::Actions];
    let words = sides.iter().filter_map(|side| naming::in_words(side.of(mend), *side));
    words.collect::<Vec<_>>().join(", and ")
}

/// What a typical step of a set misses as it is, over a sample of it; `None` where its states are not known.
///
/// # Errors
/// As [`explain`].
pub(super) fn missed_as_it_is(
    task: &MujocoTask,
    set: &[Demonstration],
    states: Option<&[StateLog]>,
) -> Result<Option<f64>> {
    let sample = sample(set, states, TRIED);
    missed(&mut task.mujoco_environment()?, task, &sample, &SetFile::default())
}

/// The frame skip that makes a sample of a set lead where it led, if another one does.
///
/// # Errors
/// As [`explain`].
pub(super) fn other_skip(
    task: &MujocoTask,
    set: &[Demonstration],
    states: Option<&[StateLog]>,
) -> Result<Option<Explained>> {
    let sample = sample(set, states, TRIED);
    let Some(tried) = read(task, &sample, &SetFile::default()) else { return Ok(None) };
    dynamics::other_skip(&mut task.mujoco_environment()?, &episodes(&tried))
}

fn sample(set: &[Demonstration], states: Option<&[StateLog]>, count: usize) -> Sample {
    let steps: Vec<(usize, usize)> = set
        .iter()
        .enumerate()
        .flat_map(|(id, one)| (0..one.steps().saturating_sub(1)).map(move |step| (id, step)))
        .collect();
    let count = count.min(steps.len());
    let chosen: Vec<(usize, usize)> = (0..count).map(|at| steps[at * steps.len() / count]).collect();
    let two = |rows: &Rows, step: usize| (step..step + 2).map(|at| rows.row(at)).collect::<Rows>();
    let pairs = chosen.iter().filter_map(|&(id, step)| {
        Demonstration::new(two(set[id].observations(), step), two(set[id].actions(), step)).ok()
    });
    let log = |id: usize, step: usize, logs: &[StateLog]| {
        let part = |numbers: &[f64]| {
            let width = numbers.len() / set[id].steps();
            numbers[step * width..(step + 2) * width].to_vec()
        };
        StateLog { qpos: part(&logs[id].qpos), qvel: part(&logs[id].qvel) }
    };
    let states = states.map(|logs| chosen.iter().map(|&(id, step)| log(id, step, logs)).collect());
    Sample { pairs: pairs.collect(), states }
}

/// The sample as a set file reads it, with its states; `None` where that is not possible.
fn read(task: &MujocoTask, sample: &Sample, file: &SetFile) -> Option<Tried> {
    let first = sample.pairs.first()?;
    let ranges = task.observation_ranges();
    let ranges = Ranges { controls: &task.specification().control_ranges, observations: &ranges };
    let (observed, acted) = (first.observations().width(), first.actions().width());
    let conversion = file.conversion(observed, acted, ranges).ok()?;
    let pairs: Option<Vec<Demonstration>> = sample
        .pairs
        .iter()
        .map(|one| {
            let observations = conversion.observations(one.observations());
            Demonstration::new(observations, conversion.actions(one.actions())).ok()
        })
        .collect();
    let pairs = pairs?;
    if pairs.first()?.actions().width() != task.specification().action_size {
        return None;
    }
    let made = match &sample.states {
        Some(states) => Made { states: states.clone(), known: Known::all(task) },
        None => known::states_in_observations(task, &pairs, &Clipping::by_task(task))?,
    };
    Some(Tried { made, pairs })
}

fn episodes(tried: &Tried) -> Vec<Episode<'_>> {
    let each = tried.pairs.iter().zip(&tried.made.states);
    each.map(|(one, states)| Episode { actions: one.actions(), states, known: &tried.made.known }).collect()
}

fn missed(
    environment: &mut MujocoEnvironment,
    task: &MujocoTask,
    sample: &Sample,
    file: &SetFile,
) -> Result<Option<f64>> {
    let Some(tried) = read(task, sample, file) else { return Ok(None) };
    dynamics::typically_missed(environment, &episodes(&tried))
}

/// What actions may be, if the observations are these: what the needed ones say, and units that are usual.
fn actions_for(
    environment: &mut MujocoEnvironment,
    task: &MujocoTask,
    sample: &Sample,
    observations: &Meaning,
) -> Result<Vec<SetFile>> {
    let observed = Side::Observations.file(observations.clone());
    let with = |actions: Meaning| SetFile { actions, ..observed.clone() };
    let mut files = vec![observed.clone()];
    let acted = sample.pairs[0].actions().width();
    let found = match read(task, sample, &observed) {
        Some(tried) => {
            // What leads somewhere is worth all that it takes.
            let mut budget = Budget { physics_steps: u64::MAX };
            needed::needed(environment, &episodes(&tried), &mut budget)?
        }
        None => None,
    };
    if let Some(lines) = found.and_then(|found| whole(needed::lines(&found), acted)) {
        let ranges = Ranges { controls: &task.specification().control_ranges, observations: &[] };
        files.push(with(naming::name(&lines, acted, Side::Actions, ranges)));
    }
    let usual = [Unit::Controls, Unit::Degrees, Unit::Percent, Unit::PercentFrom0];
    files.extend(usual.map(|unit| with(Meaning { units: Some(Units::All(unit)), ..Meaning::default() })));
    files.push(with(Meaning { sign: Some(Each::All(-1.0)), ..Meaning::default() }));
    Ok(files)
}

/// Lines for all numbers: one of which nothing is told, as it never moves, is read as its neighbors are.
fn whole(lines: Vec<Option<Line>>, width: usize) -> Option<Vec<Line>> {
    let known: Vec<Line> = lines.iter().flatten().copied().collect();
    let first = *known.first()?;
    let is_alike = |line: &Line| (line.factor.abs() - first.factor.abs()).abs() < 0.02 * first.factor.abs();
    let factor = if known.iter().all(is_alike) { first.factor.abs() } else { 1.0 };
    let filled = lines.into_iter().enumerate().map(|(at, line)| {
        let own = Line { from: at, factor, shift: 0.0 };
        let is_free = at < width && known.iter().all(|line| line.from != at);
        line.or(is_free.then_some(own))
    });
    let lines: Vec<Line> = filled.collect::<Option<_>>()?;
    let is_twice = |at: usize| lines[..at].iter().any(|line| line.from == lines[at].from);
    (!(0..lines.len()).any(is_twice)).then_some(lines)
}

/// What observations may be, the simplest first.
fn observations(task: &MujocoTask) -> Vec<Meaning> {
    let readings = &task.blueprint().observation;
    let numbers: Vec<Number> = readings.iter().flat_map(Reading::numbers).collect();
    let mut all = vec![Meaning::default()];
    let units = in_degrees(task, &numbers);
    let with = |order: &Option<Vec<usize>>, sign: Option<Each>, units: &Option<Units>| Meaning {
        order: order.clone(),
        sign,
        units: units.clone(),
        ..Meaning::default()
    };
    all.extend(units.iter().flatten().map(|units| with(&None, None, &Some(units.clone()))));
    let signs = signs(task, &numbers);
    all.extend(signs.iter().map(|sign| with(&None, Some(sign.clone()), &None)));
    for order in orders(task, readings, &numbers) {
        all.extend(units.iter().map(|units| with(&Some(order.clone()), None, units)));
    }
    all.extend(signs.iter().flat_map(|sign| {
        units.iter().flatten().map(|units| with(&None, Some(sign.clone()), &Some(units.clone())))
    }));
    all
}

/// No unit; all hinges in degrees; their positions alone.
fn in_degrees(task: &MujocoTask, numbers: &[Number]) -> Vec<Option<Units>> {
    let axes = task.model().axes();
    let is_angle =
        |number: &Number| axes.iter().any(|axis| axis.is_hinge && *number == Number::Position(axis.qpos));
    let is_turning =
        |number: &Number| axes.iter().any(|axis| axis.is_hinge && *number == Number::Velocity(axis.qvel));
    let units = |is_in_degrees: &dyn Fn(&Number) -> bool| {
        let of = |number: &Number| if is_in_degrees(number) { Unit::Degrees } else { Unit::Task };
        naming::in_units(&numbers.iter().map(of).collect::<Vec<_>>())
    };
    let both = units(&|number| is_angle(number) || is_turning(number));
    let positions = units(&is_angle);
    let mut all = vec![None];
    all.extend([both, positions].into_iter().filter(Option::is_some));
    all.dedup();
    all
}

/// Each joint with the other sign: position and velocity together, and each alone.
fn signs(task: &MujocoTask, numbers: &[Number]) -> Vec<Each> {
    let mut all = Vec::new();
    for axis in task.model().axes() {
        let (position, velocity) = (Number::Position(axis.qpos), Number::Velocity(axis.qvel));
        for flipped in [vec![position, velocity], vec![position], vec![velocity]] {
            let sign = |number: &Number| if flipped.contains(number) { -1.0 } else { 1.0 };
            all.push(Each::Listed(numbers.iter().map(sign).collect()));
        }
    }
    all
}

/// Every order of the parts of an observation, and every two joints exchanged.
fn orders(task: &MujocoTask, readings: &[Reading], numbers: &[Number]) -> Vec<Vec<usize>> {
    let mut all = Vec::new();
    if (2..=MOST_PARTS).contains(&readings.len()) {
        for parts in permutations(readings.len()).into_iter().skip(1) {
            // The set holds the parts in this order, so this is where each begins there.
            let mut starts = vec![0; readings.len()];
            let mut start = 0;
            for part in parts {
                starts[part] = start;
                start += readings[part].width();
            }
            let places = readings.iter().zip(starts);
            all.push(places.flat_map(|(reading, start)| start..start + reading.width()).collect());
        }
    }
    let axes = task.model().axes();
    if axes.len() <= MOST_JOINTS {
        for (at, one) in axes.iter().enumerate() {
            for other in &axes[at + 1..] {
                let place = |number: &Number| {
                    let exchanged = match number {
                        Number::Position(at) if *at == one.qpos => Number::Position(other.qpos),
                        Number::Position(at) if *at == other.qpos => Number::Position(one.qpos),
                        Number::Velocity(at) if *at == one.qvel => Number::Velocity(other.qvel),
                        Number::Velocity(at) if *at == other.qvel => Number::Velocity(one.qvel),
                        same => *same,
                    };
                    numbers.iter().position(|number| *number == exchanged)
                };
                let is_other = |number: &Number| *number == Number::Other;
                let order = numbers.iter().enumerate();
                let order = order.map(|(at, number)| if is_other(number) { Some(at) } else { place(number) });
                all.extend(order.collect::<Option<Vec<usize>>>());
            }
        }
    }
    all
}

/// All orders of so many things, the usual one first.
fn permutations(count: usize) -> Vec<Vec<usize>> {
    if count == 0 {
        return vec![Vec::new()];
    }
    let shorter = permutations(count - 1);
    // The last thing goes to each place, from the end to the front.
    (0..count)
        .rev()
        .flat_map(|place| {
            shorter.iter().map(move |order| {
                let mut longer = order.clone();
                longer.insert(place, count - 1);
                longer
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_as_many_orders_as_there_should_be_and_the_usual_one_is_first() {
        let all = permutations(4);
        assert_eq!((all.len(), all[0].clone()), (24, vec![0, 1, 2, 3]));
        let mut sorted = all.clone();
        sorted.sort();
        sorted.dedup();
        assert_eq!(sorted.len(), 24);
    }

    #[test]
    fn a_number_that_never_moves_is_read_as_the_others() {
        let line = |from, factor| Some(Line { from, factor, shift: 0.0 });
        let lines = whole(vec![line(0, -0.5), None, line(2, 0.5)], 3);
        assert_eq!(lines.as_deref().map(|lines| lines[1]), line(1, 0.5));
        assert_eq!(whole(vec![line(1, 1.0), None], 2), None, "its place is taken");
        assert_eq!(whole(vec![line(0, 1.0), line(0, 1.0)], 2), None);
    }
}
