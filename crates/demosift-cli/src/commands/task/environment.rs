//! `demosift task check --env`: what an environment in Python is made of, whether it repeats, and whether demonstrations fit
//! it.

use std::path::Path;

use demosift::Result;
use demosift::basics::seed::Seed;
use demosift::world::environment::{Specification, Task as _};
use demosift_gymnasium::check::{self, Checked, Recorded, SLOW};
use demosift_gymnasium::replay::Replayed;
use demosift_gymnasium::task::GymnasiumTask;
use demosift_gymnasium::trial::Repeats;
use demosift_mujoco::check::{Finding, Severity, several};

use super::{outcome, told, unreadable};
use crate::answers;
use crate::arguments::{SetArguments, TaskCheckArguments};
use crate::console::terminal;
use crate::job::as_recorded::AsRecorded;
use crate::job::demonstrations;
use crate::tables::{self, Scale, table, wrapped};
use crate::task::simulator::Simulated;

/// Demonstrations that are played again from where they began.
const MOST_REPLAYED: usize = 10;
/// The share of numbers beyond the bounds from which on they are in another unit, as for tasks of demosift. Of actions of
/// people, which their environment clipped, it is 6 % in the public set of a door.
const OTHER_UNIT: f64 = 0.5;
/// The share of the bounds below which recorded actions hardly move anything.
const HARDLY: f64 = 0.05;
/// A drift that rounding explains: observations are compared as 32-bit numbers.
const ROUNDING: f64 = 1e-5;

/// Shows what is found; an error if anything is wrong.
pub(super) fn check(simulated: &Simulated, arguments: &TaskCheckArguments) -> Result<()> {
    let task = &simulated.task;
    let name = task.source().words();
    let tried = check::check(task, &Seed::new(arguments.seed))?;
    let mut findings = of_environment(task, &tried);
    let mut compared = None;
    if let Some(data) = &arguments.data {
        match compare(task, data, &arguments.storage) {
            Ok(found) => {
                findings.extend(of_demonstrations(task, &found));
                compared = Some(found);
            }
            Err(error) if error.is_simulation() => return Err(error),
            Err(error) => findings.push(unreadable(&error)),
        }
    }
    findings.sort_by_key(|finding| finding.severity);
    if arguments.json {
        let Specification { observation_parts, control_ranges, .. } = task.specification();
        terminal::show_json(&answers::EnvironmentCheck {
            environment: &name,
            simulator: &simulated.identity(),
            observation_parts,
            control_ranges,
            info: task.info(),
            tried: &tried,
            compared: compared.as_ref(),
            findings: &findings,
        });
    } else {
        terminal::show(&summary(simulated));
        terminal::show(&under_random_actions(task, &tried));
        terminal::show(&compared.as_ref().map_or_else(String::new, |of| replays(task, of)));
        terminal::show(&told(&findings));
    }
    outcome(&findings, &name)
}

fn compare(task: &GymnasiumTask, data: &Path, how: &SetArguments) -> Result<Recorded> {
    let mut opened = demonstrations::open_unchecked(Some(data), how, None)?;
    opened.read_as_taken(task)?;
    opened.said.say();
    let AsRecorded { set, starts } = AsRecorded::of(task, &opened, MOST_REPLAYED)?;
    demonstrations::say_what_is_not_read(&opened.source);
    check::compare(task, &set, &starts, MOST_REPLAYED).map_err(|error| match error.is_bad_input() {
        true => error.at(&opened.path),
        false => error,
    })
}

fn summary(simulated: &Simulated) -> String {
    let (task, simulator) = (&simulated.task, simulated.identity());
    let Specification { observation_size, observation_parts, horizon, .. } = task.specification();
    let parts: Vec<String> =
        observation_parts.iter().map(|(name, width)| format!("{name} {width}")).collect();
    let versions: Vec<String> =
        simulator.versions.iter().map(|(name, version)| format!("{name} {version}")).collect();
    let success = if task.tells_success() { "as info says" } else { "the environment does not say" };
    let rows = [
        ("interpreter", format!("{}: {}", simulator.python.display(), versions.join(", "))),
        ("episode", format!("{horizon} steps{}", length_of_steps(task.specification()))),
        ("observation", format!("{observation_size} numbers: {}", parts.join(", "))),
        ("action", actions(task.units().bounds())),
        ("info", if task.info().is_empty() { "no numbers".to_owned() } else { task.info().join(", ") }),
        ("heuristic", format!("{}; higher is better", task.heuristic_name())),
        ("success", success.to_owned()),
    ];
    let lines = rows.iter().map(|(what, words)| tables::hanging(&format!("  {what:<12}   "), words));
    format!("The environment '{}':\n\n{}", task.specification().name, lines.collect::<String>())
}

/// Such as ` of 0.05 s`; of an environment that does not say it, that it does not.
fn length_of_steps(specification: &Specification) -> String {
    match specification.is_control_step_told {
        true => format!(" of {} s", tables::short(specification.control_step_secs)),
        false => "; how long a step is, it does not say".to_owned(),
    }
}

/// Such as `6 numbers from -1 to 1`.
fn actions(bounds: &[[f64; 2]]) -> String {
    let range = |[low, high]: &[f64; 2]| format!("{} to {}", tables::short(*low), tables::short(*high));
    let count = several(bounds.len(), "number");
    if bounds.iter().all(|bound| *bound == bounds[0]) {
        return format!("{count} from {}", range(&bounds[0]));
    }
    let ranges: Vec<String> = bounds.iter().map(range).collect();
    format!("{count}: from {}", ranges.join(", "))
}

fn under_random_actions(task: &GymnasiumTask, tried: &Checked) -> String {
    let Checked { episodes, steps, terminated, truncated, scores: [least, greatest], successes, .. } = tried;
    let scale = Scale::of([*least, *greatest], "");
    let success = successes.map_or(String::new(), |count| format!(" {count} of them reached the goal."));
    let words = format!(
        "{} of random actions: {steps} steps, {} a second in one process; {terminated} ended in a terminal state, {truncated} \
         were stopped before the horizon. The heuristic is {} to {}.{success}",
        several(*episodes, "episode"),
        tables::rounded(tried.trial.steps_per_sec),
        scale.plain(*least),
        scale.plain(*greatest)
    );
    let constant = match &tried.constant[..] {
        [] => String::new(),
        columns => {
            let size = task.specification().observation_size;
            format!(" {} of the {size} numbers of an observation never changed.", columns.len())
        }
    };
    format!("\n{}\n", wrapped(&format!("{words}{constant}")))
}

fn replays(task: &GymnasiumTask, recorded: &Recorded) -> String {
    if recorded.replayed.is_empty() {
        return String::new();
    }
    let scale = Scale::of(recorded.replayed.iter().map(|one| one.score), "");
    let has_states = of_states(recorded);
    let row = |one: &Replayed| {
        let mut cells = vec![
            one.demo.to_string(),
            format!("{} of {}", one.steps, one.recorded_steps),
            scale.plain(one.score),
            format!("{:.1e}", one.drift),
            one.left_at.map_or_else(|| "never".to_owned(), |step| format!("step {step}")),
        ];
        cells.extend(one.state_drift.map(|drift| format!("{drift:.1e}")));
        cells
    };
    let rows: Vec<Vec<String>> = recorded.replayed.iter().map(row).collect();
    let heuristic = task.heuristic_name();
    let mut header = vec!["demonstration", "steps", heuristic.as_str(), "drift", "leaves"];
    if has_states {
        header.push("drift of states");
    }
    let from = began(recorded);
    format!("\nThe demonstrations, played again from {from}:\n\n{}", table(&header, &rows))
}

/// Whether demonstrations were played again from recorded states.
fn of_states(recorded: &Recorded) -> bool {
    recorded.replayed.iter().any(|one| one.state_drift.is_some())
}

fn began(recorded: &Recorded) -> &'static str {
    if of_states(recorded) { "the recorded state" } else { "the recorded seed" }
}

fn finding(severity: Severity, message: impl Into<String>, advice: Option<&str>) -> Finding {
    Finding { severity, message: message.into(), advice: advice.map(str::to_owned), lines: None }
}

fn of_environment(task: &GymnasiumTask, tried: &Checked) -> Vec<Finding> {
    let repeats = tried.trial.repeats;
    let mut findings = vec![match repeats {
        Repeats::Exactly => finding(Severity::Fine, format!("the environment {}", repeats.words()), None),
        Repeats::StartOnly | Repeats::No => finding(
            Severity::Warning,
            format!("the environment {}", repeats.words()),
            Some(
                "it can be used, but a run cannot be repeated or resumed to the same numbers; seed all that draws at random in \
                 reset(seed=...)",
            ),
        ),
    }];
    if tried.alike == Some(false) {
        findings.push(finding(
            Severity::Warning,
            "another process of the environment plays the same episode differently",
            Some(
                "something is drawn when it is made, not when it is reset; results will depend on --workers",
            ),
        ));
    }
    if repeats == Repeats::Exactly && !tried.trial.starts_differ {
        let message = "episodes of different seeds start with the same observation";
        findings.push(finding(Severity::Fine, message, None));
    }
    let rate = tried.trial.steps_per_sec;
    findings.push(match rate < SLOW {
        true => finding(
            Severity::Warning,
            format!("the environment is slow: {} steps a second", tables::rounded(rate)),
            Some("a run asks the judge by cloning alone unless you say --judge both; --workers N plays in N processes"),
        ),
        false => finding(Severity::Fine, format!("{} steps a second", tables::rounded(rate)), None),
    });
    let [least, greatest] = tried.scores;
    if least >= greatest && tried.episodes > 1 {
        findings.push(finding(
            Severity::Warning,
            format!(
                "the heuristic '{}' is {least} in every episode of random actions",
                task.heuristic_name()
            ),
            Some("a heuristic that tells poor from poorer is easier to improve"),
        ));
    }
    if tried.terminated > 0 {
        let message = "episodes may end in a terminal state, and a heuristic is worked out of the steps that were played";
        findings.push(finding(Severity::Fine, message, None));
    }
    findings
}

fn of_demonstrations(task: &GymnasiumTask, recorded: &Recorded) -> Vec<Finding> {
    let mut findings = vec![actions_fit(task, recorded)];
    let drifts = recorded.replayed.iter().map(|one| one.drift.max(one.state_drift.unwrap_or(0.0)));
    let worst = drifts.fold(0.0, f64::max);
    let whole = recorded.replayed.iter().all(|one| one.steps == one.recorded_steps);
    let (count, from) = (several(recorded.replayed.len(), "demonstration"), began(recorded));
    findings.push(match recorded.replayed.is_empty() {
        true => finding(
            Severity::Fine,
            "the set tells no seeds, so its actions cannot be played again from where they were recorded",
            None,
        ),
        false if whole && worst <= ROUNDING => finding(
            Severity::Fine,
            format!("{count} played again from {from} lead where they led when they were recorded"),
            None,
        ),
        false if whole => finding(
            Severity::Warning,
            format!("{count} played again from {from} go elsewhere, by {worst:.1e} at most"),
            Some(&another_version(task)),
        ),
        false => finding(
            Severity::Error,
            format!("a demonstration played again from {from} ends before its actions do"),
            Some("the set was recorded in another environment, or in another version of it"),
        ),
    });
    findings
}

/// Why a replay goes elsewhere, as far as that can be known.
fn another_version(task: &GymnasiumTask) -> String {
    let here = task.versions().get("robosuite");
    match (task.source().recorded_in(), here) {
        (Some(there), Some(here)) if there != *here => format!(
            "the set was recorded in robosuite {there}, and the interpreter has {here}; name one that has {there} with --python PATH"
        ),
        _ => "another version of the simulator, or another environment; see which version recorded the set"
            .to_owned(),
    }
}

/// Whether recorded actions can be what the environment takes.
fn actions_fit(task: &GymnasiumTask, recorded: &Recorded) -> Finding {
    let bounds = task.units().bounds();
    let of = |column: usize| (bounds[column], recorded.actions[column]);
    // How far a number goes beyond its bounds, and how much it uses of them.
    let beyond = |column: usize| {
        let ([low, high], [least, greatest]) = of(column);
        (low - least).max(greatest - high) / (high - low)
    };
    let share = |column: usize| {
        let ([low, high], [least, greatest]) = of(column);
        least.abs().max(greatest.abs()) / low.abs().max(high.abs())
    };
    let largest = |number: &dyn Fn(usize) -> f64| {
        let order = |one: &usize, other: &usize| number(*one).total_cmp(&number(*other));
        (0..bounds.len()).max_by(order).unwrap_or(0)
    };
    let worst = if recorded.beyond > 0.0 { largest(&beyond) } else { largest(&share) };
    let ([low, high], [least, greatest]) = of(worst);
    let beside = format!(
        "action {worst} is recorded from {} to {}, and the environment takes {} to {}",
        tables::short(least),
        tables::short(greatest),
        tables::short(low),
        tables::short(high)
    );
    if recorded.beyond > OTHER_UNIT {
        let message = format!(
            "{} of the recorded actions lie beyond the bounds: {beside}",
            tables::percent(recorded.beyond)
        );
        let advice =
            "the set is in another unit, or of another environment; its actions must be what step() takes";
        return finding(Severity::Error, message, Some(advice));
    }
    if recorded.beyond > 0.0 {
        let message = format!(
            "{:.2} % of the recorded actions lie beyond the bounds: {beside}",
            100.0 * recorded.beyond
        );
        return finding(
            Severity::Warning,
            message,
            Some("they are clipped: the environment cannot be told to do that"),
        );
    }
    if share(worst) < HARDLY {
        let message = format!(
            "recorded actions use less than {} of what is possible: {beside}",
            tables::percent(HARDLY)
        );
        return finding(Severity::Warning, message, Some("perhaps the set is in another unit"));
    }
    finding(Severity::Fine, "recorded actions lie within the bounds of the environment", None)
}
