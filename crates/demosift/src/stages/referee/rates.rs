//! How often the referee is wrong or right: its trainings are drawn again from pools of trainings, and its decisions counted.

use rand::seq::IndexedRandom;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use statrs::distribution::{Beta, ContinuousCDF};

use super::{Candidate, Conclusion, Contest, LEVEL, Refereeing, Trained};
use crate::basics::error::{Error, Result};
use crate::basics::seed::Seed;

/// How often each conclusion was reached.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ConclusionRates {
    /// Share of *helps*; where nothing is better, that of errors.
    pub helps: f64,
    /// What its true rate is below, with a confidence of 95 % (Clopper and Pearson).
    pub helps_upper: f64,
    /// Share of *fewer helps*.
    pub fewer_helps: f64,
    /// Share of *cannot tell*.
    pub cannot_tell: f64,
    /// Share of *does not help*.
    pub does_not_help: f64,
    /// Of so many decisions.
    pub resamples: usize,
}

/// How often each conclusion is reached if trainings are drawn from these pools, with replacement; where the pools of all
/// sides are of policies alike, *helps* is an error.
///
/// Each pool is a pair with all the trainings that there are of it; rounds and dropping are those of a contest.
///
/// # Errors
/// `is_bad_input` if a pair that the contest trains has no pool, or an empty one.
pub fn conclusion_rates(
    candidates: &[Candidate],
    pools: &[Trained],
    refereeing: Refereeing,
    resamples: usize,
    seed: &Seed,
) -> Result<ConclusionRates> {
    let concluded = |number: usize| {
        let mut rng = seed.at(number).into_rng();
        let mut contest = Contest::new(candidates.to_vec(), refereeing);
        loop {
            let units = contest.next_units();
            if units.is_empty() {
                return Ok(contest.decide("", None).conclusion);
            }
            for unit in units {
                let is_its =
                    |pool: &&Trained| (pool.candidate, pool.imitator) == (unit.candidate, unit.imitator);
                let drawn = pools.iter().find(is_its).and_then(|pool| pool.trainings.choose(&mut rng));
                let name = || candidates[unit.candidate].names.join(" and ");
                let none = || Error::bad_input(format!("there is no pool of trainings of '{}'", name()));
                contest.add(unit, *drawn.ok_or_else(none)?);
            }
        }
    };
    let concluded = (0..resamples).into_par_iter().map(concluded).collect::<Result<Vec<Conclusion>>>()?;
    let count = |wanted| concluded.iter().filter(|conclusion| **conclusion == wanted).count();
    let rate = |wanted| count(wanted) as f64 / resamples.max(1) as f64;
    Ok(ConclusionRates {
        helps: rate(Conclusion::Helps),
        helps_upper: upper_bound(count(Conclusion::Helps), resamples),
        fewer_helps: rate(Conclusion::FewerHelps),
        cannot_tell: rate(Conclusion::CannotTell),
        does_not_help: rate(Conclusion::DoesNotHelp),
        resamples,
    })
}

/// What the true rate of something is below that happened so often of so many, with a confidence of 95 % (Clopper and
/// Pearson).
pub fn upper_bound(happened: usize, of: usize) -> f64 {
    let beta = Beta::new(happened as f64 + 1.0, of.saturating_sub(happened) as f64);
    beta.map_or(1.0, |beta| beta.inverse_cdf(1.0 - LEVEL))
}
