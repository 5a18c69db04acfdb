//! `demosift convert`: demonstrations in another tool's format.

use std::path::Path;

use demosift::basics::counting::counted;
use demosift::data::demonstration::episode::{Format, Source};
use demosift::data::demonstration::lerobot::{Described, Videos};
use demosift::data::demonstration::{lerobot, minari};
use demosift::{Error, Result};

use crate::answers;
use crate::arguments::{ConvertArguments, Target};
use crate::files::writing::undisturbed;
use crate::job::demonstrations::{self, Opened, Said};
use crate::job::states;
use crate::{console::terminal, task};

pub(crate) fn run(arguments: &ConvertArguments) -> Result<()> {
    check_unused(arguments)?;
    let Opened { source, path, said, .. } =
        demonstrations::open_unchecked(Some(&arguments.demonstrations), &arguments.source, None)?;
    demonstrations::say_what_is_not_read(&source);
    // One is not enough to choose from, and enough to convert.
    source.check().map_err(|error| error.at(&path))?;
    let out = &arguments.out;
    let steps = match arguments.to {
        Target::Lerobot => {
            let asked = Asked { fps: arguments.fps, task: arguments.task.as_deref(), out };
            let described = described(&source, &path, &said, &asked)?;
            described.videos.missing.iter().for_each(|words| terminal::note(words));
            let states = states::usable(&path, &source, None)?;
            undisturbed(|| {
                lerobot::write(out, &source.episodes, states.as_deref(), &described)?;
                demonstrations::hand_on(&said, out)
            })?;
            source.episodes.iter().map(|episode| episode.actions.len()).sum()
        }
        Target::Minari => {
            let bounds = demonstrations::action_bounds(&source, &said);
            undisturbed(|| {
                let steps = minari::write(out, &source.episodes, &minari_id(out), bounds.as_deref())?;
                demonstrations::hand_on(&said, out)?;
                Ok(steps)
            })?
        }
    };
    if arguments.json {
        terminal::show_json(&answers::Convert { episodes: source.episodes.len(), steps, out });
        return Ok(());
    }
    let (count, total) = (counted(source.episodes.len(), "episode"), counted(steps, "step"));
    terminal::show(&format!("{count} of {total} in all: {}\n", out.display()));
    Ok(())
}

/// Refuses what would say nothing: only LeRobot keeps a rate and what was shown.
fn check_unused(arguments: &ConvertArguments) -> Result<()> {
    let keeps_none = arguments.to != Target::Lerobot;
    let given = [
        ("--task", arguments.task.is_some() && keeps_none),
        ("--fps", arguments.fps.is_some() && keeps_none),
    ];
    refuse_unused(&given, "--to minari")
}

/// The first option that is given in vain is an error, which names what it changes nothing of.
pub(super) fn refuse_unused(given: &[(&str, bool)], of: &str) -> Result<()> {
    match given.iter().find(|(_, in_vain)| *in_vain) {
        None => Ok(()),
        Some((option, _)) => {
            Err(Error::bad_config(format!("{option} changes nothing of {of}")).with_hint("leave it away"))
        }
    }
}

/// What is asked for where a set is written.
pub(super) struct Asked<'a> {
    pub(super) fps: Option<u32>,
    pub(super) task: Option<&'a str>,
    pub(super) out: &'a Path,
}

/// What LeRobot keeps beside the steps: as the source says, where it is of LeRobot too.
///
/// The rate is the one that is asked for, or that of the source, or what its set.toml says, or that of the task.
pub(super) fn described(source: &Source, path: &Path, said: &Said, asked: &Asked<'_>) -> Result<Described> {
    let mut described = match source.format {
        Format::LeRobotV3 | Format::LeRobotV2 => lerobot::description(path, source)?,
        _ => Described::default(),
    };
    described.untold.iter().for_each(|words| terminal::note(words));
    if asked.fps.is_some_and(|fps| fps != described.steps_per_sec) && !described.videos.cameras.is_empty() {
        let left = format!(
            "the videos are not passed on: they are of {} pictures in a second",
            described.steps_per_sec
        );
        described.videos = Videos { missing: vec![left], ..Videos::default() };
    }
    let whole = |rate: f64| (rate.round().max(1.0)) as u32;
    let rate = source.says.steps_per_sec.or(said.set_file.rate);
    let told = rate.map(whole);
    described.steps_per_sec = match (asked.fps, described.steps_per_sec, told) {
        (Some(given), ..) => given,
        (None, 0, Some(told)) => told,
        (None, 0, None) => rate_of_task(asked.task)?,
        (None, described, _) => described,
    };
    let written = described.steps_per_sec;
    if let Some(rate) =
        rate.filter(|rate| asked.fps.is_none() && (rate - f64::from(written)).abs() > 1e-6 * rate)
    {
        terminal::note(&format!(
            "the set has {rate} steps a second, and {written} is written: LeRobot keeps a whole number; --fps N says another one"
        ));
    }
    if described.tasks.is_empty() {
        described.tasks = vec![asked.task.map_or_else(|| name_of(asked.out), task_name)];
    }
    Ok(described)
}

fn rate_of_task(task: Option<&str>) -> Result<u32> {
    let task = task.ok_or_else(|| {
        Error::bad_config("LeRobot keeps the rate of the steps, and nothing here tells it")
            .with_hint("add --task NAME, or --fps N")
    })?;
    Ok(task::choose(task)?.task.specification().steps_per_sec())
}

/// What others call the task: a user's own goes by the name in its file, not by the path on this machine.
fn task_name(task: &str) -> String {
    // With a rate given, a task may be one that demosift does not know.
    task::choose(task)
        .map_or_else(|_| name_of(Path::new(task)), |chosen| chosen.task.specification().name.clone())
}

/// The id of a Minari data set that is named after its folder; Minari allows letters, digits, `-` and `_` in a name.
pub(super) fn minari_id(out: &Path) -> String {
    let allowed = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
    let name: String =
        name_of(out).chars().map(|letter| if allowed(letter) { letter } else { '-' }).collect();
    let name = match name.trim_matches('-') {
        "" => "demonstrations",
        name => name,
    };
    format!("demosift/{name}-v0")
}

fn name_of(out: &Path) -> String {
    out.file_name().map_or_else(|| "demonstrations".to_owned(), |name| name.to_string_lossy().into_owned())
}
