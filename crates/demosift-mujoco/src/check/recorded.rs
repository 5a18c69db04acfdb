//! What becomes of recorded demonstrations in a task: sizes, actions, observations, and their actions played again.

use demosift::Result;
use demosift::data::demonstration::Demonstration;
use demosift::data::trajectory::StateLog;
use demosift::world::environment::Task as _;
use demosift::world::heuristic::Score;

use super::comparison::{Compared, Recorded, StatesFrom};
use super::known::{self, Known};
use super::{Finding, Severity, columns, dynamics, lengths, several};
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
            findings.push(actions(set, &recorded));
            return Ok((recorded, findings));
        }
    };
    match replay_all(task, set, Replayed { states, known: &known }, &mut recorded) {
        Ok(more) => {
            findings.extend(sizes(task, set, true));
            findings.extend(more);
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
    findings.push(actions(set, &recorded));
    Ok((recorded, findings))
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
            "{} with {} observed numbers and {} actions fit the task",
            several(set.len(), "demonstration"),
            observation_size(set),
            action_size(set)
        ))];
    }
    wrong
        .filter(|(_, _, _, whose)| !replayed || *whose != "`observation`")
        .map(|(what, found, wanted, whose)| {
            let message = format!("{what} of the set has {found} numbers, and one of the task {wanted}");
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

fn actions(set: &[Demonstration], recorded: &Recorded) -> Finding {
    let sum = |of: fn(&Compared) -> usize| recorded.demonstrations.iter().map(of).sum::<usize>();
    let outside = sum(|one| one.outside);
    if outside == 0 {
        return Finding::fine("all actions are within [-1, 1]");
    }
    let numbers = sum(|one| one.steps) * action_size(set);
    let largest = recorded.demonstrations.iter().map(|one| one.largest_action).fold(0.0, f64::max);
    let share = outside as f64 / numbers as f64 * 100.0;
    let message = format!("{share:.1} % of the numbers of actions are outside [-1, 1], up to {largest:.2}");
    // What was clipped then and is clipped now leads to the same states.
    let physics = recorded.demonstrations.iter().map(|one| one.typically_missed);
    if physics.clone().all(|missed| missed.is_some_and(dynamics::is_same_body)) {
        return Finding::fine(format!("{message}; they are clipped, as they were when they were recorded"));
    }
    Finding::warning(
        format!("{message}; they are clipped"),
        "fine for a policy that draws its actions; if they are controls in the units of ctrlrange, scale them",
    )
}

/// States of each demonstration, and which of their numbers are known.
#[derive(Clone, Copy)]
struct Replayed<'a> {
    states: &'a [StateLog],
    known: &'a Known,
}

/// Fills in what the states tell, as far as sizes allow.
fn replay_all(
    task: &MujocoTask,
    set: &[Demonstration],
    Replayed { states, known }: Replayed<'_>,
    recorded: &mut Recorded,
) -> Result<Vec<Finding>> {
    let mut findings = Vec::new();
    let mut same_physics = false;
    for (id, (demonstration, states)) in set.iter().zip(states).enumerate() {
        replay::Replay::new(task, states, demonstration.steps())
            .map_err(|error| error.during(&format!("demonstration {id}")))?;
    }
    if recorded.states == StatesFrom::Recording {
        let episodes: Vec<columns::Episode<'_>> = set
            .iter()
            .zip(states)
            .map(|(one, states)| columns::Episode { observations: one.observations(), states })
            .collect();
        findings.extend(columns::compare(task, &episodes)?);
    } else {
        findings.push(known.found(states));
    }
    if action_size(set) != task.specification().action_size {
        findings.extend(lengths::unexplained(task, recorded));
        return Ok(findings);
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
    let misses = dynamics::misses(&mut environment, &episodes)?;
    for (one, missed) in recorded.demonstrations.iter_mut().zip(&misses) {
        one.missed = missed.map(|missed| missed.share);
        one.typically_missed = missed.map(|missed| missed.typical);
    }
    if let Some(mut finding) = dynamics::judge(&mut environment, &episodes, &misses)? {
        same_physics = finding.severity == Severity::Fine;
        let is_far = misses.iter().flatten().any(|missed| !dynamics::is_same_body(missed.typical));
        let from_observations = recorded.states == StatesFrom::Observations;
        if let Some(advice) = finding.advice.as_mut().filter(|_| from_observations && is_far) {
            *advice += "; or the numbers of the set stand in another order than those of `observation`";
        }
        findings.push(finding);
    }
    findings.extend(drifts(recorded, same_physics));
    findings.extend(scores(recorded));
    Ok(findings)
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
