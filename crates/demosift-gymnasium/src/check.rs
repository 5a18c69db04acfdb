//! Whether an environment can be learned in: does it repeat, how fast is it, how do its episodes end, and do recorded
//! demonstrations fit it?

use demosift::basics::seed::Seed;
use demosift::data::demonstration::{DemoId, DemonstrationSet};
use demosift::math::rows::Rows;
use demosift::world::environment::Task as _;
use demosift::{Error, Result};
use rand::Rng as _;
use serde::Serialize;

use crate::session::Session;
use crate::task::GymnasiumTask;
use crate::trial::{Repeats, Trial, episode, random_actions, trial};
use crate::turn::Turn;

/// Steps of each of the three episodes by which is seen whether an environment repeats, where a user asks for it.
const CHECK_STEPS: usize = 200;
/// Episodes of random actions, and steps of all of them together.
const EPISODES: usize = 5;
const MOST_STEPS: usize = 2000;
/// An observation that is farther from the recorded one has left it.
const LEFT: f32 = 1e-3;
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
    /// The demonstrations whose seed the set tells, played again.
    pub replayed: Vec<Replayed>,
}

/// A demonstration that was played again from its seed with its recorded actions.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Replayed {
    /// Which.
    pub demo: DemoId,
    /// How many of its steps could be played.
    pub steps: usize,
    /// How many it has.
    pub recorded_steps: usize,
    /// The greatest distance of a number of an observation from the recorded one.
    pub drift: f64,
    /// The first step at which that is more than 0.001.
    pub left_at: Option<usize>,
    /// K of what was played.
    pub score: f64,
}

/// Tries an environment with random actions.
///
/// # Errors
/// `is_simulation` if it fails.
pub fn check(task: &GymnasiumTask, seed: &Seed) -> Result<Checked> {
    let specification = task.specification();
    let horizon = specification.horizon;
    let mut session = task.session()?;
    let trial = trial(&mut session, task.units(), CHECK_STEPS.min(horizon))?;
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
        let start = u64::from(seed.of("reset").into_rng().next_u32());
        let turns = episode(&mut session, start, &random_actions(task.units(), seed.of("act"), horizon))?;
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

fn measurements(turns: &[Turn], width: usize) -> Rows {
    let mut rows = Rows::with_capacity(width, turns.len());
    rows.push(&vec![0.0; width]);
    turns.iter().skip(1).for_each(|turn| rows.push(&turn.row()));
    rows
}

/// Holds demonstrations, as they were recorded, against an environment; those with a seed are played again from it, at most
/// `most` of them.
///
/// # Errors
/// `is_bad_input` if sizes differ, `is_simulation` if the environment fails.
pub fn compare(
    task: &GymnasiumTask,
    set: &DemonstrationSet,
    seeds: &[Option<u64>],
    most: usize,
) -> Result<Recorded> {
    let specification = task.specification();
    for (what, found, wanted) in [
        ("an observation", set.observation_size(), specification.observation_size),
        ("an action", set.action_size(), specification.action_size),
    ] {
        if found != wanted {
            return Err(Error::bad_input(format!(
                "the demonstrations have {found} numbers in {what}, and the environment has {wanted}"
            )));
        }
    }
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
    let mut session = task.session()?;
    let with_seed = set.ids().into_iter().filter_map(|demo| Some((demo, (*seeds.get(demo.0)?)?)));
    let replayed = with_seed.take(most).map(|(demo, seed)| replay(task, &mut session, set, demo, seed));
    let replayed = replayed.collect::<Result<Vec<_>>>()?;
    task.give_back(session);
    Ok(Recorded { actions, beyond: beyond as f64 / all.max(1) as f64, replayed })
}

fn replay(
    task: &GymnasiumTask,
    session: &mut Session,
    set: &DemonstrationSet,
    demo: DemoId,
    seed: u64,
) -> Result<Replayed> {
    let demonstration = set.get(demo);
    let actions: Vec<Vec<f64>> = demonstration
        .actions()
        .iter()
        .map(|row| row.iter().map(|number| f64::from(*number)).collect())
        .collect();
    let turns = episode(session, seed, &actions)?;
    let distance = |turn: &Turn, row: &[f32]| {
        turn.observation
            .iter()
            .zip(row)
            .map(|(played, recorded)| (played - recorded).abs())
            .fold(0.0, f32::max)
    };
    // The last observation is none of the demonstration's.
    let distances: Vec<f32> = turns
        .iter()
        .zip(demonstration.observations().iter())
        .map(|(turn, row)| distance(turn, row))
        .collect();
    let drift = distances.iter().copied().fold(0.0, f32::max);
    Ok(Replayed {
        demo,
        steps: turns.len() - 1,
        recorded_steps: demonstration.steps(),
        drift: f64::from(drift),
        left_at: distances.iter().position(|distance| *distance > LEFT),
        score: task.heuristic().score(&measurements(&turns, task.specification().measurements.len())),
    })
}
