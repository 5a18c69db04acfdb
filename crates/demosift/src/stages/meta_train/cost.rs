//! What meta-training costs, before it begins.

use super::{Learning, targets_of_round, variants};
use crate::basics::seed::Seed;
use crate::data::demonstration::DemonstrationSet;
use crate::world::rollout::Playground;

/// Environment steps that each round of Algorithm 1 will take, round after round without end, where episodes last to the
/// horizon; with mutual information those of lines 10 and 12 among them.
///
/// `seed` is that of the meta-training, which draws the variants of a round: what θ does before is played once for each.
pub fn steps_by_round(
    set: &DemonstrationSet,
    playground: &Playground<'_>,
    learning: &Learning<'_>,
    seed: &Seed,
) -> impl Iterator<Item = u64> {
    let Learning { training, inner, information } = *learning;
    let horizon = playground.specification().horizon;
    let seed = seed.of("batch");
    (0..).map(move |number| {
        let targets = targets_of_round(set, playground, training.meta_batch, seed.at(number));
        let policies = variants(&targets).len() + targets.len();
        let imitating = policies * inner.episodes(horizon);
        let informing = information.map_or(0, |how| 2 * policies * how.episodes(horizon));
        ((imitating + informing) * horizon) as u64
    })
}
