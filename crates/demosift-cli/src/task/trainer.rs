//! `--trainer`: a trainer of the user's own, which the referee asks beside its own imitators, and which may judge.
//!
//! Which one it is stands in the run's configuration, as far as it may be asked for differently: the table `trainer`.

use std::path::PathBuf;

use demosift::stages::referee::Refereeing;
use demosift::{Error, Result};
use demosift_gymnasium::trainer::{PythonTrainer, TRAINING_LIMIT, WantedTrainer};
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::Chosen;
use super::simulator::{PYTHON, absolute, limit, time_limit};
use crate::arguments::JobArguments;
use crate::configuration::{self, TRAINER};

/// The trainer of a run, as its configuration tells.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct OfRun {
    /// As `--trainer` takes it, from any working directory.
    train: String,
    /// The interpreter.
    python: PathBuf,
    /// How long a training may take.
    timeout_secs: u64,
}

/// Writes into the configuration how often the referee trains, and by whose trainer; who judges stands there already.
///
/// # Errors
/// `is_bad_config` if trainings by a trainer are asked for and there is none, or the other way round; `is_bad_input` if the
/// trainer's file is not there.
pub(crate) fn ask(values: &mut Table, arguments: &JobArguments, chosen: &Chosen) -> Result<()> {
    let asked = &arguments.trainer;
    let mut of_run: Option<OfRun> = values.get(TRAINER).cloned().map(of_table).transpose()?;
    let python = arguments.run.simulator.python.as_deref().map(absolute).transpose()?;
    if let Some(typed) = &asked.trainer {
        let of_environment = chosen.simulated.as_ref().map(|simulated| simulated.task.python().to_owned());
        of_run = Some(OfRun {
            train: PythonTrainer::in_words(typed)?,
            python: of_environment.unwrap_or_else(|| PYTHON.into()),
            timeout_secs: TRAINING_LIMIT.as_secs(),
        });
    }
    if let Some(of_run) = &mut of_run {
        of_run.python = python.unwrap_or_else(|| of_run.python.clone());
        of_run.timeout_secs = asked.trainer_timeout.unwrap_or(of_run.timeout_secs);
        limit("--trainer-timeout", of_run.timeout_secs)?;
    } else if asked.trainer_timeout.is_some() {
        return Err(Error::bad_config("--trainer-timeout is about a trainer, and none is given")
            .with_hint("add --trainer FILE.py:FUNCTION, or leave it away"));
    }
    let mut refereeing: Refereeing = of_table(values["referee"].clone())?;
    refereeing = arguments.referee.unwrap_or(refereeing);
    let judges = configuration::is_judged_by_trainer(values);
    if asked.trainer.is_some() && refereeing.trainer == 0 {
        match refereeing.most() == 0 && arguments.referee.is_some() {
            false => refereeing.trainer = Refereeing::usual_by_trainer(refereeing.gail),
            true if judges => {}
            true => {
                return Err(Error::bad_config(format!(
                    "--trainer trains final policies for the referee, and --referee {refereeing} asks for none"
                ))
                .with_hint("leave one of the two away, or say --referee trainer=3 or --judge trainer"));
            }
        }
    }
    if judges && of_run.is_none() {
        return Err(Error::bad_config(
            "a trainer of yours is to judge (judges = trainer), and there is none",
        )
        .with_hint("add --trainer FILE.py:FUNCTION, or take another judge, such as --judge cloning"));
    }
    if refereeing.trainer > 0 && of_run.is_none() {
        return Err(Error::bad_config(format!(
            "referee.trainer = {} asks for trainings by a trainer of yours, and there is none",
            refereeing.trainer
        ))
        .with_hint("add --trainer FILE.py:FUNCTION, or leave it out of --referee"));
    }
    values.insert("referee".to_owned(), table(&refereeing));
    if let Some(of_run) = of_run {
        values.insert(TRAINER.to_owned(), table(&of_run));
    }
    Ok(())
}

/// What a command may ask a trainer for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Needed {
    /// To judge, as nothing is judged yet.
    pub(crate) to_judge: bool,
    /// To train final policies.
    pub(crate) to_referee: bool,
}

/// Finds the trainer that a run will ask; `None` if it asks none.
///
/// # Errors
/// `is_bad_input` if it is not there, or cannot be imported.
pub(crate) fn open(
    values: &Table,
    needed: Needed,
    arguments: &JobArguments,
    chosen: &Chosen,
) -> Result<Option<PythonTrainer>> {
    let refereeing: Refereeing = of_table(values["referee"].clone())?;
    let Needed { to_judge, to_referee } = needed;
    let is_needed =
        (to_judge && configuration::is_judged_by_trainer(values)) || (to_referee && refereeing.trainer > 0);
    let Some(of_run) = values.get(TRAINER).filter(|_| is_needed) else { return Ok(None) };
    let OfRun { train, python, timeout_secs } = of_table(of_run.clone())?;
    let wanted = WantedTrainer {
        typed: &train,
        python,
        time_limit: time_limit(&arguments.run.simulator)?,
        training_limit: limit("--trainer-timeout", timeout_secs)?,
        task: chosen.task.specification(),
        in_own_unit: chosen.simulated.is_some(),
    };
    PythonTrainer::open(&wanted).map(Some)
}

/// Whether options that are about an interpreter say something although there is no environment.
pub(crate) fn is_asked(arguments: Option<&str>, begun: Option<&Table>) -> bool {
    arguments.is_some() || begun.is_some_and(|begun| begun.contains_key(TRAINER))
}

fn of_table<T: serde::de::DeserializeOwned>(value: Value) -> Result<T> {
    match value {
        Value::Table(table) => configuration::typed(table),
        other => Err(Error::bad_config(format!("the configuration: {other} is no table"))),
    }
}

fn table(of: &impl Serialize) -> Value {
    Value::try_from(of).expect("numbers and words are plain data")
}
