//! Numbers that no joint and no actuator of a model can reach, and units in which they could.

use std::f64::consts::TAU;

use demosift::data::demonstration::Demonstration;
use demosift::data::demonstration::set_file::{Meaning, SetFile, Unit};
use demosift::world::environment::{Specification, Task as _};

use super::naming;
use super::needed::straight;
use super::presented::Presented;
use super::{Finding, first_few};
use crate::model::Axis;
use crate::mujoco_task::MujocoTask;
use crate::task::observation::{Number, Reading};

/// Limits of joints give way, so a position is far outside if it is beyond one by this share of the range.
const FAR: f64 = 0.5;
/// Or by so much, rad or m, where the range is small.
const FAR_AT_LEAST: f64 = 0.1;
/// The share of the steps in which a joint must be far outside.
const OFTEN: f64 = 0.1;
/// The share of numbers that a unit must bring into the range.
const NEARLY_ALL: f64 = 0.99;
/// How far beyond its range a unit may leave a number, as a share of it.
const BESIDE: f64 = 0.05;
/// Percent go so far.
const PERCENT: f64 = 100.5;

/// Where a position of a joint stands in an observation.
struct Seen<'a> {
    axis: &'a Axis,
    range: [f64; 2],
    place: usize,
}

/// Positions that joints cannot have; without lines where `is_explained` by something else.
pub(super) fn positions(task: &MujocoTask, presented: &Presented<'_>, is_explained: bool) -> Option<Finding> {
    let numbers: Vec<Number> = task.blueprint().observation.iter().flat_map(Reading::numbers).collect();
    let axes = task.model().axes();
    let place = |number: Number| numbers.iter().position(|known| *known == number);
    let seen = axes.iter().filter_map(|axis| {
        Some(Seen { axis, range: axis.range?, place: place(Number::Position(axis.qpos))? })
    });
    let far: Vec<(Seen<'_>, f64)> = seen
        .map(|seen| {
            let share = share(presented.set, seen.place, |number| is_far(number, seen.range));
            (seen, share)
        })
        .filter(|(_, share)| *share > OFTEN)
        .collect();
    let (first, often) = far.first()?;
    let names: Vec<String> = far.iter().map(|(seen, _)| seen.axis.name.clone()).collect();
    let largest = values(presented.set, first.place)
        .fold(0.0_f64, |largest, number| if number.abs() > largest.abs() { number } else { largest });
    let message = format!(
        "recorded positions lie far outside the range of {}: {}; {:.0} % of those of {}, up to {largest:.2}, and it goes from \
         {:.2} to {:.2} {}",
        super::several(far.len(), "joint"),
        first_few(&names),
        100.0 * often,
        first.axis.name,
        first.range[0],
        first.range[1],
        if first.axis.is_hinge { "rad" } else { "m" }
    );
    if presented.set_file.observations.is_of_task() {
        return Some(Finding::warning(message, "set.toml says that they are as the task has them"));
    }
    if is_explained {
        return Some(Finding::error(message, "the recorded steps tell what they are"));
    }
    let far: Vec<Seen<'_>> = far.into_iter().map(|(seen, _)| seen).collect();
    let (mend, words) = guess(task, presented, &numbers, &far);
    let advice = format!(
        "{words}; say in set.toml what the observations are: degrees, percent, an order or a scale; if all this is right, \
         units = \"task\""
    );
    Some(Finding::error(message, advice).mended_by(mend))
}

/// A unit in which positions would be within their ranges, and what is said of it.
fn guess(
    task: &MujocoTask,
    presented: &Presented<'_>,
    numbers: &[Number],
    far: &[Seen<'_>],
) -> (Option<SetFile>, &'static str) {
    let set = presented.recorded;
    let is_as_wide = set.first().is_some_and(|one| one.observations().width() == numbers.len());
    let all_within = |unit: &dyn Fn(f64, &Seen<'_>) -> f64| {
        far.iter()
            .all(|seen| share(set, seen.place, |number| is_far(unit(number, seen), seen.range)) <= OFTEN)
    };
    let degrees = is_as_wide
        && far.iter().all(|seen| seen.axis.is_hinge)
        && all_within(&|number, _| number.to_radians());
    let percent =
        is_as_wide && far.iter().all(|seen| values(set, seen.place).all(|number| number.abs() <= PERCENT));
    let file = |chosen: Vec<Unit>| SetFile {
        observations: Meaning { units: naming::in_units(&chosen), ..Meaning::default() },
        ..SetFile::default()
    };
    if degrees {
        let units = numbers.iter().map(|number| of_hinge(task, set, numbers, *number));
        let words = if percent {
            "in degrees they would be within it, and in percent of the range too"
        } else {
            "in degrees they would be within it"
        };
        return (Some(file(units.collect())), words);
    }
    if percent {
        let is_far = |at: usize| far.iter().any(|seen| seen.place == at);
        let units = (0..numbers.len()).map(|at| if is_far(at) { Unit::Percent } else { Unit::Task });
        return (Some(file(units.collect())), "in percent of the range they would be within it");
    }
    (None, "no usual unit brings them into it")
}

/// Degrees for the position of a hinge, and for its velocity where positions change by as much; else as the task has it.
fn of_hinge(task: &MujocoTask, set: &[Demonstration], numbers: &[Number], number: Number) -> Unit {
    let axes = task.model().axes();
    let hinges = || axes.iter().filter(|axis| axis.is_hinge);
    if hinges().any(|axis| number == Number::Position(axis.qpos)) {
        return Unit::Degrees;
    }
    let place = |number: Number| numbers.iter().position(|known| *known == number);
    let of_axis = hinges().find(|axis| number == Number::Velocity(axis.qvel));
    let places = of_axis.and_then(|axis| Some((place(Number::Position(axis.qpos))?, place(number)?)));
    let Some((position, velocity)) = places else { return Unit::Task };
    let secs = task.specification().control_step_secs;
    let pairs = set.iter().flat_map(|one| {
        (1..one.steps()).map(move |step| {
            let (before, now) = (one.observations().row(step - 1), one.observations().row(step));
            let passed = f64::from(now[position]) - f64::from(before[position]);
            let middle = 0.5 * (f64::from(before[velocity]) + f64::from(now[velocity]));
            (passed / secs, middle)
        })
    });
    let line = straight(&pairs.collect::<Vec<_>>());
    let is_same_unit = line.is_some_and(|line| (0.5..2.0).contains(&line.factor));
    if is_same_unit { Unit::Degrees } else { Unit::Task }
}

/// The unit in which recorded actions are within the ranges of the controls; `None` if there is no usual one.
pub(super) fn unit_of_actions(specification: &Specification, recorded: &[Demonstration]) -> Option<Unit> {
    let ranges = &specification.control_ranges;
    if recorded.first().is_none_or(|one| one.actions().width() != ranges.len()) {
        return None;
    }
    let numbers =
        || recorded.iter().flat_map(|one| one.actions().iter().flat_map(|row| row.iter().zip(ranges)));
    let count = numbers().count() as f64;
    let largest = numbers().fold(0.0_f64, |largest, (number, _)| largest.max(f64::from(number.abs())));
    let are_within = |unit: &dyn Fn(f64) -> f64| {
        let within = numbers().filter(|(number, range)| {
            let (number, [low, high]) = (unit(f64::from(**number)), **range);
            let beside = BESIDE * (high - low);
            number >= low - beside && number <= high + beside
        });
        within.count() as f64 >= NEARLY_ALL * count
    };
    if are_within(&|number| number) {
        Some(Unit::Controls)
    } else if largest > TAU && are_within(&f64::to_radians) {
        Some(Unit::Degrees)
    } else {
        (largest > TAU && largest <= PERCENT).then_some(Unit::Percent)
    }
}

fn is_far(number: f64, [low, high]: [f64; 2]) -> bool {
    let far = (FAR * (high - low)).max(FAR_AT_LEAST);
    number < low - far || number > high + far
}

fn values(set: &[Demonstration], place: usize) -> impl Iterator<Item = f64> {
    set.iter().flat_map(move |one| one.observations().iter().map(move |row| f64::from(row[place])))
}

fn share(set: &[Demonstration], place: usize, holds: impl Fn(f64) -> bool) -> f64 {
    let count = values(set, place).count().max(1);
    values(set, place).filter(|number| holds(*number)).count() as f64 / count as f64
}
