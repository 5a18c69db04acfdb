//! What a run is about: where it lies, its task and its values, before its data is read and its folder is touched.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use demosift::basics::part::Part;
use demosift::learning::adapt::MetaPrior;
use demosift::math::arithmetic;
use demosift::results::artifact::{Artifact as _, FORMAT_VERSION};
use demosift::results::panel::Judge;
use demosift::run::experiment;
use demosift::run::preset::Preset;
use demosift::stages::judge::Judged;
use demosift::{Error, Result};
use demosift_gymnasium::trainer::PythonTrainer;
use toml::Table;

use super::demonstrations::Demonstrations;
use super::fit;
use super::given_prior::GivenPrior;
use super::identity::{self, Begun, Data, Identity, PriorOrigin};
use super::run_folder::{self, RunFolder};
use crate::arguments::{JobArguments, PresetName, RunArguments, SourceArguments};
use crate::configuration::asked_again;
use crate::configuration::{self, Layer};
use crate::task::simulator::{self, Simulated};
use crate::task::trainer::{self, Needed};
use crate::task::{self, Chosen};

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
    pub(super) fn of(arguments: &'a JobArguments) -> Self {
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
    pub(super) out: PathBuf,
    /// Which prior it is given.
    pub(super) prior: Option<PriorOrigin>,
    pub(super) part: Option<Part>,
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
            // Said before its demonstrations are found not to fit.
            let now = identity_of(&chosen, None, None);
            identity::check_same_task(&begun.identity, &now).map_err(|error| error.at(&out))?;
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
    pub(super) fn check_numbers(&self, demonstrations: &Demonstrations) -> Result<()> {
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
    pub(super) fn holds_prior(&self) -> Result<bool> {
        let Some(folder) = self.begun_folder()? else { return Ok(false) };
        Ok(MetaPrior::recall(&folder, "")?.is_some())
    }

    /// The trainer that the run will ask, which must be the one that has judged it.
    pub(super) fn trainer(
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
        let identity = identity_of(&self.chosen, data, self.prior.clone());
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
pub(super) fn identity_of(chosen: &Chosen, data: Option<Data>, prior: Option<PriorOrigin>) -> Identity {
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
