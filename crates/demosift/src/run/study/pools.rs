//! What is finished of the trainings that are made for their own sake.

use serde::Serialize;

use super::estimate::Estimate;
use super::parts::Pool;
use super::plan::Study;
use super::{Finished, TrainingResult};
use crate::data::demonstration::DemoId;
use crate::learning::adapt::Rule;
use crate::math::statistics;

/// The trainings of a pool on one of its subsets.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PoolSummary {
    /// The set.
    pub set: String,
    /// The subset, as it is asked for.
    pub subset: String,
    /// Who learned.
    pub imitator: Rule,
    /// The finished trainings, by seed.
    pub trainings: Vec<PoolTraining>,
}

/// One training of a pool.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PoolTraining {
    /// Its seed.
    pub seed: u64,
    /// On which demonstrations.
    pub demos: Vec<DemoId>,
    /// Its result.
    #[serde(flatten)]
    pub result: TrainingResult,
}

/// The finished trainings of the pools that are asked for by name; those that a referee draws from are not among them.
pub fn asked(study: &Study, finished: &Finished) -> Vec<PoolSummary> {
    study.pools.iter().flat_map(|pool| of_pool(study, pool, finished)).collect()
}

/// The trainings of all pools that are finished.
pub(super) fn pools(study: &Study, finished: &Finished) -> Vec<PoolSummary> {
    study.all_pools().iter().flat_map(|pool| of_pool(study, pool, finished)).collect()
}

pub(super) fn of_pool(study: &Study, pool: &Pool, finished: &Finished) -> Vec<PoolSummary> {
    let Some(set) = study.set(&pool.set) else { return Vec::new() };
    let of_choice = |choice| {
        let training = |seed| {
            let demos = study.chosen(set, choice, seed, finished)?;
            let result = finished.training(&set.name, &demos, pool.imitator, seed)?.clone();
            Some(PoolTraining { seed, demos, result })
        };
        PoolSummary {
            set: set.name.clone(),
            subset: choice.to_string(),
            imitator: pool.imitator,
            trainings: pool.trainings.each().filter_map(training).collect(),
        }
    };
    pool.subsets.iter().map(of_choice).collect()
}

/// Mean and spread of the end scores and of the chosen scores of a pool's trainings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoolMeans {
    /// Of the last policies.
    pub end: Estimate,
    /// Of the chosen policies.
    pub chosen: Estimate,
    /// Mean success of the last policies, where the task says.
    pub success: Option<f64>,
    /// True return of the chosen policies, where the task knows one.
    pub true_return: Option<Estimate>,
    /// What one training cost in the mean: environment steps.
    pub environment_steps: f64,
    /// And seconds of a processor.
    pub seconds: f64,
}

impl PoolSummary {
    /// Their means; `None` where no training is finished.
    pub fn means(&self) -> Option<PoolMeans> {
        let each = |part: fn(&TrainingResult) -> f64| -> Vec<f64> {
            self.trainings.iter().map(|training| part(&training.result)).collect()
        };
        let of = |part| by_student(&each(part));
        let returns: Option<Vec<f64>> =
            self.trainings.iter().map(|training| training.result.chosen.true_return).collect();
        let successes: Option<Vec<f64>> =
            self.trainings.iter().map(|training| training.result.end.success).collect();
        Some(PoolMeans {
            end: of(|result| result.end.score)?,
            chosen: of(|result| result.chosen.score)?,
            success: successes.map(|successes| statistics::mean(&successes)),
            true_return: returns.and_then(|returns| by_student(&returns)),
            environment_steps: statistics::mean(&each(|result| result.cost.environment_steps as f64)),
            seconds: statistics::mean(&each(|result| result.cost.seconds)),
        })
    }
}

/// The mean with its 95 % interval by Student's t: a bootstrap of ten trainings is too narrow.
fn by_student(values: &[f64]) -> Option<Estimate> {
    const TAIL: f64 = 0.025;
    if values.is_empty() {
        return None;
    }
    let mean = statistics::mean(values);
    let quantile = statistics::student_quantile(TAIL, values.len() as f64 - 1.0).unwrap_or(0.0);
    let reach = quantile * statistics::standard_error(values);
    Some(Estimate { mean, low: mean - reach, high: mean + reach, seeds: values.len() })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// scipy.stats.t.interval(0.95, 4, loc=mean, scale=sem) of these values.
    #[test]
    fn the_interval_is_students() {
        let found = by_student(&[2.0, 4.0, 4.0, 5.0, 10.0]).expect("there are values");
        assert_eq!((found.mean, found.seeds), (5.0, 5));
        assert!((found.low - 1.2750).abs() < 1e-4 && (found.high - 8.7250).abs() < 1e-4, "{found:?}");
        assert_eq!(by_student(&[3.0]).map(|one| (one.low, one.high)), Some((3.0, 3.0)));
    }
}
