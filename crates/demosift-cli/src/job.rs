//! Arguments as typed become a job: everything is read and checked before the run folder is touched.

use std::path::{Path, PathBuf};

use demosift::data::demonstration::choice;
use demosift::data::demonstration::{self, DemonstrationSet};
use demosift::data::trajectory::StateLog;
use demosift::learning::adapt::MetaPrior;
use demosift::results::artifact::{Artifact as _, FORMAT_VERSION};
use demosift::results::data_only::DataOnly;
use demosift::results::panel::Judge;
use demosift::run::experiment::{self, Config, Run};
use demosift::run::preset::Preset;
use demosift::stages::method::{Costs, Method};
use demosift::stages::select::Keep;
use demosift::world::rollout::Playground;
use demosift::{Error, Result};
use toml::Table;

use crate::arguments::{JobArguments, PresetName, RunArguments};
use crate::configuration::{self, Layer};
use crate::demonstrations::{self, Demonstrations};
use crate::fit;
use crate::interruption;
use crate::metrics_file::MetricsFile;
use crate::own_heuristic::{self, Beside};
use crate::run_folder::{self, Begun, Data, Identity, RunFolder};
use crate::task::{self, Chosen};
use crate::terminal::Progress;

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
    chosen: Chosen,
    /// The configuration as it is written down.
    values: Table,
    config: Config,
    folder: RunFolder,
    progress: Progress,
}

impl Job {
    /// Reads and checks everything, then begins the run or goes on with it.
    pub(crate) fn open(arguments: &JobArguments, prior: Prior) -> Result<Self> {
        Self::open_checked(arguments, prior, |_, _| Ok(()))
    }

    /// The same with a check of what a subcommand wants of set and configuration.
    pub(crate) fn open_checked(
        arguments: &JobArguments,
        prior: Prior,
        check: impl FnOnce(&DemonstrationSet, &Config) -> Result<()>,
    ) -> Result<Self> {
        use_threads(arguments.run.threads)?;
        let plan = Request::of(&arguments.run, arguments.variant.as_deref(), arguments.preset)?;
        let recorded = plan.begun.as_ref().and_then(|begun| begun.identity.data.as_ref());
        let demonstrations = demonstrations::open(
            arguments.demonstrations.as_deref(),
            &arguments.source,
            recorded,
            Some(&plan.chosen),
        )?;
        let data = demonstrations.data()?;
        let left_out = choice::in_words(&demonstrations.source.left_out);
        let Demonstrations { set, path, source, said, .. } = demonstrations;
        let mut values = plan.values.clone();
        if let Some(keep) = arguments.keep {
            if let Some(wanted) = keep.misfit(set.len()) {
                return Err(Error::bad_config(format!("--keep {keep}: {wanted}")));
            }
            let layer = Table::from_iter([("keep".to_owned(), toml::Value::String(keep.to_string()))]);
            configuration::apply(&mut values, &Layer { source: "--keep".to_owned(), values: layer })?;
        }
        let method = arguments.method.map(|method| Method::from(method).to_string());
        let judges = arguments.judge.map(|judges| judges.word().to_owned());
        for (key, option, word) in [("method", "--method", method), ("judges", "--judge", judges)] {
            let Some(word) = word else { continue };
            let layer = Table::from_iter([(key.to_owned(), toml::Value::String(word))]);
            configuration::apply(&mut values, &Layer { source: option.to_owned(), values: layer })?;
        }
        if let Some(refereeing) = arguments.referee {
            let layer = Table::try_from(refereeing).expect("two numbers are a table");
            let layer = Table::from_iter([("referee".to_owned(), toml::Value::Table(layer))]);
            configuration::apply(&mut values, &Layer { source: "--referee".to_owned(), values: layer })?;
        }
        let values = configuration::of_job(values);
        let config: Config = configuration::typed(values.clone())?;
        experiment::check(&set, plan.chosen.task.specification(), &config)
            .map_err(|error| if error.is_bad_input() { error.at(&path) } else { error })?;
        check(&set, &config)?;
        // What was begun was found to fit.
        if plan.begun.is_none() {
            fit::check(&plan.chosen, &source, &said, &path)?;
        }
        let asks_for_it = config.judges.each().contains(&Judge::Paper) || config.keep == Keep::Weights;
        if prior == Prior::Needed && asks_for_it && !plan.holds_prior()? {
            experiment::check_budget(&set, &Playground::new(plan.chosen.task.as_ref()), &config)?;
        }
        let folder = plan.open_folder(Some(data.clone()), &values, arguments.run.dry_run)?;
        let progress = match arguments.run.dry_run {
            true => Progress::of_bar_only(),
            false => Progress::new(MetricsFile::open(folder.path())?),
        };
        Ok(Self { set, path, data, left_out, chosen: plan.chosen, values, config, folder, progress })
    }

    /// The same job for one of the task's several goals, in a folder of its own within that of this one; it starts from what
    /// is known here of that goal. A dry run only looks at it.
    pub(crate) fn for_goal(&self, goal: &str, dry: bool) -> Result<Self> {
        let chosen = task::choose(&self.chosen.name)?.under(goal)?;
        let out = self.folder.path().join(goal);
        let begun = run_folder::look_into(&out, true)?;
        let identity = identity(&chosen, Some(self.data.clone()));
        let (folder, progress) = if dry {
            (RunFolder::look(out, begun.as_ref(), &identity, &self.values)?, Progress::of_bar_only())
        } else {
            let mut folder = RunFolder::open(out, begun.as_ref(), &identity, &self.values)?;
            // Whoever interrupts it goes on with the whole.
            interruption::run_is_in(self.folder.path());
            experiment::hand_on(&self.folder, &mut folder, self.chosen.task.specification().variant(goal)?)?;
            let progress = Progress::new(MetricsFile::open(folder.path())?);
            (folder, progress)
        };
        Ok(Self {
            set: self.set.clone(),
            path: self.path.clone(),
            data: self.data.clone(),
            left_out: self.left_out.clone(),
            chosen,
            values: self.values.clone(),
            config: self.config.clone(),
            folder,
            progress,
        })
    }

    /// Does a part of the job.
    pub(crate) fn run<T>(&mut self, work: impl FnOnce(&mut Run<'_>) -> Result<T>) -> Result<T> {
        let playground = Playground::new(self.chosen.task.as_ref());
        let outcome = work(&mut Run {
            set: &self.set,
            playground: &playground,
            config: &self.config,
            ledger: &mut self.folder,
            observer: &mut self.progress,
        });
        let told = self.progress.finish();
        let outcome = outcome?;
        told?;
        Ok(outcome)
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

    /// The file or folder of the set.
    pub(crate) fn set_path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn keep(&self) -> Keep {
        self.config.keep
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

    pub(crate) fn folder(&self) -> &RunFolder {
        &self.folder
    }
}

/// What a run is about, before its data is read and its folder is touched.
pub(crate) struct Request {
    pub(crate) chosen: Chosen,
    /// Of all layers but the options that a subcommand has for itself.
    pub(crate) values: Table,
    pub(crate) begun: Option<Begun>,
    out: PathBuf,
}

impl Request {
    pub(crate) fn of(
        arguments: &RunArguments,
        variant: Option<&str>,
        preset: Option<PresetName>,
    ) -> Result<Self> {
        let out = match (&arguments.out, &arguments.task) {
            (Some(out), _) => out.clone(),
            (None, Some(task)) => default_folder(task, variant),
            (None, None) if arguments.resume => {
                return Err(Error::bad_input("which run is to go on?")
                    .with_hint("add --out DIR, the folder of the run"));
            }
            (None, None) => return Err(task::missing()),
        };
        let begun = run_folder::look_into(&out, arguments.resume)?;
        let name = arguments.task.as_deref().or(begun.as_ref().map(|begun| begun.identity.task.as_str()));
        let mut chosen = task::choose(name.ok_or_else(|| {
            if arguments.resume { run_folder::nothing_to_resume(&out) } else { task::missing() }
        })?)?;
        if let Some(begun) = &begun {
            check_task(&begun.identity, &chosen).map_err(|error| error.at(&out))?;
        }
        let begun_under = || begun.as_ref().and_then(|begun| begun.identity.variant.as_deref());
        if let Some(variant) = variant.or_else(begun_under) {
            chosen = chosen.under(variant)?;
        }
        let mut values = match (&begun, preset) {
            (Some(begun), None) => begun.configuration.clone(),
            (_, preset) => {
                configuration::preset(preset.map_or(Preset::Standard, Preset::from), chosen.values.clone())?
            }
        };
        for layer in layers(arguments)? {
            configuration::apply(&mut values, &layer)?;
        }
        Ok(Self { chosen, values, begun, out })
    }

    /// Whether the run has learned its prior already.
    fn holds_prior(&self) -> Result<bool> {
        if self.begun.is_none() {
            return Ok(false);
        }
        let (_, folder) = run_folder::of_finished(&self.out)?;
        Ok(MetaPrior::recall(&folder, "")?.is_some())
    }

    /// Begins the run, or goes on with the one that is there; a dry run only looks whether that could be done.
    pub(crate) fn open_folder(&self, data: Option<Data>, values: &Table, dry: bool) -> Result<RunFolder> {
        let identity = identity(&self.chosen, data);
        let open = if dry { RunFolder::look } else { RunFolder::open };
        open(self.out.clone(), self.begun.as_ref(), &identity, values)
    }
}

/// What a run depends on, besides its configuration.
fn identity(chosen: &Chosen, data: Option<Data>) -> Identity {
    Identity {
        demosift: env!("CARGO_PKG_VERSION").to_owned(),
        format: FORMAT_VERSION,
        task: chosen.name.clone(),
        task_sha256: chosen.sha256.clone(),
        variant: chosen.variant.clone(),
        data,
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
    Ok(layers)
}

/// Whether the run that is there is about the same task; said before its demonstrations are found not to fit.
fn check_task(begun: &Identity, chosen: &Chosen) -> Result<()> {
    let hash = |sha256: &Option<String>| sha256.clone().unwrap_or_else(|| "none".to_owned());
    let pairs = [
        ("the task", begun.task.clone(), chosen.name.clone()),
        ("the SHA-256 of the task's files", hash(&begun.task_sha256), hash(&chosen.sha256)),
    ];
    match pairs.into_iter().find(|(_, old, new)| old != new) {
        Some((what, old, new)) => Err(run_folder::of_another_run(what, &old, &new)),
        None => Ok(()),
    }
}

/// `runs/TASK`, or `runs/TASK_VARIANT` for a run about one goal.
pub(crate) fn default_folder(task: &str, variant: Option<&str>) -> PathBuf {
    let mut name = Path::new(task).file_name().unwrap_or(task.as_ref()).to_owned();
    if let Some(variant) = variant {
        name.push(format!("_{variant}"));
    }
    Path::new("runs").join(name)
}

/// Makes all parallel loops use this many threads.
pub(crate) fn use_threads(count: Option<usize>) -> Result<()> {
    let Some(count) = count else { return Ok(()) };
    if count == 0 {
        return Err(Error::bad_config("--threads 0: must be at least 1"));
    }
    rayon::ThreadPoolBuilder::new()
        .num_threads(count)
        .build_global()
        .map_err(|error| Error::bad_config(format!("--threads {count}: {error}")))
}
