//! Which actions the physics needs to lead from each recorded state to the next, whatever was recorded as actions.
//!
//! Actions of a set that are controls, degrees, negated or in another order are then told by what they are of these: each
//! number of an action is a line over one of the recorded numbers.

use demosift::Result;

use super::dynamics::Episode;
use super::known::{Known, Numbers};
use crate::environment::MujocoEnvironment;

/// Steps of Gauss and Newton: a motor is linear in its control, and most else nearly so.
const STEPS: usize = 4;
/// What the first of them must leave at most of the change of its step, or no action leads there.
const PROMISING: f64 = 0.5;
/// A needed action that leaves less is exact.
const EXACT: f64 = 1e-3;
/// How far an action is moved to see what it does: far enough for f32, near enough to be linear.
const MOVED: f64 = 0.1;
/// What a needed action may leave of the change of its step.
const SOLVED: f64 = 0.05;
/// A needed action that is nearer to ±1 than this may stand for one that was clipped.
const FREE: f64 = 0.98;
/// Steps that a line is drawn through at least.
const FEWEST: usize = 8;
/// The share of the variance of a needed number that a recorded one must tell.
const TOLD: f64 = 0.98;
/// A point that is farther off a line than so many times the middle one is left out.
const FAR_OFF: f64 = 3.0;
/// Ridge beside the mean diagonal of the normal equations: an actuator without effect gets no action.
const RIDGE: f64 = 1e-9;

/// A recorded action and the action that the physics needs in its place.
pub(super) struct Needed {
    pub(super) recorded: Vec<f32>,
    pub(super) action: Vec<f64>,
}

/// A number of the task as a line over one of the set: factor · number + shift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Line {
    /// The place of the number in the set.
    pub(super) from: usize,
    pub(super) factor: f64,
    pub(super) shift: f64,
}

/// States of a step and what they should become.
#[derive(Clone, Copy)]
struct Transition<'a> {
    qpos: &'a [f64],
    qvel: &'a [f64],
    next_qpos: &'a [f64],
    next_qvel: &'a [f64],
    known: &'a Known,
}

/// Steps of the physics that may still be played to find something out.
pub(super) struct Budget {
    pub(super) physics_steps: u64,
}

/// The actions that lead through episodes of two states each, as far as there are such; `None` as soon as more than half of
/// them have none, or nothing may be played any more.
///
/// # Errors
/// `is_bad_input` if a state is not finite.
pub(super) fn needed(
    environment: &mut MujocoEnvironment,
    pairs: &[Episode<'_>],
    budget: &mut Budget,
) -> Result<Option<Vec<Needed>>> {
    let mut found = Vec::new();
    let mut failed = 0;
    for pair in pairs {
        let ((qpos, qvel), (next_qpos, next_qvel)) = (pair.state(0, environment), pair.state(1, environment));
        let transition = Transition { qpos, qvel, next_qpos, next_qvel, known: pair.known };
        let action = match pair.known.is_whole(qpos, qvel) {
            true => solve(environment, transition, budget)?,
            false => None,
        };
        match action {
            Some(action) => found.push(Needed { recorded: pair.actions.row(0).to_vec(), action }),
            None => failed += 1,
        }
        if 2 * failed > pairs.len() || budget.physics_steps == 0 {
            return Ok(None);
        }
    }
    Ok(Some(found))
}

/// The action of a transition; `None` if no action within [−1, 1] leads there.
fn solve(
    environment: &mut MujocoEnvironment,
    transition: Transition<'_>,
    budget: &mut Budget,
) -> Result<Option<Vec<f64>>> {
    let count = environment.task().controls.len();
    let change = length(&transition.change(environment));
    let each = u64::from(environment.task().frame_skip) * (count as u64 + 1);
    let mut action = vec![0.0_f64; count];
    let mut missed = missed_by(environment, transition, &action)?;
    for step in 0..STEPS {
        budget.physics_steps = budget.physics_steps.saturating_sub(each);
        let mut columns = Vec::with_capacity(count);
        for at in 0..count {
            let moved = if action[at] > 0.0 { -MOVED } else { MOVED };
            let mut other = action.clone();
            other[at] += moved;
            let there = missed_by(environment, transition, &other)?;
            let slopes = there.iter().zip(&missed).map(|(there, here)| (there - here) / moved);
            columns.push(slopes.collect::<Vec<f64>>());
        }
        let Some(by) = least_squares(&columns, &missed) else { return Ok(None) };
        action.iter_mut().zip(by).for_each(|(action, by)| *action = (*action - by).clamp(-1.0, 1.0));
        missed = missed_by(environment, transition, &action)?;
        let left = length(&missed);
        if left <= EXACT * change {
            break;
        }
        if step == 0 && (left.is_nan() || left > PROMISING * change) {
            return Ok(None);
        }
    }
    Ok((change > 0.0 && length(&missed) <= SOLVED * change).then_some(action))
}

impl Transition<'_> {
    /// What is missed where nothing moves.
    fn change(&self, environment: &MujocoEnvironment) -> Vec<f64> {
        self.differences(environment, self.qpos, self.qvel)
    }

    /// Positions as velocities, so that both count alike; only numbers that are known.
    fn differences(&self, environment: &MujocoEnvironment, qpos: &[f64], qvel: &[f64]) -> Vec<f64> {
        let secs = environment.task().specification.control_step_secs;
        let of = |numbers: Numbers, now: &[f64], next: &[f64], scale: f64| -> Vec<f64> {
            let pairs = now.iter().zip(next).enumerate();
            let known = pairs.filter(|(at, (_, next))| self.known.has(numbers, *at, **next));
            known.map(|(_, (now, next))| (now - next) * scale).collect()
        };
        let mut all = of(Numbers::Qpos, qpos, self.next_qpos, 1.0 / secs);
        all.extend(of(Numbers::Qvel, qvel, self.next_qvel, 1.0));
        all
    }
}

fn missed_by(
    environment: &mut MujocoEnvironment,
    transition: Transition<'_>,
    action: &[f64],
) -> Result<Vec<f64>> {
    environment.set_state(transition.qpos, transition.qvel)?;
    let action: Vec<f32> = action.iter().map(|number| *number as f32).collect();
    environment.push(&action, environment.task().frame_skip);
    Ok(transition.differences(environment, environment.qpos(), environment.qvel()))
}

fn length(numbers: &[f64]) -> f64 {
    numbers.iter().map(|number| number * number).sum::<f64>().sqrt()
}

/// The x with Σ columnᵢ · xᵢ nearest to the target; `None` if nothing is finite.
fn least_squares(columns: &[Vec<f64>], target: &[f64]) -> Option<Vec<f64>> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let count = columns.len();
    let mut rows: Vec<Vec<f64>> = columns
        .iter()
        .map(|column| {
            let products = columns.iter().map(|other| dot(column, other));
            products.chain([dot(column, target)]).collect()
        })
        .collect();
    let trace: f64 = (0..count).map(|at| rows[at][at]).sum();
    let ridge = RIDGE * trace / count as f64 + f64::MIN_POSITIVE;
    (0..count).for_each(|at| rows[at][at] += ridge);
    // The matrix is symmetric and positive, so no pivot needs to be looked for.
    for pivot in 0..count {
        let row = rows[pivot].clone();
        if !(row[pivot] > 0.0 && row[pivot].is_finite()) {
            return None;
        }
        for (_, other) in rows.iter_mut().enumerate().filter(|(at, _)| *at != pivot) {
            let share = other[pivot] / row[pivot];
            other.iter_mut().zip(&row).skip(pivot).for_each(|(other, row)| *other -= share * row);
        }
    }
    let solution: Vec<f64> = (0..count).map(|at| rows[at][count] / rows[at][at]).collect();
    solution.iter().all(|number| number.is_finite()).then_some(solution)
}

/// Each number of an action as a line over a recorded one; `None` where no recorded number tells it.
pub(super) fn lines(found: &[Needed]) -> Vec<Option<Line>> {
    let Some(first) = found.first() else { return Vec::new() };
    let columns = first.recorded.len();
    let best = |at: usize| {
        let through = |from: usize| {
            let free = found.iter().filter(|one| one.action[at].abs() < FREE);
            let points = free.map(|one| (f64::from(one.recorded[from]), one.action[at])).collect::<Vec<_>>();
            Some((from, robust(points)?)).filter(|(_, line)| line.told >= TOLD)
        };
        // Its own place goes before any other that tells as much.
        let own = (at < columns).then(|| through(at)).flatten();
        own.or_else(|| {
            let all = (0..columns).filter_map(through);
            all.max_by(|(_, one), (_, other)| one.told.total_cmp(&other.told))
        })
    };
    (0..first.action.len())
        .map(|at| best(at).map(|(from, line)| Line { from, factor: line.factor, shift: line.shift }))
        .collect()
}

/// The line of least squares without the points that lie off it by far: steps with contacts need other actions.
fn robust(points: Vec<(f64, f64)>) -> Option<Straight> {
    let first = straight(&points)?;
    let off = |(x, y): &(f64, f64)| (y - first.factor * x - first.shift).abs();
    let mut distances: Vec<f64> = points.iter().map(off).collect();
    distances.sort_by(f64::total_cmp);
    let usual = distances[distances.len() / 2];
    let near: Vec<(f64, f64)> =
        points.iter().copied().filter(|point| off(point) <= FAR_OFF * usual).collect();
    straight(&near).or(Some(first))
}

/// A line through points, and the share of the variance that it tells.
pub(super) struct Straight {
    pub(super) factor: f64,
    pub(super) shift: f64,
    pub(super) told: f64,
}

/// The line of least squares; `None` if there are too few points, or all stand at one place.
pub(super) fn straight(points: &[(f64, f64)]) -> Option<Straight> {
    if points.len() < FEWEST {
        return None;
    }
    let count = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (x_mean, y_mean) = (mean(|point| point.0), mean(|point| point.1));
    let sum =
        |of: &dyn Fn(f64, f64) -> f64| points.iter().map(|(x, y)| of(x - x_mean, y - y_mean)).sum::<f64>();
    let (xx, xy, yy) = (sum(&|x, _| x * x), sum(&|x, y| x * y), sum(&|_, y| y * y));
    if !(xx > 0.0 && yy > 0.0) {
        return None;
    }
    let factor = xy / xx;
    Some(Straight { factor, shift: y_mean - factor * x_mean, told: xy * xy / (xx * yy) })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

    use super::*;

    #[test]
    fn least_squares_solves_what_can_be_solved_and_leaves_alone_what_has_no_effect() {
        let columns = [vec![2.0, 0.0, 1.0], vec![0.0, 3.0, -1.0]];
        let target: Vec<f64> = (0..3).map(|row| 0.5 * columns[0][row] - 2.0 * columns[1][row]).collect();
        let solved = least_squares(&columns, &target).unwrap();
        assert!((solved[0] - 0.5).abs() < 1e-6 && (solved[1] + 2.0).abs() < 1e-6, "{solved:?}");
        let solved = least_squares(&[columns[0].clone(), vec![0.0; 3]], &columns[0]).unwrap();
        assert!((solved[0] - 1.0).abs() < 1e-6 && solved[1].abs() < 1e-6, "{solved:?}");
        assert!(least_squares(&[vec![f64::NAN]], &[1.0]).is_none());
    }

    #[test]
    fn a_line_is_told_with_its_place_even_where_actions_were_clipped() {
        let row = |step: usize| {
            let (one, other) = ((step as f64 * 0.7).sin(), (step as f64 * 1.3).cos());
            let action = vec![(-2.0 * other).clamp(-1.0, 1.0), 0.5 * one + 0.25];
            Needed { recorded: vec![one as f32, other as f32], action }
        };
        let found: Vec<Needed> = (0..60).map(row).collect();
        let lines: Vec<Line> = lines(&found).into_iter().map(Option::unwrap).collect();
        assert_eq!((lines[0].from, lines[1].from), (1, 0));
        assert!((lines[0].factor + 2.0).abs() < 1e-6 && lines[0].shift.abs() < 1e-6, "{lines:?}");
        assert!((lines[1].factor - 0.5).abs() < 1e-6 && (lines[1].shift - 0.25).abs() < 1e-6, "{lines:?}");
    }
}
