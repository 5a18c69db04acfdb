//! A trainer of the user's own, in Python: `train(demonstrations, seed)` returns a policy, which is played here.
//!
//! Each training has a process of its own, in which its policy lives and is asked for actions, one observation after the
//! other; so several trainings can run side by side, and none finds anything that another has left.
//! In an environment of Python the trainer sees actions in the environment's own unit, and so does its policy act; in a task
//! of demosift from −1 to 1.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use demosift::basics::files;
use demosift::basics::seed::Seed;
use demosift::data::demonstration::{DemoId, DemonstrationSet};
use demosift::world::environment::Specification;
use demosift::world::trainer::{Apprentice, Trainer, TrainerIdentity};
use demosift::{Error, Result};
use rand::Rng as _;
use serde::Deserialize;
use serde_json::json;

use crate::process::{Answer, Interpreter, Process, Whose};
use crate::session::{DONE, PROBLEM, PROTOCOL, Problem, install_or_name};
use crate::source::Source;
use crate::units::Units;

const LEARN: u8 = b'L';
const DEMONSTRATION: u8 = b'D';
const TRAIN: u8 = b'N';
const BEGIN: u8 = b'B';
const ACT: u8 = b'A';

/// How long a training may take where nobody says.
pub const TRAINING_LIMIT: Duration = Duration::from_secs(6 * 60 * 60);

/// Which trainer is wanted, and for what.
#[derive(Clone, Debug, PartialEq)]
pub struct WantedTrainer<'a> {
    /// As it is typed: `my_train.py:train` or `package.module:train`.
    pub typed: &'a str,
    /// The interpreter in which it works.
    pub python: PathBuf,
    /// How long a start or an action may take.
    pub time_limit: Duration,
    /// How long a training may take.
    pub training_limit: Duration,
    /// The task in which its policies act.
    pub task: &'a Specification,
    /// Whether that is an environment of Python, which has a unit of its own.
    pub in_own_unit: bool,
}

/// A trainer that was found.
#[derive(Debug)]
pub struct PythonTrainer {
    interpreter: Interpreter,
    training_limit: Duration,
    source: Source,
    identity: TrainerIdentity,
    observation: usize,
    action: usize,
    units: Option<Units>,
    versions: BTreeMap<String, String>,
}

#[derive(Deserialize)]
struct Learning {
    protocol: u32,
    versions: BTreeMap<String, String>,
}

#[derive(Deserialize)]
struct Trained {
    onnx: Option<PathBuf>,
}

impl PythonTrainer {
    /// Looks for the trainer: its file or module is imported once, by a process that ends then.
    ///
    /// # Errors
    /// `is_bad_input` if there is no such interpreter or function.
    pub fn open(wanted: &WantedTrainer<'_>) -> Result<Self> {
        let source = Source::of_trainer(wanted.typed)?;
        let name = source.function_name();
        let sha256 = sha256_of(&source)?;
        let whose = Whose {
            name: format!("the trainer {name}"),
            process: format!("the process of the trainer {name}"),
        };
        let interpreter = Interpreter { python: wanted.python.clone(), time_limit: wanted.time_limit, whose };
        let task = wanted.task;
        let mut trainer = Self {
            interpreter,
            training_limit: wanted.training_limit,
            source,
            identity: TrainerIdentity { name, sha256 },
            observation: task.observation_size,
            action: task.action_size,
            units: wanted.in_own_unit.then(|| Units::new(&task.control_ranges)),
            versions: BTreeMap::new(),
        };
        trainer.versions = trainer.start().map_err(|error| trainer.here(error))?.1;
        Ok(trainer)
    }

    /// What to type for a trainer from any working directory, where this is what was typed here.
    ///
    /// # Errors
    /// `is_bad_input` if it names no function of a file or module, or the file does not exist.
    pub fn in_words(typed: &str) -> Result<String> {
        Ok(Source::of_trainer(typed)?.words())
    }

    /// The interpreter, as it was named.
    pub fn python(&self) -> &std::path::Path {
        &self.interpreter.python
    }

    /// Versions of Python and of what learners are made of, as far as the trainer's file imports them.
    pub fn versions(&self) -> &BTreeMap<String, String> {
        &self.versions
    }

    /// A process that has imported the trainer, which is still the one that was found.
    fn start(&self) -> Result<(Process, BTreeMap<String, String>)> {
        let mut process = Process::start(&self.interpreter)?;
        let mut asked = self.source.request();
        asked["observation"] = json!(self.observation);
        asked["action"] = json!(self.action);
        let what = "its start";
        let answer = process.ask(LEARN, asked.to_string().as_bytes(), what)?;
        if answer.letter == PROBLEM {
            let problem: Problem = self.read(&answer, PROBLEM, what)?;
            return Err(self.not_found(&problem));
        }
        let learning: Learning = self.read(&answer, DONE, what)?;
        if learning.protocol != PROTOCOL {
            let found = learning.protocol;
            return Err(Error::simulation(format!(
                "the worker speaks protocol {found}, and this demosift {PROTOCOL}"
            )));
        }
        if sha256_of(&self.source)? != self.identity.sha256 {
            let name = &self.interpreter.whose.name;
            return Err(Error::bad_input(format!("the file of {name} was changed since the command began"))
                .with_hint("take back the change, or let --resume make the trainings of the changed one"));
        }
        Ok((process, learning.versions))
    }

    fn not_found(&self, problem: &Problem) -> Error {
        let Problem { kind, message, hint, .. } = problem;
        let name = &self.interpreter.whose.name;
        let error = match kind.as_str() {
            "refused" => Error::bad_input(format!("{name}: {message}")),
            _ => {
                Error::bad_input(format!("{name} cannot be imported: {message}{}", problem.place_in_words()))
            }
        };
        error.with_hint(hint.clone().unwrap_or_else(|| install_or_name(message, &self.interpreter)))
    }

    /// An error of the trainer, with where it is.
    fn here(&self, error: Error) -> Error {
        error.at(Path::new(&self.source.words()))
    }

    fn read<T: for<'a> Deserialize<'a>>(&self, answer: &Answer, letter: u8, what: &str) -> Result<T> {
        read(&self.interpreter.whose.name, answer, letter, what)
    }

    /// Hands over the demonstrations, one after the other.
    fn show(&self, process: &mut Process, set: &DemonstrationSet, demos: &[DemoId]) -> Result<()> {
        for demo in demos {
            let demonstration = set.get(*demo);
            let actions = match &self.units {
                Some(units) => units.own_rows(demonstration.actions())?,
                None => demonstration.actions().clone(),
            };
            let steps = actions.len();
            let observations = &demonstration.observations().flat()[..steps * self.observation];
            let mut payload = Vec::with_capacity(4 * (1 + observations.len() + actions.flat().len()));
            payload.extend((steps as u32).to_le_bytes());
            for numbers in [observations, actions.flat()] {
                payload.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
            }
            let what = format!("the reading of demonstration {demo}");
            let answer = process.ask(DEMONSTRATION, &payload, &what)?;
            done(&self.interpreter.whose.name, &answer, &what)?;
        }
        Ok(())
    }
}

impl PythonTrainer {
    fn trained(&self, set: &DemonstrationSet, demos: &[DemoId], seed: &Seed) -> Result<PythonApprentice> {
        let (mut process, _) = self.start()?;
        self.show(&mut process, set, demos)?;
        let seed = u64::from(seed.of("train").into_rng().next_u32());
        let what = match demos {
            [demo] => format!("a training on demonstration {demo}"),
            _ => format!("a training on {} demonstrations", demos.len()),
        };
        let hint = "--trainer-timeout SECONDS gives a training longer";
        let answer = process.ask_within(self.training_limit, hint, TRAIN, &seed.to_le_bytes(), &what)?;
        let name = self.interpreter.whose.name.clone();
        done(&name, &answer, &what)?;
        let Trained { onnx } = read(&name, &answer, DONE, &what)?;
        Ok(PythonApprentice {
            process,
            name,
            place: PathBuf::from(self.source.words()),
            units: self.units.clone(),
            own: vec![0.0; self.action],
            onnx: onnx.map(|path| files::read(&path)).transpose()?,
        })
    }
}

impl Trainer for PythonTrainer {
    fn identity(&self) -> &TrainerIdentity {
        &self.identity
    }

    fn train(&self, set: &DemonstrationSet, demos: &[DemoId], seed: &Seed) -> Result<Box<dyn Apprentice>> {
        let apprentice = self.trained(set, demos, seed).map_err(|error| self.here(error))?;
        Ok(Box::new(apprentice))
    }
}

/// A policy in the process that has trained it.
struct PythonApprentice {
    process: Process,
    /// Of the trainer.
    name: String,
    /// Where that is.
    place: PathBuf,
    units: Option<Units>,
    /// The last action in the policy's own unit.
    own: Vec<f64>,
    onnx: Option<Vec<u8>>,
}

impl PythonApprentice {
    fn begun(&mut self) -> Result<()> {
        let what = "the beginning of an episode";
        let answer = self.process.ask(BEGIN, &[], what)?;
        done(&self.name, &answer, what)
    }

    /// Leaves the action in the policy's own unit.
    fn acted(&mut self, observation: &[f32]) -> Result<()> {
        let what = "an action of its policy";
        let payload: Vec<u8> = observation.iter().flat_map(|number| number.to_le_bytes()).collect();
        let answer = self.process.ask(ACT, &payload, what)?;
        done(&self.name, &answer, what)?;
        let (numbers, rest) = answer.payload.as_chunks();
        if answer.letter != ACT || numbers.len() != self.own.len() || !rest.is_empty() {
            return Err(Error::simulation(format!("the answer of {} to {what} is no action", self.name)));
        }
        self.own.iter_mut().zip(numbers).for_each(|(own, bytes)| *own = f64::from_le_bytes(*bytes));
        Ok(())
    }
}

impl Apprentice for PythonApprentice {
    fn begin(&mut self) -> Result<()> {
        self.begun().map_err(|error| error.at(&self.place))
    }

    fn act(&mut self, observation: &[f32], action: &mut [f32]) -> Result<()> {
        self.acted(observation).map_err(|error| error.at(&self.place))?;
        match &self.units {
            Some(units) => units.of_policy(&self.own, action),
            None => action.iter_mut().zip(&self.own).for_each(|(action, own)| *action = *own as f32),
        }
        Ok(())
    }

    fn onnx(&self) -> Option<&[u8]> {
        self.onnx.as_deref()
    }
}

/// Of the file that a trainer is in, where that is known.
fn sha256_of(source: &Source) -> Result<Option<String>> {
    source.file().map(|file| files::sha256(&[file.to_owned()])).transpose()
}

/// Whether what was asked for was done.
fn done(name: &str, answer: &Answer, what: &str) -> Result<()> {
    match answer.letter {
        PROBLEM => Err(failed(name, &read(name, answer, PROBLEM, what)?, what)),
        _ => Ok(()),
    }
}

/// What is no policy, and what is no action, is the user's to mend; an exception is a failure.
fn failed(name: &str, problem: &Problem, what: &str) -> Error {
    let Problem { kind, message, hint, .. } = problem;
    let error = match kind.as_str() {
        "refused" => Error::bad_input(format!("{name}: {message}")),
        _ => Error::simulation(format!("{name} failed in {what}: {message}{}", problem.place_in_words())),
    };
    match hint {
        Some(hint) => error.with_hint(hint),
        None => error.with_hint("what was finished before is kept: --resume goes on once this is mended"),
    }
}

fn read<T: for<'a> Deserialize<'a>>(name: &str, answer: &Answer, letter: u8, what: &str) -> Result<T> {
    let read = if answer.letter == letter { serde_json::from_slice(&answer.payload).ok() } else { None };
    read.ok_or_else(|| Error::simulation(format!("the answer of {name} to {what} cannot be read")))
}
