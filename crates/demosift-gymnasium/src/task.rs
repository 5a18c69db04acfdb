//! The environment as a task: sizes, heuristic, and workers that step it.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use demosift::data::trajectory::{Parts, Trajectory};
use demosift::math::rows::Rows;
use demosift::world::environment::{Episode, Led, Rollout, Specification, Task, Worker};
use demosift::world::fold::{Fold, FoldOf, Measurements};
use demosift::world::heuristic::{Heuristic, Score};
use demosift::world::trainer::Apprentice;
use demosift::{Error, Result};

use crate::own::{self, Own, Said};
use crate::process::{Interpreter, Whose};
use crate::session::{Greeting, Session};
use crate::source::Source;
use crate::trial::{self, Repeats, Trial};
use crate::units::Units;
use crate::whole::{self, Act, Sizes};

/// The heuristic where none is named.
pub const DEFAULT_HEURISTIC: &str = "sum reward";
/// Measurements that every environment has, before those of info.
const ALWAYS: [&str; 2] = ["reward", "terminated"];
/// Names in info by which environments tell of success, the first that is there.
const SUCCESS: [&str; 2] = ["is_success", "success"];
/// Steps of the episode in which it is looked for where the first step does not tell.
const SUCCESS_WITHIN: usize = 1000;
/// Steps of each of the three episodes by which is seen whether an environment repeats.
const TRIAL_STEPS: usize = 20;
/// Steps that an error proposes where nobody says how many an episode has.
const NO_LIMIT_STEPS: usize = 1000;

/// Which environment is wanted, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Wanted {
    /// Where it comes from.
    pub source: Source,
    /// The interpreter in which it works.
    pub python: PathBuf,
    /// In a few words, such as `sum reward` or `negated min gap` (see [`FoldOf`]), or a function of a whole episode, such as
    /// `my_env.py:score`.
    pub heuristic: Option<String>,
    /// A function that measures more of each step, such as `my_env.py:measure`.
    pub measure: Option<String>,
    /// Steps of an episode, if not as many as the environment says.
    pub horizon: Option<usize>,
    /// How long a start, a reset or a step may take.
    pub time_limit: Duration,
}

/// An environment of Gymnasium as a task; cheap to clone.
#[derive(Clone)]
pub struct GymnasiumTask(Arc<Opened>);

/// What is known of an environment once it was opened.
struct Opened {
    interpreter: Interpreter,
    source: Source,
    own: Own,
    specification: Specification,
    heuristic: SinceReset,
    heuristic_words: String,
    /// The column of the measurement that says of success.
    success: Option<usize>,
    versions: BTreeMap<String, String>,
    info: Vec<String>,
    units: Units,
    is_put: bool,
    trial: Trial,
    /// Open environments that nobody plays in: to open one may take seconds.
    idle: Mutex<Vec<Session>>,
}

/// A fold over the rows that a step led to; the row of the reset has nothing to say.
struct SinceReset(Fold);

impl Heuristic for SinceReset {
    fn score(&self, measurements: &Rows) -> Score {
        let mut state = self.0.start();
        measurements.iter().skip(1).for_each(|row| self.0.push(&mut state, row));
        self.0.value(&state)
    }

    fn unit(&self) -> &str {
        self.0.unit()
    }
}

impl GymnasiumTask {
    /// Opens the environment, and plays a few steps of it to learn what it measures and whether it repeats.
    ///
    /// # Errors
    /// `is_bad_input` if it cannot be made or used, `is_bad_config` if the heuristic or the horizon does not fit it,
    /// `is_simulation` if it fails.
    pub fn open(wanted: &Wanted) -> Result<Self> {
        let Wanted { source, python, heuristic, measure, horizon, time_limit } = wanted;
        let whose = Whose::environment();
        let interpreter = Interpreter { python: python.clone(), time_limit: *time_limit, whose };
        let words = heuristic.as_deref().unwrap_or(DEFAULT_HEURISTIC);
        let Said { own, fold } = own::said(measure.as_deref(), words)?;
        let (mut session, greeting) = Session::open(&interpreter, source, &own)?;
        let horizon = horizon_of(*horizon, &greeting, source)?;
        let Measured { names, fold, success } = measured(&fold, &mut session, &greeting, horizon)?;
        let units = Units::new(&greeting.bounds);
        let trial = trial::trial(&mut session, &units, TRIAL_STEPS, horizon)?;
        let Greeting { versions, parts, bounds, info, step_secs, picture_secs, is_put, .. } = greeting;
        let specification = Specification {
            name: source.short_name(),
            observation_size: parts.iter().map(|(_, width)| width).sum(),
            observation_parts: parts,
            action_size: bounds.len(),
            control_ranges: bounds,
            measurements: names,
            variants: vec!["default".to_owned()],
            horizon,
            control_step_secs: step_secs.or(picture_secs).unwrap_or(1.0),
            is_control_step_told: step_secs.is_some(),
        };
        Ok(Self(Arc::new(Opened {
            interpreter,
            source: source.clone(),
            specification,
            heuristic: SinceReset(fold),
            heuristic_words: own.score_words().map_or_else(|| words.to_owned(), |[words, _]| words),
            own,
            success,
            versions,
            info,
            units,
            is_put,
            trial,
            idle: Mutex::new(vec![session]),
        })))
    }

    /// Where it comes from.
    pub fn source(&self) -> &Source {
        &self.0.source
    }

    /// The interpreter, as it was named.
    pub fn python(&self) -> &std::path::Path {
        &self.0.interpreter.python
    }

    /// Versions of Python and of all that the physics depend on, by name.
    pub fn versions(&self) -> &BTreeMap<String, String> {
        &self.0.versions
    }

    /// The heuristic in a few words, or the function that it is, from any working directory.
    pub fn heuristic_words(&self) -> &str {
        &self.0.heuristic_words
    }

    /// The same for people: a function without the folder that its file is in.
    pub fn heuristic_name(&self) -> String {
        self.0.own.score_words().map_or_else(|| self.0.heuristic_words.clone(), |[_, name]| name)
    }

    /// The function that measures more of each step, where there is one, from any working directory.
    pub fn measure_words(&self) -> Option<String> {
        self.0.own.measure_words()
    }

    /// The files of Python that decide what is played and measured, each once, where they are known.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut files: Vec<PathBuf> =
            self.0.source.file().map(std::path::Path::to_owned).into_iter().collect();
        for file in self.0.own.files() {
            if !files.contains(&file) {
                files.push(file);
            }
        }
        files
    }

    /// Names of the numbers of info after a step, of which heuristics can be made.
    pub fn info(&self) -> &[String] {
        &self.0.info
    }

    /// Whether the environment tells of success.
    pub fn tells_success(&self) -> bool {
        self.0.success.is_some()
    }

    /// Between its actions and those of a policy.
    pub fn units(&self) -> &Units {
        &self.0.units
    }

    /// Whether it can be put into a recorded state.
    pub fn is_put(&self) -> bool {
        self.0.is_put
    }

    /// What the first few steps showed.
    pub fn trial(&self) -> &Trial {
        &self.0.trial
    }

    /// Whether the same seed makes the same episode, as far as the first few steps showed.
    pub fn repeats(&self) -> Repeats {
        self.0.trial.repeats
    }

    /// An open environment, from those that are idle or a new one.
    pub(crate) fn session(&self) -> Result<Session> {
        let idle = self.0.idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
        idle.map_or_else(|| self.new_session(), Ok)
    }

    /// An environment in a process of its own that nobody has played in.
    pub(crate) fn new_session(&self) -> Result<Session> {
        let opened = &*self.0;
        let (mut session, greeting) = Session::open(&opened.interpreter, &opened.source, &opened.own)?;
        let Specification { observation_parts, control_ranges, measurements, horizon, .. } =
            &opened.specification;
        if (&greeting.parts, &greeting.bounds) != (observation_parts, control_ranges) {
            return Err(Error::simulation("the environment was made with other spaces than the first time"));
        }
        session.measure(&measurements[ALWAYS.len()..], *horizon, None)?;
        Ok(session)
    }

    /// An environment that can be looked at, in a process of its own; nothing of info is measured.
    pub(crate) fn session_to_view(&self) -> Result<Session> {
        let Opened { interpreter, source, .. } = &*self.0;
        Ok(Session::open_to_view(interpreter, source, &Own::default())?.0)
    }

    /// Names of the numbers of info that are measured.
    pub(crate) fn info_measured(&self) -> &[String] {
        &self.0.specification.measurements[ALWAYS.len()..]
    }

    /// Keeps an environment for the next worker, if it works.
    pub(crate) fn give_back(&self, session: Session) {
        if session.is_sound() {
            self.0.idle.lock().unwrap_or_else(PoisonError::into_inner).push(session);
        }
    }

    /// The sizes of an episode.
    fn sizes(&self) -> Sizes {
        let Specification { observation_size, control_ranges, measurements, horizon, .. } =
            self.specification();
        Sizes {
            observation: *observation_size,
            info: measurements.len() - ALWAYS.len(),
            horizon: *horizon,
            bounds: control_ranges.clone(),
        }
    }
}

impl Drop for Opened {
    fn drop(&mut self) {
        // All at once, and then each is waited for.
        let idle = self.idle.get_mut().unwrap_or_else(PoisonError::into_inner);
        idle.iter_mut().for_each(Session::close);
    }
}

impl Task for GymnasiumTask {
    fn specification(&self) -> &Specification {
        &self.0.specification
    }

    fn worker(&self) -> Result<Box<dyn Worker>> {
        Ok(Box::new(GymnasiumWorker { session: Some(self.session()?), task: self.clone() }))
    }

    fn heuristic(&self) -> &dyn Heuristic {
        &self.0.heuristic
    }

    fn succeeded(&self, measurements: &Rows) -> Option<bool> {
        let column = self.0.success?;
        Some(measurements.iter().skip(1).any(|row| row[column] > 0.5))
    }

    fn true_return(&self, measurements: &Rows) -> Option<f64> {
        Some(measurements.iter().skip(1).map(|row| f64::from(row[0])).sum())
    }

    /// Nobody can tell beforehand.
    fn may_end_early(&self) -> bool {
        true
    }
}

/// What a heuristic needs, and what stands beside it.
struct Measured {
    names: Vec<String>,
    fold: Fold,
    success: Option<usize>,
}

/// Looks up what the heuristic is of, in what every environment measures and in the numbers of info.
fn measured(words: &str, session: &mut Session, greeting: &Greeting, horizon: usize) -> Result<Measured> {
    let written: FoldOf = words.parse().map_err(|error: Error| error.during("the heuristic"))?;
    let always: Vec<String> = ALWAYS.map(str::to_owned).to_vec();
    let mut of_info: Vec<String> = Vec::new();
    for name in written.of.names().iter().filter(|name| !always.contains(name)) {
        if !of_info.contains(name) {
            of_info.push(name.clone());
        }
    }
    let success = match success_among(&greeting.info, &of_info) {
        Some(name) => Some(name),
        // Many tell of it at the end of an episode alone.
        None => {
            let wanted = [SUCCESS[0].to_owned()];
            success_among(&session.measure(&wanted, horizon, Some(horizon.min(SUCCESS_WITHIN)))?, &[])
        }
    };
    if let Some(name) = success.as_ref().filter(|name| !of_info.contains(name)) {
        of_info.push(name.clone());
    }
    let known = session.measure(&of_info, horizon, Some(horizon))?;
    let there: Vec<String> = always.iter().chain(&known).cloned().collect();
    let all = Measurements { names: &there, whose: "the environment" };
    Fold::resolve(&written, &all).map_err(|error| error.during(&format!("the heuristic '{words}'")))?;
    let names: Vec<String> = always.into_iter().chain(of_info).collect();
    let fold = Fold::resolve(&written, &Measurements { names: &names, whose: "the environment" })?;
    let success = success.and_then(|name| names.iter().position(|known| *known == name));
    Ok(Measured { names, fold, success })
}

/// By which of these names an environment tells of success.
fn success_among(seen: &[String], asked_for: &[String]) -> Option<String> {
    let is_there = |name: &&str| seen.iter().chain(asked_for).any(|known| known == name);
    SUCCESS.into_iter().find(is_there).map(str::to_owned)
}

/// How many steps an episode has.
fn horizon_of(asked: Option<usize>, greeting: &Greeting, source: &Source) -> Result<usize> {
    match (asked, greeting.limit) {
        (Some(0), _) => Err(Error::bad_config("--horizon 0: must be at least 1")),
        (Some(asked), Some(limit)) if asked > limit => Err(Error::bad_config(format!(
            "--horizon {asked}: {} stops an episode after {limit} steps by itself",
            source.words()
        ))
        .with_hint("give at most as many, or let the environment be made with a higher max_episode_steps")),
        (Some(asked), _) => Ok(asked),
        (None, Some(limit)) => Ok(limit),
        (None, None) => greeting.usual.ok_or_else(|| {
            let words = source.words();
            Error::bad_config(format!("{words} does not say after how many steps an episode stops"))
                .with_hint(format!("add --horizon N, such as --horizon {NO_LIMIT_STEPS}"))
        }),
    }
}

/// Plays whole episodes in one process.
struct GymnasiumWorker {
    task: GymnasiumTask,
    /// Always there until it is dropped.
    session: Option<Session>,
}

impl Drop for GymnasiumWorker {
    fn drop(&mut self) {
        if let Some(session) = self.session.take() {
            self.task.give_back(session);
        }
    }
}

impl Worker for GymnasiumWorker {
    fn play(&mut self, episodes: &[Episode<'_>]) -> Result<Vec<Rollout>> {
        let Self { task, session } = self;
        let session = session.as_mut().ok_or_else(|| Error::simulation("the worker has no environment"))?;
        let Specification { name, measurements, .. } = task.specification();
        let sizes = task.sizes();
        let mut rollouts = Vec::with_capacity(episodes.len());
        for alike in episodes.chunk_by(|a, b| std::ptr::eq(a.policy, b.policy) && a.acting == b.acting) {
            let acts = alike.iter().map(|&Episode { policy, acting, seed, .. }| Act { policy, acting, seed });
            let acts: Vec<Act<'_>> = acts.collect();
            let played = session.play(&sizes, &acts).and_then(|played| {
                played.into_iter().map(|parts| rollout(parts, measurements)).collect::<Result<Vec<_>>>()
            });
            rollouts.extend(played.map_err(|error| error.during(name))?);
        }
        Ok(rollouts)
    }

    /// Step by step, wherever the policy lives.
    fn play_led(&mut self, episode: Led<'_>, by: &mut dyn Apprentice) -> Result<Rollout> {
        let Self { task, session } = self;
        let session = session.as_mut().ok_or_else(|| Error::simulation("the worker has no environment"))?;
        let Specification { name, measurements, .. } = task.specification();
        let parts = whole::play_by(session, &task.sizes(), episode.seed, |observation, action| {
            by.act(observation, action)
        })?;
        rollout(parts, measurements).map_err(|error| error.during(name))
    }
}

/// An episode, if every number of it is finite.
fn rollout(parts: Parts, names: &[String]) -> Result<Rollout> {
    for (step, row) in parts.measurements.iter().enumerate() {
        check_finite(row, names, step)?;
    }
    Ok(Rollout { trajectory: Trajectory::new(parts)?, states: None })
}

fn check_finite(row: &[f32], names: &[String], step: usize) -> Result<()> {
    match row.iter().zip(names).find(|(number, _)| !number.is_finite()) {
        None => Ok(()),
        Some((number, name)) => Err(Error::simulation(format!(
            "'{name}' is {number} after step {step}, and must be a finite number"
        ))),
    }
}
