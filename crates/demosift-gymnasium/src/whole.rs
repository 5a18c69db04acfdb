//! An episode of an environment, and how a worker is asked for whole ones that plays them by itself.
//!
//! [`play`] is the one place where a policy acts in an environment of Python.
//! Where the wheel of demosift can be imported into the worker's interpreter, it runs there, and a request holds policy and
//! seeds of whole episodes ([`answer`]); elsewhere it runs here, and each step goes over the pipe.
//! Both are the same code with the same random numbers, so both play the same bits.
//!
//! A request is the length of its head (u32), the head in JSON, and then numbers of the policy, f32 each: its parameters, mean
//! and standard deviation of its observation filter.
//! An answer has for each episode its number of steps (u32), how it ended (u8), and then f32 each: observations `[T+1, obs]`,
//! actions `[T, act]`, rows of measurements `[T, measurements]`; all numbers are little-endian.

use demosift::basics::seed::Seed;
use demosift::data::observation_filter::ObservationFilter;
use demosift::data::trajectory::{Ended, Parts};
use demosift::math::rows::Rows;
use demosift::world::policy::{Acting, Mlp, Player, Policy};
use demosift::{Error, Result};
use rand::Rng as _;
use serde::{Deserialize, Serialize};

use crate::turn::Turn;
use crate::units::Units;

/// What plays whole episodes together: the same code on both sides, told by the version of demosift and that of these requests.
pub const PLAYER: &str = concat!(env!("CARGO_PKG_VERSION"), "/1");
/// Measurements that stand before the numbers of info.
const BEFORE_INFO: usize = 2;

/// Who is reset and stepped.
pub trait Turns {
    /// Starts an episode.
    ///
    /// # Errors
    /// Whatever the environment raises.
    fn reset(&mut self, seed: u64, turn: &mut Turn) -> Result<()>;

    /// Takes a step with an action `[act]` in the environment's own unit.
    ///
    /// # Errors
    /// Whatever the environment raises.
    fn step(&mut self, action: &[f64], turn: &mut Turn) -> Result<()>;
}

/// The sizes of an environment's episodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sizes {
    /// Numbers in an observation.
    pub observation: usize,
    /// Numbers of info that are measured.
    pub info: usize,
    /// Steps after which an episode ends.
    pub horizon: usize,
    /// Of each number of an action, in the environment's own unit.
    pub bounds: Vec<[f64; 2]>,
}

/// Who acts in an episode, and all its random numbers.
#[derive(Clone, Copy)]
pub struct Act<'a> {
    /// Who acts.
    pub policy: &'a Policy,
    /// How it acts.
    pub acting: Acting,
    /// The reset draws from its part `reset`, the actions from `act`.
    pub seed: &'a Seed,
}

/// Plays one episode, as far as what it measures is finite.
///
/// # Errors
/// Those of `turns`.
pub fn play(turns: &mut dyn Turns, sizes: &Sizes, act: &Act<'_>) -> Result<Parts> {
    let mut player = Player::new(act.policy);
    let mut rng = act.seed.of("act").into_rng();
    play_by(turns, sizes, act.seed, |observation, action| {
        match act.acting {
            Acting::Sampled => player.sample(observation, &mut rng, action),
            Acting::Mean => player.mean(observation, action),
        }
        Ok(())
    })
}

/// What an environment is reset with in the episode of this seed.
pub(crate) fn reset_seed(seed: &Seed) -> u64 {
    u64::from(seed.of("reset").into_rng().next_u32())
}

/// The same where `choose` fills the action `[act]` on an observation, where −1 and 1 are the ends of what is possible.
///
/// # Errors
/// Those of `turns` and of `choose`.
pub(crate) fn play_by(
    turns: &mut dyn Turns,
    sizes: &Sizes,
    seed: &Seed,
    mut choose: impl FnMut(&[f32], &mut [f32]) -> Result<()>,
) -> Result<Parts> {
    let Sizes { observation, info, horizon, bounds } = sizes;
    let (units, width) = (Units::new(bounds), bounds.len());
    let mut parts = Parts {
        observations: Rows::with_capacity(*observation, horizon + 1),
        actions: Rows::with_capacity(width, *horizon),
        measurements: Rows::with_capacity(BEFORE_INFO + info, horizon + 1),
        task_rewards: Vec::with_capacity(*horizon),
        ended: Ended::Horizon,
    };
    let (mut turn, mut action, mut own) = (Turn::default(), vec![0.0; width], vec![0.0; width]);
    turns.reset(reset_seed(seed), &mut turn)?;
    parts.observations.push(&turn.observation);
    parts.measurements.push(&vec![0.0; BEFORE_INFO + info]);
    while parts.actions.len() < *horizon && parts.ended == Ended::Horizon {
        choose(&turn.observation, &mut action)?;
        units.to_own(&action, &mut own);
        turns.step(&own, &mut turn)?;
        parts.actions.push(&action);
        parts.observations.push(&turn.observation);
        let row = turn.row();
        parts.measurements.push(&row);
        parts.task_rewards.push(turn.reward as f32);
        if row.iter().any(|number| !number.is_finite()) {
            break;
        }
        parts.ended = match (turn.terminated, turn.truncated) {
            (true, _) => Ended::Terminated,
            // A limit of its own that is also the horizon.
            (false, true) if parts.actions.len() < *horizon => Ended::Truncated,
            (false, _) => Ended::Horizon,
        };
    }
    Ok(parts)
}

/// What a request says before the numbers of the policy; seeds are used up by whoever reads it.
#[derive(Serialize)]
struct Asked<'a> {
    sizes: &'a Sizes,
    network: &'a Mlp,
    acting: Acting,
    seeds: Vec<&'a Seed>,
}

/// The same as it is read.
#[derive(Deserialize)]
struct Head {
    sizes: Sizes,
    network: Mlp,
    acting: Acting,
    seeds: Vec<Seed>,
}

/// Asks for episodes of one policy, one for each seed.
///
/// # Errors
/// None that a caller could cause.
pub(crate) fn request(sizes: &Sizes, acts: &[Act<'_>]) -> Result<Vec<u8>> {
    let Some(Act { policy, acting, .. }) = acts.first().copied() else {
        return Err(Error::simulation("no episode is asked for"));
    };
    let seeds = acts.iter().map(|act| act.seed).collect();
    let head = serde_json::to_vec(&Asked { sizes, network: policy.network(), acting, seeds })
        .map_err(|error| Error::simulation(format!("episodes cannot be asked for: {error}")))?;
    let mut bytes = Vec::with_capacity(4 + head.len() + 4 * policy.parameters().len());
    bytes.extend((head.len() as u32).to_le_bytes());
    bytes.extend(head);
    for numbers in [policy.parameters(), policy.filter().mean(), policy.filter().std()] {
        bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    }
    Ok(bytes)
}

/// Plays what is asked for in an environment that is stepped here: what a worker with the wheel does.
///
/// # Errors
/// `is_simulation` if the request is none; those of `turns`.
pub fn answer(request: &[u8], turns: &mut dyn Turns) -> Result<Vec<u8>> {
    let none = || Error::simulation("what the worker is asked to play cannot be read");
    let length = request.first_chunk().map(|length| u32::from_le_bytes(*length) as usize);
    let rest = &request[request.len().min(4)..];
    let (head, numbers) = length.and_then(|length| rest.split_at_checked(length)).ok_or_else(none)?;
    let Head { sizes, network, acting, seeds } = serde_json::from_slice(head).map_err(|_| none())?;
    let numbers = f32s(numbers);
    let parameters = network.parameter_count() + network.output_width();
    let is_whole = numbers.len() == parameters + 2 * sizes.observation
        && network.input_width() == sizes.observation
        && network.output_width() == sizes.bounds.len();
    if !is_whole {
        return Err(none());
    }
    let (parameters, filter) = numbers.split_at(parameters);
    let (mean, std) = filter.split_at(sizes.observation);
    let filter = ObservationFilter::new(mean.to_vec(), std.to_vec());
    let policy = Policy::from_parts(network, parameters.to_vec(), filter);
    let mut bytes = Vec::new();
    for seed in &seeds {
        let parts = play(turns, &sizes, &Act { policy: &policy, acting, seed })?;
        bytes.extend((parts.actions.len() as u32).to_le_bytes());
        bytes.push(match parts.ended {
            Ended::Horizon => 0,
            Ended::Terminated => 1,
            Ended::Truncated => 2,
        });
        let (observations, actions) = (parts.observations.flat(), parts.actions.flat());
        // The row of the reset is nothing but zeros.
        let measured = &parts.measurements.flat()[parts.measurements.width()..];
        for numbers in [observations, actions, measured] {
            bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        }
    }
    Ok(bytes)
}

/// The episodes of an answer.
///
/// # Errors
/// `is_simulation` if it is no answer to `count` episodes of these sizes.
pub(crate) fn episodes(mut answer: &[u8], count: usize, sizes: &Sizes) -> Result<Vec<Parts>> {
    let none = || Error::simulation("what the worker has played cannot be read");
    let mut found = Vec::with_capacity(count);
    for _ in 0..count {
        let (parts, rest) = episode(answer, sizes).ok_or_else(none)?;
        answer = rest;
        found.push(parts);
    }
    if answer.is_empty() { Ok(found) } else { Err(none()) }
}

/// The first episode of an answer, and what follows it.
fn episode<'a>(answer: &'a [u8], sizes: &Sizes) -> Option<(Parts, &'a [u8])> {
    let (length, rest) = answer.split_first_chunk::<4>()?;
    let (ended, mut rest) = rest.split_first()?;
    let steps = u32::from_le_bytes(*length) as usize;
    if steps == 0 || steps > sizes.horizon {
        return None;
    }
    let mut take = |rows: usize, width: usize| {
        let (numbers, after) = rest.split_at_checked(4 * rows * width)?;
        rest = after;
        Rows::from_flat(f32s(numbers), width).ok()
    };
    let observations = take(steps + 1, sizes.observation)?;
    let actions = take(steps, sizes.bounds.len())?;
    let measured = take(steps, BEFORE_INFO + sizes.info)?;
    let mut measurements = Rows::with_capacity(measured.width(), steps + 1);
    measurements.push(&vec![0.0; measured.width()]);
    measurements.append(&measured);
    let ended = match ended {
        0 => Ended::Horizon,
        1 => Ended::Terminated,
        2 => Ended::Truncated,
        _ => return None,
    };
    let task_rewards = measured.iter().map(|row| row[0]).collect();
    Some((Parts { observations, actions, measurements, task_rewards, ended }, rest))
}

fn f32s(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|of| f32::from_le_bytes([of[0], of[1], of[2], of[3]])).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use demosift::world::policy::PolicyShape;

    use super::*;

    /// Ends in a terminal state after as many steps as its seed says, at most 4.
    struct Counting {
        left: u64,
        seen: f32,
    }

    impl Turns for Counting {
        fn reset(&mut self, seed: u64, turn: &mut Turn) -> Result<()> {
            (self.left, self.seen) = (1 + seed % 4, 0.1);
            *turn = Turn { observation: vec![self.seen], info: vec![0.0], ..Turn::default() };
            Ok(())
        }
        fn step(&mut self, action: &[f64], turn: &mut Turn) -> Result<()> {
            self.left -= 1;
            self.seen += action[0] as f32;
            turn.observation = vec![self.seen];
            (turn.terminated, turn.reward, turn.info) =
                (self.left == 0, action[1], vec![f64::from(self.seen)]);
            Ok(())
        }
    }

    fn sizes() -> Sizes {
        Sizes { observation: 1, info: 1, horizon: 3, bounds: vec![[-2.0, 2.0], [0.0, 5.0]] }
    }

    fn policy() -> Policy {
        let shape = PolicyShape { hidden: vec![8], initial_std: 0.5 };
        Policy::untrained(&shape, ObservationFilter::new(vec![0.1], vec![0.3]), 2, Seed::new(1))
    }

    #[test]
    fn what_is_asked_for_and_played_elsewhere_is_what_is_played_here() {
        let (policy, seeds) = (policy(), Seed::new(2).many(8));
        let acts: Vec<Act<'_>> =
            seeds.iter().map(|seed| Act { policy: &policy, acting: Acting::Sampled, seed }).collect();
        let mut counting = Counting { left: 0, seen: 0.0 };
        let answered = answer(&request(&sizes(), &acts).unwrap(), &mut counting).unwrap();
        let there = episodes(&answered, acts.len(), &sizes()).unwrap();
        let mut lengths = Vec::new();
        for (there, act) in there.iter().zip(&acts) {
            let here = play(&mut counting, &sizes(), act).unwrap();
            assert_eq!((&there.observations, &there.actions), (&here.observations, &here.actions));
            assert_eq!((&there.measurements, &there.task_rewards), (&here.measurements, &here.task_rewards));
            assert_eq!(there.ended, here.ended);
            lengths.push((here.actions.len(), here.ended));
        }
        assert!(lengths.contains(&(3, Ended::Horizon)) && lengths.contains(&(1, Ended::Terminated)));
    }

    #[test]
    fn what_is_cut_or_too_long_is_no_request_and_no_answer() {
        let (policy, seed) = (policy(), Seed::new(2));
        let acts = [Act { policy: &policy, acting: Acting::Mean, seed: &seed }];
        let mut counting = Counting { left: 0, seen: 0.0 };
        let asked = request(&sizes(), &acts).unwrap();
        let answered = answer(&asked, &mut counting).unwrap();
        for length in 0..asked.len() {
            assert!(answer(&asked[..length], &mut counting).unwrap_err().is_simulation(), "{length}");
        }
        for length in 0..answered.len() {
            assert!(episodes(&answered[..length], 1, &sizes()).is_err(), "{length}");
        }
        assert!(episodes(&[&answered[..], &[0]].concat(), 1, &sizes()).is_err());
        let short = Sizes { horizon: 0, ..sizes() };
        assert!(episodes(&answered, 1, &short).is_err(), "longer than the horizon");
    }
}
