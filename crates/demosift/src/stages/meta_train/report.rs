//! What a round of meta-training tells: means over its demonstrations.

use super::{MetaState, Outcome, PlayedRound, Round, STAGE};
use crate::basics::error::Result;
use crate::basics::observer::{Event, Observer};
use crate::math::statistics::{mean, mean_of};
use crate::world::environment::EnvVariant;

/// What the share of the spread of the encodings is called that the posterior explains.
pub(crate) const ENCODING_EXPLAINED: &str = "encoding_explained";

/// Tells the numbers of a round, those of the meta-updates among them.
pub(super) fn report(
    state: &MetaState,
    played: &PlayedRound,
    updated: Vec<(&'static str, f64)>,
    observer: &mut dyn Observer,
) -> Result<()> {
    let PlayedRound { outcomes, information, behavior_spread, .. } = played;
    let mut numbers = Vec::new();
    let after: Vec<f64> = outcomes.iter().filter_map(|outcome| outcome.after.mean_score()).collect();
    let reports: Vec<_> = outcomes.iter().map(|outcome| outcome.update.numbers()).collect();
    for (place, (name, _)) in reports[0].iter().enumerate() {
        let name = match *name {
            "score" => "score_before",
            "kl" => "inner_kl",
            name => name,
        };
        numbers.push((name, mean_of(reports.iter().map(|report| report[place].1))));
    }
    if !after.is_empty() {
        numbers.push(("score_after", mean(&after)));
    }
    numbers.extend(updated);
    numbers.push(("environment_steps", state.environment_steps as f64));
    numbers.extend(behavior_spread.map(|spread| ("behavior_spread", spread)));
    if let Some(information) = information {
        numbers.extend([
            ("log_q", information.log_q),
            (ENCODING_EXPLAINED, information.explained),
            ("posterior_std", information.std),
            ("information_kl", information.kl),
        ]);
    }
    observer.on(Event::Measured { stage: STAGE, part: "", iteration: state.rounds, numbers: &numbers })?;
    observer.on(Event::Advanced { stage: STAGE, done: state.rounds })
}

/// How far the adapted behaviors lie apart: the root mean square, over times and filtered observations, of what the mean
/// trajectory after imitating one demonstration differs from the mean over all demonstrations of the same variant.
///
/// Played with the same random numbers, policies that are the same have spread 0; where nothing was played there is none.
pub(super) fn behavior_spread(round: &Round<'_>, outcomes: &[Outcome]) -> Option<f64> {
    const READINGS: usize = 50;
    if outcomes.iter().any(|one| one.after.lengths.is_empty()) {
        return None;
    }
    let means: Vec<(EnvVariant, Vec<f64>)> =
        outcomes.iter().map(|one| (one.target.variant, round.read(&one.after, READINGS).mean())).collect();
    let (mut squares, mut count) = (0.0, 0);
    for (variant, mean) in &means {
        let others: Vec<&Vec<f64>> =
            means.iter().filter(|(other, _)| other == variant).map(|(_, mean)| mean).collect();
        for (at, value) in mean.iter().enumerate() {
            let center = mean_of(others.iter().map(|other| other[at]));
            squares += (value - center).powi(2);
        }
        count += mean.len();
    }
    Some((squares / count.max(1) as f64).sqrt())
}
