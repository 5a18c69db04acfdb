//! What each demonstration teaches alone from scratch, which rankings are compared with; random subsets, which the kept one is
//! compared with.

use std::collections::BTreeMap;

use super::{Run, kept_part, learning_curve, learning_curve_with};
use crate::basics::error::{Error, Result};
use crate::basics::seed::Seed;
use crate::data::demonstration::DemoId;
use crate::results::artifact::Artifact;
use crate::results::oracle::{self, Alone, Oracle};
use crate::stages::imitate::LearningCurve;
use crate::stages::select::Ranking;
use crate::world::heuristic::Score;

/// Each demonstration alone, so many times; beside it the ranking and the policy from the kept demonstrations, as far as the
/// ledger holds them, and so many random subsets.
///
/// # Errors
/// `is_bad_config` if there is nothing to compare random subsets with, `is_diverged` if a training diverges.
pub fn oracle(run: &mut Run<'_>, repeats: usize, random: usize) -> Result<Oracle> {
    let kept = policy_from_kept(run, random)?;
    let random_size = kept.as_ref().filter(|_| random > 0).map(|kept| kept.demos.len());
    make_share(run, repeats, random_size.map(|size| Randoms { size, count: random }))?;
    let mut curves: BTreeMap<DemoId, Vec<LearningCurve>> = BTreeMap::new();
    for OracleTraining { demo, repeat } in oracle_trainings(run, repeats) {
        curves.entry(demo).or_default().push(oracle_curve(run, demo, repeat)?);
    }
    let alone: Vec<Alone> = curves.iter().map(|(demo, of_demo)| oracle::alone(*demo, of_demo)).collect();
    let worth = match (kept, oracle::best(&alone)) {
        (Some(kept), Some(best)) => {
            let random = (0..random)
                .map(|number| Ok(random_subset(run, kept.demos.len(), number)?.end.score))
                .collect::<Result<Vec<Score>>>()?;
            Some(oracle::worth(&kept, best, &curves[&best], random))
        }
        _ => None,
    };
    let agreement = Ranking::recall(run.ledger, "")?.map(|ranking| oracle::agreement(&ranking, &alone));
    Ok(Oracle { alone, agreement, kept: worth })
}

/// Random subsets, which the kept one is compared with.
#[derive(Clone, Copy)]
struct Randoms {
    size: usize,
    count: usize,
}

/// A piece of the oracle's work.
enum Piece {
    Alone(OracleTraining),
    Random { size: usize, number: usize },
}

/// What is the share of one part of a run; nothing where a run has no parts.
///
/// # Errors
/// `is_left_to_others` if other parts have not finished theirs.
fn make_share(run: &mut Run<'_>, repeats: usize, randoms: Option<Randoms>) -> Result<()> {
    let Some(part) = run.ledger.part() else { return Ok(()) };
    let random = randoms
        .into_iter()
        .flat_map(|Randoms { size, count }| (0..count).map(move |number| Piece::Random { size, number }));
    let pieces: Vec<Piece> =
        oracle_trainings(run, repeats).into_iter().map(Piece::Alone).chain(random).collect();
    for (_, piece) in pieces.iter().enumerate().filter(|(number, _)| part.takes(*number)) {
        match piece {
            Piece::Alone(OracleTraining { demo, repeat }) => oracle_curve(run, *demo, *repeat)?,
            Piece::Random { size, number } => random_subset(run, *size, *number)?,
        };
    }
    let mut left = 0;
    for piece in &pieces {
        let name = match piece {
            Piece::Alone(OracleTraining { demo, repeat }) => oracle_part(*demo, *repeat),
            Piece::Random { size, number } => random_part(*size, *number),
        };
        left += usize::from(LearningCurve::recall(run.ledger, &name)?.is_none());
    }
    match left {
        0 => Ok(()),
        left => Err(Error::left_to_others(format!("{left} trainings are left to the other parts"))),
    }
}

/// The policy from the kept demonstrations, which `random` subsets are compared with, if the ledger holds it.
///
/// # Errors
/// `is_bad_config` if it is missing and there is something to be compared with it.
pub fn policy_from_kept(run: &Run<'_>, random: usize) -> Result<Option<LearningCurve>> {
    let kept = LearningCurve::recall(run.ledger, &kept_part(run.config))?;
    if random > 0 && kept.is_none() {
        return Err(Error::bad_config("--random compares with the policy from the kept demonstrations, which the run folder does not hold")
            .with_hint("`demosift imitate --out DIR --resume` makes it"));
    }
    Ok(kept)
}

/// From scratch on one demonstration alone, with a seed of its own, which no other stage shares.
pub fn oracle_curve(run: &mut Run<'_>, demo: DemoId, repeat: usize) -> Result<LearningCurve> {
    let seed = Seed::new(run.config.seed).of("oracle").at(repeat);
    learning_curve_with(run, &oracle_part(demo, repeat), &[demo], &seed)
}

/// An imitation of one demonstration alone.
pub(crate) struct OracleTraining {
    pub(crate) demo: DemoId,
    pub(crate) repeat: usize,
}

/// All that an oracle trains, each demonstration so many times in a row.
pub(crate) fn oracle_trainings(run: &Run<'_>, repeats: usize) -> Vec<OracleTraining> {
    let of_demo = |demo| (0..repeats).map(move |repeat| OracleTraining { demo, repeat });
    run.set.ids().into_iter().flat_map(of_demo).collect()
}

/// Under which name the oracle's imitations are stored.
pub(crate) fn oracle_part(demo: DemoId, repeat: usize) -> String {
    format!("oracle_{demo}_{repeat}")
}

/// From scratch on a random subset of so many demonstrations, with the random numbers of the kept one; `number` tells
/// several apart.
pub fn random_subset(run: &mut Run<'_>, size: usize, number: usize) -> Result<LearningCurve> {
    use rand::seq::IndexedRandom;
    let mut rng = Seed::new(run.config.seed).of("random_subset").at(number).into_rng();
    let demos: Vec<DemoId> = run.set.ids().sample(&mut rng, size).copied().collect();
    learning_curve(run, &random_part(size, number), &demos)
}

/// Under which name the imitations of random subsets are stored: another `--keep` asks for subsets of another size.
pub(crate) fn random_part(size: usize, number: usize) -> String {
    format!("random_{size}_{number}")
}
