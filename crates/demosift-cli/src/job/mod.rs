//! Arguments as typed become a job: everything is read and checked before the run folder is touched.

pub(crate) mod as_recorded;
pub(crate) mod demonstrations;
pub(crate) mod fit;
pub(crate) mod given_prior;
pub(crate) mod own_heuristic;
pub(crate) mod run_folder;
pub(crate) mod threads;

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use demosift::basics::ledger::Ledger;
use demosift::basics::part::Part;
use demosift::data::demonstration::choice;
use demosift::data::demonstration::{self, DemonstrationSet};
use demosift::data::trajectory::StateLog;
use demosift::learning::adapt::MetaPrior;
use demosift::math::arithmetic;
use demosift::results::artifact::{Artifact as _, FORMAT_VERSION};
use demosift::results::data_only::DataOnly;
use demosift::results::panel::Judge;
use demosift::run::experiment::{self, Config, Run};
use demosift::run::preset::Preset;
use demosift::stages::judge::Judged;
use demosift::stages::method::{Costs, Method};
use demosift::stages::select::Keep;
use demosift::world::rollout::Playground;
use demosift::{Error, Result};
use demosift_gymnasium::trainer::PythonTrainer;
use toml::Table;

use crate::arguments::{JobArguments, PresetName, RunArguments, SourceArguments};
use crate::configuration::asked_again;
use crate::configuration::{self, Layer};
use crate::console::interruption;
use crate::console::terminal::Progress;
use crate::files::metrics_file::MetricsFile;
use crate::task::simulator::{self, Simulated};
use crate::task::trainer::{self, Needed};
use crate::task::{self, Chosen};
use demonstrations::Demonstrations;
use given_prior::GivenPrior;
use own_heuristic::Beside;
use run_folder::{Begun, Data, Identity, PriorOrigin, RunFolder};

/// Whether a subcommand needs a prior, and so learns one where none is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Prior {
    Needed,
    NotNeeded,
}

/// A set, a task and a configuration that fit each other, with the run folder that keeps what comes of them.
pub(crate) struct Job {
    set: DemonstrationSet,
    /// The file or folder of the set.
    path: PathBuf,
    data: Data,
    /// Episodes of the file that were not taken, in words.
    left_out: Option<String>,
    /// What `set.toml` says of the numbers of the set, a sentence each.
    numbers: Vec<String>,
    chosen: Chosen,
    /// The configuration as it is written down.
    values: Table,
    config: Config,
    /// Who judges, or whom the referee asks besides ours.
    trainer: Option<Arc<PythonTrainer>>,
    folder: RunFolder,
    progress: Progress,
}

impl Job {
    /// Reads and checks everything, then begins the run or goes on with it.
    pub(crate) fn open(arguments: &JobArguments, prior: Prior) -> Result<Self> {
        Self::open_checked(arguments, prior, |_, _| Ok(()))
    }

    /// The same for a part of the work: the part begins the run, or joins it.
    pub(crate) fn open_part(arguments: &JobArguments, prior: Prior, part: Option<Part>) -> Result<Self> {
        Self::open_asked(&Asked { part, ..Asked::of(arguments) }, arguments, prior, |_, _| Ok(()))
    }

    /// The same for what trains final policies, and so needs the trainer that is to be asked.
    pub(crate) fn open_refereed(arguments: &JobArguments, part: Option<Part>) -> Result<Self> {
        let asked = Asked { part, referees: true, ..Asked::of(arguments) };
        Self::open_asked(&asked, arguments, Prior::Needed, |_, _| Ok(()))
    }

    /// The same for demonstrations that are judged from the prior of an earlier run; one is enough.
    pub(crate) fn open_given(arguments: &JobArguments, given: &GivenPrior) -> Result<Self> {
        threads::make_all_loops_use(arguments.run.threads)?;
        let plan = Request::of(&Asked { given: Some(given), ..Asked::of(arguments) })?;
        let recorded = plan.begun.as_ref().and_then(|begun| begun.identity.data.as_ref());
        let path = arguments.demonstrations.as_deref();
        let demonstrations =
            demonstrations::open_of_any_size(path, &arguments.source, recorded, Some(&plan.chosen))?;
        given.check_sizes(&demonstrations.set).map_err(|error| error.at(&demonstrations.path))?;
        // What is kept is decided by the earlier run; its number may be more than there are here.
        let mut values = plan.values.clone();
        values.insert("keep".to_owned(), toml::Value::String(Keep::Quarter.to_string()));
        set_words(&mut values, arguments)?;
        let values = configuration::of_job(values);
        given.check_values(&values)?;
        let config: Config = configuration::config_of_job(values.clone())?;
        demonstrations.check(&Playground::new(plan.chosen.task.as_ref()), &config)?;
        plan.check_numbers(&demonstrations)?;
        let mut job = Self::of_plan(plan, demonstrations, values, config, arguments.run.dry_run)?;
        experiment::hand_on_prior(&given.folder, &mut job.folder)?;
        Ok(job)
    }

    /// The same with a check of what a subcommand wants of set and configuration.
    pub(crate) fn open_checked(
        arguments: &JobArguments,
        prior: Prior,
        check: impl FnOnce(&DemonstrationSet, &Config) -> Result<()>,
    ) -> Result<Self> {
        Self::open_asked(&Asked::of(arguments), arguments, prior, check)
    }

    fn open_asked(
        asked: &Asked<'_>,
        arguments: &JobArguments,
        prior: Prior,
        check: impl FnOnce(&DemonstrationSet, &Config) -> Result<()>,
    ) -> Result<Self> {
        threads::make_all_loops_use(arguments.run.threads)?;
        let plan = Request::of(asked)?;
        let recorded = plan.begun.as_ref().and_then(|begun| begun.identity.data.as_ref());
        let path = arguments.demonstrations.as_deref();
        let demonstrations = demonstrations::open(path, &arguments.source, recorded, Some(&plan.chosen))?;
        let mut values = plan.values.clone();
        if let Some(keep) = arguments.keep {
            if let Some(wanted) = keep.misfit(demonstrations.set.len()) {
                return Err(Error::bad_config(format!("--keep {keep}: {wanted}")));
            }
            let layer = Table::from_iter([("keep".to_owned(), toml::Value::String(keep.to_string()))]);
            configuration::apply(&mut values, &Layer { source: "--keep".to_owned(), values: layer })?;
        }
        set_words(&mut values, arguments)?;
        trainer::ask(&mut values, arguments, &plan.chosen)?;
        let mut values = configuration::of_job(values);
        if let Some(begun) = &plan.begun {
            asked_again::remember(&plan.out, &begun.configuration, &mut values);
        }
        let config: Config = configuration::config_of_job(values.clone())?;
        let playground = Playground::new(plan.chosen.task.as_ref());
        demonstrations.check(&playground, &config)?;
        check(&demonstrations.set, &config)?;
        plan.check_numbers(&demonstrations)?;
        let asks_for_it = config.judges.each().contains(&Judge::Paper) || config.keep == Keep::Weights;
        if prior == Prior::Needed && asks_for_it && !plan.holds_prior()? {
            if let Some(part) = plan.part {
                return Err(no_prior(part).at(&plan.out));
            }
            experiment::check_budget(&demonstrations.set, &playground, &config)?;
        }
        drop(playground);
        if let Some(simulated) = &plan.chosen.simulated {
            simulated.notes(arguments.judge.is_none() && !asks_for_it);
        }
        let needed = Needed { to_judge: prior == Prior::Needed, to_referee: asked.referees };
        let trainer = plan.trainer(&values, needed, arguments)?;
        let job = Self::of_plan(plan, demonstrations, values, config, arguments.run.dry_run)?;
        Ok(Self { trainer: trainer.map(Arc::new), ..job })
    }

    /// Begins the run or goes on with it, once everything that it depends on is known.
    fn of_plan(
        plan: Request,
        demonstrations: Demonstrations,
        values: Table,
        config: Config,
        dry: bool,
    ) -> Result<Self> {
        let data = demonstrations.data()?;
        let left_out = choice::in_words(&demonstrations.source.left_out);
        let numbers = demonstrations.said.in_words(&demonstrations.source);
        let Demonstrations { set, path, .. } = demonstrations;
        let folder = plan.open_folder(Some(data.clone()), &values, dry)?;
        let progress = match dry {
            true => Progress::of_bar_only(),
            false => Progress::new(MetricsFile::of(&folder.written())?),
        };
        let chosen = plan.chosen;
        Ok(Self {
            set,
            path,
            data,
            left_out,
            numbers,
            chosen,
            values,
            config,
            trainer: None,
            folder,
            progress,
        })
    }

    /// The same job for one of the task's several goals, in a folder of its own within that of this one; it starts from what
    /// is known here of that goal. A dry run only looks at it.
    pub(crate) fn for_goal(&self, goal: &str, dry: bool) -> Result<Self> {
        let chosen = task::choose(&self.chosen.name)?.under(goal)?;
        let out = self.folder.path().join(goal);
        let begun = run_folder::look_into(&out, true)?;
        let identity = identity(&chosen, Some(self.data.clone()), None);
        let open = if dry { RunFolder::look } else { RunFolder::open };
        let mut folder = open(out, begun.as_ref(), &identity, &self.values)?;
        if !dry {
            // Whoever interrupts it goes on with the whole.
            interruption::run_is_in(self.folder.path());
        }
        experiment::hand_on(&self.folder, &mut folder, self.chosen.task.specification().variant(goal)?)?;
        let progress = match dry {
            true => Progress::of_bar_only(),
            false => Progress::new(MetricsFile::of(folder.path())?),
        };
        Ok(Self {
            set: self.set.clone(),
            path: self.path.clone(),
            data: self.data.clone(),
            left_out: self.left_out.clone(),
            numbers: self.numbers.clone(),
            chosen,
            values: self.values.clone(),
            config: self.config.clone(),
            trainer: self.trainer.clone(),
            folder,
            progress,
        })
    }

    /// Does a part of the job.
    pub(crate) fn run<T>(&mut self, work: impl FnOnce(&mut Run<'_>) -> Result<T>) -> Result<T> {
        let mut playground = self.chosen.playground()?;
        if let Some(trainer) = &self.trainer {
            playground = playground.with_trainer(trainer.as_ref());
        }
        let outcome = work(&mut Run {
            set: &self.set,
            playground: &playground,
            config: &self.config,
            ledger: &mut self.folder,
            observer: &mut self.progress,
        });
        self.progress.finish();
        // Of a user's own task the fault may be in the model.
        let of_own = self.chosen.sha256.is_some();
        outcome.map_err(|error| match error.is_diverged() || error.is_simulation() {
            true if of_own => error.at(Path::new(&self.chosen.name)),
            _ => error,
        })
    }

    pub(crate) fn set(&self) -> &DemonstrationSet {
        &self.set
    }

    /// The one goal that the run is about, where the task has several.
    pub(crate) fn variant(&self) -> Option<&str> {
        self.chosen.variant.as_deref()
    }

    pub(crate) fn variants(&self) -> &[String] {
        &self.chosen.task.specification().variants
    }

    pub(crate) fn unit(&self) -> &str {
        self.chosen.task.heuristic().unit()
    }

    /// Adds what the demonstrations themselves scored to what others say of them; to be asked for after they are ranked, and
    /// never before.
    pub(crate) fn beside(&self, data_only: DataOnly) -> Beside {
        own_heuristic::beside(data_only, self.chosen.mujoco.as_ref(), &self.set, self.states())
    }

    /// The simulator's states of the demonstrations, where the set holds them.
    pub(crate) fn states(&self) -> Result<Option<Vec<StateLog>>> {
        demonstration::open::read_states(&self.path, self.data.format)
    }

    /// The task.
    pub(crate) fn chosen(&self) -> &Chosen {
        &self.chosen
    }

    /// What the run depends on.
    pub(crate) fn data(&self) -> &Data {
        &self.data
    }

    /// Which episodes of the set were not taken, and why.
    pub(crate) fn left_out(&self) -> Option<&str> {
        self.left_out.as_deref()
    }

    /// What `set.toml` says of the numbers of the set, a sentence each.
    pub(crate) fn numbers_in_words(&self) -> &[String] {
        &self.numbers
    }

    /// The file or folder of the set.
    pub(crate) fn set_path(&self) -> &Path {
        &self.path
    }

    /// Which part of the work is done here.
    pub(crate) fn part(&self) -> Option<Part> {
        self.folder.part()
    }

    pub(crate) fn keep(&self) -> Keep {
        self.config.keep
    }

    /// Under which name the policy is stored that one training made of the kept.
    pub(crate) fn kept_part(&self) -> String {
        experiment::kept_part(&self.config)
    }

    /// How many are kept, as far as it is known before judging.
    pub(crate) fn k(&self) -> usize {
        self.config.keep.count_before_judging(self.set.len())
    }

    pub(crate) fn method(&self) -> Method {
        self.config.method
    }

    /// What the stages cost that the run folder holds, beside the budget of the run's method.
    pub(crate) fn costs(&mut self) -> Result<Costs> {
        self.run(|run| experiment::costs(run))
    }

    /// Stores what is made of the run's results.
    pub(crate) fn store(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        self.folder.store(name, bytes)
    }

    pub(crate) fn folder(&self) -> &RunFolder {
        &self.folder
    }
}

/// Learning the prior has no parts.
fn no_prior(part: Part) -> Error {
    Error::bad_input(format!(
        "part {part} of the judge of the paper needs the prior, which is learned once, and the run has none"
    ))
    .with_hint(
        "make it with `demosift meta-train` and the same options but --part, and start the parts then; \
         --judge cloning needs none",
    )
}

/// The options that are words of the configuration.
fn set_words(values: &mut Table, arguments: &JobArguments) -> Result<()> {
    let method = arguments.method.map(|method| Method::from(method).to_string());
    let judges = arguments.judge.map(|judges| judges.word().to_owned());
    for (key, option, word) in [("method", "--method", method), ("judges", "--judge", judges)] {
        let Some(word) = word else { continue };
        let layer = Table::from_iter([(key.to_owned(), toml::Value::String(word))]);
        configuration::apply(values, &Layer { source: option.to_owned(), values: layer })?;
    }
    Ok(())
}

/// What says which run is to begin or to go on.
#[derive(Clone, Copy)]
pub(crate) struct Asked<'a> {
    pub(crate) run: &'a RunArguments,
    pub(crate) variant: Option<&'a str>,
    pub(crate) preset: Option<PresetName>,
    /// The prior of an earlier run, with its task and its values.
    pub(crate) given: Option<&'a GivenPrior>,
    /// The demonstrations, which may name their environment.
    pub(crate) set: Option<&'a Path>,
    /// How these are stored.
    pub(crate) stored: Option<&'a SourceArguments>,
    /// Which part of the run's work is to be done.
    pub(crate) part: Option<Part>,
    /// Whether final policies are trained, and so a trainer may be needed.
    pub(crate) referees: bool,
    /// The trainer that is typed.
    pub(crate) trainer: Option<&'a str>,
}

impl<'a> Asked<'a> {
    fn of(arguments: &'a JobArguments) -> Self {
        let JobArguments { run, variant, preset, demonstrations, .. } = arguments;
        let (variant, set) = (variant.as_deref(), demonstrations.as_deref());
        let trainer = arguments.trainer.trainer.as_deref();
        let stored = Some(&arguments.source.storage);
        Self { run, variant, preset: *preset, given: None, set, stored, part: None, referees: false, trainer }
    }
}

/// What a run is about, before its data is read and its folder is touched.
pub(crate) struct Request {
    pub(crate) chosen: Chosen,
    /// Of all layers but the options that a subcommand has for itself.
    pub(crate) values: Table,
    pub(crate) begun: Option<Begun>,
    out: PathBuf,
    /// Which prior it is given.
    prior: Option<PriorOrigin>,
    part: Option<Part>,
}

impl Request {
    pub(crate) fn of(asked: &Asked<'_>) -> Result<Self> {
        let Asked { run: arguments, variant, preset, given, set, stored, part, trainer: typed, .. } = *asked;
        let task_of_prior = given.map(|given| &given.identity.task);
        let env = match &arguments.out {
            Some(_) => None,
            None => simulator::folder_name(&arguments.simulator, simulator::naming(set, stored, None))?,
        };
        let out = match (&arguments.out, arguments.task.as_ref().or(env.as_ref()).or(task_of_prior)) {
            (Some(out), _) => out.clone(),
            (None, Some(task)) => default_folder(task, variant),
            (None, None) if arguments.resume => {
                return Err(Error::bad_input("which run is to go on?")
                    .with_hint("add --out DIR, the folder of the run"));
            }
            (None, None) => return Err(task::missing()),
        };
        let begun = run_folder::look_into(&out, arguments.resume || part.is_some())?;
        let data = begun.as_ref().and_then(|begun| begun.identity.data.as_ref());
        let set = set.or(data.map(|data| data.path.as_path()));
        let set = simulator::naming(set, stored, data.map(|data| &data.columns));
        let earlier = begun.as_ref().map(|begun| &begun.identity).or(given.map(|given| &given.identity));
        let environment = earlier.filter(|_| arguments.task.is_none()).and_then(Identity::environment);
        let name = arguments.task.as_ref().or(earlier.map(|identity| &identity.task)).map(String::as_str);
        let none = || if arguments.resume { run_folder::nothing_to_resume(&out) } else { task::missing() };
        let has_trainer = trainer::is_asked(typed, begun.as_ref().map(|begun| &begun.configuration));
        let mut chosen = match simulator::open(&arguments.simulator, set, environment, has_trainer)? {
            Some(simulated) => task::in_python(simulated)?,
            None => task::choose(name.ok_or_else(none)?)?,
        };
        if let Some(begun) = &begun {
            check_task(&begun.identity, &chosen).map_err(|error| error.at(&out))?;
        }
        let identities = begun.iter().map(|begun| &begun.identity).chain(given.map(|given| &given.identity));
        let begun_under = || identities.clone().find_map(|identity| identity.variant.as_deref());
        if let Some(variant) = variant.or_else(begun_under) {
            chosen = chosen.under(variant)?;
        }
        if let Some(given) = given {
            given.check_task(&chosen)?;
        }
        let mut values = match (&begun, given, preset) {
            (Some(begun), _, None) => begun.configuration.clone(),
            (None, Some(given), None) => given.values.clone(),
            (_, _, preset) => {
                let preset = preset.map_or(Preset::Standard, Preset::from);
                let mut values = configuration::preset(preset, chosen.values.clone())?;
                if let Some(simulated) = &chosen.simulated {
                    let begun = begun.as_ref().map(|begun| &begun.configuration);
                    configuration::apply(&mut values, &simulated.values(begun)?)?;
                }
                values
            }
        };
        if let Some(begun) = &begun {
            values.extend(asked_again::last(&begun.configuration));
        }
        configuration::with_trainings_by_trainer(&mut values);
        for layer in layers(arguments)? {
            configuration::apply(&mut values, &layer)?;
        }
        if values.get("portable").and_then(toml::Value::as_bool) == Some(true) {
            arithmetic::make_portable();
        }
        let prior = given.map(|given| given.origin.clone());
        Ok(Self { chosen, values, begun, out, prior, part })
    }

    /// Whether the numbers of demonstrations are such as the task takes; what was begun was found to be so.
    fn check_numbers(&self, demonstrations: &Demonstrations) -> Result<()> {
        let Demonstrations { source, said, path, .. } = demonstrations;
        match self.begun {
            None => fit::check(&self.chosen, source, said, path),
            Some(_) => Ok(()),
        }
    }

    /// The folder of the run, if that has begun.
    fn begun_folder(&self) -> Result<Option<RunFolder>> {
        let folder = self.begun.as_ref().map(|_| run_folder::of_finished(&self.out));
        Ok(folder.transpose()?.map(|(_, folder)| folder))
    }

    /// Whether the run has learned its prior already.
    fn holds_prior(&self) -> Result<bool> {
        let Some(folder) = self.begun_folder()? else { return Ok(false) };
        Ok(MetaPrior::recall(&folder, "")?.is_some())
    }

    /// The trainer that the run will ask, which must be the one that has judged it.
    fn trainer(
        &self,
        values: &Table,
        mut needed: Needed,
        arguments: &JobArguments,
    ) -> Result<Option<PythonTrainer>> {
        let folder = self.begun_folder()?;
        let judged =
            folder.as_ref().map(|folder| Judged::recall(folder, Judge::Trainer.name())).transpose()?;
        // One that is typed is held against the one that has judged, whatever is left to do.
        needed.to_judge &= judged.flatten().is_none() || arguments.trainer.trainer.is_some();
        let trainer = trainer::open(values, needed, arguments, &self.chosen)?;
        if let (Some(folder), Some(trainer)) = (&folder, &trainer) {
            experiment::check_judged_by(folder, trainer).map_err(|error| error.at(&self.out))?;
        }
        Ok(trainer)
    }

    /// Begins the run, or goes on with the one that is there; a dry run only looks whether that could be done.
    pub(crate) fn open_folder(&self, data: Option<Data>, values: &Table, dry: bool) -> Result<RunFolder> {
        let identity = identity(&self.chosen, data, self.prior.clone());
        match self.part {
            Some(part) if !dry => RunFolder::join(self.out.clone(), part, &identity, values),
            _ => {
                let open = if dry { RunFolder::look } else { RunFolder::open };
                open(self.out.clone(), self.begun.as_ref(), &identity, values)
            }
        }
    }
}

/// What a run depends on, besides its configuration.
fn identity(chosen: &Chosen, data: Option<Data>, prior: Option<PriorOrigin>) -> Identity {
    Identity {
        demosift: env!("CARGO_PKG_VERSION").to_owned(),
        format: FORMAT_VERSION,
        task: chosen.name.clone(),
        task_sha256: chosen.sha256.clone(),
        variant: chosen.variant.clone(),
        simulator: chosen.simulated.as_ref().map(Simulated::identity),
        data,
        prior,
        // Known when it is written down.
        configuration_sha256: String::new(),
    }
}

fn layers(arguments: &RunArguments) -> Result<Vec<Layer>> {
    let mut layers = Vec::new();
    if let Some(path) = &arguments.config {
        layers.push(Layer::from_file(path)?);
    }
    for assignment in &arguments.set {
        layers.push(Layer::from_assignment(assignment)?);
    }
    if let Some(seed) = arguments.seed {
        layers.push(Layer::from_option("--seed", "seed", seed)?);
    }
    if arguments.portable {
        let values = Table::from_iter([("portable".to_owned(), toml::Value::Boolean(true))]);
        layers.push(Layer { source: "--portable".to_owned(), values });
    }
    Ok(layers)
}

/// Whether the run that is there is about the same task; said before its demonstrations are found not to fit.
fn check_task(begun: &Identity, chosen: &Chosen) -> Result<()> {
    let hash = |sha256: &Option<String>| sha256.clone().unwrap_or_else(|| "none".to_owned());
    let pair = |what: &str, old: String, new: String| (old != new).then(|| (what.to_owned(), old, new));
    let now = chosen.simulated.as_ref().map(Simulated::identity);
    // What is called something else is of other files too.
    let differs = pair("the task", begun.task.clone(), chosen.name.clone())
        .or_else(|| simulator::difference(begun.simulator.as_ref(), now.as_ref()))
        .or_else(|| pair("the SHA-256 of the task's files", hash(&begun.task_sha256), hash(&chosen.sha256)));
    match differs {
        Some((what, old, new)) => Err(run_folder::of_another_run(&what, &old, &new)),
        None => Ok(()),
    }
}

/// `runs/TASK`, or `runs/TASK_VARIANT` for a run about one goal; always within `runs`.
pub(crate) fn default_folder(task: &str, variant: Option<&str>) -> PathBuf {
    // Of `.` and `..` only the folder itself knows its name.
    let absolute = std::fs::canonicalize(task).unwrap_or_else(|_| PathBuf::from(task));
    let of_path = || absolute.file_name().map(OsStr::to_owned);
    let mut name = Path::new(task).file_name().map(OsStr::to_owned).or_else(of_path).unwrap_or("task".into());
    if let Some(variant) = variant {
        name.push(format!("_{}", variant.replace(std::path::MAIN_SEPARATOR, "_")));
    }
    Path::new("runs").join(name)
}
