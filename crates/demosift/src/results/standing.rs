//! Where a new demonstration stands among those of an earlier run, judged from the same prior with the same random numbers.
//!
//! A score depends on no other demonstration of its set: the starts, the evaluation episodes and the draws are those of the
//! earlier judging. So a new score can stand beside the old ones as if it had been among them from the start.

use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::basics::seed::Seed;
use crate::data::demonstration::DemoId;
use crate::results::uncertainty::{self, Measured, Resampling};
use crate::stages::judge::{ScoreTable, Suitability};
use crate::stages::select::{self, Keep, Ranking};
use crate::world::heuristic::Score;

/// Where a demonstration would stand, had it been in the earlier set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Standing {
    /// Which of the new ones.
    pub demo: DemoId,
    /// S (Eq. 8).
    #[serde(rename = "score")]
    pub gain: Score,
    /// Lower end of the interval of S.
    pub low: Score,
    /// Upper end of the interval of S.
    pub high: Score,
    /// Its place among the earlier ones and itself, from 1.
    pub place: usize,
    /// How many these are.
    pub of: usize,
    /// The probability that it belongs to the K best of them, K being how many the earlier run keeps.
    pub top: f64,
    /// Whether it would be kept; `None` where only all demonstrations together tell: where the earlier run kept by weights, or
    /// by its probabilities ([`Keep::Auto`]) and this judge was asked about a part of them.
    pub kept: Option<bool>,
}

/// What an earlier run keeps of those that it judged.
#[derive(Clone, Copy, Debug)]
pub struct Kept {
    /// By which rule.
    pub keep: Keep,
    /// How many of those that the judge was asked about.
    pub count: usize,
    /// Whether it was asked about all.
    pub of_all: bool,
}

/// What one judge found of the earlier demonstrations and of the new ones.
#[derive(Clone, Copy, Debug)]
pub struct Beside<'a> {
    /// S of all earlier ones, or of those near the cut.
    pub earlier: &'a ScoreTable,
    /// S of the new ones.
    pub new: &'a ScoreTable,
    /// Of the draws.
    pub seed: &'a Seed,
}

/// Where each of the new demonstrations stands, each by itself beside the earlier ones; in the order of the new set.
///
/// With several judges it stands by the mean of their gains.
///
/// # Errors
/// Bad input if the tables were not made with the same variants and numbers of evaluations.
pub fn standings(by_judge: &[Beside<'_>], kept: Kept) -> Result<Vec<Standing>> {
    let new = by_judge.first().map_or_else(Vec::new, |beside| beside.new.demos());
    new.into_iter().map(|demo| standing(by_judge, kept, demo)).collect()
}

fn standing(by_judge: &[Beside<'_>], kept: Kept, demo: DemoId) -> Result<Standing> {
    let earlier = by_judge.iter().filter_map(|beside| beside.earlier.demos().last().copied()).max();
    let added = DemoId(earlier.ok_or_else(|| Error::bad_input("the earlier run judged nothing"))?.0 + 1);
    let with_it = |beside: &Beside<'_>| {
        let mut table = beside.earlier.clone();
        // All gains are beside the same agents before; a single new demonstration is not raced, so it may know fewer of them.
        let before = |of: &Suitability| {
            let earlier = beside.earlier.suitabilities.iter().find(|earlier| earlier.variant == of.variant);
            earlier.map_or_else(|| of.before.clone(), |earlier| earlier.before.clone())
        };
        let new = (beside.new.of_demo(demo)).map(|of| Suitability {
            demo: added,
            before: before(of),
            ..of.clone()
        });
        table.suitabilities.extend(new);
        table
    };
    let tables: Vec<ScoreTable> = by_judge.iter().map(with_it).collect();
    let seeds: Vec<Seed> = by_judge.iter().map(|beside| beside.seed.of("standing")).collect();
    let measured: Vec<Measured<'_>> =
        tables.iter().zip(&seeds).map(|(table, seed)| Measured { table, seed }).collect();
    let doubts = uncertainty::together(&measured, &Resampling::default())?;
    let doubt = doubts.of(added).expect("it was added");
    let rankings: Vec<Ranking> = tables.iter().map(select::rank).collect();
    let ranking = select::together(&rankings).entries;
    let place = ranking.iter().position(|entry| entry.demo == added).expect("it was added") + 1;
    let is_kept = match kept.keep {
        Keep::Weights => None,
        Keep::Auto => kept.of_all.then(|| doubts.worth_keeping().contains(&added)),
        Keep::Quarter | Keep::Count(_) => Some(place <= kept.count),
    };
    // None of those near a cut may be above it.
    let top = doubt.top.at(kept.count.min(ranking.len())).unwrap_or(0.0);
    Ok(Standing {
        demo,
        gain: doubt.gain,
        low: doubt.low,
        high: doubt.high,
        place,
        of: ranking.len(),
        top,
        kept: is_kept,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::environment::EnvVariant;

    fn found(demo: usize, after: f64) -> Suitability {
        Suitability {
            demo: DemoId(demo),
            variant: EnvVariant(0),
            before: vec![vec![0.0, 0.1]],
            after: vec![vec![after, after + 0.1], vec![after + 0.02, after + 0.12]],
            distances: vec![0.0; 2],
            curves: vec![vec![]; 2],
            evaluated: None,
        }
    }

    fn table(after: &[f64]) -> ScoreTable {
        ScoreTable::new(after.iter().enumerate().map(|(demo, &after)| found(demo, after)).collect())
    }

    #[test]
    fn each_stands_where_it_would_have_stood_from_the_start() {
        let earlier = table(&[3.0, 1.0, 2.0, 0.5]);
        let (seed, new) = (Seed::new(1), table(&[2.5, 0.0, 9.0]));
        let beside = Beside { earlier: &earlier, new: &new, seed: &seed };
        let of =
            |keep, count| standings(&[beside], Kept { keep, count, of_all: true }).expect("whole tables");
        let found = of(Keep::Quarter, 1);
        let places: Vec<_> = found.iter().map(|of| (of.place, of.of, of.kept)).collect();
        assert_eq!(places, [(2, 5, Some(false)), (5, 5, Some(false)), (1, 5, Some(true))]);
        assert!(found.iter().all(|of| of.low < of.gain && of.gain < of.high));
        assert!(found[2].top > 0.99 && found[1].top < 0.01);

        // The same gain as if it had been judged with them.
        let whole = select::rank(&table(&[3.0, 1.0, 2.0, 0.5, 2.5]));
        assert_eq!(found[0].gain, whole.entries[1].gain);
        let wide = of(Keep::Count(3), 3);
        assert_eq!(wide.iter().map(|of| of.kept).collect::<Vec<_>>(), [Some(true), Some(false), Some(true)]);
        let by_weights = of(Keep::Weights, 2);
        assert!(by_weights.iter().all(|of| of.kept.is_none()));
        let auto = of(Keep::Auto, 1);
        assert_eq!(auto[2].kept, Some(true));
        assert_eq!(auto[1].kept, Some(false));

        let of_part = |keep, count| {
            let kept = Kept { keep, count, of_all: false };
            standings(&[beside], kept).expect("whole tables").remove(2)
        };
        assert_eq!(
            of_part(Keep::Auto, 1).kept,
            None,
            "the best of those near the cut may be far from the best"
        );
        let none_above = of_part(Keep::Count(1), 0);
        assert_eq!((none_above.kept, none_above.top), (Some(false), 0.0));
    }

    #[test]
    fn a_new_one_stands_beside_the_agents_before_of_the_earlier_run() {
        let mut earlier = table(&[3.0, 1.0]);
        let before = vec![vec![0.0; 2], vec![4.0; 2]];
        earlier.suitabilities.iter_mut().for_each(|of| of.before = before.clone());
        // It is not raced by itself, so that it knows the first of these alone.
        let mut new = table(&[1.0]);
        new.suitabilities[0].before = vec![vec![0.0; 2]];
        let seed = Seed::new(1);
        let beside = Beside { earlier: &earlier, new: &new, seed: &seed };
        let found =
            standings(&[beside], Kept { keep: Keep::Quarter, count: 1, of_all: true }).expect("whole tables");
        assert_eq!(
            found[0].gain,
            select::rank(&earlier).entries[1].gain,
            "its after is that of demonstration 1"
        );
    }

    #[test]
    fn tables_of_unlike_judging_are_told() {
        let earlier = table(&[3.0, 1.0]);
        let mut new = table(&[2.0]);
        new.suitabilities[0].after[0].push(1.0);
        let (seed, kept) = (Seed::new(1), Kept { keep: Keep::Quarter, count: 1, of_all: true });
        let of = |earlier, new| standings(&[Beside { earlier, new, seed: &seed }], kept);
        let error = of(&earlier, &new).expect_err("another number of evaluations");
        assert!(error.is_bad_input() && error.to_string().contains("2 evaluations"), "{error}");
        assert!(of(&ScoreTable::default(), &table(&[1.0])).is_err());
    }

    #[test]
    fn by_two_judges_it_stands_by_the_mean_of_their_gains() {
        let (one, other) = (table(&[3.0, 1.0, 2.0]), table(&[1.0, 3.0, 2.0]));
        let (new_to_one, new_to_other) = (table(&[4.0]), table(&[1.0]));
        let seed = Seed::new(1);
        let by_judge = [
            Beside { earlier: &one, new: &new_to_one, seed: &seed },
            Beside { earlier: &other, new: &new_to_other, seed: &seed },
        ];
        let found =
            standings(&by_judge, Kept { keep: Keep::Quarter, count: 1, of_all: true }).expect("whole tables");
        assert_eq!((found[0].place, found[0].of, found[0].kept), (1, 4, Some(true)));
        assert!((found[0].gain - (4.06 + 1.06 - 0.1) / 2.0).abs() < 0.1, "{}", found[0].gain);
    }
}
