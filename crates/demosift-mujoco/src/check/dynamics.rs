//! Whether recorded actions lead through the recorded states, and if not, what else would.
//!
//! Two replays: all actions from the first state, which shows how far an episode drifts, and each action from its own state,
//! which shows whether the physics is the same whatever chaos makes of a small difference.

use demosift::Result;
use demosift::rows::Rows;
use demosift::trajectory::StateLog;
use serde::Serialize;

use super::{Finding, in_first, looked_at};
use crate::environment::MujocoEnvironment;

/// Positions of a replay may differ by this much, rad or m, before it counts as having left the recording.
pub(super) const LEFT: f64 = 0.01;
/// Share of a step's change that a replay may miss: contact solvers start from what no recording holds, and the public HalfCheetah
/// set, recorded elsewhere and in f32, misses up to 3 % of it.
const SAME_PHYSICS: f64 = 0.05;
/// From here on the physics is another one.
const OTHER_PHYSICS: f64 = 0.2;
/// What an explanation may leave of what is missed without it.
const EXPLAINED: f64 = 0.25;
/// Transitions that another explanation is tried on.
const TRIED: usize = 100;
/// Frame skips that are tried.
const SKIPS: u32 = 50;

/// How far a replay of all actions goes from the recorded positions, rad or m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Drift {
    /// The greatest difference of the whole episode; infinite if the replay became unstable.
    pub greatest: f64,
    /// Root of the mean square over all steps and positions.
    pub rms: f64,
    /// The first step at which a position differs by more than 0.01; `None` if none does.
    pub left_at: Option<usize>,
}

/// A recorded episode: T actions and the states that they were taken in.
#[derive(Clone, Copy)]
pub(super) struct Episode<'a> {
    pub(super) actions: &'a Rows,
    pub(super) states: &'a StateLog,
    /// Which positions are not known, and so not compared.
    pub(super) hidden: &'a [usize],
}

impl Taken {
    /// As the environment takes actions.
    fn by(environment: &MujocoEnvironment) -> Self {
        Self { physics_steps: environment.task().frame_skip, shift: 0, as_controls: false }
    }
}

impl Episode<'_> {
    fn state(&self, step: usize, environment: &MujocoEnvironment) -> (&[f64], &[f64]) {
        let (nq, nv) = (environment.qpos().len(), environment.qvel().len());
        (&self.states.qpos[step * nq..][..nq], &self.states.qvel[step * nv..][..nv])
    }
}

/// A way in which actions may have been taken.
#[derive(Clone, Copy)]
struct Taken {
    physics_steps: u32,
    /// Which action leads from a state to the next: that of the state plus this.
    shift: isize,
    /// Whether recorded actions are controls, not yet scaled to [−1, 1].
    as_controls: bool,
}

/// Replays all actions from the first recorded state.
///
/// # Errors
/// `is_bad_input` if a state is not finite.
pub(super) fn drift(environment: &mut MujocoEnvironment, episode: Episode<'_>) -> Result<Drift> {
    let (qpos, qvel) = episode.state(0, environment);
    let (qpos, qvel) = (qpos.to_vec(), qvel.to_vec());
    environment.set_state(&qpos, &qvel)?;
    let skip = environment.task().frame_skip;
    let mut drift = Drift { greatest: 0.0, rms: 0.0, left_at: None };
    let (mut squares, mut count) = (0.0, 0);
    for step in 1..episode.actions.len() {
        environment.push(episode.actions.row(step - 1), skip);
        if environment.is_unstable() {
            return Ok(Drift { greatest: f64::INFINITY, left_at: drift.left_at.or(Some(step)), ..drift });
        }
        let (recorded, _) = episode.state(step, environment);
        let known = environment.qpos().iter().zip(recorded).enumerate();
        let known = known.filter(|(at, _)| !episode.hidden.contains(at));
        let differences = known.map(|(_, (now, then))| (now - then).abs());
        let largest = differences.clone().fold(0.0, f64::max);
        squares += differences.map(|difference| difference * difference).sum::<f64>();
        count += recorded.len() - episode.hidden.len();
        drift.greatest = drift.greatest.max(largest);
        drift.left_at = drift.left_at.or((largest > LEFT).then_some(step));
    }
    drift.rms = (squares / count.max(1) as f64).sqrt();
    Ok(drift)
}

/// What each episode's actions miss of the recorded changes, each taken in its own recorded state; `None` for an episode of
/// one state, or in which nothing moves. Of a large set only the first steps are played.
///
/// # Errors
/// `is_bad_input` if a state is not finite.
pub(super) fn misses(
    environment: &mut MujocoEnvironment,
    episodes: &[Episode<'_>],
) -> Result<Vec<Option<f64>>> {
    let taken = Taken::by(environment);
    let most = first_steps(episodes).unwrap_or(usize::MAX);
    let each = episodes.iter().map(|episode| missed(environment, &[*episode], taken, most));
    each.collect()
}

fn first_steps(episodes: &[Episode<'_>]) -> Option<usize> {
    looked_at(episodes.iter().map(|episode| episode.actions.len()))
}

/// Positions that stand still while velocities do not, or the other way round: one of the two was not recorded.
pub(super) fn not_recorded(environment: &MujocoEnvironment, episodes: &[Episode<'_>]) -> Vec<Finding> {
    let (nq, nv) = (environment.qpos().len(), environment.qvel().len());
    let stands = |episode: &&Episode<'_>| {
        let known: Vec<usize> = (0..nq).filter(|at| !episode.hidden.contains(at)).collect();
        let first = &episode.states.qpos[..nq];
        episode.states.qpos.chunks_exact(nq).all(|row| known.iter().all(|at| row[*at] == first[*at]))
    };
    let is_slow = |episode: &&Episode<'_>| episode.states.qvel.iter().all(|velocity| *velocity == 0.0);
    // Of one state nothing can be said.
    let long = episodes.iter().filter(|episode| nq > 0 && nv > 0 && episode.states.qvel.len() > nv);
    let count = episodes.len();
    let still = long.clone().filter(|episode| stands(episode) && !is_slow(episode)).count();
    let slow = long.filter(|episode| !stands(episode) && is_slow(episode)).count();
    let found = [
        (still, "positions never change in the recording", "though velocities are not 0", "positions"),
        (slow, "velocities are 0 all along in the recording", "though positions change", "velocities"),
    ];
    let found = found.into_iter().filter(|(number, ..)| *number > 0);
    found
        .map(|(number, what, though, which)| {
            Finding::error(
                format!("{what} of {number} of {}, {though}", super::several(count, "demonstration")),
                format!("see whether the recorder wrote the {which} down at every step"),
            )
        })
        .collect()
}

/// Whether actions lead to the recorded states, and if not, why; `misses` are those of the episodes, in order.
///
/// # Errors
/// As [`misses`].
pub(super) fn judge(
    environment: &mut MujocoEnvironment,
    episodes: &[Episode<'_>],
    misses: &[Option<f64>],
) -> Result<Option<Finding>> {
    let known: Vec<f64> = misses.iter().flatten().copied().collect();
    let largest = known.iter().copied().fold(0.0, f64::max);
    if known.is_empty() {
        return Ok(None);
    }
    if is_same_physics(largest) {
        let message = format!(
            "each recorded action leads to the next recorded state (it misses at most {} of a step's change){}",
            percent_missed(largest),
            in_first(first_steps(episodes))
        );
        return Ok(Some(Finding::fine(message)));
    }
    let wrong: Vec<usize> =
        (0..misses.len()).filter(|id| misses[*id].is_some_and(|missed| !is_same_physics(missed))).collect();
    let odd: Vec<Episode<'_>> = wrong.iter().map(|id| episodes[*id]).collect();
    let whose = if wrong.len() == known.len() {
        "the demonstrations".to_owned()
    } else {
        let ids: Vec<String> = wrong.iter().map(usize::to_string).collect();
        format!("{} of {} demonstrations ({})", wrong.len(), known.len(), super::first_few(&ids))
    };
    let message = format!(
        "the actions of {whose} do not lead to the next recorded state: they miss up to {} of a step's change{}",
        percent_missed(largest),
        in_first(first_steps(episodes))
    );
    let advice = match explanation(environment, &odd)? {
        Some(words) => words,
        None if wrong.len() < known.len() => {
            "these were recorded with another model or body than the others; that may be what you want to find out about"
                .to_owned()
        }
        None => "the model is another one than that of the recording: compare masses, gears, ctrlrange, damping and timestep"
            .to_owned(),
    };
    let other = largest >= OTHER_PHYSICS && wrong.len() == known.len();
    Ok(Some(if other { Finding::error(message, advice) } else { Finding::warning(message, advice) }))
}

/// Whether what is missed can be put down to what no recording holds.
pub(super) fn is_same_physics(missed: f64) -> bool {
    missed <= SAME_PHYSICS
}

/// A share with a decimal; what is many times over says no more with all its digits.
pub fn percent_missed(share: f64) -> String {
    if share <= 10.0 { format!("{:.1} %", share * 100.0) } else { "over 1000 %".to_owned() }
}

/// What of the change of a step is missed, root mean square over root mean square, of positions or of velocities: the larger.
///
/// 0 is the same physics; 1 is as good as no prediction at all.
/// What never changes has no share of its change; [`not_recorded`] speaks of it.
fn missed(
    environment: &mut MujocoEnvironment,
    episodes: &[Episode<'_>],
    taken: Taken,
    at_most: usize,
) -> Result<Option<f64>> {
    let mut error = [0.0; 2];
    let mut change = [0.0; 2];
    let mut transitions = 0;
    for episode in episodes {
        for step in 0..episode.actions.len().saturating_sub(1) {
            let Some(number) = step.checked_add_signed(taken.shift).filter(|at| *at < episode.actions.len())
            else {
                continue;
            };
            if transitions == at_most {
                break;
            }
            transitions += 1;
            let (qpos, qvel) = episode.state(step, environment);
            environment.set_state(qpos, qvel).map_err(|error| error.during(&format!("step {step}")))?;
            environment.push(&action(environment, episode.actions.row(number), taken), taken.physics_steps);
            let (next_qpos, next_qvel) = episode.state(step + 1, environment);
            let now = [environment.qpos(), environment.qvel()];
            for (kind, (before, after)) in [(qpos, next_qpos), (qvel, next_qvel)].into_iter().enumerate() {
                let hidden = if kind == 0 { episode.hidden } else { &[] };
                error[kind] += squared_distance(now[kind], after, hidden);
                change[kind] += squared_distance(before, after, hidden);
            }
        }
    }
    let shares = error.into_iter().zip(change).filter(|(_, change)| *change > 0.0);
    Ok(shares.map(|(error, change)| (error / change).sqrt()).reduce(f64::max))
}

/// The action to take in this environment for what was recorded.
fn action(environment: &MujocoEnvironment, recorded: &[f32], taken: Taken) -> Vec<f32> {
    if !taken.as_controls {
        return recorded.to_vec();
    }
    let controls = environment.task().controls.iter().zip(recorded);
    controls
        .map(|(control, value)| ((f64::from(*value) - control.middle) / control.half_range) as f32)
        .collect()
}

fn squared_distance(a: &[f64], b: &[f64], hidden: &[usize]) -> f64 {
    let known = a.iter().zip(b).enumerate().filter(|(at, _)| !hidden.contains(at));
    known.map(|(_, (a, b))| (a - b) * (a - b)).sum()
}

/// What would make the recorded actions lead to the recorded states, if something that is tried does.
fn explanation(environment: &mut MujocoEnvironment, episodes: &[Episode<'_>]) -> Result<Option<String>> {
    let as_it_is = Taken::by(environment);
    let timestep = environment.model().timestep_secs();
    let Some(missed_now) = missed(environment, episodes, as_it_is, TRIED)? else { return Ok(None) };
    let late = "an action belongs to the state that it was taken in";
    let mut tried = vec![
        (Taken { shift: 1, ..as_it_is }, format!("the recording has each action one step late: {late}")),
        (Taken { shift: -1, ..as_it_is }, format!("the recording has each action one step early: {late}")),
        (
            Taken { as_controls: true, ..as_it_is },
            "the recorded actions are controls in the units of ctrlrange: scale them to [-1, 1], or set ctrlrange to the \
             range that was meant"
                .to_owned(),
        ),
    ];
    tried.extend((1..=SKIPS).filter(|skip| *skip != as_it_is.physics_steps).map(|skip| {
        let step = f64::from(skip) * timestep;
        let words = format!("it was recorded with frame_skip = {skip}, a control step of {step:.4} s");
        (Taken { physics_steps: skip, ..as_it_is }, words)
    }));
    let mut best: Option<(f64, String)> = None;
    for (taken, words) in tried {
        let Some(missed) = missed(environment, episodes, taken, TRIED)? else { continue };
        if missed < EXPLAINED * missed_now && best.as_ref().is_none_or(|(least, _)| missed < *least) {
            best = Some((missed, words));
        }
    }
    Ok(best
        .map(|(missed, words)| format!("it seems that {words} (then they miss {})", percent_missed(missed))))
}
