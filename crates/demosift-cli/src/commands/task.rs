//! `demosift task check`: what a task is made of, whether it can be learned in, and whether demonstrations fit it.

mod environment;
mod new;

use std::path::Path;
use std::time::Instant;

use demosift::basics::seed::Seed;
use demosift::{Error, Result};
use demosift_mujoco::check::{
    self, Actuator, Compared, Finding, Part, Range, Recorded, Seen, Severity, StatesFrom, Tried,
};
use demosift_mujoco::mujoco_task::MujocoTask;

use crate::answers;
use crate::arguments::{SetArguments, TaskCheckArguments, TaskCommand};
use crate::job::demonstrations::{self, Opened, Said};
use crate::job::fit::{self, Held};
use crate::tables::{self, Scale, table, wrapped};
use crate::task::{self, Chosen};
use crate::{console::terminal, task::simulator};

/// Rows that a table has before it sums up.
const SHOWN: usize = 24;

const LEGEND: &str = "Misses: the share of a step's change that an action, taken in its own recorded state, does not bring \
                      about, of the median step among those in which something moves. Drift: how far positions go from \
                      the recorded ones, rad or m, at most and as root mean square; leaves: the first step at which it is \
                      more than 0.01.";

pub(crate) fn run(command: &TaskCommand) -> Result<()> {
    match command {
        TaskCommand::Check(arguments) => check(arguments),
        TaskCommand::New(arguments) => new::run(arguments),
    }
}

fn check(arguments: &TaskCheckArguments) -> Result<()> {
    let set = simulator::naming(arguments.data.as_deref(), Some(&arguments.storage.storage), None);
    if let Some(simulated) = simulator::open(&arguments.simulator, set, None, false)? {
        return environment::check(&simulated, arguments);
    }
    let named = arguments.task.as_ref().ok_or_else(task::missing)?;
    let chosen = task::choose(named)?;
    let Some(task) = &chosen.mujoco else {
        return Err(Error::bad_input(format!(
            "the task '{}' has no model that could be checked",
            chosen.name
        ))
        .with_hint("give the path of a folder with a task.toml, or another one of `demosift tasks`"));
    };
    let (seen, mut findings) = check::look(task);
    let start = Instant::now();
    let (played, more) = check::play(task, &Seed::new(arguments.seed))?;
    let steps_per_sec = played.steps_per_sec(start.elapsed().as_secs_f64());
    findings.extend(more);
    let mut against = None;
    if let Some(data) = &arguments.data {
        match held_against(task, &chosen, data, &arguments.storage) {
            Ok(held) => against = Some(held),
            // What was found of the task holds all the same.
            Err(error) => findings.push(unreadable(&error)),
        }
    }
    findings.extend(against.iter_mut().flat_map(|against| std::mem::take(&mut against.findings)));
    let recorded = against.as_ref().map(|against| &against.recorded);
    findings.sort_by_key(|finding| finding.severity);
    if arguments.json {
        terminal::show_json(&answers::TaskCheck {
            task: &seen,
            played: &played,
            steps_per_sec,
            recorded,
            findings: &findings,
        });
    } else {
        terminal::show(&summary(&seen));
        terminal::show(&under_random_actions(&seen, &played, steps_per_sec));
        if let Some(recorded) = recorded {
            terminal::show(&under_recorded_actions(&seen, recorded));
        }
        terminal::show(&told(&findings));
        if let Some(Against { said, .. }) = &against {
            terminal::show(&mended(&findings, said));
        }
    }
    outcome(&findings, named)
}

/// An error if there is one among the findings.
fn outcome(findings: &[Finding], of: &str) -> Result<()> {
    match check::count(findings, Severity::Error) {
        0 => Ok(()),
        count => Err(Error::bad_input(format!(
            "the check of '{of}' found {}",
            if count == 1 { "an error".to_owned() } else { format!("{count} errors") }
        ))),
    }
}

/// A set that was held against the task.
struct Against {
    recorded: Recorded,
    findings: Vec<Finding>,
    said: Said,
}

/// Holds the demonstrations of a set, of which one is enough, against the task.
fn held_against(task: &MujocoTask, chosen: &Chosen, data: &Path, how: &SetArguments) -> Result<Against> {
    let mut opened = demonstrations::open_unchecked(Some(data), how, None)?;
    opened.read_for(Some(chosen))?;
    let Opened { source, path, said, .. } = opened;
    // States of another model are a finding here.
    let held = Held::of(&source, &said, &path, None).map_err(|error| error.at(&path))?;
    demonstrations::say_what_is_not_read(&source);
    let (recorded, findings) = check::compare_presented(task, &held.presented())?;
    Ok(Against { recorded, findings, said })
}

fn unreadable(error: &Error) -> Finding {
    Finding {
        severity: Severity::Error,
        message: format!("the demonstrations cannot be read: {error}"),
        advice: error.hint().map(str::to_owned),
        lines: None,
    }
}

fn summary(seen: &Seen) -> String {
    let parts: Vec<String> = seen.observation.iter().map(part).collect();
    let unit = if seen.unit.is_empty() { String::new() } else { format!(" [{}]", seen.unit) };
    let rows = [
        ("bodies", counted(&seen.bodies)),
        (
            "joints",
            format!(
                "{}; {} positions, {} velocities",
                counted(&seen.joints),
                seen.positions,
                seen.velocities
            ),
        ),
        ("cameras", counted(&seen.cameras)),
        (
            "control step",
            format!(
                "{:.4} s: {} steps of the physics of {} s",
                seen.control_step_secs, seen.frame_skip, seen.timestep_secs
            ),
        ),
        ("episode", episode(seen)),
        ("observation", format!("{} numbers: {}", seen.observation_size, parts.join(", "))),
        ("action", actuators(seen)),
        ("variants", counted(&seen.variants)),
        ("heuristic", format!("{}{unit}; higher is better", seen.heuristic)),
        ("success", seen.success.clone().unwrap_or_else(|| "the task does not say".to_owned())),
        ("reward", if seen.reward.is_empty() { "none".to_owned() } else { seen.reward.join(" + ") }),
        (
            "return",
            seen.true_return.as_ref().map_or_else(
                || "the task does not say".to_owned(),
                |name| format!("the sum of {name} over the steps, for reports only"),
            ),
        ),
    ];
    let lines = rows.iter().map(|(what, words)| tables::hanging(&format!("  {what:<12}   "), words));
    format!("The task '{}':\n\n{}", seen.name, lines.collect::<String>())
}

/// Such as `1000 control steps, 8.00 s; ends early as soon as height leaves [0.8, 2]`.
fn episode(seen: &Seen) -> String {
    let whole = format!("{} control steps, {:.2} s", seen.horizon, seen.episode_secs);
    if seen.ends.is_empty() {
        return whole;
    }
    format!("{whole}; ends early as soon as {}", seen.ends.join(", or "))
}

/// Such as `qvel 9 clipped to [-10, 10]`.
fn part(part: &Part) -> String {
    let clipped = part.clip.map_or(String::new(), |[low, high]| format!(" clipped to [{low}, {high}]"));
    format!("{} {}{clipped}", part.key, part.columns.len())
}

/// Names with their ranges, which are said once where they are all the same.
fn actuators(seen: &Seen) -> String {
    let range =
        |actuator: &Actuator| format!("{} to {}", tables::short(actuator.low), tables::short(actuator.high));
    let ranges: Vec<String> = seen.actuators.iter().map(range).collect();
    let names: Vec<String> = seen.actuators.iter().map(|actuator| actuator.name.clone()).collect();
    if ranges.iter().all(|range| *range == ranges[0]) {
        return format!("{}; controls from {}", counted(&names), ranges[0]);
    }
    let named: Vec<String> =
        names.iter().zip(&ranges).map(|(name, range)| format!("{name} ({range})")).collect();
    counted(&named)
}

/// Such as `2: shoulder, elbow`.
fn counted(names: &[String]) -> String {
    match names.len() {
        0 => "none".to_owned(),
        count => format!("{count}: {}", names.join(", ")),
    }
}

fn under_random_actions(seen: &Seen, played: &Tried, steps_per_sec: f64) -> String {
    let scale = Scale::of([played.scores.least, played.scores.greatest], &seen.unit);
    let success = played.success.map_or(String::new(), |share| {
        format!(", and {} of the episodes are a success", tables::percent(share))
    });
    let scores = if played.unstable == played.episodes {
        "No episode could be finished.".to_owned()
    } else {
        format!(
            "The heuristic is {} to {}{success}.",
            scale.plain(played.scores.least),
            scale.with_unit(played.scores.greatest)
        )
    };
    let cut = if played.steps_per_episode < seen.horizon {
        format!(" (the first {} control steps of each)", played.steps_per_episode)
    } else {
        String::new()
    };
    let ended = match played.ended_early {
        0 => String::new(),
        count => format!(" ({count} of them ended early)"),
    };
    let words = format!(
        "{}{cut} of random actions{ended}: {} control steps, {} a second on one thread.",
        check::several(played.episodes, "episode"),
        played.steps,
        tables::rounded(steps_per_sec)
    );
    let number = |value: f64| if value.is_finite() { format!("{value:.4}") } else { "none".to_owned() };
    let remark = |range: &Range| if range.is_constant() { "constant" } else { "" }.to_owned();
    let row =
        |what: String, range: &Range| vec![what, number(range.least), number(range.greatest), remark(range)];
    let few = played.observation.len() <= SHOWN;
    let columns = played.observation.iter().enumerate();
    let mut rows: Vec<Vec<String>> = columns
        .filter(|(_, range)| few || range.is_constant())
        .take(SHOWN)
        .map(|(column, range)| row(format!("observation {column}: {}", range.name), range))
        .collect();
    let rest = match played.observation.len() - rows.len() {
        0 => String::new(),
        rest => format!("  … and {rest} more numbers of an observation\n"),
    };
    let measured = seen.measurements.iter().zip(&played.measurements);
    rows.extend(
        measured.map(|(measured, range)| row(format!("{}: {}", measured.name, measured.what), range)),
    );
    format!(
        "\n{}\n{}\n\n{}{rest}",
        wrapped(&words),
        wrapped(&scores),
        table(&["what", "least", "greatest", ""], &rows)
    )
}

fn under_recorded_actions(seen: &Seen, recorded: &Recorded) -> String {
    let words = match recorded.states {
        StatesFrom::Recording => "The demonstrations, played again from their first recorded state:",
        StatesFrom::Observations => "The demonstrations, played again from their first observation:",
        StatesFrom::Nowhere => "The demonstrations:",
    };
    let scale = Scale::of(recorded.demonstrations.iter().filter_map(|one| one.score), &seen.unit);
    let title = scale.title("heuristic");
    let shown = Shown {
        replayed: recorded.states != StatesFrom::Nowhere,
        scored: recorded.demonstrations.iter().any(|one| one.score.is_some()),
        succeeded: recorded.demonstrations.iter().any(|one| one.succeeded.is_some()),
    };
    let mut header = vec!["demonstration", "steps", "max action"];
    if shown.replayed {
        header.extend(shown.scored.then_some(title.as_str()));
        header.extend(shown.succeeded.then_some("success"));
        header.extend(["misses", "drift", "rms", "leaves"]);
    }
    let rows: Vec<Vec<String>> = recorded
        .demonstrations
        .iter()
        .enumerate()
        .take(SHOWN)
        .map(|(id, one)| row_of(id, one, scale, shown))
        .collect();
    let rest = match recorded.demonstrations.len() - rows.len() {
        0 => String::new(),
        rest => format!("  … and {rest} more\n"),
    };
    format!(
        "\n{words}\n\n{}{rest}{}",
        table(&header, &rows),
        if shown.replayed { format!("\n{}\n", wrapped(LEGEND)) } else { String::new() }
    )
}

/// Which columns there is anything to show in.
#[derive(Clone, Copy)]
struct Shown {
    replayed: bool,
    scored: bool,
    succeeded: bool,
}

fn row_of(id: usize, one: &Compared, scale: Scale<'_>, shown: Shown) -> Vec<String> {
    let mut row = vec![id.to_string(), one.steps.to_string(), format!("{:.2}", one.largest_action)];
    if !shown.replayed {
        return row;
    }
    let unknown = || "-".to_owned();
    if shown.scored {
        row.push(one.score.map_or_else(unknown, |score| scale.plain(score)));
    }
    if shown.succeeded {
        row.push(one.succeeded.map_or_else(unknown, tables::yes_or_no));
    }
    row.push(one.typically_missed.map_or_else(unknown, check::percent_missed));
    match one.drift {
        None => row.extend([(); 3].map(|()| unknown())),
        Some(drift) => {
            row.extend([drift.greatest, drift.rms].map(tables::drifted));
            row.push(drift.left_at.map_or_else(|| "never".to_owned(), |step| format!("step {step}")));
        }
    }
    row
}

/// The lines of a set.toml that would mend what was found, and where they go.
pub(super) fn mended(findings: &[Finding], said: &Said) -> String {
    match fit::lines(findings) {
        lines if lines.is_empty() => String::new(),
        lines => format!("\nTo mend the set, {}\n", fit::where_to_write(&lines, said)),
    }
}

/// All findings, each with what can be done.
pub(super) fn told(findings: &[Finding]) -> String {
    let lines = findings.iter().map(|finding| {
        let severity = match finding.severity {
            Severity::Error => "ERROR",
            Severity::Warning => "warning",
            Severity::Fine => "fine",
        };
        let advice = finding.advice.as_ref().map_or(String::new(), |advice| format!(": {advice}"));
        tables::hanging(&format!("  {severity:<7}   "), &format!("{}{advice}", finding.message))
    });
    format!("\n{}", lines.collect::<String>())
}
