//! Whether recorded episodes last as long as those of the task, and where they do not, whether the task would have ended them too.

use demosift::Result;
use demosift::data::trajectory::StateLog;
use demosift::math::rows::Rows;
use demosift::world::environment::Task as _;

use super::comparison::Recorded;
use super::known::Known;
use super::{Finding, first_few, several};
use crate::mujoco_task::MujocoTask;
use crate::task::ends::Bound;

/// What the task measures in recorded episodes.
#[derive(Clone, Copy)]
pub(super) struct Measured<'a> {
    /// `[T+1, measurements]` of each demonstration; `None` where the simulation became unstable.
    pub(super) rows: &'a [Option<Rows>],
    pub(super) states: &'a [StateLog],
    pub(super) known: &'a Known,
}

/// How a recorded episode ends.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    /// At the horizon.
    Horizon,
    /// With the step that leads out of a range of the task, or as near to it as another solver of contacts may bring it.
    Explained,
    /// Before the horizon, within all ranges.
    Unexplained,
    /// After a range was left: the task would have ended it at this step.
    Overrun(usize),
}

/// Lengths of demonstrations of which nothing is measured.
pub(super) fn unexplained(task: &MujocoTask, recorded: &Recorded) -> Option<Finding> {
    let horizon = task.specification().horizon;
    let others: Vec<usize> = (0..recorded.demonstrations.len())
        .filter(|id| recorded.demonstrations[*id].steps != horizon)
        .collect();
    let advice = if task.may_end_early() {
        "whether the ranges of [ends] end them there is not known without the simulator's states"
    } else {
        "an agent plays the task's length, whatever it imitates; see whether `horizon` is what you mean, and if the \
         recorder ended episodes when something fell or was reached, say so in [ends]"
    };
    (!others.is_empty()).then(|| Finding::warning(of_other_length(recorded, &others, horizon), advice))
}

/// Lengths of demonstrations, held against the ranges of the task.
///
/// # Errors
/// If MuJoCo has no memory for a simulation, or a state is not finite.
pub(super) fn explained(
    task: &MujocoTask,
    recorded: &Recorded,
    measured: Measured<'_>,
) -> Result<Vec<Finding>> {
    let ranges = known_ranges(task, measured)?;
    if ranges.is_empty() {
        return Ok(unexplained(task, recorded).into_iter().collect());
    }
    let horizon = task.specification().horizon;
    let ends: Vec<End> = recorded
        .demonstrations
        .iter()
        .zip(measured.rows)
        .map(|(one, rows)| {
            rows.as_ref().map_or(End::Unexplained, |rows| end(&ranges, rows, one.steps, horizon))
        })
        .collect();
    let those =
        |is_it: fn(&End) -> bool| -> Vec<usize> { (0..ends.len()).filter(|id| is_it(&ends[*id])).collect() };
    let mut findings = Vec::new();
    let short = those(|end| *end == End::Explained);
    if !short.is_empty() {
        let words: Vec<String> =
            ranges.iter().map(|kept| kept.words(&task.specification().measurements)).collect();
        findings.push(Finding::fine(format!(
            "{}; each of these ends where the task ends an episode ({})",
            of_other_length(recorded, &short, horizon),
            words.join(", or ")
        )));
    }
    let other = those(|end| *end == End::Unexplained);
    if !other.is_empty() {
        let nothing = "which [ends] does not explain";
        findings.push(Finding::warning(
            format!("{}, {nothing}: {}", of_other_length(recorded, &other, horizon), ids(&other)),
            "if the recorder stopped them, an agent that goes on longer is compared with nothing; if something else ended \
             them, say it in [ends]; or see whether `horizon` is what you mean",
        ));
    }
    let overrun = those(|end| matches!(end, End::Overrun(_)));
    let first =
        ends.iter().filter_map(|end| if let End::Overrun(step) = end { Some(step) } else { None }).min();
    if let Some(step) = first {
        findings.push(Finding::warning(
            format!(
                "{} of {} go on after the task would have ended them, the first at step {step}: {}",
                overrun.len(),
                several(ends.len(), "demonstration"),
                ids(&overrun)
            ),
            "what they show afterward no agent can show: widen the range in [ends], or see whether it measures what the \
             recorder did",
        ));
    }
    Ok(findings)
}

fn end(ranges: &[Bound], rows: &Rows, steps: usize, horizon: usize) -> End {
    let value = |row: usize, kept: &Bound| f64::from(rows.row(row)[kept.column]);
    let is_left = |row: usize| ranges.iter().any(|kept| !kept.within.holds(value(row, kept)));
    if let Some(step) = (0..steps).find(|row| is_left(*row)) {
        return End::Overrun(step);
    }
    // The last row was not recorded but simulated, which is a little off: one more such step would have left the range.
    let goes_on_to = |kept: &Bound| 2.0 * value(steps, kept) - value(steps - 1, kept);
    match steps == horizon {
        true => End::Horizon,
        false if is_left(steps) => End::Explained,
        false if ranges.iter().any(|kept| !kept.within.holds(goes_on_to(kept))) => End::Explained,
        false => End::Unexplained,
    }
}

/// The ranges whose measurements do not depend on what is not known of the states.
fn known_ranges(task: &MujocoTask, measured: Measured<'_>) -> Result<Vec<Bound>> {
    let all = task.blueprint().ends.ranges().to_vec();
    let Some(states) = measured.states.first().filter(|_| !measured.known.hidden.is_empty()) else {
        return Ok(all);
    };
    let mut environment = task.mujoco_environment()?;
    let (nq, nv) = (environment.qpos().len(), environment.qvel().len());
    let (mut qpos, qvel) = (states.qpos[..nq].to_vec(), &states.qvel[..nv]);
    environment.set_state(&qpos, qvel)?;
    let here = environment.measured().to_vec();
    measured.known.hidden.iter().for_each(|at| qpos[*at] += 1.0);
    environment.set_state(&qpos, qvel)?;
    let there = environment.measured();
    let is_same = |column: usize| (here[column] - there[column]).abs() < 1e-9;
    let measurements = &task.blueprint().measurements;
    let depends = |kept: &Bound| {
        let base = measurements[kept.column].rate_of().unwrap_or(kept.column);
        !is_same(base)
    };
    Ok(all.into_iter().filter(|kept| !depends(kept)).collect())
}

/// Such as `5 of 10 demonstrations have 267 to 447 steps, and an episode of the task 1000`.
fn of_other_length(recorded: &Recorded, those: &[usize], horizon: usize) -> String {
    let lengths = those.iter().map(|id| recorded.demonstrations[*id].steps);
    let (least, most) = (lengths.clone().min().unwrap_or(0), lengths.max().unwrap_or(0));
    let span = if least == most { least.to_string() } else { format!("{least} to {most}") };
    let count = several(recorded.demonstrations.len(), "demonstration");
    format!("{} of {count} have {span} steps, and an episode of the task {horizon}", those.len())
}

fn ids(those: &[usize]) -> String {
    first_few(&those.iter().map(usize::to_string).collect::<Vec<_>>())
}
