//! Judging (§4.3; Algorithm 2): how much better does imitating each demonstration make the agent at the task?
//!
//! Every demonstration is adapted to from the same meta-parameters, with the same random numbers, and the adapted
//! policy is scored by the task's heuristic on the same evaluation episodes as the meta-parameters themselves.
//!
//! | Algorithm 2 | here |
//! |---|---|
//! | 1, 2: for all e_j, for all v_i | the loop in [`judge`] |
//! | 3–10: adapt | [`adapt::adapt`] in [`judge_one`] |
//! | 11: evaluate θ_ij for M random seeds | [`evaluate`] |
//! | 12: S = K(after) − K(before) (Eq. 8) | [`Suitability::score`] |
//! | 14: i_opt (Eq. 9) | [`crate::select`] |
//!
//! Where we differ: an adaptation may be repeated with other random numbers and the outcomes pooled, and what is
//! evaluated is the mean of its last θ, since a single θ of one short adaptation is a noisy witness.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::adapt::{self, Course, InnerUpdate, MetaPrior, UpdateReport};
use crate::demonstration::{DemoId, DemonstrationSet};
use crate::environment::{EnvVariant, Specification};
use crate::error::Result;
use crate::heuristic::Score;
use crate::observer::{Event, Observer};
use crate::policy::Policy;
use crate::rollout::{self, Acting, Playground};
use crate::rows::Rows;
use crate::seed::Seed;

/// How demonstrations are judged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Judging {
    /// max_iter: inner updates per adaptation (§4.3: a few).
    pub iterations: usize,
    /// Of how many last θ of an adaptation the mean is evaluated; not in the paper.
    pub averaged: usize,
    /// M: evaluation seeds (Algorithm 2 line 11); not in the paper.
    pub evaluations: usize,
    /// Adaptations per demonstration and variant, each with its own random numbers; not in the paper.
    pub repeats: usize,
    /// How the policy acts when it is evaluated; sampling is what Algorithm 2 says, and shows what the mean action hides:
    /// an agent that imitates a noisy demonstration becomes as noisy.
    pub acting: Acting,
}

/// S_{v|e} with everything that it was made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Suitability {
    /// v_i.
    pub demo: DemoId,
    /// e_j.
    pub variant: EnvVariant,
    /// K of the meta-parameters, one an evaluation seed, `[M]`.
    pub before: Vec<Score>,
    /// K after adapting, one an evaluation seed, for each repeat, `[repeats][M]`.
    pub after: Vec<Vec<Score>>,
    /// The adaptation curves, `[repeats][iterations]`.
    pub curves: Vec<Vec<UpdateReport>>,
}

impl Suitability {
    /// S_{v|e} = K(τ after) − K(τ before), means over seeds and repeats (Eq. 8).
    pub fn score(&self) -> Score {
        self.mean_after() - self.mean_before()
    }

    /// Mean K of the meta-parameters.
    pub fn mean_before(&self) -> Score {
        mean(&self.before)
    }

    /// Mean K after adapting.
    pub fn mean_after(&self) -> Score {
        mean(&self.after.iter().map(|scores| mean(scores)).collect::<Vec<_>>())
    }
}

fn mean(scores: &[Score]) -> Score {
    scores.iter().sum::<f64>() / scores.len().max(1) as f64
}

/// All suitabilities of a set: variants in order, demonstrations in order within each.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ScoreTable {
    /// One an adaptation target.
    pub suitabilities: Vec<Suitability>,
}

/// Name of the stage in events.
pub const STAGE: &str = "judge";

/// Algorithm 2, continued from the suitabilities that `table` already holds.
pub fn judge(
    prior: &MetaPrior,
    set: &DemonstrationSet,
    playground: &Playground<'_>,
    (judging, inner): (&Judging, &InnerUpdate),
    mut table: ScoreTable,
    (seed, observer): (&Seed, &mut dyn Observer),
) -> Result<ScoreTable> {
    let demonstrated = prior.demonstrated_pairs(set);
    let variants = playground.specification().variant_ids();
    let targets: Vec<(EnvVariant, DemoId)> = variants
        .into_iter()
        .flat_map(|variant| set.ids().into_iter().map(move |demo| (variant, demo)))
        .collect();
    observer.on(Event::Started { stage: STAGE, done: table.suitabilities.len(), total: targets.len() });
    for (variant, demo) in targets.iter().skip(table.suitabilities.len()) {
        let judge = Judge { playground, judging, inner, variant: *variant, seed: seed.at(variant.0) };
        // The meta-parameters are the same for all demonstrations under a variant, and so is their score.
        let before = match table.suitabilities.last() {
            Some(last) if last.variant == *variant => last.before.clone(),
            _ => judge.evaluate(&prior.policy)?,
        };
        let suitability = judge
            .judge_one(prior, (*demo, &demonstrated[demo.0]), before)
            .map_err(|error| error.during(&format!("judging demonstration {demo}")))?;
        report(&suitability, observer);
        table.suitabilities.push(suitability);
        observer.on(Event::Advanced { stage: STAGE, done: table.suitabilities.len() });
        observer.on(Event::Checkpoint { stage: STAGE, part: "", state: &table });
    }
    Ok(table)
}

/// Environment steps that judging so many demonstrations takes, where episodes last to the horizon.
pub fn steps(demonstrations: usize, task: &Specification, judging: &Judging, inner: &InnerUpdate) -> u64 {
    let adaptations = demonstrations * judging.repeats;
    let adapting = adaptations * judging.iterations * inner.episodes(task.horizon);
    let evaluating = (1 + adaptations) * judging.evaluations;
    ((adapting + evaluating) * task.horizon * task.variants.len()) as u64
}

/// What is the same for all demonstrations under a variant: above all the random numbers.
struct Judge<'a> {
    playground: &'a Playground<'a>,
    judging: &'a Judging,
    inner: &'a InnerUpdate,
    variant: EnvVariant,
    seed: Seed,
}

impl Judge<'_> {
    /// Lines 3 to 12 for one demonstration.
    fn judge_one(
        &self,
        prior: &MetaPrior,
        (demo, demonstrated): (DemoId, &Rows),
        before: Vec<Score>,
    ) -> Result<Suitability> {
        let repeats: Vec<_> = (0..self.judging.repeats)
            .into_par_iter()
            .map(|repeat| {
                let Judging { iterations, averaged, .. } = *self.judging;
                let course = Course { inner: self.inner, iterations, averaged };
                let seed = self.seed.of("adapt").at(repeat);
                let adapted =
                    adapt::adapt(prior, &[demonstrated], self.playground, self.variant, &course, &seed)?;
                Ok((self.evaluate(&adapted.learner.policy)?, adapted.curve))
            })
            .collect::<Result<_>>()?;
        let (after, curves) = repeats.into_iter().unzip();
        Ok(Suitability { demo, variant: self.variant, before, after, curves })
    }

    /// Line 11: K of a policy on the M evaluation seeds, which are the same for everybody.
    fn evaluate(&self, policy: &Policy) -> Result<Vec<Score>> {
        let seeds = self.seed.of("evaluate").many(self.judging.evaluations);
        let trajectories = rollout::play(self.playground, policy, self.judging.acting, self.variant, seeds)?;
        Ok(trajectories.iter().map(|played| self.playground.score(played)).collect())
    }
}

fn report(suitability: &Suitability, observer: &mut dyn Observer) {
    for (repeat, curve) in suitability.curves.iter().enumerate() {
        let part =
            format!("variant {} demonstration {} repeat {repeat}", suitability.variant.0, suitability.demo);
        for (iteration, update) in curve.iter().enumerate() {
            let numbers = &update.numbers();
            observer.on(Event::Measured { stage: STAGE, part: &part, iteration, numbers });
        }
    }
}
