//! `demosift export`: what a run kept, in the form of the tool that its demonstrations came from, and what it trained.

mod policies;

use std::path::{Path, PathBuf};

use clap::ValueEnum as _;
use demosift::basics::counting::counted;
use demosift::basics::files;
use demosift::data::demonstration::episode::Format;
use demosift::data::demonstration::{DemoId, DemonstrationSet, lerobot, minari, robomimic};
use demosift::results::artifact::Artifact as _;
use demosift::results::uncertainty::Uncertainty;
use demosift::stages::imitate::LearningCurve;
use demosift::stages::referee::Verdict;
use demosift::stages::select::{Ranking, Subset};
use demosift::stages::subset_selection::Weighing;
use demosift::{Error, Result};
use serde::Serialize;
use serde_json::Value;

use super::convert::{self, Asked};
use super::imitate::NAMED;
use crate::answers::{self, Exported};
use crate::arguments::{ExportArguments, Form, SetArguments};
use crate::console::quoting::{quoted, quoted_path};
use crate::files::writing::undisturbed;
use crate::job::demonstrations::{self, Demonstrations};
use crate::job::identity::{Data, Identity};
use crate::job::run_folder::{self, RunFolder};
use crate::job::states;
use crate::{console::terminal, tables};

/// How many demonstrations are named one by one.
const MOST_NAMED: usize = 20;

/// What a run recommends to train on: what its verdict says, or without one what its ranking keeps; or what the user names.
struct Kept {
    identity: Identity,
    data: Data,
    folder: RunFolder,
    demonstrations: Demonstrations,
    /// In the order of the set.
    ids: Vec<DemoId>,
    /// Whose choice these are.
    chosen_by: String,
}

pub(crate) fn run(arguments: &ExportArguments) -> Result<()> {
    check_unused(arguments)?;
    // Not everything needs the demonstrations, which may be gone.
    let kept = || {
        let kept = open(arguments)?;
        terminal::note(&in_words(&kept));
        others_imitated(&kept)?.iter().for_each(|words| terminal::note(words));
        Ok(kept)
    };
    match arguments.form {
        Form::LerobotEpisodes => write_episode_list(&kept()?, arguments),
        Form::Json => say(&terminal::tame_json(&format!("{:#}\n", as_json(&kept()?)?)), arguments),
        Form::Csv => say(&as_csv(&kept()?)?, arguments),
        Form::Lerobot => write_lerobot(&kept()?, arguments),
        Form::Minari => write_minari(&kept()?, arguments),
        Form::RobomimicFilterKey => add_filter_key(&kept()?, arguments),
        Form::Onnx => policies::run(arguments),
    }
}

/// Refuses what would say nothing.
fn check_unused(arguments: &ExportArguments) -> Result<()> {
    let ExportArguments { run: _, form, data, out, name, fps, demonstration_ids, edit_my_file } = arguments;
    let (makes_key, reads_set) = (*form == Form::RobomimicFilterKey, *form != Form::Onnx);
    let given = [
        ("--data", data.is_some() && !reads_set),
        ("--demonstration-ids", !demonstration_ids.is_empty() && !reads_set),
        ("--fps", fps.is_some() && *form != Form::Lerobot),
        ("--name", name.is_some() && !makes_key),
        ("--edit-my-file", *edit_my_file && !makes_key),
        ("--out", out.is_some() && makes_key),
    ];
    let form = form.to_possible_value().expect("no form is skipped");
    convert::refuse_unused(&given, &format!("--as {}", form.get_name()))
}

fn write_lerobot(kept: &Kept, arguments: &ExportArguments) -> Result<()> {
    let out = folder(arguments)?;
    let Demonstrations { source, path, said, .. } = &kept.demonstrations;
    // What an environment is called is no task, and its rate is known to it alone.
    let task = kept.identity.simulator.is_none().then_some(kept.identity.task.as_str());
    let asked = Asked { fps: arguments.fps, task, out: &out };
    let mut described = convert::described(source, path, said, &asked)?;
    if described.tasks.len() > 1 {
        // Those of the kept alone.
        let of_kept = source.ids.iter().zip(&described.tasks).filter(|(id, _)| kept.ids.contains(id));
        described.tasks = of_kept.map(|(_, task)| task.clone()).collect();
    }
    let places = places(kept);
    described.videos = described.videos.of(&places);
    described.videos.missing.iter().for_each(|words| terminal::note(words));
    let states = states::usable(path, source, None)?.map(|states| at(&places, &states));
    let episodes = at(&places, &source.episodes);
    undisturbed(|| {
        lerobot::write(&out, &episodes, states.as_deref(), &described)?;
        demonstrations::hand_on(said, &out)
    })?;
    written(kept, &out)?;
    let name = out.file_name().unwrap_or_default().to_string_lossy();
    let id = quoted(&format!("local/{name}"));
    let options = format!("--dataset.repo_id={id} --dataset.root={}", quoted_path(&out));
    terminal::note(&format!("train on it: {}", training(&options, !described.videos.cameras.is_empty())));
    Ok(())
}

/// Where the kept demonstrations stand among the episodes that were read.
fn places(kept: &Kept) -> Vec<usize> {
    let ids = &kept.demonstrations.source.ids;
    (0..ids.len()).filter(|place| kept.ids.contains(&ids[*place])).collect()
}

fn at<T: Clone>(places: &[usize], all: &[T]) -> Vec<T> {
    places.iter().map(|place| all[*place].clone()).collect()
}

fn write_minari(kept: &Kept, arguments: &ExportArguments) -> Result<()> {
    let out = folder(arguments)?;
    let name = convert::minari_id(&out);
    let Demonstrations { source, path, said, .. } = &kept.demonstrations;
    let episodes = at(&places(kept), &source.episodes);
    let bounds = demonstrations::action_bounds(source, said);
    let changed = undisturbed(|| {
        let changed = match source.format {
            Format::MinariHdf5 => minari::write_subset(&out, path, &labels(kept), &name)?,
            _ => {
                minari::write(&out, &episodes, &name, bounds.as_deref())?;
                Vec::new()
            }
        };
        demonstrations::hand_on(said, &out)?;
        Ok(changed)
    })?;
    changed.iter().for_each(|words| terminal::note(words));
    written(kept, &out)
}

fn open(arguments: &ExportArguments) -> Result<Kept> {
    let run = &arguments.run;
    let (identity, folder) = run_folder::of_finished(run)?;
    let data = identity.data.clone().ok_or_else(|| {
        Error::bad_input("this run has no demonstrations; wanted one of sift or select").at(run)
    })?;
    let demonstrations =
        demonstrations::open(arguments.data.as_deref(), &SetArguments::default(), Some(&data), None)?;
    let found = demonstrations.data()?.sha256;
    if found != data.sha256 {
        return Err(Error::bad_input(format!(
            "the demonstrations are not those of the run: their SHA-256 was {}, and is {found} now",
            data.sha256
        ))
        .at(&demonstrations.path));
    }
    let choice = match &arguments.demonstration_ids[..] {
        [] => choice_of_run(run, &identity, &folder)?,
        named => super::imitate::check(named, &demonstrations.set)
            .map(|()| Choice { ids: super::imitate::named(named), by: "as you name them".to_owned() })?,
    };
    let Choice { mut ids, by: chosen_by } = choice;
    ids.sort_unstable();
    check_known(&ids, &demonstrations.set, run)?;
    Ok(Kept { identity, data, folder, demonstrations, ids, chosen_by })
}

/// Demonstrations, and whose choice they are.
struct Choice {
    ids: Vec<DemoId>,
    by: String,
}

/// What to train on is the referee's to say, where it was asked.
fn choice_of_run(run: &Path, identity: &Identity, folder: &RunFolder) -> Result<Choice> {
    let subset = Subset::recall(folder, "")?.ok_or_else(|| {
        let hint = in_folder_of_goal(run)
            .unwrap_or_else(|| "demosift select --resume --out RUN ranks them and keeps the best".to_owned());
        Error::bad_input("this run has kept no demonstrations yet").at(run).with_hint(hint)
    })?;
    let verdict = Verdict::recall(folder, "")?;
    let recommended =
        verdict.as_ref().and_then(|verdict| Some((verdict.recommended()?, verdict.winner_names()?)));
    Ok(match recommended {
        Some((ids, names)) => {
            let what = if names == ["all"] { "the whole set".to_owned() } else { names.join(" and ") };
            Choice { ids: ids.to_vec(), by: format!("as the referee recommends ({what})") }
        }
        None => {
            let configuration = run_folder::read_configuration(run, identity)?;
            let keep = configuration.get("keep").and_then(|keep| keep.as_str()).unwrap_or("quarter");
            Choice { ids: subset.demos, by: format!("as the ranking keeps them (keep = {keep})") }
        }
    })
}

/// Where results of a run of several goals lie, if this is one.
fn in_folder_of_goal(run: &Path) -> Option<String> {
    let goal = run_folder::first_within(run)?;
    Some(format!("it has several goals; give the folder of one of them, such as {}", goal.display()))
}

/// What is passed on, for users who may expect something else.
fn in_words(kept: &Kept) -> String {
    let (count, of) = (kept.ids.len(), kept.demonstrations.set.len());
    let which = if count > MOST_NAMED { String::new() } else { format!(": {}", tables::list(&kept.ids)) };
    format!("{count} of {of} demonstrations, {}{which}", kept.chosen_by)
}

/// Says of policies from demonstrations that were named that these are not what is passed on.
fn others_imitated(kept: &Kept) -> Result<Option<String>> {
    let mut others = Vec::new();
    for name in policies::names(kept.folder.path())? {
        let part = name.strip_prefix("policy_").filter(|part| part.starts_with(NAMED));
        let curve = part.map(|part| LearningCurve::recall(&kept.folder, part)).transpose()?.flatten();
        let demos = curve.map(|curve| curve.demos).filter(|demos| *demos != kept.ids);
        others.extend(demos.map(|demos| demos.iter().map(ToString::to_string).collect::<Vec<_>>().join(",")));
    }
    Ok(others.first().map(|first| {
        format!(
            "policies were also trained on demonstrations that you named ({}); --demonstration-ids {first} hands these on",
            others.join("; ")
        )
    }))
}

/// Whether all that a run's files name are demonstrations of its set.
fn check_known(ids: &[DemoId], set: &DemonstrationSet, run: &Path) -> Result<()> {
    match ids.iter().find(|id| !set.holds(**id)) {
        None => Ok(()),
        Some(id) => Err(Error::bad_input(format!(
            "the run names demonstration {id}, and the demonstrations of its set are {}",
            tables::range_of(set)
        ))
        .at(run)
        .with_hint(
            "its files are of another run, or were changed; run it again with another folder for --out",
        )),
    }
}

/// The command of LeRobot 0.4 that trains; it wants to be told that nothing is uploaded.
fn training(options: &str, has_camera: bool) -> String {
    let command = format!("lerobot-train {options} --policy.type=act --policy.push_to_hub=false");
    match has_camera {
        true => command,
        false => format!(
            "{command} (act and diffusion want a camera or observation.environment_state, and no camera is in this set; \
             another type may do without)"
        ),
    }
}

/// What the file calls the kept demonstrations, in its order.
fn labels(kept: &Kept) -> Vec<String> {
    kept.ids.iter().map(|&id| label(kept, id)).collect()
}

/// The list, which scripts take, and beside it the commands of LeRobot that use it.
fn write_episode_list(kept: &Kept, arguments: &ExportArguments) -> Result<()> {
    let list = episode_list(kept)?;
    say(&format!("{list}\n"), arguments)?;
    let Demonstrations { source, path, .. } = &kept.demonstrations;
    if source.format == Format::LeRobotV2 {
        terminal::note(&of_older_version(path));
    }
    let root = quoted_path(path);
    let options = format!("--dataset.repo_id=YOUR/SET --dataset.root={root} --dataset.episodes=\"{list}\"");
    let has_camera = !lerobot::description(path, source)?.videos.cameras.is_empty();
    terminal::note(&format!("train on these: {}", training(&options, has_camera)));
    let is_kept = |label: &str| labels(kept).iter().any(|kept| kept == label);
    let of_set = source.episodes.iter().map(|episode| &episode.label);
    let mut rest: Vec<&str> = of_set
        .chain(source.left_out.iter().map(|out| &out.label))
        .map(String::as_str)
        .filter(|label| !is_kept(label))
        .collect();
    rest.sort_by_key(|label| label.parse::<u64>().unwrap_or(u64::MAX));
    if !rest.is_empty() {
        terminal::note(&format!(
            "delete the rest, in a new set within the folder of this one: lerobot-edit-dataset --repo_id YOUR/SET --root {root} \
             --new_repo_id SET_kept --operation.type delete_episodes --operation.episode_indices \"[{}]\"; it lies in \
             {} then",
            rest.join(","),
            quoted_path(&path.join("SET_kept"))
        ));
    }
    Ok(())
}

/// What has to be done to a set before the commands of LeRobot 0.4 take it: its converter looks for the folder by the id below the
/// root, and puts the new set in its place.
fn of_older_version(path: &Path) -> String {
    let folder = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let root = folder.parent().map_or_else(|| ".".to_owned(), quoted_path);
    let id = quoted(&folder.file_name().unwrap_or_default().to_string_lossy());
    format!(
        "LeRobot 0.4 takes version 3.0 only, and this set is of an older one; its converter makes it 3.0 in place, from 2.1: \
         python -m lerobot.datasets.v30.convert_dataset_v21_to_v30 --repo-id={id} --root={root} --push-to-hub=false"
    )
}

fn label(kept: &Kept, demo: DemoId) -> String {
    kept.demonstrations.source.episode(demo).map_or_else(String::new, |episode| episode.label.clone())
}

fn episode_list(kept: &Kept) -> Result<String> {
    match kept.demonstrations.source.format {
        Format::LeRobotV3 | Format::LeRobotV2 => Ok(format!("[{}]", labels(kept).join(","))),
        other => Err(Error::bad_input(format!(
            "the demonstrations are stored as {other}, so they have no numbers in a LeRobot data set"
        ))
        .at(&kept.data.path)
        .with_hint("--as lerobot --out FOLDER writes the kept ones as a LeRobot data set")),
    }
}

fn add_filter_key(kept: &Kept, arguments: &ExportArguments) -> Result<()> {
    let path = &kept.demonstrations.path;
    if kept.demonstrations.source.format != Format::Robomimic {
        return Err(Error::bad_input(format!(
            "the demonstrations are stored as {}; only a robomimic file has filter keys",
            kept.demonstrations.source.format
        ))
        .at(path));
    }
    if !arguments.edit_my_file {
        return Err(Error::bad_config("a filter key is written into the file of the demonstrations itself")
            .at(path)
            .with_hint("add --edit-my-file to allow it; nothing but the key is changed"));
    }
    let name = arguments.name.as_deref().unwrap_or("demosift");
    // In place, so a write that is cut short could take the whole file with it.
    undisturbed(|| robomimic::add_filter_key(path, name, &labels(kept)))?;
    terminal::show(&format!(
        "Filter key '{name}' of {}: {}\n",
        counted(kept.ids.len(), "demonstration"),
        path.display()
    ));
    Ok(())
}

/// Every demonstration of a run, with where the numbers come from.
fn as_json(kept: &Kept) -> Result<Value> {
    let configuration = run_folder::read_configuration(kept.folder.path(), &kept.identity)?;
    Ok(value(&answers::Export {
        demosift: &kept.identity.demosift,
        task: &kept.identity.task,
        task_sha256: kept.identity.task_sha256.as_deref(),
        variant: kept.identity.variant.as_deref(),
        data: &kept.data,
        seed: configuration.get("seed"),
        configuration: &configuration,
        chosen: &kept.chosen_by,
        demonstrations: rows(kept)?,
    }))
}

fn value(answer: &impl Serialize) -> Value {
    serde_json::to_value(answer).expect("plain data always serializes")
}

fn rows(kept: &Kept) -> Result<Vec<Exported>> {
    let ranking = Ranking::recall(&kept.folder, "")?.ok_or_else(|| {
        let without = Error::bad_input("this run has no ranking").at(kept.folder.path());
        match in_folder_of_goal(kept.folder.path()) {
            Some(hint) => without.with_hint(hint),
            None => without,
        }
    })?;
    let ranked: Vec<DemoId> = ranking.entries.iter().map(|ranked| ranked.demo).collect();
    check_known(&ranked, &kept.demonstrations.set, kept.folder.path())?;
    let uncertainty = Uncertainty::recall(&kept.folder, "")?;
    let weighing = Weighing::recall(&kept.folder, "")?;
    let weights = weighing.as_ref().and_then(|weighing| weighing.rounds.last()).map(|round| &round.weights);
    let rows = ranking.entries.iter().enumerate().map(|(rank, ranked)| {
        let demo: DemoId = ranked.demo;
        let doubt = uncertainty.as_ref().and_then(|uncertainty| uncertainty.of(demo));
        Exported {
            demonstration: demo,
            label: label(kept, demo),
            steps: kept.demonstrations.set.get(demo).steps(),
            rank: rank + 1,
            kept: kept.ids.contains(&demo),
            score: ranked.gain,
            low: doubt.map(|doubt| doubt.low),
            high: doubt.map(|doubt| doubt.high),
            before: ranked.before,
            after: ranked.after,
            improves: doubt.map(|doubt| doubt.improves),
            weight: weights.and_then(|weights| weights.get(demo)),
        }
    });
    Ok(rows.collect())
}

/// The same as a table; what it comes from stands in lines that begin with `#`.
fn as_csv(kept: &Kept) -> Result<String> {
    const COLUMNS: [&str; 12] = [
        "demonstration",
        "label",
        "steps",
        "rank",
        "kept",
        "score",
        "low",
        "high",
        "before",
        "after",
        "improves",
        "weight",
    ];
    let all = as_json(kept)?;
    let mut text = format!(
        "# demosift {}, task {}{}, seed {}, data sha256 {}, kept {}\n{}\n",
        kept.identity.demosift,
        kept.identity.task,
        kept.identity.variant.as_ref().map_or(String::new(), |variant| format!(", variant {variant}")),
        all["seed"],
        kept.data.sha256,
        kept.chosen_by,
        COLUMNS.join(",")
    );
    for row in rows(kept)?.iter().map(value) {
        let cells = COLUMNS.map(|column| match &row[column] {
            Value::Null => String::new(),
            Value::String(word) if word.contains([',', '"', '\n']) => {
                format!("\"{}\"", word.replace('"', "\"\""))
            }
            Value::String(word) => word.clone(),
            other => other.to_string(),
        });
        text += &cells.join(",");
        text.push('\n');
    }
    Ok(text)
}

/// Prints words, or writes them where they are wanted.
fn say(text: &str, arguments: &ExportArguments) -> Result<()> {
    match &arguments.out {
        Some(out) if out.exists() => {
            Err(Error::bad_input("there is something of this name already; wanted the name of a new file")
                .at(out))
        }
        Some(out) => undisturbed(|| files::write_atomically(out, text.as_bytes())),
        None => {
            terminal::show(text);
            Ok(())
        }
    }
}

fn folder(arguments: &ExportArguments) -> Result<PathBuf> {
    arguments.out.clone().ok_or_else(|| {
        Error::bad_config("what is to be written is a folder, and none is named")
            .with_hint("add --out FOLDER")
    })
}

fn written(kept: &Kept, out: &Path) -> Result<()> {
    terminal::show(&format!(
        "{} of {} demonstrations: {}\n",
        kept.ids.len(),
        kept.demonstrations.set.len(),
        out.display()
    ));
    Ok(())
}
