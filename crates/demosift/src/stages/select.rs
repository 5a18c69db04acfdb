//! Selecting demonstrations (§4.3 Eq. 9, §4.4, §5.2): a ranking by suitability, and its top K.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::data::demonstration::DemoId;
use crate::math::statistics::mean_of;
use crate::stages::judge::{ScoreTable, Suitability};
use crate::world::environment::EnvVariant;
use crate::world::heuristic::Score;

/// Demonstrations from the most to the least suitable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Ranking {
    /// The most suitable first.
    pub entries: Vec<Ranked>,
}

impl Ranking {
    /// Where each demonstration stands in the order of the set, which holds those of the ranking.
    pub fn places_in_set(&self) -> Vec<usize> {
        let mut by_id: Vec<usize> = (0..self.entries.len()).collect();
        by_id.sort_by_key(|&rank| self.entries[rank].demo);
        let mut places = vec![0; by_id.len()];
        by_id.into_iter().enumerate().for_each(|(place, rank)| places[rank] = place);
        places
    }

    /// How many of the first K are among these: a judge of a part of the set keeps as many of its own.
    pub fn of_first(&self, k: usize, among: &[DemoId]) -> usize {
        let among: BTreeSet<&DemoId> = among.iter().collect();
        self.entries.iter().take(k).filter(|entry| among.contains(&entry.demo)).count()
    }

    /// The demonstrations, the most suitable first.
    pub fn demos(&self) -> Vec<DemoId> {
        self.entries.iter().map(|entry| entry.demo).collect()
    }

    /// Numbers in the order of the set, in that of the ranking.
    pub fn ordered(&self, of_set: &[f64]) -> Vec<f64> {
        self.places_in_set().into_iter().map(|place| of_set[place]).collect()
    }
}

/// One place of a ranking.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Ranked {
    /// v_i.
    pub demo: DemoId,
    /// Mean K of the meta-parameters.
    pub before: Score,
    /// Mean K after adapting.
    pub after: Score,
    /// S (Eq. 8): how much better imitating it made the agent; the mean over variants where all are ranked together.
    #[serde(rename = "score")]
    pub gain: Score,
}

/// Which demonstrations to learn from, ordered by rank.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Subset {
    /// The chosen demonstrations, the most suitable first.
    pub demos: Vec<DemoId>,
}

/// How many demonstrations to keep, written `quarter`, `auto`, `weights` or a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum Keep {
    /// A quarter of the set, rounded up.
    Quarter,
    /// Those that this budget shows to be worth it; see [`crate::results::uncertainty`].
    Auto,
    /// Those that end up heavy enough in the selection by weights; see [`crate::stages::subset_selection`].
    Weights,
    /// K of the top K.
    Count(usize),
}

impl Keep {
    /// What may stand in place of a number, for errors.
    pub const WORDS: &str = "auto, weights, or quarter";

    /// K of the top K of a set of so many, as far as it is known before judging: a quarter, rounded up, where judging finds it.
    pub fn count_before_judging(self, demonstrations: usize) -> usize {
        match self {
            Self::Count(count) => count,
            Self::Quarter | Self::Auto | Self::Weights => quarter(demonstrations),
        }
    }

    /// What is wrong with it for a set of so many, if anything: what it must be instead.
    pub fn misfit(self, demonstrations: usize) -> Option<String> {
        let is_wrong = matches!(self, Self::Count(count) if !(1..=demonstrations).contains(&count));
        is_wrong.then(|| {
            format!("must be from 1 to the {demonstrations} demonstrations there are, {}", Self::WORDS)
        })
    }
}

/// A quarter of so many demonstrations, rounded up.
pub fn quarter(demonstrations: usize) -> usize {
    demonstrations.div_ceil(4)
}

impl std::fmt::Display for Keep {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Quarter => "quarter".fmt(out),
            Self::Auto => "auto".fmt(out),
            Self::Weights => "weights".fmt(out),
            Self::Count(count) => count.fmt(out),
        }
    }
}

impl std::str::FromStr for Keep {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match (text, text.parse()) {
            ("quarter", _) => Ok(Self::Quarter),
            ("auto", _) => Ok(Self::Auto),
            ("weights", _) => Ok(Self::Weights),
            (_, Ok(count)) => Ok(Self::Count(count)),
            _ => Err(Error::bad_config(format!(
                "keep = {text}, and must be {}, or a number of demonstrations",
                Self::WORDS.replace(" or", "")
            ))),
        }
    }
}

impl TryFrom<String> for Keep {
    type Error = Error;

    fn try_from(text: String) -> Result<Self> {
        text.parse()
    }
}

impl From<Keep> for String {
    fn from(keep: Keep) -> Self {
        keep.to_string()
    }
}

/// The ranking over all variants by mean suitability (Eq. 9 for a single variant); ties by id.
pub fn rank(table: &ScoreTable) -> Ranking {
    rank_where(table, |_| true)
}

/// The ranking under one variant e_j (Eq. 9); ties by id.
pub fn rank_under(table: &ScoreTable, variant: EnvVariant) -> Ranking {
    rank_where(table, |of| of == variant)
}

fn rank_where(table: &ScoreTable, counts: impl Fn(EnvVariant) -> bool) -> Ranking {
    let mut by_demo: BTreeMap<DemoId, Vec<&Suitability>> = BTreeMap::new();
    for of in table.suitabilities.iter().filter(|of| counts(of.variant)) {
        by_demo.entry(of.demo).or_default().push(of);
    }
    ordered(by_demo.into_iter().map(|(demo, found)| ranked(demo, &found)).collect())
}

/// The ranking under one variant by the mean of the gains of several tables.
pub fn rank_together_under(tables: &[&ScoreTable], variant: EnvVariant) -> Ranking {
    let rankings: Vec<Ranking> = tables.iter().map(|table| rank_under(table, variant)).collect();
    together(&rankings)
}

/// The ranking by the mean of the gains that several rankings of the same demonstrations give; ties by id.
pub fn together(rankings: &[Ranking]) -> Ranking {
    let mut by_demo: BTreeMap<DemoId, Vec<&Ranked>> = BTreeMap::new();
    rankings
        .iter()
        .flat_map(|ranking| &ranking.entries)
        .for_each(|entry| by_demo.entry(entry.demo).or_default().push(entry));
    let mean = |(demo, found): (DemoId, Vec<&Ranked>)| Ranked {
        demo,
        before: mean_of(found.iter().map(|entry| entry.before)),
        after: mean_of(found.iter().map(|entry| entry.after)),
        gain: mean_of(found.iter().map(|entry| entry.gain)),
    };
    ordered(by_demo.into_iter().map(mean).collect())
}

/// The most suitable first, ties by id.
fn ordered(mut entries: Vec<Ranked>) -> Ranking {
    entries.sort_by(|a, b| b.gain.total_cmp(&a.gain).then(a.demo.cmp(&b.demo)));
    Ranking { entries }
}

fn ranked(demo: DemoId, found: &[&Suitability]) -> Ranked {
    Ranked {
        demo,
        before: mean_of(found.iter().map(|of| of.mean_before())),
        after: mean_of(found.iter().map(|of| of.mean_after())),
        gain: mean_of(found.iter().map(|of| of.gain())),
    }
}

/// The first K of a ranking (§5.2).
///
/// ```
/// use demosift::data::demonstration::DemoId;
/// use demosift::stages::judge::{ScoreTable, Suitability};
/// use demosift::stages::select::{rank, rank_under, top_k};
/// use demosift::world::environment::EnvVariant;
///
/// // What judging found of a demonstration under a variant: K before and after imitating it, one per evaluation seed.
/// let found = |demo, variant, before: [f64; 2], after: [f64; 2]| Suitability {
///     demo: DemoId(demo),
///     variant: EnvVariant(variant),
///     before: vec![before.to_vec()],
///     after: vec![after.to_vec()],
///     distances: vec![0.0],
///     curves: vec![vec![]],
///     evaluated: None,
/// };
/// let table = ScoreTable::new(vec![
///     found(0, 0, [1.0, 2.0], [1.5, 2.5]), // S = 0.5
///     found(1, 0, [1.0, 2.0], [2.0, 3.0]), // S = 1
///     found(0, 1, [0.0, 0.0], [0.5, 0.5]), // S = 0.5
///     found(1, 1, [0.0, 0.0], [-1.0, -1.0]), // S = −1
/// ]);
///
/// // Under the first variant the second demonstration is the more suitable one; over both it is not.
/// assert_eq!(top_k(&rank_under(&table, EnvVariant(0)), 1)?.demos, [DemoId(1)]);
/// assert_eq!(top_k(&rank(&table), 1)?.demos, [DemoId(0)]);
/// assert_eq!(rank(&table).entries[1].gain, 0.0);
///
/// // A subset of nothing or of more than there is gets an error that says what would be right.
/// let error = top_k(&rank(&table), 3).unwrap_err();
/// assert!(error.to_string().contains("from 1 to the 2 demonstrations"));
/// # Ok::<(), demosift::Error>(())
/// ```
pub fn top_k(ranking: &Ranking, k: usize) -> Result<Subset> {
    if let Some(wanted) = Keep::Count(k).misfit(ranking.entries.len()) {
        return Err(Error::bad_config(format!("keep = {k}, and {wanted}")));
    }
    Ok(Subset { demos: ranking.entries.iter().take(k).map(|entry| entry.demo).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::judge::Suitability;

    #[test]
    fn the_gain_by_several_is_the_mean_of_theirs() {
        let (one, other) = (
            table(&[(0, 0, 4.0), (0, 1, 3.0), (0, 2, 2.0)]),
            table(&[(0, 0, 2.0), (0, 1, 9.0), (0, 2, 4.0)]),
        );
        let both = together(&[rank(&one), rank(&other)]);
        assert_eq!(order(&both), [1, 0, 2]);
        assert_eq!(both.entries[0], Ranked { demo: DemoId(1), before: 2.0, after: 6.0, gain: 4.0 });
        assert_eq!(together(&[rank(&one)]), rank(&one));
    }

    #[test]
    fn a_judge_of_some_keeps_as_many_of_them_as_the_judge_of_all() {
        let ranking = rank(&table(&[(0, 0, 5.0), (0, 1, 4.0), (0, 2, 3.0), (0, 3, 2.0), (0, 4, 1.0)]));
        assert_eq!(ranking.of_first(3, &ranking.demos()), 3);
        assert_eq!(ranking.of_first(3, &[DemoId(2), DemoId(3)]), 1);
        assert_eq!(ranking.of_first(0, &[DemoId(2)]), 0);
    }

    fn table(scores: &[(usize, usize, f64)]) -> ScoreTable {
        let suitability = |&(variant, demo, after): &(usize, usize, f64)| Suitability {
            demo: DemoId(demo),
            variant: EnvVariant(variant),
            before: vec![vec![1.0, 3.0]],
            after: vec![vec![after, after], vec![after, after]],
            distances: Vec::new(),
            curves: Vec::new(),
            evaluated: None,
        };
        ScoreTable::new(scores.iter().map(suitability).collect())
    }

    fn order(ranking: &Ranking) -> Vec<usize> {
        ranking.entries.iter().map(|entry| entry.demo.0).collect()
    }

    #[test]
    fn what_to_keep_is_written_as_it_is_read() {
        for keep in [Keep::Quarter, Keep::Auto, Keep::Weights, Keep::Count(3)] {
            assert_eq!(keep.to_string().parse::<Keep>().expect("its own words"), keep);
        }
        let error = "most".parse::<Keep>().expect_err("no such word");
        assert_eq!(
            error.to_string(),
            "keep = most, and must be auto, weights, quarter, or a number of demonstrations"
        );
    }

    #[test]
    fn eq_8_is_the_mean_after_less_the_mean_before() {
        assert_eq!(table(&[(0, 0, 7.0)]).suitabilities[0].gain(), 5.0);
    }

    #[test]
    fn eq_9_ranks_by_score_per_variant_and_ties_by_id() {
        let table = table(&[(0, 0, 1.0), (0, 1, 5.0), (0, 2, 5.0), (1, 0, 9.0), (1, 1, 0.0), (1, 2, 0.5)]);
        assert_eq!(order(&rank_under(&table, EnvVariant(0))), [1, 2, 0]);
        assert_eq!(order(&rank_under(&table, EnvVariant(1))), [0, 2, 1]);
        assert_eq!(order(&rank(&table)), [0, 2, 1]);
    }

    #[test]
    fn the_top_k_are_among_the_top_k_plus_one() {
        let ranking = rank(&table(&[(0, 0, 1.0), (0, 1, 5.0), (0, 2, 3.0), (0, 3, -1.0)]));
        for k in 1..4 {
            let (fewer, more) =
                (top_k(&ranking, k).expect("in range"), top_k(&ranking, k + 1).expect("in range"));
            assert!(fewer.demos.iter().all(|demo| more.demos.contains(demo)));
        }
        assert!(top_k(&ranking, 0).expect_err("out of range").is_bad_config());
        assert!(top_k(&ranking, 5).expect_err("out of range").is_bad_config());
    }
}
