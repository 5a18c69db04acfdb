//! Whom the judge of the paper judges in a large set, where judging everybody would take hours.
//!
//! The judge by cloning has judged all by then, and what lies far from its cut another judge would hardly move across it.
//! So where both are asked, the judge of the paper is asked about those near the cut: it says which of them belong above.

use std::collections::BTreeMap;

use super::Config;
use crate::data::demonstration::{DemoId, DemonstrationSet};
use crate::results::panel::{Judge, Judges};
use crate::stages::judge::ScoreTable;
use crate::stages::select::{self, Ranking};

/// So many are near the cut, unless the configuration says another number.
pub(crate) const NEAR_CUT: usize = 100;

/// Where the configuration of an earlier version does not say it.
pub(super) fn near_cut() -> usize {
    NEAR_CUT
}

/// Who is judged.
pub(super) struct Judged {
    /// Ascending.
    pub(super) demos: Vec<DemoId>,
    /// How many of them belong to the best K of the set, as far as is known.
    pub(super) cut: usize,
}

/// How many of a set a judge judges: all, or of a large set of which both are asked, the judge of the paper a part.
pub fn how_many(config: &Config, set: &DemonstrationSet, judge: Judge) -> usize {
    if is_asked_near_the_cut(config, judge) { set.len().min(config.near_cut) } else { set.len() }
}

fn is_asked_near_the_cut(config: &Config, judge: Judge) -> bool {
    judge == Judge::Paper && config.judges == Judges::Both
}

/// So many that stand nearest to the cut of the judge by cloning.
pub(super) fn near(by_cloning: &ScoreTable, cut: usize, count: usize) -> Judged {
    let demos = nearest(&by_goal(by_cloning), cut, count);
    let cut = select::rank(by_cloning).of_first(cut, &demos);
    Judged { demos, cut }
}

/// What is kept is decided under each goal by itself (Eq. 9).
fn by_goal(scores: &ScoreTable) -> Vec<Ranking> {
    scores.variants().into_iter().map(|variant| select::rank_under(scores, variant)).collect()
}

/// So many as stand nearest to the cut of any of the rankings; ascending.
fn nearest(rankings: &[Ranking], cut: usize, count: usize) -> Vec<DemoId> {
    let mut away: BTreeMap<DemoId, usize> = BTreeMap::new();
    for ranking in rankings {
        for (place, entry) in ranking.entries.iter().enumerate() {
            // Of the border between the last that is kept and the next, twice, to stay with whole numbers.
            let from_cut = (2 * place + 1).abs_diff(2 * cut);
            away.entry(entry.demo).and_modify(|least| *least = from_cut.min(*least)).or_insert(from_cut);
        }
    }
    let mut demos: Vec<(usize, DemoId)> = away.into_iter().map(|(demo, away)| (away, demo)).collect();
    demos.sort_unstable();
    let mut nearest: Vec<DemoId> = demos.into_iter().take(count).map(|(_, demo)| demo).collect();
    nearest.sort_unstable();
    nearest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::select::Ranked;

    fn ranking(demos: &[usize]) -> Ranking {
        let ranked = |&demo: &usize| Ranked { demo: DemoId(demo), before: 0.0, after: 0.0, gain: 0.0 };
        Ranking { entries: demos.iter().map(ranked).collect() }
    }

    fn found(rankings: &[Ranking], cut: usize, count: usize) -> Vec<usize> {
        nearest(rankings, cut, count).into_iter().map(|demo| demo.0).collect()
    }

    #[test]
    fn those_on_both_sides_of_the_cut_are_nearest_to_it() {
        let one = [ranking(&[7, 3, 5, 1, 0, 2, 6, 4])];
        assert_eq!(found(&one, 3, 2), [1, 5]);
        assert_eq!(found(&one, 3, 4), [0, 1, 3, 5]);
        assert_eq!(found(&one, 1, 4), [1, 3, 5, 7], "the top ends there");
        assert_eq!(found(&one, 8, 2), [4, 6], "all are kept");
    }

    #[test]
    fn under_several_goals_the_nearest_cut_counts() {
        let two = [ranking(&[0, 1, 2, 3, 4, 5]), ranking(&[5, 4, 3, 2, 1, 0])];
        // The cuts lie between 0 and 1, and between 5 and 4.
        assert_eq!(found(&two, 1, 4), [0, 1, 4, 5]);
    }
}
