//! What meta-training costs, before it begins.

use super::{InnerUpdate, MetaTraining, MutualInformation, tasks_of_round};
use crate::adapt::Rule;
use crate::demonstration::{DemoId, DemonstrationSet};
use crate::environment::EnvVariant;
use crate::rollout::Playground;
use crate::seed::Seed;

/// Environment steps that each round of Algorithm 1 will take, round after round without end, where episodes last to the
/// horizon; with mutual information those of lines 10 and 12 among them.
///
/// `seed` is that of the meta-training, which draws the variants of a round: what θ does before is played once for each.
pub fn steps_by_round(
    set: &DemonstrationSet,
    playground: &Playground<'_>,
    (training, inner, information): (&MetaTraining, &InnerUpdate, Option<&MutualInformation>),
    seed: &Seed,
) -> impl Iterator<Item = u64> {
    let horizon = playground.specification().horizon;
    let seed = seed.of("batch");
    (0..).map(move |number| {
        let tasks = tasks_of_round(set, playground, training.meta_batch, seed.at(number));
        let (befores, afters) = (variants(&tasks), tasks.len());
        let told = information.map_or(0, |how| how.episodes(horizon));
        let before = episodes_before(inner, information, horizon);
        let imitating = befores * before + afters * inner.episodes(horizon);
        let informing = (befores + 2 * afters) * told;
        ((imitating + informing) * horizon) as u64
    })
}

/// Episodes of line 7: those that an inner update learns from, and by behavioral cloning, which learns from none, those
/// that Q compares with.
pub(super) fn episodes_before(
    inner: &InnerUpdate,
    information: Option<&MutualInformation>,
    horizon: usize,
) -> usize {
    let told = match inner.imitation {
        Rule::Gail => 0,
        Rule::BehavioralCloning => information.map_or(0, |how| how.episodes(horizon)),
    };
    inner.episodes(horizon).max(told)
}

/// How many variants there are among these tasks.
fn variants(tasks: &[(DemoId, EnvVariant)]) -> usize {
    let mut variants: Vec<EnvVariant> = tasks.iter().map(|(_, variant)| *variant).collect();
    variants.sort_unstable();
    variants.dedup();
    variants.len()
}
