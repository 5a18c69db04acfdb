//! The demonstrations that a user names, read and checked, with what identifies them.

use std::path::{Path, PathBuf};

use demosift::basics::files;
use demosift::data::demonstration::choice::{self, Choice};
use demosift::data::demonstration::episode::{self, Columns, Episode, Source};
use demosift::data::demonstration::open::{self, Located};
use demosift::data::demonstration::set_file::{self, Conversion, Meaning, Ranges, SetFile, Unit, Units};
use demosift::data::demonstration::{DemoId, DemonstrationSet};
use demosift::data::trajectory::StateLog;
use demosift::run::experiment::{self, Config};
use demosift::world::environment::Task as _;
use demosift::world::rollout::Playground;
use demosift::{Error, Result};
use demosift_gymnasium::task::GymnasiumTask;
use demosift_mujoco::mujoco_task::MujocoTask;

use crate::arguments::{SetArguments, SourceArguments};
use crate::console::terminal;
use crate::job::identity::Data;
use crate::job::run_folder;
use crate::task::Chosen;

/// Demonstrations with the file or folder that they are in.
pub(crate) struct Demonstrations {
    pub(crate) source: Source,
    /// In the numbers of the task.
    pub(crate) set: DemonstrationSet,
    pub(crate) path: PathBuf,
    pub(crate) said: Said,
    choice: Choice,
}

/// What the user says of the numbers of a set.
#[derive(Clone, Debug)]
pub(crate) struct Said {
    pub(crate) set_file: SetFile,
    /// Where it is said; `None` where it is not, or a run remembers it.
    pub(crate) path: Option<PathBuf>,
    /// Where it would be said.
    pub(crate) place: PathBuf,
}

impl Said {
    /// The same in sentences, for a set that holds these episodes.
    pub(crate) fn in_words(&self, source: &Source) -> Vec<String> {
        let usual = source.episodes.iter().find(|one| one.actions.width() > 0);
        let sizes = usual.map(|one| (one.observations.width(), one.actions.width()));
        let (observed, acted) = sizes.unwrap_or_default();
        self.set_file.in_words(observed, acted)
    }

    /// Tells the user of it, where anything is said.
    pub(crate) fn say(&self) {
        if self.set_file.is_none() {
            return;
        }
        let of = self.path.as_ref().map_or_else(|| "the run".to_owned(), |path| path.display().to_string());
        terminal::note(&format!(
            "the numbers of the set are read as {of} says: {}",
            self.set_file.to_string().trim_end().replace('\n', "; ")
        ));
    }
}

impl Demonstrations {
    /// Whether set, task and configuration fit each other.
    pub(crate) fn check(&self, playground: &Playground<'_>, config: &Config) -> Result<()> {
        experiment::check(&self.set, playground.specification(), config)
            .map_err(|error| if error.is_bad_input() { error.at(&self.path) } else { error })
    }

    /// What a run depends on.
    pub(crate) fn data(&self) -> Result<Data> {
        let format = self.source.format;
        let path = std::fs::canonicalize(&self.path)
            .map_err(|error| Error::io("cannot find", &self.path, &error))?;
        if path.to_str().is_none() {
            return Err(Error::bad_input("the path is not UTF-8, and a run cannot write it down")
                .at(&path)
                .with_hint("rename it, or give a link to it that has another name"));
        }
        Ok(Data {
            sha256: sha256(&self.source, &self.path, &self.said)?,
            path,
            format: Some(format),
            columns: self.source.columns.clone(),
            choice: self.choice.clone(),
            set_file: self.said.set_file.clone(),
        })
    }
}

/// Reads what is given, or what a run that goes on was begun with, for a task; without one its numbers stay as they were
/// recorded.
pub(crate) fn open(
    given: Option<&Path>,
    how: &SetArguments,
    recorded: Option<&Data>,
    task: Option<&Chosen>,
) -> Result<Demonstrations> {
    let opened = open_for(given, how, recorded, task)?;
    let set = opened.source.set();
    opened.with(set)
}

/// The same where one demonstration is enough.
pub(crate) fn open_of_any_size(
    given: Option<&Path>,
    how: &SetArguments,
    recorded: Option<&Data>,
    task: Option<&Chosen>,
) -> Result<Demonstrations> {
    let opened = open_for(given, how, recorded, task)?;
    let set = opened.source.set_of_any_size();
    opened.with(set)
}

fn open_for(
    given: Option<&Path>,
    how: &SetArguments,
    recorded: Option<&Data>,
    task: Option<&Chosen>,
) -> Result<Opened> {
    let mut opened = open_unchecked(given, how, recorded)?;
    if task.is_some() {
        opened.read_for(task)?;
    }
    Ok(opened)
}

/// What lies there, of which not all need be fit to learn from; its numbers are as they were recorded.
pub(crate) struct Opened {
    pub(crate) source: Source,
    pub(crate) path: PathBuf,
    pub(crate) said: Said,
    choice: Choice,
}

impl Opened {
    fn with(self, set: Result<DemonstrationSet>) -> Result<Demonstrations> {
        let Self { source, path, said, choice } = self;
        let set = set.map_err(|error| error.at(&path))?;
        say_what_is_not_read(&source);
        Ok(Demonstrations { source, set, path, said, choice })
    }

    /// From now on demonstrations are in the numbers of the task, as the user says what those of the set are.
    ///
    /// # Errors
    /// If what is said does not fit the set or the task.
    pub(crate) fn read_for(&mut self, task: Option<&Chosen>) -> Result<()> {
        let at = |error: Error| if error.is_bad_input() { error.at(&self.path) } else { error };
        read_for(&mut self.source, &self.said, task).map_err(at)
    }

    /// From now on actions are what `step` of an environment in Python takes, in its own unit, and observations what it returns,
    /// as the user says what those of the set are; where nothing is said, they are that already.
    ///
    /// # Errors
    /// As [`Opened::read_for`].
    pub(crate) fn read_as_taken(&mut self, task: &GymnasiumTask) -> Result<()> {
        let mut meant = self.said.set_file.clone();
        let of_step = Meaning { units: Some(Units::All(Unit::Controls)), ..Meaning::default() };
        let are_taken = meant.actions.is_none() || meant.actions == of_step;
        if are_taken {
            meant.actions = Meaning::default();
        } else if meant.actions.units.is_none() {
            meant.actions.units = of_step.units;
        }
        if meant.is_none() {
            return Ok(());
        }
        let bounds = &task.specification().control_ranges;
        let ranges = Ranges { controls: bounds, observations: &[] };
        let conversion = conversion(&self.source, &self.said, &meant, ranges)?;
        let (_, acted) = widths(&self.source);
        self.source.conversion = match are_taken {
            true => conversion,
            false => conversion.in_unit_of(bounds, acted).map_err(|error| error.at(&self.path))?,
        };
        Ok(())
    }
}

/// The same of a source.
///
/// # Errors
/// As [`Opened::read_for`].
pub(crate) fn read_for(source: &mut Source, said: &Said, task: Option<&Chosen>) -> Result<()> {
    let meant = meant(&said.set_file, task);
    if meant.is_none() {
        return Ok(());
    }
    if let Some(task) = task.filter(|_| said.set_file.is_none()) {
        // Where the user has said nothing, it is the set that does not fit.
        let (observed, acted) = widths(source);
        task.task.specification().check_sizes(observed, acted)?;
    }
    let observations = task.and_then(|task| task.mujoco.as_ref()).map(MujocoTask::observation_ranges);
    let ranges = Ranges {
        controls: task.map_or(&[], |task| &task.task.specification().control_ranges),
        observations: observations.as_deref().unwrap_or_default(),
    };
    source.conversion = conversion(source, said, &meant, ranges)?;
    said.say();
    Ok(())
}

/// What becomes of the numbers of a set that mean this.
fn conversion(source: &Source, said: &Said, meant: &SetFile, ranges: Ranges<'_>) -> Result<Conversion> {
    let (observed, acted) = widths(source);
    meant.conversion(observed, acted, ranges).map_err(|error| match &said.path {
        Some(path) => error.at(path),
        None => error,
    })
}

/// Numbers in an observation and in an action of the first episode that has any.
fn widths(source: &Source) -> (usize, usize) {
    let wide = |width: fn(&Episode) -> usize| source.episodes.iter().map(width).find(|width| *width > 0);
    (wide(|one| one.observations.width()).unwrap_or(0), wide(|one| one.actions.width()).unwrap_or(0))
}

/// What the numbers of a set are: what the user says, and of an environment in Python the actions that its `step` takes, where
/// nothing else is said.
fn meant(said: &SetFile, task: Option<&Chosen>) -> SetFile {
    let mut meant = said.clone();
    if task.is_some_and(|task| task.simulated.is_some()) && meant.actions.units.is_none() {
        meant.actions.units = Some(Units::All(Unit::Controls));
    }
    meant
}

/// SHA-256 of demonstrations and of what the user says of their numbers.
pub(crate) fn sha256(source: &Source, path: &Path, said: &Said) -> Result<String> {
    let (as_stored, set_file) = (open::sha256(source, path)?, &said.set_file);
    if set_file.is_none() {
        return Ok(as_stored);
    }
    Ok(files::sha256_of(format!("{as_stored}\n{set_file}").as_bytes()))
}

/// Copies what the user says of a set into a set that was made of it, whose numbers are the same.
pub(crate) fn hand_on(said: &Said, out: &Path) -> Result<()> {
    if said.set_file.is_none() {
        return Ok(());
    }
    files::write_atomically(&out.join(set_file::SET_FILE), said.set_file.to_string().as_bytes())
}

/// Where actions of a set lie, for those who write it down: as the set says, or anywhere if they are not those of a task.
pub(crate) fn action_bounds(source: &Source, said: &Said) -> Option<Vec<[f64; 2]>> {
    let everywhere = || {
        let width = source.episodes.first().map_or(0, |episode| episode.actions.width());
        vec![[f64::NEG_INFINITY, f64::INFINITY]; width]
    };
    let are_others = !said.set_file.actions.is_none();
    source.says.action_bounds.clone().or_else(|| are_others.then(everywhere))
}

/// Nothing is left out without a word.
pub(crate) fn say_what_is_not_read(source: &Source) {
    choice::in_words(&source.left_out).iter().chain(&source.not_read).for_each(|words| terminal::note(words));
}

/// The simulator's states of a demonstration, which `states` holds by the positions in the file.
pub(crate) fn states_of(states: &[StateLog], demo: DemoId) -> Result<&StateLog> {
    states
        .get(demo.0)
        .ok_or_else(|| Error::bad_input(format!("the set has no states of demonstration {demo}")))
}

/// The same without the check that one could learn from them.
pub(crate) fn open_unchecked(
    given: Option<&Path>,
    how: &SetArguments,
    recorded: Option<&Data>,
) -> Result<Opened> {
    let given = given.or(recorded.map(|data| data.path.as_path())).ok_or_else(|| {
        Error::bad_input("no demonstrations are given").with_hint(
            "give the path of a file or folder of demonstrations; docs/formats.md lists the formats",
        )
    })?;
    if run_folder::is_one(given) && !given.join(episode::RECORDED).exists() {
        let go_on =
            format!("to go on with the run: --out {} --resume, and no demonstrations", given.display());
        return Err(Error::bad_input("this is a run folder and holds no demonstrations")
            .at(given)
            .with_hint(go_on));
    }
    if recorded.is_some_and(|data| data.path == given) && !given.exists() {
        return Err(Error::bad_input("the demonstrations of the run are not where they were").at(given).with_hint(
            "if they have moved, say where they are now: --data SET of `export` and `report`, or their path in a command that \
             goes on with the run",
        ));
    }
    let columns = match recorded {
        Some(data) if how.columns().are_usual() => data.columns.clone(),
        _ => how.columns(),
    };
    let choice = match recorded {
        Some(data) if how.choice().is_all() => data.choice.clone(),
        _ => how.choice(),
    };
    let format = how.storage.format.or(recorded.and_then(|data| data.format));
    let located = open::located(given, format)?;
    let said = said(&located, how.storage.set_file.as_deref(), recorded)?;
    let Located { path, format } = located;
    let source = open::open_chosen(&path, Some(format), &columns, &choice)?;
    Ok(Opened { source, path, said, choice })
}

/// What the file says that is given, or lies with the set; where there is none, what a run remembers.
pub(crate) fn said(set: &Located, given: Option<&Path>, recorded: Option<&Data>) -> Result<Said> {
    let place = set_file::place_for(set);
    let path = given.map(Path::to_owned).or_else(|| set_file::find(set));
    let set_file = match &path {
        Some(path) => SetFile::read(path)?,
        None => recorded.map_or_else(SetFile::default, |data| data.set_file.clone()),
    };
    Ok(Said { set_file, path, place })
}

impl SetArguments {
    /// All episodes that are not left out by name.
    pub(crate) fn of(storage: &SourceArguments) -> Self {
        Self { episodes: None, storage: storage.clone() }
    }

    fn columns(&self) -> Columns {
        let SourceArguments { observation_columns, action_columns, .. } = &self.storage;
        Columns { observations: observation_columns.clone(), actions: action_columns.clone() }
    }

    fn choice(&self) -> Choice {
        let SourceArguments { without, skip_bad, filter_key, .. } = &self.storage;
        Choice {
            episodes: self.episodes.clone(),
            without: without.clone(),
            skip_bad: *skip_bad,
            filter_key: filter_key.clone(),
        }
    }
}
