//! Arguments as typed become a job: everything is read and checked before the run folder is touched.

pub(crate) mod as_recorded;
pub(crate) mod demonstrations;
pub(crate) mod fit;
pub(crate) mod given_prior;
pub(crate) mod identity;
pub(crate) mod own_heuristic;
pub(crate) mod request;
pub(crate) mod run_folder;
pub(crate) mod states;
pub(crate) mod threads;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use demosift::basics::counting::counted;
use demosift::basics::ledger::Ledger;
use demosift::basics::part::Part;
use demosift::data::demonstration::choice;
use demosift::data::demonstration::{self, DemonstrationSet};
use demosift::data::trajectory::StateLog;
use demosift::results::data_only::DataOnly;
use demosift::results::panel::Judge;
use demosift::run::experiment::{self, Config, Run};
use demosift::stages::method::{Costs, Method};
use demosift::stages::select::Keep;
use demosift::world::rollout::Playground;
use demosift::{Error, Result};
use demosift_gymnasium::trainer::PythonTrainer;
use toml::Table;

use crate::arguments::JobArguments;
use crate::configuration::asked_again;
use crate::configuration::{self, Layer};
use crate::console::interruption;
use crate::console::terminal::{self, Progress};
use crate::files::metrics_file::MetricsFile;
use crate::task::trainer::{self, Needed};
use crate::task::{self, Chosen};
use demonstrations::Demonstrations;
use given_prior::GivenPrior;
use identity::Data;
use own_heuristic::Beside;
use request::{Asked, Request, identity_of};
use run_folder::RunFolder;

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
            // A run that goes on was told when it began.
            simulated.notes(plan.begun.is_none() && arguments.judge.is_none() && !asks_for_it);
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
        let identity = identity_of(&chosen, Some(self.data.clone()), None);
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
        let again = playground.played_again();
        if again.times > 0 {
            terminal::note(&format!(
                "{} ran away and had to be begun again from another start: {}; `demosift task check` says what in a model makes \
                 that likely",
                counted(again.times as usize, "episode"),
                again.why
            ));
        }
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

/// Learning the prior has no parts. The wheel learns it first where it reads these words (`demosift/parts.py`).
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
