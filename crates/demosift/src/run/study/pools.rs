//! What is finished of the trainings that are made for their own sake.

use serde::Serialize;

use super::estimate::{Estimate, estimate};
use super::parts::Pool;
use super::plan::Study;
use super::{Finished, TrainingResult};
use crate::data::demonstration::DemoId;
use crate::learning::adapt::Rule;
use crate::math::statistics;

/// The trainings of a pool on one of its subsets.
#[derive(Clone, Debug, PartialEq, Serialize)]
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
pub struct PoolTraining {
    /// Its seed.
    pub seed: u64,
    /// On which demonstrations.
    pub demos: Vec<DemoId>,
    /// What came of it.
    #[serde(flatten)]
    pub result: TrainingResult,
}

/// The trainings of all pools that are finished.
pub fn pools(study: &Study, finished: &Finished) -> Vec<PoolSummary> {
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
}

impl PoolSummary {
    /// Their means; `None` where no training is finished.
    pub fn means(&self) -> Option<PoolMeans> {
        let of = |part: fn(&TrainingResult) -> f64| {
            estimate(&self.trainings.iter().map(|training| part(&training.result)).collect::<Vec<_>>())
        };
        let successes: Option<Vec<f64>> =
            self.trainings.iter().map(|training| training.result.end.success).collect();
        Some(PoolMeans {
            end: of(|result| result.end.score)?,
            chosen: of(|result| result.chosen.score)?,
            success: successes.map(|successes| statistics::mean(&successes)),
        })
    }
}
