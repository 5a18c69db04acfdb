//! Whether an environment can be learned in: does it repeat, how fast is it, how do its episodes end, and do recorded
//! demonstrations fit it?

use demosift::Result;
use demosift::basics::seed::Seed;
use demosift::data::demonstration::DemonstrationSet;
use demosift::world::environment::Task as _;
use serde::Serialize;

use crate::replay::{self, Replayed, Starts};
use crate::session::Session;
use crate::task::GymnasiumTask;
use crate::trial::{Repeats, Trial, episode, measurements, random_actions, trial};
use crate::whole::reset_seed;

/// Steps of each of the three episodes by which is seen whether an environment repeats, where a user asks for it.
const CHECK_STEPS: usize = 200;
/// Episodes of random actions, and steps of all of them together.
const EPISODES: usize = 5;
const MOST_STEPS: usize = 2000;
/// Steps a second below which an environment is slow: learning by trial and error then takes hours.
pub const SLOW: f64 = 1000.0;

/// What is found of an environment.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Checked {
    /// Whether it repeats.
    pub trial: Trial,
    /// Whether another process of it plays the same; nothing to say where it does not even repeat in one.
    pub alike: Option<bool>,
    /// Of random actions.
    pub episodes: usize,
    /// Of all these episodes.
    pub steps: usize,
    /// How many of them ended in a terminal state.
    pub terminated: usize,
    /// How many the environment stopped before the horizon.
    pub truncated: usize,
    /// The least and the greatest heuristic.
    pub scores: [f64; 2],
    /// How many reached the goal, where the environment tells.
    pub successes: Option<usize>,
    /// Numbers of an observation that never changed.
    pub constant: Vec<usize>,
}

/// What is found of demonstrations beside an environment.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Recorded {
    /// The least and the greatest of each number of their actions, as they were recorded.
    pub actions: Vec<[f64; 2]>,
    /// The share of all numbers that lie beyond the bounds.
    pub beyond: f64,
    /// Demonstrations of which the set tells how they began, played again.
    pub replayed: Vec<Replayed>,
}

/// Tries an environment with random actions.
///
/// # Errors
/// `is_simulation` if it fails.
pub fn check(task: &GymnasiumTask, seed: &Seed) -> Result<Checked> {
    let specification = task.specification();
    let horizon = specification.horizon;
    let mut session = task.session()?;
    let trial = trial(&mut session, task.units(), CHECK_STEPS, horizon)?;
    let alike = match trial.repeats {
        Repeats::Exactly => Some(plays_alike(task, &mut session, horizon)?),
        Repeats::StartOnly | Repeats::No => None,
    };
    let mut ranges = vec![[f32::INFINITY, f32::NEG_INFINITY]; specification.observation_size];
    let mut found = Checked {
        trial,
        alike,
        episodes: 0,
        steps: 0,
        terminated: 0,
        truncated: 0,
        scores: [f64::INFINITY, f64::NEG_INFINITY],
        successes: task.tells_success().then_some(0),
        constant: Vec::new(),
    };
    while found.episodes < EPISODES && found.steps < MOST_STEPS {
        let seed = seed.at(found.episodes);
        let turns =
            episode(&mut session, reset_seed(&seed), &random_actions(task.units(), seed.of("act"), horizon))?;
        let steps = turns.len() - 1;
        let last = turns.last().expect("there is the turn of the reset");
        found.episodes += 1;
        found.steps += steps;
        found.terminated += usize::from(last.terminated);
        found.truncated += usize::from(last.truncated && !last.terminated && steps < horizon);
        let measured = measurements(&turns, specification.measurements.len());
        let score = task.heuristic().score(&measured);
        found.scores = [found.scores[0].min(score), found.scores[1].max(score)];
        let succeeded = task.succeeded(&measured) == Some(true);
        found.successes = found.successes.map(|count| count + usize::from(succeeded));
        for number in turns.iter().flat_map(|turn| turn.observation.iter().zip(0..)) {
            let range = &mut ranges[number.1];
            *range = [range[0].min(*number.0), range[1].max(*number.0)];
        }
    }
    task.give_back(session);
    let constant = ranges.iter().enumerate().filter(|(_, range)| range[0] >= range[1]);
    found.constant = constant.map(|(column, _)| column).collect();
    Ok(found)
}

/// Whether a process that has played nothing yet plays as this one does.
fn plays_alike(task: &GymnasiumTask, session: &mut Session, horizon: usize) -> Result<bool> {
    let actions = random_actions(task.units(), Seed::new(0).of("alike"), CHECK_STEPS.min(horizon));
    let mut other = task.new_session()?;
    let alike = episode(session, 3, &actions)? == episode(&mut other, 3, &actions)?;
    task.give_back(other);
    Ok(alike)
}

/// Holds demonstrations, as they were recorded, against an environment; those of which is known how they began are played
/// again, at most `most` of them.
///
/// # Errors
/// `is_bad_input` if sizes differ, `is_simulation` if the environment fails.
pub fn compare(
    task: &GymnasiumTask,
    set: &DemonstrationSet,
    starts: &Starts,
    most: usize,
) -> Result<Recorded> {
    task.specification().check_sizes(set.observation_size(), set.action_size())?;
    let mut actions = vec![[f64::INFINITY, f64::NEG_INFINITY]; set.action_size()];
    let (mut beyond, mut all) = (0_usize, 0_usize);
    for (number, column) in set
        .iter()
        .flat_map(|(_, demonstration)| demonstration.actions().iter().flat_map(|row| row.iter().zip(0..)))
    {
        let (number, [low, high]) = (f64::from(*number), task.units().bounds()[column]);
        actions[column] = [actions[column][0].min(number), actions[column][1].max(number)];
        let slack = 1e-6 * (high - low);
        beyond += usize::from(number < low - slack || number > high + slack);
        all += 1;
    }
    let replayed = replay::replayed(task, set, starts, &starts.known(task, set, most))?;
    Ok(Recorded { actions, beyond: beyond as f64 / all.max(1) as f64, replayed })
}
