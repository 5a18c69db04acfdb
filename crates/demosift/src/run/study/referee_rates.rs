//! How often the referee says what: a pool of trainings on each side, from which its trainings are drawn again many times.
//!
//! On a set of equals *helps* is an error; on others its rate is the power of the referee.
//! A subset that is kept may really be better than others of its size, even among equals, so "random K" can stand in its
//! place: then the kept and the control are drawn from one pool, and no *helps* is right.

use serde::Serialize;

use super::choice::{Choice, TopK};
use super::parts::Set;
use super::plan::Study;
use super::pools::{PoolSummary, PoolTraining, of_pool};
use super::refereed::{Refereed, named, size};
use super::{Finished, Outcome};
use crate::basics::seed::Seed;
use crate::data::demonstration::DemoId;
use crate::stages::imitate::CurvePoint;
use crate::stages::referee::{
    self, Candidate, ConclusionRates, IMITATORS, Imitator, KEPT, NamedSubset, Refereeing, Side, Trained,
    Training,
};

/// Decisions that are drawn.
const RESAMPLES: usize = 1000;

/// What the referee said.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RefereedSummary {
    /// Of which set.
    pub set: String,
    /// What was kept.
    pub kept: String,
    /// With how many trainings.
    pub with: Refereeing,
    /// Trainings in the smallest pool that was drawn from.
    pub pool: usize,
    /// How often it said what.
    pub rates: ConclusionRates,
}

impl Refereed {
    /// What the referee says, for each kept subset and number of trainings whose pools have at least as many by now.
    pub(super) fn summarize(&self, study: &Study, finished: &Finished) -> Vec<RefereedSummary> {
        let Some(set) = study.set(&self.set) else { return Vec::new() };
        let pools: Vec<PoolSummary> =
            self.pools(Some(set)).iter().flat_map(|pool| of_pool(study, pool, finished)).collect();
        let of = |kept: &Choice, with: Refereeing| {
            let candidates = candidates(kept, set)?;
            let choice = |candidate: &Candidate| match candidate.side {
                Side::Kept => named(kept, Some(set)).to_string(),
                Side::Whole => Choice::All.to_string(),
                Side::Random => Choice::Random(TopK::Count(candidate.size)).to_string(),
            };
            let mut drawn_from = Vec::new();
            for imitator in IMITATORS.into_iter().filter(|rule| with.trainings(*rule) > 0) {
                for (index, candidate) in candidates.iter().enumerate() {
                    let is_its = |pool: &&PoolSummary| {
                        Imitator::from(pool.imitator) == imitator && pool.subset == choice(candidate)
                    };
                    let is_enough = |pool: &&PoolSummary| pool.trainings.len() >= with.trainings(imitator);
                    let pool = pools.iter().find(is_its).filter(is_enough)?;
                    let trainings = pool.trainings.iter().map(training).collect();
                    drawn_from.push(Trained { candidate: index, imitator, trainings, dropped: false });
                }
            }
            let pool = drawn_from.iter().map(|pool| pool.trainings.len()).min()?;
            let seed = Seed::new(self.first).of("study").of("referee");
            let rates = referee::conclusion_rates(&candidates, &drawn_from, with, RESAMPLES, &seed);
            let rates = rates.expect("each pair has a pool");
            Some(RefereedSummary { set: set.name.clone(), kept: kept.to_string(), with, pool, rates })
        };
        self.kept.iter().flat_map(|kept| self.with.iter().filter_map(move |with| of(kept, *with))).collect()
    }
}

/// The sides of the comparison. Which demonstrations they are says the pool; here they only count.
fn candidates(kept: &Choice, set: &Set) -> Option<Vec<Candidate>> {
    let ids: Vec<DemoId> = (0..set.demonstrations).map(DemoId).collect();
    let kept = NamedSubset::new(KEPT, ids.get(..size(kept, set)?)?);
    let candidates = referee::candidates(&ids, &[kept]).ok()?;
    candidates.iter().any(|candidate| candidate.side == Side::Kept).then_some(candidates)
}

fn training(of: &PoolTraining) -> Training {
    let point = |outcome: Outcome| CurvePoint {
        updates: 0,
        environment_steps: 0,
        score: outcome.score,
        standard_error: outcome.standard_error,
        success: outcome.success,
        true_return: outcome.true_return,
    };
    let (outcome, end) = (point(of.result.chosen), point(of.result.end));
    Training { outcome, end, chosen_by: outcome.score }
}
