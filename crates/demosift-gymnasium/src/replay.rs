//! Demonstrations that are played again with their recorded actions: what comes out says whether this is the environment, in
//! the version, in which they were recorded.
//!
//! An episode is played open loop from where it began, a seed or a state.
//! Single steps from recorded states would say less: what a controller remembers is in no state.

use demosift::Result;
use demosift::data::demonstration::minari::Seeded;
use demosift::data::demonstration::robomimic::Recording;
use demosift::data::demonstration::{DemoId, Demonstration, DemonstrationSet};
use demosift::world::environment::Task as _;
use serde::Serialize;

use crate::session::Session;
use crate::task::GymnasiumTask;
use crate::trial::{episode, measurements};
use crate::turn::Turn;
use crate::whole::Turns as _;

/// An observation that is farther from the recorded one has left it.
pub(crate) const LEFT: f32 = 1e-3;

/// How recorded episodes began and what acted in them, in the environment's own unit, by their position in the file, as far as
/// a set tells.
#[derive(Clone, Debug, PartialEq)]
pub enum Starts {
    /// From seeds.
    Seeds(Vec<Option<Seeded>>),
    /// From states of the simulator.
    States(Vec<Option<Recording>>),
}

/// A demonstration that was played again from where it began with its recorded actions.
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
    /// The same of a number of the simulator's state, where states are recorded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state_drift: Option<f64>,
    /// The first step at which the distance of an observation is more than 0.001.
    pub left_at: Option<usize>,
    /// K of what was played.
    pub score: f64,
    /// Whether it reached the goal, where the environment says.
    pub succeeded: Option<bool>,
}

impl Starts {
    /// Those of which is known how they began, at most so many.
    pub(crate) fn known(&self, task: &GymnasiumTask, set: &DemonstrationSet, most: usize) -> Vec<DemoId> {
        let is_known = |demo: &DemoId| match self {
            Self::Seeds(seeds) => seeds.get(demo.0).is_some_and(Option::is_some),
            Self::States(recordings) => task.is_put() && recordings.get(demo.0).is_some_and(Option::is_some),
        };
        set.ids().into_iter().filter(is_known).take(most).collect()
    }
}

/// Plays those of these demonstrations again of which is known how they began.
///
/// # Errors
/// `is_simulation` if the environment fails.
pub fn replayed(
    task: &GymnasiumTask,
    set: &DemonstrationSet,
    starts: &Starts,
    demos: &[DemoId],
) -> Result<Vec<Replayed>> {
    if demos.is_empty() {
        return Ok(Vec::new());
    }
    // A process of its own: it is left with another model, and with episodes of another length.
    let mut session = task.new_session()?;
    let mut found = Vec::new();
    for &demo in demos {
        let demonstration = set.get(demo);
        match starts {
            Starts::Seeds(seeds) => {
                let Some(seeded) = seeds.get(demo.0).and_then(Option::as_ref) else { continue };
                // What is measured at the end of an episode is measured at its end.
                session.measure(task.info_measured(), demonstration.steps(), None)?;
                let turns = episode(&mut session, seeded.seed, &seeded.actions)?;
                found.push(compared(task, demo, demonstration, &turns));
            }
            Starts::States(recordings) => {
                let Some(recording) = recordings.get(demo.0).and_then(Option::as_ref) else { continue };
                session.measure(task.info_measured(), demonstration.steps(), None)?;
                let (turns, state_drift) = from_state(&mut session, recording)?;
                let compared = compared(task, demo, demonstration, &turns);
                found.push(Replayed { state_drift: Some(state_drift), ..compared });
            }
        }
    }
    Ok(found)
}

/// All turns from the first recorded state on, and the greatest distance of a number of the state from the recorded one.
fn from_state(session: &mut Session, recording: &Recording) -> Result<(Vec<Turn>, f64)> {
    let Recording { model, states, actions } = recording;
    let Some(first) = states.first() else { return Ok((Vec::new(), 0.0)) };
    let mut turn = Turn::default();
    session.put(model.as_deref(), first, &mut turn)?;
    let (mut turns, mut drift) = (vec![turn.clone()], 0.0_f64);
    for (recorded, action) in states.iter().zip(actions) {
        drift = drift.max(distance_of_states(&session.state()?, recorded));
        session.step(action, &mut turn)?;
        turns.push(turn.clone());
        if turn.terminated || turn.truncated {
            break;
        }
    }
    Ok((turns, drift))
}

/// Of two states, which differ without end if one has more numbers than the other.
fn distance_of_states(played: &[f64], recorded: &[f64]) -> f64 {
    if played.len() != recorded.len() {
        return f64::INFINITY;
    }
    played.iter().zip(recorded).map(|(played, recorded)| (played - recorded).abs()).fold(0.0, f64::max)
}

/// The greatest distance of a number of an observation from the recorded one.
pub(crate) fn distance(turn: &Turn, recorded: &[f32]) -> f32 {
    let both = turn.observation.iter().zip(recorded);
    both.map(|(played, recorded)| (played - recorded).abs()).fold(0.0, f32::max)
}

fn compared(task: &GymnasiumTask, demo: DemoId, demonstration: &Demonstration, turns: &[Turn]) -> Replayed {
    // The last observation is none of the demonstration's.
    let distances: Vec<f32> = turns
        .iter()
        .zip(demonstration.observations().iter())
        .map(|(turn, row)| distance(turn, row))
        .collect();
    let drift = distances.iter().copied().fold(0.0, f32::max);
    let measured = measurements(turns, task.specification().measurements.len());
    Replayed {
        demo,
        steps: turns.len().saturating_sub(1),
        recorded_steps: demonstration.steps(),
        drift: f64::from(drift),
        state_drift: None,
        left_at: distances.iter().position(|distance| *distance > LEFT),
        score: task.heuristic().score(&measured),
        succeeded: task.succeeded(&measured),
    }
}
