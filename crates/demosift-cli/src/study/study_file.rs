//! A study file: what it plans, its sets and its methods' configurations, all read and checked before a cell is made.

mod form;

use std::path::{Path, PathBuf};

use demosift::basics::files;
use demosift::data::demonstration::DemonstrationSet;
use demosift::data::demonstration::episode::{Columns, Format};
use demosift::data::demonstration::open;
use demosift::math::arithmetic;
use demosift::results::panel::Judges;
use demosift::results::recording::Origin;
use demosift::run::experiment::{self, Config};
use demosift::run::preset::Preset;
use demosift::run::study::{
    Claim, Combination, Drawn, Figure, Judge, Known, Only, Pool, Refereed, Regret, Seeds, Set, Study, TopK,
    Weights, names,
};
use demosift::world::rollout::Playground;
use demosift::{Error, Result};
use serde::Deserialize;

use crate::configuration::{self, Layer};
use crate::task::{self, Chosen};
use crate::{job::demonstrations, job::fit};

pub(crate) use form::{Asked, Source};
use form::{File, MethodEntry, PoolEntry, RefereeEntry, SetEntry, known_preset, read};

/// Where a study that comes with demosift says that its sets are; a checkout has them there.
const SETS: &str = "../data";

/// A study with all that its cells are made from.
pub(crate) struct Opened {
    /// Of the sets that are there and asked for.
    pub(crate) study: Study,
    /// In the order of the study's sets.
    pub(crate) sets: Vec<OpenedSet>,
    /// Which part of it is to be done; all sets, as the study has no others.
    pub(crate) only: Only,
    /// What is to be said of it, such as which sets are not there.
    pub(crate) notes: Vec<String>,
}

/// A set, its task, and the configurations for both.
pub(crate) struct OpenedSet {
    pub(crate) set: DemonstrationSet,
    pub(crate) chosen: Chosen,
    /// The task as the study file names it.
    pub(crate) task: String,
    pub(crate) sha256: String,
    pub(crate) episodes: Option<Vec<usize>>,
    /// Those that the study file names, and as what it says that the set is stored.
    pub(crate) columns: Columns,
    pub(crate) format: Option<Format>,
    /// Of trainings.
    pub(crate) training: Config,
    /// Of each method that has cells of its own, by name.
    pub(crate) methods: Vec<(String, Config)>,
}

/// Reads and checks everything.
pub(crate) fn open(asked: &Asked<'_>) -> Result<Opened> {
    let path = &asked.source.path();
    let file = read(asked).map_err(|error| error.at(path))?;
    let folders = Folders {
        study: path.parent().unwrap_or(Path::new(".")),
        public: asked.public,
        sets: match asked.source {
            Source::At(_) => None,
            Source::BuiltIn { sets, .. } => Some(sets),
        },
    };
    let known: Vec<&str> = file.sets.iter().map(|set| set.name.as_str()).collect();
    let asked_for = asked.only.sets.as_ref().map(|typed| names(typed, &known));
    let named = |set: &SetEntry| asked_for.as_ref().is_none_or(|wanted| wanted.contains(&set.name));
    if let Some(name) = asked_for.iter().flatten().find(|name| !known.contains(&name.as_str())) {
        let list = known.join(", ");
        return Err(Error::bad_config(format!("the study has no set '{name}'; it has: {list}")).at(path));
    }
    // A set is judged from what was learned on another.
    let lends = |set: &SetEntry| file.sets.iter().any(|of| named(of) && of.prior.as_ref() == Some(&set.name));
    let (mut sets, mut notes) = (Vec::new(), Vec::new());
    for entry in file.sets.iter().filter(|set| named(set) || lends(set)) {
        let during = |error: Error| error.during(&format!("the set '{}'", entry.name));
        match open_set(entry, &file, folders).map_err(during)? {
            Found::There { opened, mut plan } => {
                if !named(entry) {
                    // It is asked for its prior alone.
                    (plan.seeds.count, plan.oracle_seeds.count, plan.regret) = (0, 0, false);
                }
                sets.push((*opened, *plan));
            }
            Found::NotThere(why) => notes.push(format!("The set {} is left out: {why}.", entry.name)),
        }
    }
    let names_there = |sets: &[(OpenedSet, Set)]| -> Vec<String> {
        sets.iter().map(|(_, plan)| plan.name.clone()).collect()
    };
    let there = names_there(&sets);
    sets.retain(|(_, plan)| match plan.prior.as_ref().filter(|of| known.contains(&of.as_str())) {
        Some(of) if !there.contains(of) => {
            notes.push(format!(
                "The set {} is left out: its prior is learned on {of}, which is not there.",
                plan.name
            ));
            false
        }
        _ => true,
    });
    if let Some(wanted) = asked_for.as_ref().filter(|_| !file.sets.iter().all(named)) {
        notes.push(format!("Only these sets were asked for: {}.", wanted.join(", ")));
    }
    let there = names_there(&sets);
    let is_there = |set: &String| !known.contains(&set.as_str()) || there.contains(set);
    let is_asked_for =
        |set: &String| is_there(set) && asked_for.as_ref().is_none_or(|wanted| wanted.contains(set));
    let (sets, planned): (Vec<OpenedSet>, Vec<Set>) = sets.into_iter().unzip();
    let first = file.seeds.first;
    let mut study = Study {
        name: asked.source.name(),
        sets: planned,
        methods: file.methods.iter().map(method).collect::<Result<_>>().map_err(|error| error.at(path))?,
        oracle: file.oracle.as_ref().map_or(Vec::new(), |oracle| oracle.imitators.clone()),
        hits_at: file
            .hits_at
            .clone()
            .unwrap_or_else(|| vec![TopK::Count(1), TopK::Count(2), TopK::Quarter, TopK::Half]),
        regret: file.regret.as_ref().map(|regret| Regret {
            at: regret.at.clone(),
            imitators: regret.imitators.clone(),
            trainings: Seeds { first, count: regret.trainings },
        }),
        pools: file
            .pools
            .iter()
            .filter(|pool| is_asked_for(&pool.set))
            .map(|pool| pool_of(pool, first))
            .collect(),
        referees: (file.referees.iter().filter(|entry| is_asked_for(&entry.set)))
            .map(|entry| refereed(entry, first))
            .collect::<Result<_>>()
            .map_err(|error| error.at(path))?,
        drawn: Drawn { in_part: !notes.is_empty() && !draws_nothing(&file), ..drawn(&file, is_there) },
    };
    study.oracle.dedup();
    if study.sets.is_empty() {
        let hint = "give the folder of the public sets: --data DIR";
        let why = notes.first().map_or("it has no set".to_owned(), Clone::clone);
        return Err(Error::bad_input(format!("nothing is left of the study. {why}")).with_hint(hint));
    }
    study.check().map_err(|error| error.at(path))?;
    make_portable_if_asked(&sets, trains(&file)).map_err(|error| error.at(path))?;
    let methods: Vec<&str> = study.methods.iter().map(|method| method.name.as_str()).collect();
    let only = Only { sets: None, methods: asked.only.methods.as_ref().map(|typed| names(typed, &methods)) };
    study.check_only(&only).map_err(|error| error.at(path))?;
    Ok(Opened { study, sets, only, notes })
}

fn draws_nothing(file: &File) -> bool {
    file.curves.is_none() && file.weights.is_none() && file.figures.is_empty() && file.claims.is_empty()
}

/// Whether it may train policies.
fn trains(file: &File) -> bool {
    let lists = !(file.pools.is_empty() && file.referees.is_empty());
    lists || file.oracle.is_some() || file.regret.is_some() || file.curves.is_some()
}

/// A process computes one way, so what is portable is all of a study or nothing.
fn make_portable_if_asked(sets: &[OpenedSet], trains: bool) -> Result<()> {
    let of_set = |set: &OpenedSet| {
        let of_methods = set.methods.iter().map(|(_, config)| config.portable);
        of_methods.chain(trains.then_some(set.training.portable)).collect::<Vec<_>>()
    };
    let asked: Vec<bool> = sets.iter().flat_map(of_set).collect();
    if !asked.contains(&true) {
        return Ok(());
    }
    if asked.contains(&false) {
        return Err(Error::bad_config(
            "portable = true stands in some values of the study and not in all, and a process computes one way",
        )
        .with_hint("write it into the values of both [judging] and [training], and into no method, or nowhere"));
    }
    arithmetic::make_portable();
    Ok(())
}

/// What is drawn of the sets that are there: what names others alone is left out.
fn drawn(file: &File, is_there: impl Fn(&String) -> bool) -> Drawn {
    let File { title, paper_says, reading, preset, curves, weights, figures, claims, .. } = file;
    if draws_nothing(file) {
        return Drawn::default();
    }
    let left = |sets: &[String]| -> Option<Vec<String>> {
        let left: Vec<String> = sets.iter().filter(|set| is_there(set)).cloned().collect();
        (sets.is_empty() || !left.is_empty()).then_some(left)
    };
    Drawn {
        title: title.clone(),
        preset: preset.clone(),
        paper: paper_says.clone(),
        reading: reading.clone(),
        in_part: false,
        curves: curves.clone(),
        weights: weights
            .as_ref()
            .and_then(|weights| Some(Weights { sets: left(&weights.sets)?, ..weights.clone() })),
        figures: figures
            .iter()
            .filter_map(|of| Some(Figure { sets: left(&of.sets)?, ..of.clone() }))
            .collect(),
        claims: claims.iter().filter_map(|of| Some(Claim { sets: left(&of.sets)?, ..of.clone() })).collect(),
    }
}

fn method(entry: &MethodEntry) -> Result<Judge> {
    let combination = match (entry.rule, &entry.of) {
        (Some(rule), Some(of)) => Some(Combination { rule, of: of.clone() }),
        (None, None) => None,
        _ => {
            return Err(Error::bad_config(format!(
                "the method '{}' has one of rule and of; a combination has both, and any other method none",
                entry.name
            )));
        }
    };
    if combination.is_some() && (entry.values.is_some() || entry.preset.is_some() || entry.own_prior) {
        return Err(Error::bad_config(format!(
            "the method '{}' combines others, so it has no preset, no values and no prior of its own",
            entry.name
        )));
    }
    Ok(Judge { name: entry.name.clone(), clones: entry.clones, own_prior: entry.own_prior, combination })
}

fn pool_of(entry: &PoolEntry, first: u64) -> Pool {
    let trainings = Seeds { first, count: entry.trainings };
    Pool { set: entry.set.clone(), subsets: entry.subsets.clone(), imitator: entry.imitator, trainings }
}

fn refereed(entry: &RefereeEntry, first: u64) -> Result<Refereed> {
    Ok(Refereed {
        set: entry.set.clone(),
        kept: entry.kept.clone(),
        pools: entry.pools.parse()?,
        with: entry.with.iter().map(|with| with.parse()).collect::<Result<_>>()?,
        first,
    })
}

#[derive(Clone, Copy)]
struct Folders<'a> {
    /// That of the study file, from which paths in it count.
    study: &'a Path,
    /// That of the public sets.
    public: Option<&'a Path>,
    /// That of the sets that come with demosift, for a study that comes with it.
    sets: Option<&'a Path>,
}

impl Folders<'_> {
    /// What the study file means by a path.
    fn find(&self, written: &Path) -> PathBuf {
        match (self.sets, written.strip_prefix(SETS)) {
            (Some(sets), Ok(rest)) => sets.join(rest),
            _ => self.study.join(written),
        }
    }
}

enum Found {
    There {
        opened: Box<OpenedSet>,
        plan: Box<Set>,
    },
    /// In words.
    NotThere(String),
}

fn open_set(entry: &SetEntry, file: &File, folders: Folders<'_>) -> Result<Found> {
    let path = match located(entry, folders)? {
        Located::At(path) => path,
        Located::NotThere(why) => return Ok(Found::NotThere(why)),
    };
    let columns =
        Columns { observations: entry.observation_columns.clone(), actions: entry.action_columns.clone() };
    let located = open::located(&path, entry.format)?;
    let said = demonstrations::said(&located, None, None)?;
    let open::Located { path, format } = located;
    let mut source = open::open(&path, Some(format), &columns)?;
    let sha256 = demonstrations::sha256(&source, &path, &said)?;
    if let Some(wanted) = entry.sha256.as_ref().filter(|wanted| **wanted != sha256) {
        return Err(Error::bad_input(format!("the SHA-256 is {sha256}, and must be {wanted}")).at(&path));
    }
    let chosen = choose(entry, folders)?;
    demonstrations::read_for(&mut source, &said, Some(&chosen))?;
    let whole = source.set().map_err(|error| {
        // A study has no option that leaves them out.
        Error::bad_input(error.message()).at(&path).with_hint(
            "make a set without the bad episodes and name that: demosift convert SET --skip-bad --to minari FOLDER",
        )
    })?;
    fit::check(&chosen, &source, &said, &path)?;
    let set = match &entry.episodes {
        Some(episodes) => part_of(&whole, episodes)?,
        None => whole.clone(),
    };
    let opened = OpenedSet {
        training: training(&set, &chosen, file)?,
        methods: configurations(&set, &chosen, file)?,
        task: entry.task.clone(),
        sha256,
        episodes: entry.episodes.clone(),
        columns,
        format: entry.format,
        set,
        chosen,
    };
    let of_file = |kind: &str, values: Vec<f64>| picked(kind, values, whole.len(), entry.episodes.as_deref());
    let mut known = Vec::new();
    if let Some(returns) = &entry.returns {
        known.push(of_file("return", returns.clone())?);
    }
    if let Some(stage) = &entry.stage {
        let stages = origins(&folders.find(stage))?.iter().map(|origin| origin.stage_score).collect();
        known.push(of_file("stage", stages)?);
    }
    let bodies = match &entry.bodies {
        Some(path) => bodies(&folders.find(path), whole.len(), entry.episodes.as_deref())?,
        None => Bodies::default(),
    };
    let recorded_under = match &entry.recorded_under {
        Some(path) => {
            let task = under_all_variants(entry, folders)?.task;
            let variants = &task.specification().variants;
            recorded_under(&folders.find(path), variants, whole.len(), entry.episodes.as_deref())?
        }
        None => Vec::new(),
    };
    let oracle = file.oracle.as_ref().map_or(0, |oracle| entry.oracle_seeds.unwrap_or(oracle.seeds));
    let plan = Set {
        name: entry.name.clone(),
        task: entry.task.clone(),
        variant: opened.chosen.variant.clone(),
        unit: opened.chosen.task.heuristic().unit().to_owned(),
        episodes: entry.episodes.clone(),
        demonstrations: opened.set.len(),
        seeds: Seeds { first: file.seeds.first, count: entry.seeds.unwrap_or(file.seeds.count) },
        oracle_seeds: Seeds { first: file.seeds.first, count: oracle },
        regret: entry.regret.unwrap_or(true),
        known,
        prior: entry.prior.clone(),
        bodies: bodies.of,
        succeeded: bodies.succeeded,
        recorded_under,
        body: entry.body.clone().or_else(|| {
            // A task that is named by its path has a name of its own.
            let name = &opened.chosen.task.specification().name;
            (*name != entry.task).then(|| name.clone())
        }),
    };
    Ok(Found::There { opened: Box::new(opened), plan: Box::new(plan) })
}

enum Located {
    At(PathBuf),
    /// In words.
    NotThere(String),
}

fn located(entry: &SetEntry, folders: Folders<'_>) -> Result<Located> {
    let (source, file) = match (&entry.data, &entry.source, &entry.file) {
        (Some(data), None, None) => return Ok(Located::At(folders.find(data))),
        (None, Some(source), Some(file)) if entry.sha256.is_some() => (source, file),
        _ => {
            return Err(Error::bad_config(
                "it must have data, the path of a set beside the study file, or of a public set source, file and sha256",
            ));
        }
    };
    let Some(public) = folders.public else {
        return Ok(Located::NotThere(format!(
            "it is of {source} and does not come with demosift, and no --data DIR is given"
        )));
    };
    let path = public.join(file);
    match path.exists() {
        true => Ok(Located::At(path)),
        false => {
            Ok(Located::NotThere(format!("{} of {source} is not in the folder of --data", file.display())))
        }
    }
}

fn part_of(whole: &DemonstrationSet, episodes: &[usize]) -> Result<DemonstrationSet> {
    let (mut seen, mut picked) = (Vec::new(), Vec::new());
    for &episode in episodes {
        let Some((_, demonstration)) = whole.iter().nth(episode) else {
            return Err(Error::bad_config(format!(
                "episodes names {episode}, and there are 0 to {}",
                whole.len() - 1
            )));
        };
        if seen.contains(&episode) {
            return Err(Error::bad_config(format!("episodes names {episode} twice")));
        }
        seen.push(episode);
        picked.push(demonstration.clone());
    }
    DemonstrationSet::new(picked)
}

/// Of values for the whole file those of the episodes that are used.
fn picked(kind: &str, values: Vec<f64>, whole: usize, episodes: Option<&[usize]>) -> Result<Known> {
    if values.len() != whole {
        return Err(Error::bad_config(format!(
            "its {kind} has {} numbers, and must have one for each of the {whole} demonstrations of the file",
            values.len()
        )));
    }
    let values = match episodes {
        Some(episodes) => episodes.iter().map(|episode| values[*episode]).collect(),
        None => values,
    };
    Ok(Known { kind: kind.to_owned(), values })
}

/// Where the demonstrations of a file came from, in their order.
fn origins(path: &Path) -> Result<Vec<Origin>> {
    #[derive(Deserialize)]
    struct Origins {
        demonstrations: Vec<Origin>,
    }
    if !path.exists() {
        return Err(Error::bad_input("the file of the demonstrations' stages does not exist").at(path));
    }
    let bytes = files::read(path)?;
    let origins: Origins = serde_json::from_slice(&bytes).map_err(|error| {
        Error::bad_input(format!("this does not say where demonstrations came from: {error}")).at(path)
    })?;
    let mut origins = origins.demonstrations;
    origins.sort_by_key(|origin| origin.demonstration);
    Ok(origins)
}

/// Who made the demonstrations that are used.
#[derive(Default)]
struct Bodies {
    /// The task in whose body each was made.
    of: Vec<String>,
    /// Whether it reached the goal there; nothing, unless that is known of all.
    succeeded: Vec<bool>,
}

fn bodies(path: &Path, whole: usize, episodes: Option<&[usize]>) -> Result<Bodies> {
    let used = origins_of(path, whole, episodes)?;
    let succeeded: Option<Vec<bool>> = used.iter().map(|origin| origin.succeeded).collect();
    Ok(Bodies {
        of: used.into_iter().map(|origin| origin.task).collect(),
        succeeded: succeeded.unwrap_or_default(),
    })
}

/// The variant under which each demonstration that is used was recorded.
fn recorded_under(
    path: &Path,
    variants: &[String],
    whole: usize,
    episodes: Option<&[usize]>,
) -> Result<Vec<String>> {
    let name = |origin: Origin| {
        variants.get(origin.variant).cloned().ok_or_else(|| {
            let wrong =
                format!("it tells of variant {}, and the task has {}", origin.variant, variants.len());
            Error::bad_input(wrong).at(path)
        })
    };
    origins_of(path, whole, episodes)?.into_iter().map(name).collect()
}

/// Where the demonstrations that are used came from.
fn origins_of(path: &Path, whole: usize, episodes: Option<&[usize]>) -> Result<Vec<Origin>> {
    let all = origins(path)?;
    if all.len() != whole {
        let wrong = format!("it tells of {} demonstrations, and there are {whole}", all.len());
        return Err(Error::bad_input(wrong).at(path));
    }
    Ok(match episodes {
        Some(episodes) => episodes.iter().map(|episode| all[*episode].clone()).collect(),
        None => all,
    })
}

/// The task, by name or by its path from the study file.
fn under_all_variants(entry: &SetEntry, folders: Folders<'_>) -> Result<Chosen> {
    let beside = folders.study.join(&entry.task);
    match (task::names().contains(&entry.task.as_str()), beside.to_str()) {
        (false, Some(path)) if beside.exists() => task::choose(path),
        _ => task::choose(&entry.task),
    }
}

/// The same under the one variant in which its set is judged.
fn choose(entry: &SetEntry, folders: Folders<'_>) -> Result<Chosen> {
    let chosen = under_all_variants(entry, folders)?;
    let variants = chosen.task.specification().variants.clone();
    match &entry.variant {
        Some(variant) => chosen.under(variant),
        None if variants.len() > 1 => Err(Error::bad_config(format!(
            "the task '{}' has several goals, so the set must name one as its variant: {}",
            entry.task,
            variants.join(", ")
        ))),
        None => Ok(chosen),
    }
}

fn preset(name: Option<&String>, file: &File) -> Result<Preset> {
    known_preset(name.or(file.preset.as_ref()).map_or("standard", String::as_str))
}

/// A configuration in layers, as that of a job is made.
fn configuration(chosen: &Chosen, preset: Preset, layers: &[Layer]) -> Result<Config> {
    let mut values = configuration::preset(preset, chosen.values.clone())?;
    for layer in layers {
        configuration::apply(&mut values, layer)?;
    }
    configuration::typed(configuration::of_job(values))
}

fn training(set: &DemonstrationSet, chosen: &Chosen, file: &File) -> Result<Config> {
    let values = Layer { source: "training.values".to_owned(), values: file.training.values.clone() };
    let config = configuration(chosen, preset(file.training.preset.as_ref(), file)?, &[values])?;
    experiment::check(set, chosen.task.specification(), &config)?;
    Ok(config)
}

fn configurations(set: &DemonstrationSet, chosen: &Chosen, file: &File) -> Result<Vec<(String, Config)>> {
    let direct = file.methods.iter().filter(|method| method.of.is_none());
    let of = |method: &MethodEntry| -> Result<(String, Config)> {
        let common = Layer { source: "judging.values".to_owned(), values: file.judging.values.clone() };
        let values = method.values.clone().unwrap_or_default();
        let own = Layer { source: format!("the values of '{}'", method.name), values };
        let config = configuration(chosen, preset(method.preset.as_ref(), file)?, &[common, own])?;
        match config.judges {
            Judges::Cloning | Judges::Paper => {}
            Judges::Both => {
                return Err(Error::bad_config(
                    "judges = both, and a method asks one: cloning or paper; a method with a rule combines others",
                ));
            }
            Judges::Trainer => {
                return Err(Error::bad_config(
                    "judges = trainer, and a method asks cloning or paper: a study trains by nobody else's trainer",
                ));
            }
        }
        experiment::check(set, chosen.task.specification(), &config)?;
        experiment::check_budget(set, &Playground::new(chosen.task.as_ref()), &config)?;
        Ok((method.name.clone(), config))
    };
    direct
        .map(|method| of(method).map_err(|error| error.during(&format!("the method '{}'", method.name))))
        .collect()
}
