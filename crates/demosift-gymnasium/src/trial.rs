//! A few steps by which is seen whether an environment repeats, and how fast it is.

use std::time::Instant;

use demosift::Result;
use demosift::basics::seed::Seed;
use demosift::math::rows::Rows;
use rand::Rng as _;
use serde::{Deserialize, Serialize};

use crate::session::Session;
use crate::turn::Turn;
use crate::units::Units;
use crate::whole::Turns as _;

/// Whether the same seed and the same actions make the same episode again, with another one played between.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Repeats {
    /// To the last bit.
    Exactly,
    /// It starts the same way and goes on differently.
    StartOnly,
    /// Not even its first observation is the same.
    No,
}

/// What three short episodes showed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Trial {
    /// Whether the first came again.
    pub repeats: Repeats,
    /// Whether episodes of other seeds start differently.
    pub starts_differ: bool,
    /// Environment steps in a second, in one process and in whole episodes, whose resets count.
    pub steps_per_sec: f64,
}

impl Repeats {
    /// In words, as the end of a sentence about the environment.
    pub fn words(self) -> &'static str {
        match self {
            Self::Exactly => "repeats: the same seed and actions make the same episode, to the last bit",
            Self::StartOnly => {
                "does not repeat: the same seed starts the same way, and the same actions then lead elsewhere"
            }
            Self::No => "does not repeat: the same seed starts differently each time",
        }
    }
}

/// Random actions of a policy, the same for the same seed.
pub(crate) fn random_actions(units: &Units, seed: Seed, steps: usize) -> Vec<Vec<f64>> {
    let mut rng = seed.into_rng();
    let width = units.bounds().len();
    let one = |_| {
        let action: Vec<f32> =
            (0..width).map(|_| rng.next_u32() as f32 / u32::MAX as f32 * 2.0 - 1.0).collect();
        let mut own = vec![0.0; width];
        units.to_own(&action, &mut own);
        own
    };
    (0..steps).map(one).collect()
}

/// All turns of an episode with these actions, the reset's first.
pub(crate) fn episode(session: &mut Session, seed: u64, actions: &[Vec<f64>]) -> Result<Vec<Turn>> {
    let mut turns = begun(session, seed)?;
    play_on(session, actions, &mut turns)?;
    Ok(turns)
}

/// The turn of a reset.
fn begun(session: &mut Session, seed: u64) -> Result<Vec<Turn>> {
    let mut turn = Turn::default();
    session.reset(seed, &mut turn)?;
    Ok(vec![turn])
}

/// Adds the turns of these actions, as far as the episode goes.
fn play_on(session: &mut Session, actions: &[Vec<f64>], turns: &mut Vec<Turn>) -> Result<()> {
    let mut turn = Turn::default();
    for action in actions {
        session.step(action, &mut turn)?;
        turns.push(turn.clone());
        if turn.terminated || turn.truncated {
            break;
        }
    }
    Ok(())
}

/// Rows of measurements of these turns, of which the reset's has nothing to say.
pub(crate) fn measurements(turns: &[Turn], width: usize) -> Rows {
    let mut rows = Rows::with_capacity(width, turns.len());
    rows.push(&vec![0.0; width]);
    turns.iter().skip(1).for_each(|turn| rows.push(&turn.row()));
    rows
}

/// Plays a seed, another one, and the first again, for at most so many steps each of the `horizon` that an episode has.
pub(crate) fn trial(session: &mut Session, units: &Units, most: usize, horizon: usize) -> Result<Trial> {
    let actions = random_actions(units, Seed::new(0).of("trial"), most.min(horizon));
    let first = episode(session, 1, &actions)?;
    let start = Instant::now();
    let mut other = begun(session, 2)?;
    let reset_secs = start.elapsed().as_secs_f64();
    let start = Instant::now();
    play_on(session, &actions, &mut other)?;
    let stepping_secs = start.elapsed().as_secs_f64();
    let again = episode(session, 1, &actions)?;
    let repeats = match (first == again, first[0] == again[0]) {
        (true, _) => Repeats::Exactly,
        (false, true) => Repeats::StartOnly,
        (false, false) => Repeats::No,
    };
    let starts_differ = first[0].observation != other[0].observation;
    let played = other.len() - 1;
    let ends_early = other.last().is_some_and(|last| last.terminated || last.truncated);
    let steps = if ends_early { played } else { horizon };
    let steps_per_sec = steps_per_sec(reset_secs, stepping_secs / played as f64, steps);
    Ok(Trial { repeats, starts_differ, steps_per_sec })
}

/// Environment steps in a second, of an episode of a reset and so many steps.
fn steps_per_sec(reset_secs: f64, step_secs: f64, steps: usize) -> f64 {
    let steps = steps as f64;
    steps / (reset_secs + steps * step_secs).max(1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: 0.05 s and 1000 steps of 0.0002 s are 0.25 s.
    #[test]
    fn a_reset_counts_once_an_episode() {
        assert!((steps_per_sec(0.05, 0.0002, 1000) - 4000.0).abs() < 1e-6);
        assert!((steps_per_sec(0.05, 0.0002, 20) - 20.0 / 0.054).abs() < 1e-6);
    }
}
