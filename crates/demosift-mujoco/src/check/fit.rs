//! Whether the numbers of a set can be what a task takes: a cheap look, before anything is played.
//!
//! It asks for the rate, for the clock, for what the set says of its actions, for positions that no joint can reach, for
//! actions that are mostly outside [−1, 1], and it tries some recorded steps where the simulator's states are known.
//! What is found comes with the lines of a `set.toml` that would mend it.

use demosift::Result;
use demosift::data::demonstration::Demonstration;
use demosift::data::demonstration::set_file::{Each, Meaning, SetFile, Unit, Units};
use demosift::data::demonstration::timing::Timing;
use demosift::data::trajectory::StateLog;
use demosift::world::environment::Specification;

use super::explained::{Explained, percent_missed};
use super::mending;
use super::presented::Presented;
use super::{Finding, Severity, columns, dynamics, first_few, reach, several};
use crate::mujoco_task::MujocoTask;
use crate::replay;

/// From this share of numbers outside [−1, 1] on, actions cannot be what a task takes. A public set of a policy with noise
/// has 27 %.
const MOSTLY: f64 = 0.5;
/// The same of the middle of one number alone: no noise is as large.
const LARGE: f64 = 5.0;
/// Steps of which observations are held against recorded states.
const OBSERVED: usize = 2000;
/// Rates that differ by at most this share are the same: LeRobot keeps whole numbers.
const SAME_RATE: f64 = 0.03;
/// Bounds that differ by less are the same.
const SAME_BOUND: f64 = 1e-3;

/// What is known of the physics of recorded steps.
#[derive(Clone, Debug, Default)]
pub(super) struct Physics {
    /// What a typical step misses; `None` where no state is known.
    pub(super) missed: Option<f64>,
    /// What explains it, if something does.
    pub(super) explained: Option<Explained>,
    /// Whether a finding says already what the observations are.
    pub(super) are_observations_explained: bool,
}

impl Physics {
    /// Whether recorded actions lead where they led.
    fn is_same(&self) -> bool {
        self.missed.is_some_and(dynamics::is_same_body)
    }

    fn mend(&self) -> Option<&SetFile> {
        self.explained.as_ref()?.mend.as_ref()
    }
}

/// Holds a set of the task's sizes against a task, of which `mujoco` is the model where it has one.
///
/// # Errors
/// If MuJoCo has no memory for a simulation. What is wrong with the set is a finding.
pub fn fit(
    specification: &Specification,
    mujoco: Option<&MujocoTask>,
    presented: &Presented<'_>,
) -> Result<Vec<Finding>> {
    let sizes = presented.set.first().map(|one| (one.observations().width(), one.actions().width()));
    if sizes != Some((specification.observation_size, specification.action_size)) {
        return Ok(of_time(specification, mujoco, presented, &Physics::default()));
    }
    let undecided = mujoco.and_then(dynamics::undecided);
    let mut physics = match mujoco {
        Some(task) if undecided.is_none() => physics(task, presented)?,
        _ => Physics::default(),
    };
    let seen = match (mujoco, presented.states) {
        (Some(task), Some(states))
            if physics.missed.is_some()
                || undecided.is_some() && are_states_of(task, presented.set, states) =>
        {
            observations(task, presented, states)?
        }
        _ => None,
    };
    physics.are_observations_explained = seen.as_ref().is_some_and(|finding| finding.lines.is_some())
        || physics.mend().is_some_and(|mend| !mend.observations.is_none());
    let mut findings: Vec<Finding> = seen.into_iter().collect();
    findings.extend(beside(specification, mujoco, presented, &physics));
    findings.extend(undecided.or_else(|| steps(&physics, presented)));
    Ok(findings)
}

/// Whether some recorded observations are what the task observes in the recorded states. Where nothing mends them, another body
/// may have been recorded, which does not stop anybody.
fn observations(
    task: &MujocoTask,
    presented: &Presented<'_>,
    states: &[StateLog],
) -> Result<Option<Finding>> {
    let finding = columns::compare(task, &observed(presented, states), OBSERVED)?;
    Ok(match finding.severity {
        Severity::Fine => None,
        _ if finding.lines.is_some() => Some(finding),
        _ => Some(Finding { severity: Severity::Warning, ..finding }),
    })
}

/// The episodes of a set with their states.
pub(super) fn observed<'a>(presented: &Presented<'a>, states: &'a [StateLog]) -> Vec<columns::Episode<'a>> {
    let each = presented.set.iter().zip(presented.recorded).zip(states);
    each.map(|((one, recorded), states)| columns::Episode {
        observations: one.observations(),
        recorded: recorded.observations(),
        states,
    })
    .collect()
}

/// All but what is said of the physics itself.
pub(super) fn beside(
    specification: &Specification,
    mujoco: Option<&MujocoTask>,
    presented: &Presented<'_>,
    physics: &Physics,
) -> Vec<Finding> {
    let mut findings = of_time(specification, mujoco, presented, physics);
    findings.extend(bounds(specification, presented, physics));
    if let Some(task) = mujoco {
        findings.extend(reach::positions(task, presented, physics.are_observations_explained));
    }
    findings.push(actions(specification, presented, physics));
    findings
}

/// Whether states are as many as the set has and as the model takes.
fn are_states_of(task: &MujocoTask, set: &[Demonstration], states: &[StateLog]) -> bool {
    states.len() == set.len()
        && states.iter().zip(set).all(|(log, one)| replay::Replay::new(task, log, one.steps()).is_ok())
}

/// Plays some steps of a set, and looks for what explains it if they lead elsewhere.
fn physics(task: &MujocoTask, presented: &Presented<'_>) -> Result<Physics> {
    let Presented { set, recorded, states, .. } = *presented;
    if states.is_some_and(|states| !are_states_of(task, set, states)) {
        return Ok(Physics::default());
    }
    let missed = mending::missed_as_it_is(task, set, states)?;
    let explained = match missed {
        Some(missed) if !dynamics::is_other_physics(missed) => None,
        // Where observations are far off, their states may not even be played.
        _ => mending::explain(task, recorded, states)?
            .map_or_else(|| mending::other_skip(task, set, states), |explained| Ok(Some(explained)))?,
    };
    Ok(Physics { missed, explained, ..Physics::default() })
}

/// The rate of a set and its clock.
fn of_time(
    specification: &Specification,
    mujoco: Option<&MujocoTask>,
    presented: &Presented<'_>,
    physics: &Physics,
) -> Vec<Finding> {
    let task_rate = 1.0 / specification.control_step_secs;
    let Presented { says, timing, set_file, .. } = presented;
    if let Some(rate) = set_file.rate {
        // Whoever says what the rate is knows better than the clock.
        return match !specification.is_control_step_told || is_same_rate(rate, task_rate) {
            true => Vec::new(),
            false => vec![Finding::error(
                format!("set.toml says {} a second, and {}", steps_in(rate), in_task(specification)),
                other_rate(rate, mujoco),
            )],
        };
    }
    let told = says.steps_per_sec.map(|rate| (rate, format!("{} says", says.file)));
    let told = told.or_else(|| Some((1.0 / timing.as_ref()?.step_secs, "the timestamps say".to_owned())));
    let right = || SetFile { rate: Some(rounded(task_rate)), ..SetFile::default() };
    let mut findings = Vec::new();
    match told {
        Some((rate, _)) if is_same_rate(rate, task_rate) => findings.push(Finding::fine(format!(
            "the rate of the set, {} a second, is that of the task",
            steps_in(rate)
        ))),
        Some((rate, who)) if !specification.is_control_step_told => findings.push(Finding::warning(
            format!(
                "{who} {} a second, and the environment does not say how long its steps are",
                steps_in(rate)
            ),
            format!("let it step as long, {} s; its attribute `dt` says so", rounded(1.0 / rate)),
        )),
        Some((rate, who)) => {
            let message = format!("{who} {} a second, and {}", steps_in(rate), in_task(specification));
            let finding = if physics.is_same() {
                Finding::error(
                    format!("{message}; yet its steps follow each other as at the rate of the task"),
                    "so what it says seems to be wrong: set.toml can say what is right",
                )
            } else {
                let way = other_rate(rate, mujoco);
                let advice = format!(
                    "{way}; if it was recorded at the rate of the task after all, set.toml can say so"
                );
                Finding::error(message, advice)
            };
            findings.push(finding.mended_by(Some(right())));
        }
        None => {}
    }
    findings.extend(timing.as_ref().and_then(|timing| jumps(presented, timing)).map(|finding| {
        let rate = rounded(told_rate(presented).unwrap_or(task_rate));
        finding.mended_by(Some(SetFile { rate: Some(rate), ..SetFile::default() }))
    }));
    findings
}

fn told_rate(presented: &Presented<'_>) -> Option<f64> {
    presented.says.steps_per_sec.or_else(|| Some(1.0 / presented.timing.as_ref()?.step_secs))
}

fn jumps(presented: &Presented<'_>, timing: &Timing) -> Option<Finding> {
    let first = timing.jumps.first()?;
    let labels: Vec<String> = timing.jumps.iter().map(|jump| jump.label.clone()).collect();
    Some(Finding::error(
        format!(
            "the timestamps of {} of {} jump: in episode {} {:.3} s pass before step {}, and {:.3} s before most",
            labels.len(),
            several(presented.set.len(), "episode"),
            first.label,
            first.secs,
            first.step,
            timing.step_secs
        ),
        format!(
            "steps are missing there: leave these out by --without {}; if only the clock jumped and not the robot, set.toml \
             may say the rate",
            labels.join(",")
        ),
    ))
}

fn is_same_rate(rate: f64, wanted: f64) -> bool {
    (rate - wanted).abs() <= SAME_RATE * wanted || (rate - wanted.round()).abs() < 0.5
}

/// A rate without digits that nobody wrote.
fn rounded(rate: f64) -> f64 {
    let whole = rate.round();
    if (rate - whole).abs() < 1e-6 * rate { whole } else { (rate * 1000.0).round() / 1000.0 }
}

fn steps_in(rate: f64) -> String {
    format!("{} steps", rounded(rate))
}

fn in_task(specification: &Specification) -> String {
    format!(
        "the task '{}' takes {} (a control step of {:.4} s)",
        specification.name,
        rounded(1.0 / specification.control_step_secs),
        specification.control_step_secs
    )
}

fn other_rate(rate: f64, mujoco: Option<&MujocoTask>) -> String {
    let skip = mujoco.map(|task| 1.0 / (rate * task.model().timestep_secs()));
    match skip {
        Some(skip) if (skip - skip.round()).abs() < 0.01 * skip && skip >= 0.99 => {
            format!("frame_skip = {} in task.toml makes the task's rate that of the set", skip.round())
        }
        Some(_) => {
            "give the task that rate, by timestep and frame_skip, or the set the rate of the task".to_owned()
        }
        None => "give the environment that rate, or the set the rate of the environment".to_owned(),
    }
}

/// What the set says of where actions lie.
fn bounds(specification: &Specification, presented: &Presented<'_>, physics: &Physics) -> Option<Finding> {
    let Presented { says, set_file, .. } = presented;
    let bounds = says.action_bounds.as_ref().filter(|_| set_file.actions.is_none() && !physics.is_same())?;
    let is_usual = |[low, high]: &[f64; 2]| {
        (low + 1.0).abs() < SAME_BOUND && (high - 1.0).abs() < SAME_BOUND || high - low > 1e6 || low >= high
    };
    if bounds.len() != specification.action_size || bounds.iter().all(is_usual) {
        return None;
    }
    let is_range = |([low, high], [least, most]): (&[f64; 2], &[f64; 2])| {
        let near = SAME_BOUND * (1.0 + most.abs().max(least.abs()));
        (low - least).abs() < near && (high - most).abs() < near
    };
    let (actions, what) = if bounds.iter().zip(&specification.control_ranges).all(is_range) {
        (
            Meaning { units: Some(Units::All(Unit::Controls)), ..Meaning::default() },
            "that is ctrlrange, so they are controls",
        )
    } else {
        let shown = |numbers: Vec<f64>| {
            let all = numbers.iter().all(|number| *number == numbers[0]);
            if all { Each::All(numbers[0]) } else { Each::Listed(numbers) }
        };
        let scale = shown(bounds.iter().map(|[low, high]| 2.0 / (high - low)).collect());
        let offset = shown(bounds.iter().map(|[low, high]| -(low + high) / (high - low)).collect());
        let offset = (offset != Each::All(0.0)).then_some(offset);
        (
            Meaning { scale: Some(scale), offset, ..Meaning::default() },
            "scaled, they are the whole range of each actuator",
        )
    };
    let shown: Vec<String> = bounds.iter().map(|[low, high]| format!("[{low}, {high}]")).collect();
    let same = shown.iter().all(|one| *one == shown[0]);
    let shown = if same { shown[0].clone() } else { first_few(&shown) };
    let finding = Finding::error(
        format!("{} says that actions lie in {shown}, and the task takes [-1, 1]", says.file),
        format!("{what}: set.toml can say so"),
    );
    let mend = SetFile { actions, ..SetFile::default() };
    let is_explained = physics.mend().is_some_and(|mend| !mend.actions.is_none());
    Some(finding.mended_by((!is_explained).then_some(mend)))
}

/// How much of the actions is cut off.
fn actions(specification: &Specification, presented: &Presented<'_>, physics: &Physics) -> Finding {
    let Presented { set, set_file, .. } = presented;
    let numbers = || set.iter().flat_map(|one| one.actions().flat());
    let (count, outside) = (numbers().count(), numbers().filter(|number| number.abs() > 1.0).count());
    if outside == 0 {
        return Finding::fine("all actions are within [-1, 1]");
    }
    let share = outside as f64 / count as f64;
    let largest = numbers().fold(0.0_f32, |largest, number| largest.max(number.abs()));
    let message =
        format!("{:.1} % of the numbers of actions are outside [-1, 1], up to {largest:.2}", 100.0 * share);
    // What was clipped then and is clipped now leads to the same states.
    if physics.is_same() {
        return Finding::fine(format!("{message}; they are clipped, as they were when they were recorded"));
    }
    let clipped = format!("{message}; they are clipped");
    let large = large_numbers(presented);
    if set_file.actions.is_of_task() || share <= MOSTLY && large.is_empty() {
        return Finding::warning(
            clipped,
            "fine for a policy that draws its actions; if they are controls, degrees or percent, say so in set.toml",
        );
    }
    let which = match &large[..] {
        [] => String::new(),
        _ if share > MOSTLY => String::new(),
        large => format!(" (number {} mostly far outside)", first_few(large)),
    };
    let message = format!("{clipped}, so hardly anything of them would be left{which}");
    if physics.mend().is_some_and(|mend| !mend.actions.is_none()) {
        return Finding::error(message, "the recorded steps tell what they are");
    }
    let guess = reach::unit_of_actions(specification, presented.recorded);
    let within = guess.map_or("", |unit| match unit {
        Unit::Controls => " (as controls they lie within ctrlrange)",
        Unit::Degrees => " (in degrees they lie within ctrlrange)",
        _ => " (in percent of ctrlrange they lie within it)",
    });
    let mend = guess.map(|unit| SetFile {
        actions: Meaning { units: Some(Units::All(unit)), ..Meaning::default() },
        ..SetFile::default()
    });
    Finding::error(
        message,
        format!(
            "say in set.toml what they are{within}: controls, degrees, percent, or a scale; if they are meant to be clipped, \
             units = \"task\""
        ),
    )
    .mended_by(mend)
}

/// Numbers of an action whose middle size is far beyond 1.
fn large_numbers(presented: &Presented<'_>) -> Vec<String> {
    let width = presented.set.first().map_or(0, |one| one.actions().width());
    let is_large = |at: &usize| {
        let numbers = presented.set.iter().flat_map(|one| one.actions().iter().map(|row| row[*at].abs()));
        let mut sizes: Vec<f32> = numbers.collect();
        sizes.sort_by(f32::total_cmp);
        sizes.get(sizes.len() / 2).is_some_and(|middle| f64::from(*middle) > LARGE)
    };
    (0..width).filter(is_large).map(|at| at.to_string()).collect()
}

/// What the steps that were tried say.
fn steps(physics: &Physics, presented: &Presented<'_>) -> Option<Finding> {
    let missed = physics.missed;
    let percent = missed.map_or("not known".to_owned(), percent_missed);
    let message = format!(
        "the recorded actions do not lead to the next recorded state: a typical step misses {percent} of its change"
    );
    match &physics.explained {
        Some(explained) if explained.mend.is_some() || presented.set_file.rate.is_none() => {
            Some(Finding::error(message, explained.in_words()).mended_by(explained.mend.clone()))
        }
        _ if physics.is_same() => Some(Finding::fine(format!(
            "recorded actions lead to the next recorded state: of the steps that were tried a typical one misses {percent}"
        ))),
        _ => missed.map(|missed| {
            let why = if dynamics::is_other_physics(missed) {
                "nothing that was tried explains it: another model or body, or numbers in another order"
            } else {
                "a body that is a little different, or actions that stand a step early or late"
            };
            Finding::warning(message, format!("{why}; `demosift task check TASK --data SET` says more"))
        }),
    }
}
