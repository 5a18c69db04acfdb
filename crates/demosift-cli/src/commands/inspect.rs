//! `demosift inspect`: what a file of demonstrations holds, and whether one could learn from it.

use std::path::Path;

use demosift::Result;
use demosift::basics::counting::counted;
use demosift::data::demonstration::choice;
use demosift::data::demonstration::episode::Source;
use demosift::data::demonstration::inspection::{self, Inspection, Look, Spread};
use demosift::data::demonstration::listing::{ColumnSeen, Used};
use demosift::data::demonstration::open;
use demosift::run::experiment;
use demosift_mujoco::check::{Finding, Severity};

use super::task::{mended, told};
use crate::answers;
use crate::arguments::InspectArguments;
use crate::job::demonstrations::{self, Opened, Said};
use crate::job::fit::{self, Held};
use crate::report::looks;
use crate::report::page::name_of_set;
use crate::tables::{table, wrapped};
use crate::task::Chosen;
use crate::{console::terminal, task};

/// Episodes and columns that are shown one by one before only the odd ones are.
const SHOWN: usize = 24;
/// Odd episodes that are shown of a set of many.
const MOST_ODD: usize = 40;

pub(crate) fn run(arguments: &InspectArguments) -> Result<()> {
    let chosen = arguments.task.as_deref().map(task::choose).transpose()?;
    let mut opened =
        demonstrations::open_unchecked(Some(&arguments.demonstrations), &arguments.source, None)?;
    match opened.read_for(chosen.as_ref()) {
        // Without a task the numbers are shown as they were recorded.
        Err(error) if chosen.is_none() && error.hint().is_some() => terminal::note(&error.to_string()),
        read => read?,
    }
    let Opened { source, path, said, .. } = opened;
    let converted = source.converted();
    let seen = inspection::inspect(&converted);
    let looks = inspection::looks(&converted);
    let held = open::columns(&path, &source).unwrap_or_default();
    let set = source.set();
    let fits = chosen.as_ref().map(|chosen| fits(chosen, &source, &said, &path)).transpose()?;
    let wrong = set.as_ref().err().map(ToString::to_string);
    let way = set.as_ref().err().and_then(demosift::Error::hint);
    if let Some(page) = &arguments.html {
        let fits = fits.as_ref().zip(arguments.task.as_ref()).map(|(fits, task)| fits.in_words(task));
        let made = looks::Made {
            demosift: env!("CARGO_PKG_VERSION"),
            set: name_of_set(&path),
            format: seen.format.to_string(),
            observation_size: seen.observations.len(),
            action_size: seen.actions.len(),
            left_out: choice::in_words(&seen.left_out),
            numbers: &said.in_words(&source),
            why_not: wrong.as_deref(),
            way_out: way,
            fits,
        };
        looks::write(page, &looks, &made)?;
    }
    if arguments.json {
        terminal::show_json(&answers::Inspect {
            path: &path,
            inspection: &seen,
            columns_of_file: &held,
            episodes_by_oddness: &looks,
            learnable: wrong.is_none(),
            why_not: wrong.as_deref(),
            way_out: way,
            task: arguments.task.as_deref(),
            fits_task: fits.as_ref().map(|fits| fits.why_not.is_none()),
            why_it_does_not_fit: fits.as_ref().and_then(|fits| fits.why_not.as_deref()),
            findings: fits.as_ref().map_or(&[], |fits| &fits.findings),
        });
        return Ok(());
    }
    terminal::show(&format!("{}\n\n", summary(&seen)));
    terminal::show(&episodes(&seen));
    terminal::show(&columns(&seen));
    terminal::show(&columns_of_file(&held));
    terminal::show(&each(&looks));
    if let Some(wrong) = wrong {
        terminal::show(&format!("\nNobody can learn from this set: {wrong}.\n"));
        way.iter().for_each(|way| terminal::show(&format!("What can be done: {way}\n")));
    }
    if let (Some(fits), Some(task)) = (fits, &arguments.task) {
        if !fits.findings.is_empty() {
            terminal::show(&told(&fits.findings));
        }
        terminal::show(&match fits.why_not {
            Some(_) if !fits.findings.is_empty() => {
                format!("\nIt does not fit the task '{task}': see ERROR above.\n")
            }
            _ => format!("\n{}\n", fits.in_words(task)),
        });
        terminal::show(&mended(&fits.findings, &said));
    }
    if let Some(page) = &arguments.html {
        terminal::show(&format!("\nPage: {}\n", page.display()));
    }
    Ok(())
}

/// Whether a set fits a task, and what was found out.
struct Fits {
    why_not: Option<String>,
    findings: Vec<Finding>,
}

impl Fits {
    fn in_words(&self, task: &str) -> String {
        match &self.why_not {
            None => format!("It fits the task '{task}'."),
            Some(why) => format!("It does not fit the task '{task}': {why}."),
        }
    }
}

fn fits(chosen: &Chosen, source: &Source, said: &Said, path: &Path) -> Result<Fits> {
    let no = |why: String| Ok(Fits { why_not: Some(why), findings: Vec::new() });
    let Ok(set) = source.set() else { return no("the set is not fit to learn from".to_owned()) };
    let task = chosen.task.specification();
    let misfit = experiment::check_fits(&set, task).err().map(|error| error.to_string());
    let sizes = (set.observation_size(), set.action_size());
    if let (Some(misfit), true) = (&misfit, sizes != (task.observation_size, task.action_size)) {
        return no(misfit.clone());
    }
    let mut findings = fit::findings(chosen, &Held::of(source, said, path, chosen.mujoco.as_ref())?)?;
    findings.extend(misfit.map(|message| Finding {
        severity: Severity::Error,
        message,
        advice: None,
        lines: None,
    }));
    let errors = findings.iter().filter(|finding| finding.severity == Severity::Error);
    let why: Vec<&str> = errors.map(|finding| finding.message.as_str()).collect();
    Ok(Fits { why_not: (!why.is_empty()).then(|| why.join("; ")), findings })
}

fn summary(seen: &Inspection) -> String {
    let lengths = seen.episodes.iter().map(|episode| episode.steps);
    let span = match (lengths.clone().min(), lengths.max()) {
        (Some(least), Some(most)) if least == most => format!("of {} each", counted(least, "step")),
        (Some(least), Some(most)) => format!("of {least} to {most} steps, {} in all", seen.steps),
        _ => String::new(),
    };
    let dropped = match seen.dropped_steps {
        0 => String::new(),
        1 => "\n1 step after the last complete episode was left out.".to_owned(),
        steps => format!("\n{steps} steps after the last complete episode were left out."),
    };
    let left_out: String = choice::in_words(&seen.left_out)
        .iter()
        .chain(&seen.not_read)
        .map(|words| format!("\n{}", wrapped(words)))
        .collect();
    format!(
        "{} {span}, stored as {}.\nAn observation is {} ({}), an action {} ({}).{dropped}{left_out}",
        counted(seen.episodes.len(), "episode"),
        seen.format,
        seen.columns.observations.join(" + "),
        counted(seen.observations.len(), "number"),
        seen.columns.actions.join(" + "),
        counted(seen.actions.len(), "number")
    )
}

fn episodes(seen: &Inspection) -> String {
    let all = seen.episodes.len() <= SHOWN;
    let sizes = (seen.observations.len(), seen.actions.len());
    let odd = |index: &usize| {
        let episode = &seen.episodes[*index];
        all || episode.not_finite > 0 || (episode.observation_size, episode.action_size) != sizes
    };
    let shown: Vec<usize> = (0..seen.episodes.len()).filter(odd).collect();
    let rows: Vec<Vec<String>> = shown
        .iter()
        .map(|&index| {
            let episode = &seen.episodes[index];
            vec![
                episode.demonstration.to_string(),
                episode.label.clone(),
                episode.steps.to_string(),
                episode.not_finite.to_string(),
            ]
        })
        .collect();
    let rest = match seen.episodes.len() - shown.len() {
        0 => String::new(),
        rest => format!("  … and {rest} more without anything odd\n"),
    };
    let header = ["demonstration", "in the file", "steps", "not finite"];
    if rows.is_empty() { rest } else { table(&header, &rows) + &rest }
}

fn columns(seen: &Inspection) -> String {
    let mut rows = Vec::new();
    let few = seen.observations.len() + seen.actions.len() <= 2 * SHOWN;
    for (what, spreads, bounded) in
        [("observation", &seen.observations, false), ("action", &seen.actions, true)]
    {
        for (index, spread) in spreads.iter().enumerate() {
            let remarks = remarks(spread, bounded);
            if few || bounded || !remarks.is_empty() {
                let written = |value: f32| match value.abs() {
                    // Digits that nobody counts.
                    1e9.. => format!("{value:e}"),
                    _ => format!("{value:.4}"),
                };
                let number = |value: Option<f32>| value.map_or("none".to_owned(), written);
                rows.push(vec![
                    format!("{what} {index}"),
                    number(spread.least),
                    number(spread.greatest),
                    remarks,
                ]);
            }
        }
    }
    let rest = match seen.observations.len() + seen.actions.len() - rows.len() {
        0 => String::new(),
        rest => format!("  … and {rest} more without anything odd\n"),
    };
    format!("\n{}{rest}", table(&["number", "least", "greatest", ""], &rows))
}

/// What the recording alone says of each episode, the oddest first.
fn each(looks: &[Look]) -> String {
    let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.3}"));
    let share = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{:.0}%", 100.0 * value));
    let is_shown = |look: &&Look| looks.len() <= SHOWN || !look.odd.is_empty();
    let rows: Vec<Vec<String>> = looks
        .iter()
        .filter(is_shown)
        .take(MOST_ODD)
        .map(|look| {
            vec![
                look.label.clone(),
                look.steps.to_string(),
                number(look.jerk),
                number(look.jerk_95),
                look.arc_length.map_or("-".to_owned(), |length| format!("{length:.2}")),
                share(look.fast_power),
                share(look.still),
                look.jump.map_or("-".to_owned(), |jump| format!("{jump:.1}")),
                share(Some(look.outside)),
                look.end_distance.map_or("-".to_owned(), |distance| format!("{distance:.2}")),
                look.odd.join(", "),
            ]
        })
        .collect();
    let rest = match looks.len() - rows.len() {
        0 => String::new(),
        rest => format!("  … and {rest} more; --json lists all\n"),
    };
    let what = "What the recording alone says of each episode, the oddest first. It does not say what an agent learns from it.";
    let header = [
        "episode",
        "steps",
        "jerk",
        "p95",
        "arc length",
        "fast",
        "still",
        "jump",
        "outside",
        "end off",
        "odd",
    ];
    format!("\n{}\n\n{}{rest}", wrapped(what), table(&header, &rows))
}

/// What the file holds, and what of it is read.
fn columns_of_file(held: &[ColumnSeen]) -> String {
    let rows: Vec<Vec<String>> = held
        .iter()
        .map(|column| {
            let shape = column.shape.as_ref().map_or_else(String::new, |shape| format!("{shape:?}"));
            let used = match column.used {
                Used::Observation => "observation",
                Used::Action => "action",
                Used::Image => "left out: images are not read",
                Used::NoNumbers => "left out: no numbers",
                Used::NotThere => "described, and not in the tables",
                Used::Not => "-",
            };
            vec![column.name.clone(), shape, column.kind.clone(), used.to_owned()]
        })
        .collect();
    let others: Vec<&str> =
        held.iter().filter(|column| column.used == Used::Not).map(|column| column.name.as_str()).collect();
    let way = match others.is_empty() {
        true => String::new(),
        false => format!(
            "{}\n",
            wrapped(
                "Of the columns marked - nothing is read; --observation-columns and --action-columns name others."
            )
        ),
    };
    format!("\n{}{way}", table(&["column", "shape", "kind", "used as"], &rows))
}

fn remarks(spread: &Spread, bounded: bool) -> String {
    let mut remarks = Vec::new();
    if spread.is_constant() {
        remarks.push("constant".to_owned());
    }
    if spread.not_finite > 0 {
        remarks.push(format!("not finite at {}", counted(spread.not_finite, "step")));
    }
    if bounded && spread.outside > 0 {
        remarks.push(format!("outside [-1, 1] at {}", counted(spread.outside, "step")));
    }
    remarks.join(", ")
}
