//! `--env`: a task that is an environment of the user's own, in Python processes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use demosift::data::demonstration::episode::Columns;
use demosift::world::environment::Task as _;
use demosift::world::rollout::Playground;
use demosift::{Error, Result};
use demosift_gymnasium::check::SLOW;
use demosift_gymnasium::source::{NamingSet, Source};
use demosift_gymnasium::task::{GymnasiumTask, Wanted};
use demosift_gymnasium::trial::Repeats;
use serde::{Deserialize, Serialize};
use toml::Table;

use crate::arguments::{SimulatorArguments, SourceArguments};
use crate::configuration::Layer;
use crate::console::terminal;

/// The interpreter where none is named.
pub(super) const PYTHON: &str = "python3";
/// How long a start, a reset or a step may take where nobody says.
const TIME_LIMIT_SECS: u64 = 60;
/// More workers than any machine has processors are a typing mistake, and would be started.
const MOST_WORKERS: usize = 4096;
/// More than a year is a typing error, and a clock cannot count all that a number can say.
const MOST_SECS: u64 = 365 * 24 * 60 * 60;
/// What a run on a slow environment leaves out, unless it is asked for.
const SLOW_VALUES: &str = "judges = 'cloning'\nreferee.gail = 0";

/// What a run depends on whose task is an environment; kept in `run.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct Simulator {
    /// The interpreter.
    pub(crate) python: PathBuf,
    /// In a few words, or the function of a whole episode, from any working directory.
    pub(crate) heuristic: String,
    /// The function that measures more of each step, from any working directory.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) measure: Option<String>,
    pub(crate) horizon: usize,
    /// Of Python and of all that the physics depend on.
    pub(crate) versions: BTreeMap<String, String>,
    /// Whether the same seed made the same episode when the run began.
    pub(crate) repeats: Repeats,
    /// Least and greatest of each number of an action, in the environment's own unit: what −1 and 1 of a policy mean.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) bounds: Vec<[f64; 2]>,
    /// The environment that a set named: as Gymnasium writes it, or what a set of robomimic says of it and is observed of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) spec: Option<String>,
    /// Whether code that the set names may run.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(crate) trusted: bool,
}

/// An environment with the workers that may play in it at once.
pub(crate) struct Simulated {
    pub(crate) task: GymnasiumTask,
    workers: usize,
}

impl Simulated {
    /// What a run depends on.
    pub(crate) fn identity(&self) -> Simulator {
        let task = &self.task;
        let source = task.source();
        Simulator {
            python: task.python().to_owned(),
            heuristic: task.heuristic_words().to_owned(),
            measure: task.measure_words(),
            horizon: task.specification().horizon,
            versions: task.versions().clone(),
            repeats: task.repeats(),
            bounds: task.specification().control_ranges.clone(),
            spec: source.spec().map(str::to_owned),
            trusted: matches!(source, Source::Set { trusted: true, .. }),
        }
    }

    /// A playground whose workers are waited for, on threads of their own.
    pub(crate) fn playground(&self) -> Result<Playground<'_>> {
        Playground::with_workers(&self.task, self.workers)
    }

    /// What a job leaves out unless it is asked for, where learning by trial and error would take hours: as the run has it
    /// that goes on, and else by the clock.
    pub(crate) fn values(&self, begun: Option<&Table>) -> Result<Layer> {
        let slow = self.task.trial().steps_per_sec < SLOW;
        let mut layer =
            Layer::from_text("the speed of the environment", if slow { SLOW_VALUES } else { "" })?;
        if let Some(begun) = begun {
            let kept = begun.iter().filter(|(key, _)| ["judges", "referee"].contains(&key.as_str()));
            layer.values = kept.map(|(key, value)| (key.clone(), value.clone())).collect();
        }
        Ok(layer)
    }

    /// Says what the user should know of the environment before a run.
    pub(crate) fn notes(&self, asks_cloning_only: bool) {
        let repeats = self.task.repeats();
        if repeats != Repeats::Exactly {
            terminal::note(&format!(
                "the environment {}, so neither another run nor one that goes on with --resume has the same numbers, and scores \
                 are compared with more noise",
                repeats.words()
            ));
        }
        let rate = self.task.trial().steps_per_sec;
        if asks_cloning_only && rate < SLOW {
            terminal::note(&format!(
                "the environment makes about {rate:.0} steps a second, so only cloning judges and trains: the paper's judge and \
                 GAIL need many more steps; --judge both and --referee cloning=10,gail=3 ask for them, and --dry-run says what \
                 that would cost"
            ));
        }
    }
}

/// The environment of an earlier run, as `run.json` tells of it.
#[derive(Clone, Copy)]
pub(crate) struct Earlier<'a> {
    /// As `--env` takes it.
    pub(crate) env: &'a str,
    pub(crate) simulator: &'a Simulator,
}

/// The set that may name its environment; `recorded` are the columns of a run that goes on, where no others are typed.
pub(crate) fn naming<'a>(
    path: Option<&'a Path>,
    how: Option<&'a SourceArguments>,
    recorded: Option<&'a Columns>,
) -> Option<NamingSet<'a>> {
    let typed = how.map_or(&[][..], |how| &how.observation_columns);
    let observations = match recorded {
        Some(recorded) if typed.is_empty() => &recorded.observations,
        _ => typed,
    };
    Some(NamingSet { path: path?, format: how.and_then(|how| how.format), observations })
}

/// Opens the environment that is asked for, or that an earlier run was about; `None` if it is a task that is meant.
///
/// `set` is the set of demonstrations that `from-set` means; `has_trainer` says whether some options may be about a trainer.
pub(crate) fn open(
    asked: &SimulatorArguments,
    set: Option<NamingSet<'_>>,
    earlier: Option<Earlier<'_>>,
    has_trainer: bool,
) -> Result<Option<Simulated>> {
    let simulator = earlier.map(|earlier| earlier.simulator);
    let source = match (&asked.env, earlier) {
        (Some(env), _) => Source::parse(env, set, asked.trust_set)?,
        (None, Some(Earlier { env, simulator })) => match &simulator.spec {
            Some(spec) => Source::of_spec(spec.clone(), simulator.trusted || asked.trust_set),
            None => Source::parse(env, set, false)?,
        },
        (None, None) => return asked.check_unused(has_trainer).map(|()| None),
    };
    let python = asked.python.as_deref().map(absolute).transpose()?;
    let workers = asked.workers.unwrap_or_else(rayon::current_num_threads);
    check_workers(workers)?;
    let task = GymnasiumTask::open(&Wanted {
        source,
        python: python.or(simulator.map(|of| of.python.clone())).unwrap_or_else(|| PYTHON.into()),
        heuristic: asked.heuristic.clone().or(simulator.map(|of| of.heuristic.clone())),
        measure: asked.measure.clone().or(simulator.and_then(|of| of.measure.clone())),
        horizon: asked.horizon.or(simulator.map(|of| of.horizon)),
        time_limit: time_limit(asked)?,
    })?;
    Ok(Some(Simulated { task, workers }))
}

/// How long a start, a reset, a step or an action may take.
pub(super) fn time_limit(asked: &SimulatorArguments) -> Result<Duration> {
    limit("--time-limit", asked.time_limit.unwrap_or(TIME_LIMIT_SECS))
}

/// So many seconds, if they can be meant.
pub(super) fn limit(option: &str, secs: u64) -> Result<Duration> {
    match secs {
        1..=MOST_SECS => Ok(Duration::from_secs(secs)),
        _ => {
            Err(Error::bad_config(format!("{option} {secs}: must be from 1 to {MOST_SECS} seconds, a year")))
        }
    }
}

/// Whether so many workers can be meant.
fn check_workers(count: usize) -> Result<()> {
    match count {
        1..=MOST_WORKERS => Ok(()),
        _ => Err(Error::bad_config(format!("--workers {count}: must be from 1 to {MOST_WORKERS}"))),
    }
}

/// The name that the environment's folder has, before it is opened.
pub(crate) fn folder_name(asked: &SimulatorArguments, set: Option<NamingSet<'_>>) -> Result<Option<String>> {
    let env = asked.env.as_ref();
    env.map(|env| Ok(Source::parse(env, set, asked.trust_set)?.short_name())).transpose()
}

/// The first thing in which two runs differ that are about an environment: what it is, before and now.
pub(crate) fn difference(
    old: Option<&Simulator>,
    new: Option<&Simulator>,
) -> Option<(String, String, String)> {
    let (old, new) = match (old, new) {
        (None, None) => return None,
        (Some(old), Some(new)) => (old, new),
        (old, _) => {
            let kind = |is_one: bool| if is_one { "an environment of --env" } else { "a task of demosift" };
            let is_one = old.is_some();
            return Some(("the task".to_owned(), kind(is_one).to_owned(), kind(!is_one).to_owned()));
        }
    };
    let or_none = |words: &Option<String>| words.clone().unwrap_or_else(|| "none".to_owned());
    let mut pairs = vec![
        ("the environment that the set names".to_owned(), or_none(&old.spec), or_none(&new.spec)),
        ("the heuristic".to_owned(), old.heuristic.clone(), new.heuristic.clone()),
        ("the function that measures".to_owned(), or_none(&old.measure), or_none(&new.measure)),
        ("the horizon".to_owned(), old.horizon.to_string(), new.horizon.to_string()),
    ];
    let version =
        |of: &Simulator, name: &str| of.versions.get(name).cloned().unwrap_or_else(|| "not there".to_owned());
    let mut names: Vec<&String> = old.versions.keys().chain(new.versions.keys()).collect();
    names.sort();
    names.dedup();
    pairs.extend(
        names
            .into_iter()
            .map(|name| (format!("the version of {name}"), version(old, name), version(new, name))),
    );
    // Runs of before they were written down do not say.
    if !old.bounds.is_empty() && !new.bounds.is_empty() {
        pairs.push(("the range of an action".to_owned(), ranges(&old.bounds), ranges(&new.bounds)));
    }
    pairs.into_iter().find(|(_, old, new)| old != new)
}

/// The range of each number of an action.
fn ranges(bounds: &[[f64; 2]]) -> String {
    let ranges: Vec<String> = bounds.iter().map(|[low, high]| format!("{low} to {high}")).collect();
    ranges.join(", ")
}

/// An interpreter by its path from any working directory; a link is kept, since an environment of Python is known by it.
pub(super) fn absolute(python: &Path) -> Result<PathBuf> {
    if python.components().count() < 2 {
        return Ok(python.to_owned());
    }
    std::path::absolute(python).map_err(|error| Error::io("cannot find the interpreter", python, &error))
}

impl SimulatorArguments {
    /// Refuses what would say nothing; an interpreter and a time limit may be those of a trainer.
    fn check_unused(&self, has_trainer: bool) -> Result<()> {
        let Self { env: _, python, workers, horizon, heuristic, measure, time_limit, trust_set } = self;
        let given = [
            ("--python", python.is_some() && !has_trainer),
            ("--workers", workers.is_some()),
            ("--horizon", horizon.is_some()),
            ("--heuristic", heuristic.is_some()),
            ("--measure", measure.is_some()),
            ("--time-limit", time_limit.is_some() && !has_trainer),
            ("--trust-set", *trust_set),
        ];
        match given.iter().find(|(_, is_given)| *is_given) {
            None => Ok(()),
            Some((option, _)) => {
                Err(Error::bad_config(format!("{option} is about an environment, and none is given"))
                    .with_hint("add --env gymnasium:ID or --env my_env.py:make, or leave it away"))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn simulator(versions: &[(&str, &str)]) -> Simulator {
        Simulator {
            python: "python3".into(),
            heuristic: "sum reward".to_owned(),
            measure: None,
            horizon: 30,
            versions: versions
                .iter()
                .map(|(name, version)| ((*name).to_owned(), (*version).to_owned()))
                .collect(),
            repeats: Repeats::Exactly,
            bounds: Vec::new(),
            spec: None,
            trusted: false,
        }
    }

    #[test]
    fn a_difference_names_what_was_and_what_is() {
        let old = simulator(&[("mujoco", "3.3.7"), ("python", "3.11.7")]);
        assert_eq!(difference(Some(&old), Some(&old)), None);
        let words =
            |what: &str, old: &str, new: &str| Some((what.to_owned(), old.to_owned(), new.to_owned()));
        let new = simulator(&[("mujoco", "3.17.0"), ("python", "3.11.7")]);
        assert_eq!(difference(Some(&old), Some(&new)), words("the version of mujoco", "3.3.7", "3.17.0"));
        let without = simulator(&[("python", "3.11.7")]);
        assert_eq!(
            difference(Some(&old), Some(&without)),
            words("the version of mujoco", "3.3.7", "not there")
        );
        // Where the interpreter lies says nothing of what it plays.
        let elsewhere = Simulator { python: "/venv/bin/python".into(), ..old.clone() };
        assert_eq!(difference(Some(&old), Some(&elsewhere)), None);
        assert_eq!(difference(Some(&old), None).unwrap().2, "a task of demosift");
        let within = |bounds: &[[f64; 2]]| Simulator { bounds: bounds.to_vec(), ..old.clone() };
        let (narrow, wide) = (within(&[[-1.0, 1.0], [0.0, 5.5]]), within(&[[-1.0, 1.0], [0.0, 6.0]]));
        let wanted = words("the range of an action", "-1 to 1, 0 to 5.5", "-1 to 1, 0 to 6");
        assert_eq!(difference(Some(&narrow), Some(&wide)), wanted);
        assert_eq!(difference(Some(&narrow), Some(&narrow)), None);
        assert_eq!(difference(Some(&old), Some(&wide)), None, "an earlier run says nothing of them");
    }
}
