//! What the judge by cloning spares in a large set: there are more demonstrations to tell apart, and each costs as much.
//!
//! Both rules are measured in `docs/results/scale.md`.

use super::CloningJudge;
use crate::data::demonstration::Extent;
use crate::stages::judge::Judging;

/// Up to so many demonstrations each is judged as it is configured, unless the configuration says another number.
pub(crate) const FULL_EFFORT_UP_TO: usize = 100;

/// Where the configuration of an earlier version does not say it.
pub(super) fn full_effort_up_to() -> usize {
    FULL_EFFORT_UP_TO
}

/// With two in place of three the ranking was worse.
const LEAST_REPEATS: usize = 3;

/// Short recordings are learned by heart long before the updates are over that long ones need.
const PASSES: usize = 600;

/// How a set of this extent is judged by cloning; as it is configured, where it is small.
pub(super) fn judging(by: &CloningJudge, Extent { demonstrations, longest }: Extent) -> Judging {
    let as_configured = by.judging.clone();
    if demonstrations <= by.full_effort_up_to {
        return as_configured;
    }
    let Judging { iterations, averaged, repeats, .. } = as_configured;
    let pairs_an_update = (by.cloning.steps * by.cloning.batch.min(longest)).max(1);
    let enough = (PASSES * longest).div_ceil(pairs_an_update).max(1);
    let fewer = repeats.div_ceil(2).max(LEAST_REPEATS).min(repeats);
    let iterations = iterations.min(enough);
    Judging { iterations, averaged: averaged.min(iterations), repeats: fewer, ..as_configured }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::preset::Preset;

    fn set(demonstrations: usize, longest: usize) -> Extent {
        Extent { demonstrations, longest }
    }

    #[test]
    fn a_small_set_is_judged_as_configured_and_a_large_one_with_fewer_repeats_and_passes() {
        let by = Preset::Quick.config().cloning_judge;
        assert_eq!(judging(&by, set(100, 60)), by.judging);
        // 600 passes over 60 pairs, all in one batch, are 600 steps, and an update takes 20.
        let sparing = Judging { iterations: 30, ..by.judging.clone() };
        assert_eq!(judging(&by, set(101, 60)), sparing);
        // 200 pairs are two batches, and of a thousand 100 updates make 200 passes.
        assert_eq!(judging(&by, set(101, 200)).iterations, 60);
        assert_eq!(judging(&by, set(101, 1000)).iterations, by.judging.iterations);
        assert_eq!(judging(&CloningJudge { full_effort_up_to: 101, ..by.clone() }, set(101, 60)), by.judging);
        let repeats = |repeats| {
            let asked = Judging { repeats, ..by.judging.clone() };
            judging(&CloningJudge { judging: asked, ..by.clone() }, set(101, 60)).repeats
        };
        assert_eq!([1, 2, 3, 6, 10].map(repeats), [1, 2, 3, 3, 5]);
    }

    #[test]
    fn no_more_updates_are_averaged_than_are_made() {
        let mut by = Preset::Quick.config().cloning_judge;
        by.cloning.steps = 200;
        let sparing = judging(&by, set(101, 60));
        assert_eq!((sparing.iterations, sparing.averaged), (3, 3));
    }
}
