//! Judging (§4.3; Algorithm 2): how much better does imitating each demonstration make the agent at the task?
//!
//! Every demonstration is adapted to from the same meta-parameters, with the same random numbers, and the adapted
//! policy is scored by the task's heuristic on the same evaluation episodes as the meta-parameters themselves.
//!
//! | Algorithm 2 | here |
//! |---|---|
//! | 1, 2: for all e_j, for all v_i | the loop in [`judge`] |
//! | 3–10: adapt | [`adapt::adapt`] in [`Judge::adapt`] |
//! | 11: evaluate θ_ij for M random seeds | [`Judge::evaluate`] |
//! | 12: S = K(after) − K(before) (Eq. 8) | [`Suitability::score`] |
//! | 14: i_opt (Eq. 9) | [`crate::select`] |
//!
//! Where we differ: an adaptation may be repeated with other random numbers and the outcomes pooled, and what is
//! evaluated is the mean of its last θ, since a single θ of one short adaptation is a noisy witness.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::adapt::{self, Course, InnerUpdate, MetaPrior, UpdateReport};
use crate::adapted_behaviors;
use crate::demonstration::{DemoId, Demonstration, DemonstrationSet};
use crate::environment::{EnvVariant, Specification};
use crate::error::Result;
use crate::heuristic::Score;
use crate::observer::{Event, Observer};
use crate::policy::Policy;
use crate::rollout::{self, Acting, Playground};
use crate::rows::Rows;
use crate::seed::Seed;
use crate::trajectory::Trajectory;

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
    /// How far the adapted agent's evaluation episodes are from v_i (Table 1), one a repeat, `[repeats]`.
    pub distances: Vec<f64>,
    /// The adaptation curves, `[repeats][iterations]`.
    pub curves: Vec<Vec<UpdateReport>>,
}

/// θ_ij: what came of imitating a demonstration under a variant, to be looked at.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AdaptedPolicy {
    /// v_i.
    pub demo: DemoId,
    /// e_j.
    pub variant: EnvVariant,
    /// That of the first repeat, as it was evaluated.
    pub policy: Policy,
}

/// What judging finds; while it goes on, what it has found so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Judged {
    /// S of all.
    pub scores: ScoreTable,
    /// One a suitability, in the same order.
    pub adapted: Vec<AdaptedPolicy>,
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

impl ScoreTable {
    /// The adapted behaviors distance over the entire set (Table 1), the lower the better: how far from what was
    /// demonstrated the adapted agents are, in the units of observations and actions; NaN of an empty table.
    pub fn adapted_behaviors_distance(&self) -> f64 {
        let distances: Vec<f64> = self.suitabilities.iter().map(|of| mean(&of.distances)).collect();
        distances.iter().sum::<f64>() / distances.len() as f64
    }
}

/// Name of the stage in events.
pub const STAGE: &str = "judge";

/// Algorithm 2, continued from what `judged` already holds.
///
/// ```
/// use demosift::adapt::Learner;
/// use demosift::judge::{Judged, judge};
/// use demosift::observer::Silent;
/// use demosift::point_mass::{PointMass, planted_set};
/// use demosift::preset::Preset;
/// use demosift::rollout::Playground;
/// use demosift::seed::Seed;
///
/// // Degrees away from the goal; the second demonstration leads there.
/// let set = planted_set(&[180.0, 0.0, 100.0], Seed::new(1))?;
/// let mut config = Preset::Quick.config();
/// (config.inner.batch_steps, config.judge.iterations) = (600, 12);
/// config.inner.alphas = vec![1.0, 0.5]; // half steps after the first
///
/// // Any prior can be judged from; this one knows nothing, and `meta_train` makes better ones.
/// let prior = Learner::untrained(&set, &config.policy, &[32, 32], &Seed::new(7));
/// let task = PointMass::new();
/// let how = (&config.judge, &config.inner);
/// let nothing = Judged::default(); // or what was judged before a kill
/// let judged =
///     judge(&prior, &set, &Playground::new(&task), how, nothing, (&Seed::new(7), &mut Silent))?;
///
/// // One suitability for each demonstration under each of the task's variants, which here is one.
/// let scores: Vec<f64> = judged.scores.suitabilities.iter().map(|of| of.score()).collect();
/// assert_eq!(scores.len(), 3);
/// assert!(scores[1] > scores[2] && scores[2] > scores[0], "{scores:?} m nearer to the goal");
/// // The policies that imitated them are there too, to be looked at.
/// assert_eq!(judged.adapted.len(), 3);
/// # Ok::<(), demosift::Error>(())
/// ```
pub fn judge(
    prior: &MetaPrior,
    set: &DemonstrationSet,
    playground: &Playground<'_>,
    (judging, inner): (&Judging, &InnerUpdate),
    mut judged: Judged,
    (seed, observer): (&Seed, &mut dyn Observer),
) -> Result<Judged> {
    let demonstrated = prior.demonstrated_pairs(set);
    let variants = playground.specification().variant_ids();
    let targets: Vec<(EnvVariant, DemoId)> = variants
        .into_iter()
        .flat_map(|variant| set.ids().into_iter().map(move |demo| (variant, demo)))
        .collect();
    let done = judged.scores.suitabilities.len();
    observer.on(Event::Started { stage: STAGE, done, total: targets.len() });
    for (variant, demo) in targets.iter().skip(done) {
        let seed = seed_under(seed, *variant);
        let judge = Judge { playground, judging, inner, variant: *variant, seed };
        // The meta-parameters are the same for all demonstrations under a variant, and so is their score.
        let before = match judged.scores.suitabilities.last() {
            Some(last) if last.variant == *variant => last.before.clone(),
            _ => judge.score(&judge.evaluate(&prior.policy)?),
        };
        let target = Target { demo: *demo, demonstration: set.get(*demo), pairs: &demonstrated[demo.0] };
        let (suitability, policy) = judge
            .judge_one(prior, &target, before)
            .map_err(|error| error.during(&format!("judging demonstration {demo}")))?;
        report(&suitability, observer);
        judged.scores.suitabilities.push(suitability);
        judged.adapted.push(AdaptedPolicy { demo: *demo, variant: *variant, policy });
        observer.on(Event::Advanced { stage: STAGE, done: judged.scores.suitabilities.len() });
        observer.on(Event::Checkpoint { stage: STAGE, part: "", state: &judged });
    }
    Ok(judged)
}

/// Environment steps that judging so many demonstrations takes, where episodes last to the horizon.
pub fn steps(demonstrations: usize, task: &Specification, judging: &Judging, inner: &InnerUpdate) -> u64 {
    let adaptations = demonstrations * judging.repeats;
    let adapting = adaptations * judging.iterations * inner.episodes(task.horizon);
    let evaluating = (1 + adaptations) * judging.evaluations;
    ((adapting + evaluating) * task.horizon * task.variants.len()) as u64
}

/// One of the episodes in which the agent was scored, played again as it was to the bit: before imitating or after, as
/// the policy is; with its seed.
///
/// `seed` is that of [`judge`], and `evaluation` counts the M evaluation seeds from 0.
pub fn replay(
    playground: &Playground<'_>,
    policy: &Policy,
    judging: &Judging,
    (variant, evaluation): (EnvVariant, usize),
    seed: &Seed,
) -> Result<(Trajectory, Seed)> {
    let seed = || evaluation_seeds(&seed_under(seed, variant), judging.evaluations).swap_remove(evaluation);
    let played = rollout::play(playground, policy, judging.acting, variant, vec![seed()])?;
    Ok((played.into_iter().next().expect("one seed, one episode"), seed()))
}

fn seed_under(seed: &Seed, variant: EnvVariant) -> Seed {
    seed.at(variant.0)
}

fn evaluation_seeds(seed: &Seed, evaluations: usize) -> Vec<Seed> {
    seed.of("evaluate").many(evaluations)
}

/// What is the same for all demonstrations under a variant: above all the random numbers.
struct Judge<'a> {
    playground: &'a Playground<'a>,
    judging: &'a Judging,
    inner: &'a InnerUpdate,
    variant: EnvVariant,
    seed: Seed,
}

/// The demonstration that is judged.
struct Target<'a> {
    demo: DemoId,
    demonstration: &'a Demonstration,
    /// Its pairs behind the agent's filter.
    pairs: &'a Rows,
}

/// What came of one adaptation.
struct Repeat {
    policy: Policy,
    scores: Vec<Score>,
    distance: f64,
    curve: Vec<UpdateReport>,
}

impl Judge<'_> {
    /// Lines 3 to 12 for one demonstration.
    fn judge_one(
        &self,
        prior: &MetaPrior,
        target: &Target<'_>,
        before: Vec<Score>,
    ) -> Result<(Suitability, Policy)> {
        let repeats = (0..self.judging.repeats).into_par_iter();
        let repeats: Vec<Repeat> =
            repeats.map(|repeat| self.adapt(prior, target, repeat)).collect::<Result<_>>()?;
        let policy = repeats.first().expect("judging repeats at least once").policy.clone();
        let (mut after, mut distances, mut curves) = (Vec::new(), Vec::new(), Vec::new());
        for Repeat { scores, distance, curve, .. } in repeats {
            after.push(scores);
            distances.push(distance);
            curves.push(curve);
        }
        let (demo, variant) = (target.demo, self.variant);
        Ok((Suitability { demo, variant, before, after, distances, curves }, policy))
    }

    /// Lines 3 to 11 once.
    fn adapt(&self, prior: &MetaPrior, target: &Target<'_>, repeat: usize) -> Result<Repeat> {
        let Judging { iterations, averaged, .. } = *self.judging;
        let course = Course { inner: self.inner, iterations, averaged };
        let seed = self.seed.of("adapt").at(repeat);
        let adapted = adapt::adapt(prior, &[target.pairs], self.playground, self.variant, &course, &seed)?;
        let policy = adapted.learner.policy;
        let played = self.evaluate(&policy)?;
        let distance = adapted_behaviors::distance(target.demonstration, &played)?;
        Ok(Repeat { scores: self.score(&played), distance, policy, curve: adapted.curve })
    }

    /// Line 11: a policy on the M evaluation seeds, which are the same for everybody.
    fn evaluate(&self, policy: &Policy) -> Result<Vec<Trajectory>> {
        let seeds = evaluation_seeds(&self.seed, self.judging.evaluations);
        rollout::play(self.playground, policy, self.judging.acting, self.variant, seeds)
    }

    /// K.
    fn score(&self, played: &[Trajectory]) -> Vec<Score> {
        played.iter().map(|played| self.playground.score(played)).collect()
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
