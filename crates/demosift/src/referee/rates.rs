//! How often the referee is wrong: its trainings are drawn again from pools of trainings, and its decisions counted.

use rand::seq::IndexedRandom;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use statrs::distribution::{Beta, ContinuousCDF};

use super::{Candidate, Conclusion, Contest, LEVEL, Refereeing, Trained};
use crate::error::{Error, Result};
use crate::seed::Seed;

/// How often something was concluded.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorRate {
    /// Times that *helps* was concluded.
    pub helps: usize,
    /// Of so many.
    pub resamples: usize,
    /// Their quotient.
    pub rate: f64,
    /// What the true rate is below, with a confidence of 95 % (Clopper and Pearson).
    pub upper: f64,
}

/// How often *helps* is concluded if trainings are drawn from these pools, with replacement; where the pools of all sides
/// are of policies alike, that is the rate of errors.
///
/// Each pool is a pair with all the trainings that there are of it; rounds and dropping are those of a contest.
///
/// # Errors
/// `is_bad_input` if a pair that the contest trains has no pool, or an empty one.
pub fn error_rates(
    candidates: &[Candidate],
    pools: &[Trained],
    refereeing: Refereeing,
    resamples: usize,
    seed: &Seed,
) -> Result<ErrorRate> {
    let helps = |number: usize| {
        let mut rng = seed.at(number).into_rng();
        let mut contest = Contest::new(candidates.to_vec(), refereeing);
        loop {
            let units = contest.next_units();
            if units.is_empty() {
                return Ok(contest.decide("").conclusion == Conclusion::Helps);
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
    let concluded = (0..resamples).into_par_iter().map(helps).collect::<Result<Vec<bool>>>()?;
    let helps = concluded.into_iter().filter(|helps| *helps).count();
    let rate = helps as f64 / resamples.max(1) as f64;
    Ok(ErrorRate { helps, resamples, rate, upper: upper_bound(helps, resamples) })
}

/// What the true rate of something is below that happened so often of so many, with a confidence of 95 % (Clopper and
/// Pearson).
pub fn upper_bound(happened: usize, of: usize) -> f64 {
    let beta = Beta::new(happened as f64 + 1.0, of.saturating_sub(happened) as f64);
    beta.map_or(1.0, |beta| beta.inverse_cdf(1.0 - LEVEL))
}
