//! What becomes of recorded demonstrations in a task: sizes, actions, observations, and their actions played again.

use demosift::Result;
use demosift::data::demonstration::Demonstration;
use demosift::data::trajectory::StateLog;
use demosift::world::environment::Task as _;
use demosift::world::heuristic::Score;

use super::comparison::{Compared, Recorded, StatesFrom};
use super::explained::Explained;
use super::fit::{self, Physics};
use super::known::{self, Known};
use super::presented::Presented;
use super::{Finding, LOOKED_AT, Severity, columns, dynamics, lengths, mending, several};
use crate::mujoco_task::MujocoTask;
use crate::replay;

/// Holds demonstrations, however many, against a task; `states` are the simulator's of each demonstration, where the set has them.
///
/// # Errors
/// If MuJoCo has no memory for a simulation. What is wrong with the set is a finding.
pub fn compare(
    task: &MujocoTask,
    set: &[Demonstration],
    states: Option<&[StateLog]>,
) -> Result<(Recorded, Vec<Finding>)> {
    compare_presented(task, &Presented::plain(set, states))
}

/// The same with what the set and the user say of its numbers.
///
/// # Errors
/// As [`compare`].
pub fn compare_presented(task: &MujocoTask, presented: &Presented<'_>) -> Result<(Recorded, Vec<Finding>)> {
    let Presented { set, states, .. } = *presented;
    let specification = task.specification();
    let compared = set.iter().map(|demonstration| {
        let numbers = demonstration.actions().flat();
        Compared {
            steps: demonstration.steps(),
            outside: numbers.iter().filter(|number| number.abs() > 1.0).count(),
            largest_action: numbers.iter().fold(0.0, |largest, number| f64::from(number.abs()).max(largest)),
            missed: None,
            typically_missed: None,
            drift: None,
            score: None,
            succeeded: None,
        }
    });
    let mut recorded = Recorded { states: StatesFrom::Nowhere, demonstrations: compared.collect() };
    if let Some(finding) = other_sizes(set) {
        return Ok((recorded, vec![finding]));
    }
    let fits = observation_size(set) == specification.observation_size;
    let clipping = if fits { known::clipping(task, set) } else { known::Clipping::default() };
    let from_observations = match states {
        None if fits => known::states_in_observations(task, set, &clipping),
        _ => None,
    };
    recorded.states = match (states, &from_observations) {
        (Some(_), _) => StatesFrom::Recording,
        (None, Some(_)) => StatesFrom::Observations,
        (None, None) => StatesFrom::Nowhere,
    };
    let mut findings = Vec::new();
    if states.is_none() {
        findings.extend(clipping.findings);
    }
    let (states, known) = match (states, &from_observations) {
        (Some(states), _) => (states, Known::all(task)),
        (None, Some(made)) => (&made.states[..], made.known.clone()),
        (None, None) => {
            findings.extend(lengths::unexplained(task, &recorded));
            findings.push(Finding::warning(
                "the set holds no states of the simulator, so nothing is played again and no observation is checked",
                "record `qpos` and `qvel` beside the observations, if you can: docs/formats.md says where",
            ));
            findings.extend(sizes(task, set, false));
            findings.extend(beside(task, presented, &Physics::default()));
            return Ok((recorded, findings));
        }
    };
    let replayed = Replayed { states, known: &known };
    let mut physics = Physics::default();
    match replay_all(task, presented, replayed, &mut recorded) {
        Ok(Replays { findings: more, explained }) => {
            findings.extend(sizes(task, set, true));
            findings.extend(more);
            let missed = recorded.demonstrations.iter().map(|one| one.typically_missed);
            let missed = missed.collect::<Option<Vec<_>>>().and_then(largest);
            physics = Physics { missed, explained, ..Physics::default() };
        }
        Err(error) => {
            findings.extend(lengths::unexplained(task, &recorded));
            findings.extend(sizes(task, set, false));
            findings.push(Finding::error(
                error.to_string(),
                "the states are of another model: see whether the set was recorded in this one",
            ));
        }
    }
    physics.are_observations_explained =
        findings.iter().any(|one| one.lines.as_ref().is_some_and(|lines| lines.contains("observations.")));
    findings.extend(beside(task, presented, &physics));
    Ok((recorded, findings))
}

fn largest(missed: Vec<f64>) -> Option<f64> {
    missed.into_iter().reduce(f64::max)
}

/// What [`fit::fit`] finds too, as far as sizes allow.
fn beside(task: &MujocoTask, presented: &Presented<'_>, physics: &Physics) -> Vec<Finding> {
    let specification = task.specification();
    let fits = observation_size(presented.set) == specification.observation_size;
    fit::beside(specification, Some(task).filter(|_| fits), presented, physics)
}

fn observation_size(set: &[Demonstration]) -> usize {
    set.first().map_or(0, |one| one.observations().width())
}

fn action_size(set: &[Demonstration]) -> usize {
    set.first().map_or(0, |one| one.actions().width())
}

/// Whether there are demonstrations at all, all of the same sizes.
fn other_sizes(set: &[Demonstration]) -> Option<Finding> {
    let advice = "see what was recorded; `demosift inspect` shows it";
    if set.is_empty() {
        return Some(Finding::error("the set holds no demonstration", advice));
    }
    let (observed, acted) = (observation_size(set), action_size(set));
    let fits = |one: &Demonstration| (one.observations().width(), one.actions().width()) == (observed, acted);
    let other = set.iter().position(|one| !fits(one))?;
    let (observed_there, acted_there) = (set[other].observations().width(), set[other].actions().width());
    Some(Finding::error(
        format!(
            "demonstration {other} has {observed_there} observed numbers and {acted_there} actions, but demonstration 0 has \
             {observed} and {acted}"
        ),
        advice,
    ))
}

/// Where states were replayed, [`columns::compare`] has said more of observations of another size.
fn sizes(task: &MujocoTask, set: &[Demonstration], replayed: bool) -> Vec<Finding> {
    let specification = task.specification();
    let sizes = [
        ("an observation", observation_size(set), specification.observation_size, "`observation`"),
        ("an action", action_size(set), specification.action_size, "the model's actuators"),
    ];
    let wrong = sizes.into_iter().filter(|(_, found, wanted, _)| found != wanted);
    if wrong.clone().next().is_none() {
        return vec![Finding::fine(format!(
            "{} with {} and {} fit the task",
            several(set.len(), "demonstration"),
            several(observation_size(set), "observed number"),
            several(action_size(set), "action")
        ))];
    }
    wrong
        .filter(|(_, _, _, whose)| !replayed || *whose != "`observation`")
        .map(|(what, found, wanted, whose)| {
            let message =
                format!("{what} of the set has {}, and one of the task {wanted}", several(found, "number"));
            let parts = if whose == "`observation`" { format!(" ({})", widths(task)) } else { String::new() };
            Finding::error(
                message,
                format!(
                    "change {whose}{parts}, or name other columns of the set; `demosift inspect` shows them"
                ),
            )
        })
        .collect()
}

/// Such as `qpos 2, qvel 2, phase 1`.
fn widths(task: &MujocoTask) -> String {
    let mut widths: Vec<(&str, usize)> = Vec::new();
    for reading in &task.blueprint().observation {
        match widths.last_mut() {
            Some((key, width)) if *key == reading.key() => *width += reading.width(),
            _ => widths.push((reading.key(), reading.width())),
        }
    }
    widths.iter().map(|(key, width)| format!("{key} {width}")).collect::<Vec<_>>().join(", ")
}

/// States of each demonstration, and which of their numbers are known.
#[derive(Clone, Copy)]
struct Replayed<'a> {
    states: &'a [StateLog],
    known: &'a Known,
}

/// What replays found.
struct Replays {
    findings: Vec<Finding>,
    /// What explains that actions lead elsewhere, if something does.
    explained: Option<Explained>,
}

/// Fills in what the states tell, as far as sizes allow.
fn replay_all(
    task: &MujocoTask,
    presented: &Presented<'_>,
    Replayed { states, known }: Replayed<'_>,
    recorded: &mut Recorded,
) -> Result<Replays> {
    let set = presented.set;
    let mut findings = Vec::new();
    let mut same_physics = false;
    for (id, (demonstration, states)) in set.iter().zip(states).enumerate() {
        replay::Replay::new(task, states, demonstration.steps())
            .map_err(|error| error.during(&format!("demonstration {id}")))?;
    }
    if recorded.states == StatesFrom::Recording {
        findings.push(columns::compare(task, &fit::observed(presented, states), LOOKED_AT)?);
    } else {
        findings.push(known.found(states));
    }
    if action_size(set) != task.specification().action_size {
        findings.extend(lengths::unexplained(task, recorded));
        return Ok(Replays { findings, explained: None });
    }
    let episodes: Vec<dynamics::Episode<'_>> = set
        .iter()
        .zip(states)
        .map(|(one, states)| dynamics::Episode { actions: one.actions(), states, known })
        .collect();
    let mut environment = task.mujoco_environment()?;
    let mut measured = Vec::new();
    for (episode, compared) in episodes.iter().zip(&mut recorded.demonstrations) {
        compared.drift = dynamics::drift(&mut environment, *episode)?;
        let rows = replay::measurements(task, episode.states, episode.actions).ok();
        // What is measured may depend on what is not known.
        if let Some(rows) = rows.as_ref().filter(|_| known.is_all()) {
            compared.score = Some(task.heuristic().score(rows));
            compared.succeeded = task.succeeded(rows);
        }
        measured.push(rows);
    }
    findings.extend(lengths::explained(
        task,
        recorded,
        lengths::Measured { rows: &measured, states, known },
    )?);
    findings.extend(dynamics::not_recorded(&environment, &episodes));
    if let Some(finding) = dynamics::undecided(task) {
        findings.push(finding);
        findings.extend(drifts(recorded, same_physics));
        findings.extend(scores(recorded));
        return Ok(Replays { findings, explained: None });
    }
    let misses = dynamics::misses(&mut environment, &episodes)?;
    for (one, missed) in recorded.demonstrations.iter_mut().zip(&misses) {
        one.missed = missed.map(|missed| missed.share);
        one.typically_missed = missed.map(|missed| missed.typical);
    }
    let all_are_off =
        misses.iter().all(|missed| missed.is_none_or(|missed| !dynamics::is_same_body(missed.typical)));
    let explained = match all_are_off {
        true => mending::explain(task, presented.recorded, presented.states)?,
        false => None,
    };
    if let Some(mut finding) = dynamics::judge(&mut environment, &episodes, &misses, explained.clone())? {
        same_physics = finding.severity == Severity::Fine;
        let is_far = misses.iter().flatten().any(|missed| !dynamics::is_same_body(missed.typical));
        let from_observations = recorded.states == StatesFrom::Observations;
        let is_open = from_observations && is_far && finding.lines.is_none();
        if let Some(advice) = finding.advice.as_mut().filter(|_| is_open) {
            *advice += "; or the numbers of the set stand in another order than those of `observation`";
        }
        findings.push(finding);
    }
    findings.extend(drifts(recorded, same_physics));
    findings.extend(scores(recorded));
    Ok(Replays { findings, explained })
}

fn drifts(recorded: &Recorded, same_physics: bool) -> Option<Finding> {
    let left = recorded.demonstrations.iter().filter_map(|one| one.drift.as_ref()?.left_at);
    let count = recorded.demonstrations.len();
    let (left, first) = (left.clone().count(), left.min());
    recorded.demonstrations.iter().find(|one| one.drift.is_some())?;
    let Some(first) = first else {
        return Some(Finding::fine(format!(
            "played again from its first state, no demonstration leaves its recorded positions by more than {}",
            dynamics::LEFT
        )));
    };
    // Where the physics is another one, that has been said.
    same_physics.then(|| {
        Finding::fine(format!(
            "played again from their first states, {left} of {count} demonstrations leave their recorded positions by more \
             than {}, the first after {first} steps: small differences grow, above all with contacts",
            dynamics::LEFT
        ))
    })
}

fn scores(recorded: &Recorded) -> Option<Finding> {
    let scores: Vec<Score> = recorded.demonstrations.iter().filter_map(|one| one.score).collect();
    let first = *scores.first()?;
    (scores.len() > 1 && scores.iter().all(|score| *score == first)).then(|| {
        Finding::warning(
            format!("the heuristic of every recorded demonstration is {first}"),
            "either all of them are equally good, or the heuristic does not see what differs",
        )
    })
}
