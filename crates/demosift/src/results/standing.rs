//! Where a new demonstration stands among those of an earlier run, judged from the same prior with the same random numbers.
//!
//! A score depends on no other demonstration of its set: the starts, the evaluation episodes and the draws are those of the
//! earlier judging. So a new score can stand beside the old ones as if it had been among them from the start.

use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::basics::seed::Seed;
use crate::data::demonstration::DemoId;
use crate::results::uncertainty::{self, Resampling};
use crate::stages::judge::{ScoreTable, Suitability};
use crate::stages::select::{self, Keep};
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
    /// Whether it would be kept; `None` where the earlier run kept by weights, which only all demonstrations together have.
    pub kept: Option<bool>,
}

/// What an earlier run found, and what it keeps.
#[derive(Clone, Copy, Debug)]
pub struct Earlier<'a> {
    /// S of all, or of those near the cut.
    pub scores: &'a ScoreTable,
    /// By which rule.
    pub keep: Keep,
    /// How many of these.
    pub kept: usize,
}

/// Where each of the new demonstrations stands, each by itself beside the earlier ones; in the order of the new set.
///
/// # Errors
/// Bad input if the two tables were not made with the same variants and numbers of evaluations.
pub fn standings(earlier: &Earlier<'_>, new: &ScoreTable, seed: &Seed) -> Result<Vec<Standing>> {
    new.demos().into_iter().map(|demo| standing(earlier, new, demo, seed)).collect()
}

fn standing(earlier: &Earlier<'_>, new: &ScoreTable, demo: DemoId, seed: &Seed) -> Result<Standing> {
    let last = earlier.scores.demos().last().copied();
    let added = DemoId(last.ok_or_else(|| Error::bad_input("the earlier run judged nothing"))?.0 + 1);
    let mut table = earlier.scores.clone();
    table.suitabilities.extend(new.of_demo(demo).map(|of| Suitability { demo: added, ..of.clone() }));
    let doubts = uncertainty::uncertainty(&table, &Resampling::default(), &seed.of("standing"))?;
    let doubt = doubts.of(added).expect("it was added");
    let ranking = select::rank(&table).entries;
    let place = ranking.iter().position(|entry| entry.demo == added).expect("it was added") + 1;
    let kept = match earlier.keep {
        Keep::Weights => None,
        Keep::Auto => Some(doubts.worth_keeping().contains(&added)),
        Keep::Quarter | Keep::Count(_) => Some(place <= earlier.kept),
    };
    let top = doubt.top.at(earlier.kept.clamp(1, ranking.len())).unwrap_or(f64::NAN);
    Ok(Standing {
        demo,
        gain: doubt.gain,
        low: doubt.low,
        high: doubt.high,
        place,
        of: ranking.len(),
        top,
        kept,
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
        }
    }

    fn table(after: &[f64]) -> ScoreTable {
        ScoreTable {
            suitabilities: after.iter().enumerate().map(|(demo, &after)| found(demo, after)).collect(),
        }
    }

    #[test]
    fn each_stands_where_it_would_have_stood_from_the_start() {
        let earlier = table(&[3.0, 1.0, 2.0, 0.5]);
        let of = |keep, kept| Earlier { scores: &earlier, keep, kept };
        let seed = Seed::new(1);
        let new = table(&[2.5, 0.0, 9.0]);
        let found = standings(&of(Keep::Quarter, 1), &new, &seed).expect("whole tables");
        let places: Vec<_> = found.iter().map(|of| (of.place, of.of, of.kept)).collect();
        assert_eq!(places, [(2, 5, Some(false)), (5, 5, Some(false)), (1, 5, Some(true))]);
        assert!(found.iter().all(|of| of.low < of.gain && of.gain < of.high));
        assert!(found[2].top > 0.99 && found[1].top < 0.01);

        // The same gain as if it had been judged with them.
        let whole = select::rank(&table(&[3.0, 1.0, 2.0, 0.5, 2.5]));
        assert_eq!(found[0].gain, whole.entries[1].gain);
        let wide = standings(&of(Keep::Count(3), 3), &new, &seed).expect("whole tables");
        assert_eq!(wide.iter().map(|of| of.kept).collect::<Vec<_>>(), [Some(true), Some(false), Some(true)]);
        let by_weights = standings(&of(Keep::Weights, 2), &new, &seed).expect("whole tables");
        assert!(by_weights.iter().all(|of| of.kept.is_none()));
        let auto = standings(&of(Keep::Auto, 1), &new, &seed).expect("whole tables");
        assert_eq!(auto[2].kept, Some(true));
        assert_eq!(auto[1].kept, Some(false));
    }

    #[test]
    fn tables_of_unlike_judging_are_told() {
        let earlier = table(&[3.0, 1.0]);
        let mut new = table(&[2.0]);
        new.suitabilities[0].after[0].push(1.0);
        let of = Earlier { scores: &earlier, keep: Keep::Quarter, kept: 1 };
        let error = standings(&of, &new, &Seed::new(1)).expect_err("another number of evaluations");
        assert!(error.is_bad_input() && error.to_string().contains("2 evaluations"), "{error}");
        let nothing = Earlier { scores: &ScoreTable::default(), ..of };
        assert!(standings(&nothing, &table(&[1.0]), &Seed::new(1)).is_err());
    }
}
