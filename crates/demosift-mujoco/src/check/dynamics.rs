//! Whether recorded actions lead through the recorded states, and if not, what else would.
//!
//! Two replays: all actions from the first state, which shows how far an episode drifts, and each action from its own state,
//! which shows whether the physics is the same whatever chaos makes of a small difference.

use demosift::Result;
use demosift::data::trajectory::StateLog;
use demosift::math::rows::Rows;
use serde::Serialize;

use super::explained::{Explained, percent_missed};
use super::known::{Known, Numbers};
use super::{Finding, LOOKED_AT, in_first, looked_at};
use crate::environment::MujocoEnvironment;
use crate::mujoco_task::MujocoTask;

/// Positions of a replay may differ by this much, rad or m, before it counts as having left the recording.
pub(super) const LEFT: f64 = 0.01;
/// Share of its change that a typical step may miss in the same physics: recordings are in f32, and contact solvers start from
/// what no recording holds. A public HalfCheetah set, recorded with another version of the engine, misses 1 %.
const SAME_PHYSICS: f64 = 0.05;
/// Up to here another version of the engine, with other contacts, may miss as much of a typical step.
const OTHER_CONTACTS: f64 = 0.2;
/// From here on no contacts explain what a typical step misses.
const OTHER_PHYSICS: f64 = 0.4;
/// A change of less than this share of the usual one is rest, of which no share is missed.
const AT_REST: f64 = 0.1;
/// What an explanation may leave of what is missed without it.
const EXPLAINED: f64 = 0.25;
/// Transitions that another explanation is tried on.
const TRIED: usize = 100;
/// Frame skips that are tried.
const SKIPS: u32 = 50;

/// How far a replay of all actions goes from the recorded positions, rad or m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
    /// Which numbers of the states are known; the others are not compared.
    pub(super) known: &'a Known,
}

/// What the actions of an episode miss of the recorded changes: 0 is the same physics, 1 as good as no prediction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Missed {
    /// Of all steps together, root mean square over root mean square, of positions or of velocities: the larger.
    pub(super) share: f64,
    /// Of the median step among those in which something moves, of positions or of velocities: the larger.
    pub(super) typical: f64,
}

impl Taken {
    /// As the environment takes actions.
    fn by(environment: &MujocoEnvironment) -> Self {
        Self { physics_steps: environment.task().frame_skip, shift: 0 }
    }
}

impl Episode<'_> {
    /// Its state at a step, `[nq]` and `[nv]`.
    pub(super) fn state(&self, step: usize, environment: &MujocoEnvironment) -> (&[f64], &[f64]) {
        let (nq, nv) = (environment.qpos().len(), environment.qvel().len());
        (&self.states.qpos[step * nq..][..nq], &self.states.qvel[step * nv..][..nv])
    }

    /// How far `a` is from `b` in the numbers that are known of the recorded `b`.
    fn distance(&self, a: &[f64], b: &[f64], numbers: Numbers) -> f64 {
        let pairs = a.iter().zip(b).enumerate().filter(|(at, (_, b))| self.known.has(numbers, *at, **b));
        pairs.map(|(_, (a, b))| (a - b) * (a - b)).sum::<f64>().sqrt()
    }
}

/// A way in which actions may have been taken.
#[derive(Clone, Copy)]
struct Taken {
    physics_steps: u32,
    /// Which action leads from a state to the next: that of the state plus this.
    shift: isize,
}

/// Replays all actions from the first recorded state; `None` where that is not wholly known.
///
/// # Errors
/// `is_bad_input` if a state is not finite.
pub(super) fn drift(environment: &mut MujocoEnvironment, episode: Episode<'_>) -> Result<Option<Drift>> {
    let (qpos, qvel) = episode.state(0, environment);
    if !episode.known.is_whole(qpos, qvel) {
        return Ok(None);
    }
    let (qpos, qvel) = (qpos.to_vec(), qvel.to_vec());
    environment.set_state(&qpos, &qvel)?;
    let skip = environment.task().frame_skip;
    let mut drift = Drift { greatest: 0.0, rms: 0.0, left_at: None };
    let (mut squares, mut count) = (0.0, 0);
    for step in 1..episode.actions.len() {
        environment.push(episode.actions.row(step - 1), skip);
        if environment.is_unstable() {
            let left_at = drift.left_at.or(Some(step));
            return Ok(Some(Drift { greatest: f64::INFINITY, left_at, ..drift }));
        }
        let (recorded, _) = episode.state(step, environment);
        let pairs = environment.qpos().iter().zip(recorded).enumerate();
        let known = pairs.filter(|(at, (_, then))| episode.known.has(Numbers::Qpos, *at, **then));
        let differences = known.map(|(_, (now, then))| (now - then).abs());
        let largest = differences.clone().fold(0.0, f64::max);
        count += differences.clone().count();
        squares += differences.map(|difference| difference * difference).sum::<f64>();
        drift.greatest = drift.greatest.max(largest);
        drift.left_at = drift.left_at.or((largest > LEFT).then_some(step));
    }
    drift.rms = (squares / count.max(1) as f64).sqrt();
    Ok(Some(drift))
}

/// What each episode's actions miss of the recorded changes, each taken in its own recorded state; `None` for an episode of
/// one state, in which nothing moves, or of which no state is wholly known. Of a large set only the first steps are played.
///
/// # Errors
/// `is_bad_input` if a state is not finite.
pub(super) fn misses(
    environment: &mut MujocoEnvironment,
    episodes: &[Episode<'_>],
) -> Result<Vec<Option<Missed>>> {
    let taken = Taken::by(environment);
    let most = first_steps(episodes).unwrap_or(usize::MAX);
    let each = episodes.iter().map(|episode| missed(environment, &[*episode], taken, most));
    each.collect()
}

/// Why no recorded step can be played by itself, where positions and velocities do not decide how a state goes on.
pub(super) fn undecided(task: &MujocoTask) -> Option<Finding> {
    let more = task.model().hidden_state()?;
    Some(Finding::fine(format!(
        "a state of the model also holds {more}, which no recording tells, so no recorded step is played by itself: what an \
         action leads to is not compared"
    )))
}

fn first_steps(episodes: &[Episode<'_>]) -> Option<usize> {
    looked_at(episodes.iter().map(|episode| episode.actions.len()), LOOKED_AT)
}

/// Positions that stand still while velocities do not, or the other way round: one of the two was not recorded.
pub(super) fn not_recorded(environment: &MujocoEnvironment, episodes: &[Episode<'_>]) -> Vec<Finding> {
    let (nq, nv) = (environment.qpos().len(), environment.qvel().len());
    let stands = |episode: &&Episode<'_>| {
        let known: Vec<usize> = (0..nq).filter(|at| !episode.known.hidden.contains(at)).collect();
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

/// What a typical step of episodes misses, if any of their states is known.
///
/// # Errors
/// As [`misses`].
pub(super) fn typically_missed(
    environment: &mut MujocoEnvironment,
    episodes: &[Episode<'_>],
) -> Result<Option<f64>> {
    let taken = Taken::by(environment);
    Ok(missed(environment, episodes, taken, usize::MAX)?.map(|missed| missed.typical))
}

/// Whether actions lead to the recorded states, and if not, why; `misses` are those of the episodes, in order, and `units` what
/// is wrong with their numbers, if that explains it.
///
/// What a typical step misses decides, since the same robot recorded with older contacts misses much in the few steps in
/// which it lands, the more the wilder it moves.
///
/// # Errors
/// As [`misses`].
pub(super) fn judge(
    environment: &mut MujocoEnvironment,
    episodes: &[Episode<'_>],
    misses: &[Option<Missed>],
    units: Option<Explained>,
) -> Result<Option<Finding>> {
    let known: Vec<Missed> = misses.iter().flatten().copied().collect();
    if known.is_empty() {
        return Ok(None);
    }
    let first = in_first(first_steps(episodes));
    let most = largest(known.iter().map(|missed| missed.share));
    let typical = largest(known.iter().map(|missed| missed.typical));
    if is_same_physics(typical) {
        let landings = if is_same_physics(most) {
            String::new()
        } else {
            format!(
                "; some steps miss more, up to {} of the change of an episode in root mean square, as contacts of another \
                 version of the engine do",
                percent_missed(most)
            )
        };
        return Ok(Some(Finding::fine(format!(
            "each recorded action leads to the next recorded state (a typical step misses at most {} of its \
             change){first}{landings}",
            percent_missed(typical)
        ))));
    }
    let beyond = |bound: f64| -> Vec<usize> {
        (0..misses.len()).filter(|id| misses[*id].is_some_and(|missed| missed.typical > bound)).collect()
    };
    // Where some are far off, they are what is wrong, and not those that are nearly right.
    let far = beyond(OTHER_CONTACTS);
    let wrong = if far.is_empty() || far.len() == known.len() { beyond(SAME_PHYSICS) } else { far };
    let all_are = wrong.len() == known.len();
    let whose = if all_are {
        "the demonstrations".to_owned()
    } else {
        let ids: Vec<String> = wrong.iter().map(usize::to_string).collect();
        format!("{} of {} demonstrations ({})", wrong.len(), known.len(), super::first_few(&ids))
    };
    let odd: Vec<Episode<'_>> = wrong.iter().map(|id| episodes[*id]).collect();
    let other = explanation(environment, &odd)?;
    // Of two explanations that leave hardly anything, that which can be mended.
    let explained = match (units.filter(|_| all_are), other) {
        (Some(units), Some(other)) if !is_same_physics(units.missed) && other.missed < units.missed => {
            Some(other)
        }
        (units, other) => units.or(other),
    };
    let least =
        wrong.iter().filter_map(|id| misses[*id]).map(|missed| missed.typical).fold(f64::INFINITY, f64::min);
    let how =
        if explained.is_none() && typical <= OTHER_CONTACTS { "lead only nearly" } else { "do not lead" };
    let message = format!(
        "the actions of {whose} {how} to the next recorded state: a typical step misses {} of its change{first}",
        if percent_missed(least) == percent_missed(typical) {
            percent_missed(typical)
        } else {
            format!("{} to {}", percent_missed(least), percent_missed(typical))
        }
    );
    let is_other = all_are && (explained.is_some() && typical > OTHER_CONTACTS || least > OTHER_PHYSICS);
    let advice = match &explained {
        Some(explained) => explained.in_words(),
        None => what_it_may_be(typical, least, all_are).to_owned(),
    };
    let finding = if is_other { Finding::error(message, advice) } else { Finding::warning(message, advice) };
    Ok(Some(finding.mended_by(explained.and_then(|explained| explained.mend))))
}

/// What may be behind shares of typical steps that are missed, of the demonstrations that miss some.
fn what_it_may_be(most: f64, least: f64, all_are: bool) -> &'static str {
    if most <= OTHER_CONTACTS {
        "so little may come of contacts, joint limits or damping that differ between versions of the engine: the same body, \
         and imitating it makes sense"
    } else if !all_are && least > OTHER_CONTACTS {
        "these were recorded with another model or body than the others; that may be what you want to find out about"
    } else if least > OTHER_PHYSICS {
        "the model is another one than that of the recording: compare masses, gears, ctrlrange, damping and timestep"
    } else {
        "contacts that differ much, as between versions of the engine, or another model: compare friction and contact \
         parameters, masses, gears, damping and timestep"
    }
}

fn largest(shares: impl Iterator<Item = f64>) -> f64 {
    shares.fold(0.0, f64::max)
}

/// Whether what is missed of a typical step can be put down to what no recording holds.
pub(super) fn is_same_physics(missed: f64) -> bool {
    missed <= SAME_PHYSICS
}

/// Whether no contacts explain what is missed of a typical step.
pub(super) fn is_other_physics(missed: f64) -> bool {
    missed > OTHER_PHYSICS
}

/// Whether it can be put down to that or to another version of the engine.
pub(super) fn is_same_body(missed: f64) -> bool {
    missed <= OTHER_CONTACTS
}

/// What is missed of the change of a step, and the change, each as a distance.
#[derive(Clone, Copy)]
struct Step {
    missed: f64,
    change: f64,
}

/// What of the change of steps is missed, if something changes.
///
/// What never changes has no share of its change; [`not_recorded`] speaks of it.
fn missed(
    environment: &mut MujocoEnvironment,
    episodes: &[Episode<'_>],
    taken: Taken,
    at_most: usize,
) -> Result<Option<Missed>> {
    let mut steps = [Vec::new(), Vec::new()];
    for episode in episodes {
        for step in 0..episode.actions.len().saturating_sub(1) {
            let Some(number) = step.checked_add_signed(taken.shift).filter(|at| *at < episode.actions.len())
            else {
                continue;
            };
            let (qpos, qvel) = episode.state(step, environment);
            if !episode.known.is_whole(qpos, qvel) {
                continue;
            }
            if steps[0].len() == at_most {
                break;
            }
            environment.set_state(qpos, qvel).map_err(|error| error.during(&format!("step {step}")))?;
            environment.push(episode.actions.row(number), taken.physics_steps);
            let (next_qpos, next_qvel) = episode.state(step + 1, environment);
            let distance = |a: &[f64], b: &[f64], numbers| episode.distance(a, b, numbers);
            for (to, (numbers, now, before, after)) in steps.iter_mut().zip([
                (Numbers::Qpos, environment.qpos(), qpos, next_qpos),
                (Numbers::Qvel, environment.qvel(), qvel, next_qvel),
            ]) {
                to.push(Step {
                    missed: distance(now, after, numbers),
                    change: distance(before, after, numbers),
                });
            }
        }
    }
    let larger = |of: fn(&[Step]) -> Option<f64>| steps.iter().filter_map(|steps| of(steps)).reduce(f64::max);
    Ok(larger(share).zip(larger(typical)).map(|(share, typical)| Missed { share, typical }))
}

fn share(steps: &[Step]) -> Option<f64> {
    let change = root_mean_square(steps.iter().map(|step| step.change));
    (change > 0.0).then(|| root_mean_square(steps.iter().map(|step| step.missed)) / change)
}

/// Of the median step among those that move.
fn typical(steps: &[Step]) -> Option<f64> {
    let usual = root_mean_square(steps.iter().map(|step| step.change));
    let moves = steps.iter().filter(|step| step.change > AT_REST * usual);
    let mut shares: Vec<f64> = moves.map(|step| step.missed / step.change).collect();
    shares.sort_by(f64::total_cmp);
    shares.get(shares.len() / 2).copied()
}

fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value * value, count + 1));
    (sum / f64::from(count.max(1))).sqrt()
}

/// What would make the recorded actions lead to the recorded states, if another time does: actions that are late or early, or
/// another frame skip.
///
/// # Errors
/// As [`misses`].
fn explanation(environment: &mut MujocoEnvironment, episodes: &[Episode<'_>]) -> Result<Option<Explained>> {
    let as_it_is = Taken::by(environment);
    let late = "an action belongs to the state that it was taken in";
    let mut tried = vec![
        (Taken { shift: 1, ..as_it_is }, format!("the recording has each action one step late: {late}")),
        (Taken { shift: -1, ..as_it_is }, format!("the recording has each action one step early: {late}")),
    ];
    tried.extend(other_skips(environment));
    best_of(environment, episodes, tried)
}

/// The frame skip that makes the recorded actions lead to the recorded states, if another one does.
///
/// # Errors
/// As [`misses`].
pub(super) fn other_skip(
    environment: &mut MujocoEnvironment,
    episodes: &[Episode<'_>],
) -> Result<Option<Explained>> {
    let tried = other_skips(environment);
    best_of(environment, episodes, tried)
}

fn other_skips(environment: &MujocoEnvironment) -> Vec<(Taken, String)> {
    let as_it_is = Taken::by(environment);
    let timestep = environment.model().timestep_secs();
    let others = (1..=SKIPS).filter(|skip| *skip != as_it_is.physics_steps);
    let all = others.map(|skip| {
        let step = f64::from(skip) * timestep;
        let words = format!("it was recorded with frame_skip = {skip}, a control step of {step:.4} s");
        (Taken { physics_steps: skip, ..as_it_is }, words)
    });
    all.collect()
}

/// What explains most, if it explains enough: little is left of what is missed, and no more than contacts explain.
fn best_of(
    environment: &mut MujocoEnvironment,
    episodes: &[Episode<'_>],
    tried: Vec<(Taken, String)>,
) -> Result<Option<Explained>> {
    let as_it_is = Taken::by(environment);
    let Some(missed_now) = missed(environment, episodes, as_it_is, TRIED)? else { return Ok(None) };
    let mut best: Option<Explained> = None;
    for (taken, words) in tried {
        let Some(missed) = missed(environment, episodes, taken, TRIED)? else { continue };
        let missed = missed.typical;
        let is_enough = missed < EXPLAINED * missed_now.typical && is_same_body(missed);
        if is_enough && best.as_ref().is_none_or(|best| missed < best.missed) {
            best = Some(Explained { words, missed, mend: None });
        }
    }
    Ok(best)
}
