//! Two judges of one set: what each says, how far each agrees with itself and with the other, and which of them decides.
//!
//! One imitates by behavioral cloning from scratch (§4.1.1, C.4), many times and cheaply; the other is the paper's, which
//! adapts meta-learned parameters (§4).
//! Somebody else's trainer can judge in place of both, alone, since each of its imitations may take minutes.
//! A judge whose repeats agree no better than shuffled ones has no vote, nor has one under which no imitation surely made
//! the agent better: what it says of this set is chance.
//! The order is that of the mean of both judges' gains (Eq. 8), or that of the one with a vote; `docs/design.md` says why.
//! Of a large set the second may have judged only those near the cut of the first: it then decides nothing, and says which of
//! these it would put above the cut.

use std::collections::BTreeMap;

use rand::seq::SliceRandom as _;
use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::basics::seed::Seed;
use crate::data::demonstration::DemoId;
use crate::math::agreement;
use crate::math::statistics;
use crate::results::uncertainty::{self, Measured, Resampling, Uncertainty};
use crate::stages::judge::ScoreTable;
use crate::stages::select::{self, Ranking};

/// Who judges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Judge {
    /// Behavioral cloning of each demonstration by policies that know nothing.
    Cloning,
    /// The paper's: meta-learned parameters that adapt, or what [`crate::stages::method::Method`] puts in their place.
    Paper,
    /// Somebody else's trainer, which learns from each demonstration alone.
    Trainer,
}

impl Judge {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Cloning, Self::Paper, Self::Trainer];

    /// The name under which its results are stored.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cloning => "cloning",
            Self::Paper => "paper",
            Self::Trainer => "trainer",
        }
    }
}

impl std::fmt::Display for Judge {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.name().fmt(out)
    }
}

/// Which judges are asked, or which of them decide.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Judges {
    /// Behavioral cloning alone.
    Cloning,
    /// The paper's alone.
    Paper,
    /// Cloning first, then the paper's; where both decide, the mean of their gains.
    Both,
    /// Somebody else's trainer alone.
    Trainer,
}

impl From<Judge> for Judges {
    fn from(judge: Judge) -> Self {
        match judge {
            Judge::Cloning => Self::Cloning,
            Judge::Paper => Self::Paper,
            Judge::Trainer => Self::Trainer,
        }
    }
}

impl Judges {
    /// In the order in which they judge.
    pub fn each(self) -> &'static [Judge] {
        match self {
            Self::Cloning => &[Judge::Cloning],
            Self::Paper => &[Judge::Paper],
            Self::Both => &[Judge::Cloning, Judge::Paper],
            Self::Trainer => &[Judge::Trainer],
        }
    }
}

/// Whether what a judge says counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Vote {
    /// It does.
    Counts,
    /// Nobody can know: each demonstration was imitated once.
    Unrepeated,
    /// Nobody can know: of so few demonstrations, imitated so few times, even repeats that agree in everything may do so by chance.
    TooFewToTell,
    /// Its repeats agree no better than chance.
    DisagreesWithItself,
    /// Imitating by it surely made the agent better for no demonstration.
    TaughtNothing,
}

/// What one judge says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Opinion {
    /// Who.
    pub judge: Judge,
    /// Its order of those that it judged.
    pub ranking: Ranking,
    /// How sure it is.
    pub uncertainty: Uncertainty,
    /// Spearman's rank correlation of one repeat with the mean of the others, the mean over repeats; `None` with one repeat,
    /// or where all demonstrations are alike.
    pub agrees_with_itself: Option<f64>,
    /// Whether that counts.
    pub vote: Vote,
}

/// A demonstration of which one judge is sure that it belongs to the best K, and the other that it does not.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Disagreement {
    /// v_i.
    pub demo: DemoId,
    /// Who would keep it.
    pub kept_by: Judge,
}

/// What the judges say of a set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Panel {
    /// One per judge, in the order in which they were asked.
    pub opinions: Vec<Opinion>,
    /// Whose order is taken; each of them judged all.
    pub decides: Judges,
    /// The order by the mean of both judges' gains, where both decide.
    pub together: Option<Together>,
    /// Spearman's rank correlation between the judges, where there are two, over those that both judged.
    pub agreement: Option<f64>,
    /// Where they clearly differ about the best K, in the order of the set.
    pub disagreements: Vec<Disagreement>,
}

/// What both judges say of a set as one: each gain is the mean of theirs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Together {
    /// The order of all.
    pub ranking: Ranking,
    /// How sure they are.
    pub uncertainty: Uncertainty,
}

/// An order of the set that is taken, and how sure it is.
#[derive(Clone, Copy, Debug)]
pub struct Order<'a> {
    /// The order.
    pub ranking: &'a Ranking,
    /// How sure it is.
    pub uncertainty: &'a Uncertainty,
}

/// What a judge found, to be weighed.
#[derive(Clone, Copy, Debug)]
pub struct Found<'a> {
    /// Who.
    pub judge: Judge,
    /// S of all, or of a judge behind the first of some.
    pub scores: &'a ScoreTable,
}

impl Panel {
    /// The order that is taken.
    pub fn deciding(&self) -> Order<'_> {
        match (&self.together, self.decides) {
            (Some(Together { ranking, uncertainty }), _) => Order { ranking, uncertainty },
            (None, Judges::Paper) => self.of(Judge::Paper).expect("who decides was asked").order(),
            (None, _) => self.opinions[0].order(),
        }
    }

    /// The opinion of a judge, if it was asked.
    pub fn of(&self, judge: Judge) -> Option<&Opinion> {
        self.opinions.iter().find(|opinion| opinion.judge == judge)
    }

    /// How many demonstrations the order that is taken holds: all.
    pub fn judged(&self) -> usize {
        self.deciding().ranking.entries.len()
    }

    /// Whether a judge that was asked judged all; one that did not judged those near the cut.
    pub fn judged_all(&self, opinion: &Opinion) -> bool {
        opinion.judged() == self.judged()
    }

    /// How many of those that a judge judged are among the first K of the order that is taken: so many it would put there too.
    pub fn places_above(&self, opinion: &Opinion, k: usize) -> usize {
        self.deciding().ranking.of_first(k, &opinion.ranking.demos())
    }

    /// Those whose order is not the one that is taken; where both decide, each of them.
    pub fn others(&self) -> impl Iterator<Item = &Opinion> {
        self.opinions.iter().filter(|opinion| self.decides != opinion.judge.into())
    }
}

impl Opinion {
    /// Its order, and how sure it is.
    pub fn order(&self) -> Order<'_> {
        Order { ranking: &self.ranking, uncertainty: &self.uncertainty }
    }

    /// How many demonstrations it is about.
    pub fn judged(&self) -> usize {
        self.ranking.entries.len()
    }
}

/// Sets the judges beside each other, the first of which judged all; `k` is where they must not disagree, K of the top K.
///
/// # Errors
/// Bad input if there is no judge, or a table is not whole: a demonstration lacks a variant, repeats or evaluations.
pub fn panel(found: &[Found<'_>], k: usize, seed: &Seed) -> Result<Panel> {
    let opinions = found.iter().map(|found| opinion(found, seed)).collect::<Result<Vec<_>>>()?;
    let first = opinions.first().ok_or_else(|| Error::bad_input("no judge was asked"))?;
    let may_decide = |opinion: &&Opinion| opinion.vote.counts() && opinion.judged() == first.judged();
    let may_decide: Vec<Judge> = opinions.iter().filter(may_decide).map(|opinion| opinion.judge).collect();
    let (decides, together) = match may_decide.as_slice() {
        [] => (first.judge.into(), None),
        [one] => ((*one).into(), None),
        _ => (Judges::Both, Some(together(found, seed)?)),
    };
    let (agreement, disagreements) = match opinions.as_slice() {
        [one, other] => (agreement(one, other), disagreements([one, other], k)),
        _ => (None, Vec::new()),
    };
    Ok(Panel { opinions, decides, together, agreement, disagreements })
}

impl Vote {
    /// Whether the judge may decide.
    pub fn counts(self) -> bool {
        matches!(self, Self::Counts | Self::Unrepeated | Self::TooFewToTell)
    }
}

/// The mean of the gains by each, drawn again from the same draws as each by itself.
fn together(found: &[Found<'_>], seed: &Seed) -> Result<Together> {
    let seeds: Vec<Seed> = found.iter().map(|found| uncertainty_seed(&seed.of(found.judge.name()))).collect();
    let measured: Vec<Measured<'_>> =
        found.iter().zip(&seeds).map(|(found, seed)| Measured { table: found.scores, seed }).collect();
    let rankings: Vec<Ranking> = found.iter().map(|found| select::rank(found.scores)).collect();
    Ok(Together {
        ranking: select::together(&rankings),
        uncertainty: uncertainty::together(&measured, &Resampling::default())?,
    })
}

fn uncertainty_seed(of_judge: &Seed) -> Seed {
    of_judge.of("uncertainty")
}

fn opinion(found: &Found<'_>, seed: &Seed) -> Result<Opinion> {
    let seed = seed.of(found.judge.name());
    let uncertainty =
        uncertainty::uncertainty(found.scores, &Resampling::default(), &uncertainty_seed(&seed))?;
    let repeats = repeats(found.scores);
    let agrees_with_itself = agreement_of(&repeats);
    let helps = uncertainty.demonstrations.iter().any(|doubt| doubt.improves >= uncertainty.level);
    let is_more_than_chance = agrees_with_itself
        .is_some_and(|agreement| is_more_than_chance(agreement, &repeats, seed.of("chance")));
    let vote = match (is_more_than_chance, helps) {
        // Intervals of one repeat are too narrow, and even they show no help.
        (_, false) if repeats.len() < 2 => Vote::TaughtNothing,
        (_, true) if repeats.len() < 2 => Vote::Unrepeated,
        (_, true) if !can_be_more_than_chance(&repeats) => Vote::TooFewToTell,
        (_, false) if !can_be_more_than_chance(&repeats) => Vote::TaughtNothing,
        (false, _) => Vote::DisagreesWithItself,
        (true, false) => Vote::TaughtNothing,
        (true, true) => Vote::Counts,
    };
    Ok(Opinion {
        judge: found.judge,
        ranking: select::rank(found.scores),
        uncertainty,
        agrees_with_itself,
        vote,
    })
}

/// Mean scores over evaluations and variants, `[repeats][n]` in the order of the set: of the repeats that all demonstrations have.
fn repeats(table: &ScoreTable) -> Vec<Vec<f64>> {
    let demos = table.demos();
    let mut means = vec![vec![0.0; demos.len()]; table.repeats()];
    for of in &table.suitabilities {
        let place = demos.binary_search(&of.demo).expect("it was taken from here");
        for (repeat, scores) in means.iter_mut().zip(&of.after) {
            repeat[place] += statistics::mean(scores);
        }
    }
    means
}

/// Spearman's correlation of each repeat with the mean of the others, averaged; `None` where that means nothing.
fn agreement_of(repeats: &[Vec<f64>]) -> Option<f64> {
    if repeats.len() < 2 {
        return None;
    }
    let of = |left_out: usize| {
        let others = repeats.iter().enumerate().filter(|(repeat, _)| *repeat != left_out);
        let mut mean = vec![0.0; repeats[left_out].len()];
        others.for_each(|(_, other)| mean.iter_mut().zip(other).for_each(|(sum, score)| *sum += score));
        agreement::spearman(&repeats[left_out], &mean)
    };
    let each: Vec<f64> = (0..repeats.len()).map(of).collect();
    // A repeat in which all are alike, as where nobody succeeded, agrees with nothing and contradicts nothing.
    let agreement = each.iter().map(|agreement| if agreement.is_finite() { *agreement } else { 0.0 });
    each.iter().any(|agreement| agreement.is_finite()).then(|| statistics::mean_of(agreement))
}

/// How often the repeats are shuffled, and up to which share of these may agree as well.
const SHUFFLES: usize = 999;
const CHANCE: f64 = 0.05;

/// Whether the test below can find anything: repeats that agree in everything do so by chance in one of as many cases as the
/// orders of all but one of them come to.
fn can_be_more_than_chance(repeats: &[Vec<f64>]) -> bool {
    let each: Vec<f64> = repeats.iter().map(|repeat| logarithm_of_orders(repeat)).collect();
    let most = each.iter().copied().fold(0.0, f64::max);
    most - each.iter().sum::<f64>() <= CHANCE.ln()
}

/// The logarithm of how many orders of some scores can be told apart, n! / ∏ t! for t that are alike: where only one succeeded, n.
fn logarithm_of_orders(scores: &[f64]) -> f64 {
    let mut sorted = scores.to_vec();
    sorted.sort_by(f64::total_cmp);
    let of_all = |count: usize| (1..=count).map(|place| (place as f64).ln()).sum::<f64>();
    let alike: f64 = sorted.chunk_by(|one, other| one == other).map(|alike| of_all(alike.len())).sum();
    of_all(scores.len()) - alike
}

/// A permutation test: who was imitated is shuffled in every repeat, each by itself.
fn is_more_than_chance(agreement: f64, repeats: &[Vec<f64>], seed: Seed) -> bool {
    let is_as_good =
        |shuffled: &[Vec<f64>]| agreement_of(shuffled).is_none_or(|chance| chance >= agreement - 1e-9);
    if let Some(all) = all_shuffles(repeats) {
        let as_good = all.iter().filter(|shuffled| is_as_good(shuffled)).count();
        return as_good as f64 / all.len() as f64 <= CHANCE;
    }
    let mut rng = seed.into_rng();
    let mut shuffled = repeats.to_vec();
    let mut as_good = 1;
    for _ in 0..SHUFFLES {
        shuffled.iter_mut().for_each(|repeat| repeat.shuffle(&mut rng));
        as_good += usize::from(is_as_good(&shuffled));
    }
    as_good as f64 / (SHUFFLES + 1) as f64 <= CHANCE
}

/// Every way to shuffle all repeats but the first, where these are no more than would be drawn: of few cases a draw is too rough,
/// and the order in which the first stands changes nothing.
fn all_shuffles(repeats: &[Vec<f64>]) -> Option<Vec<Vec<Vec<f64>>>> {
    let orders = (1..=repeats[0].len()).try_fold(1_usize, |orders, place| orders.checked_mul(place))?;
    orders.checked_pow(repeats.len() as u32 - 1).filter(|cases| *cases <= SHUFFLES)?;
    let mut cases = vec![vec![repeats[0].clone()]];
    for repeat in &repeats[1..] {
        let orders = orders_of(repeat);
        cases = (cases.iter())
            .flat_map(|case| orders.iter().map(move |order| case.iter().chain([order]).cloned().collect()))
            .collect();
    }
    Some(cases)
}

/// All orders of some numbers.
fn orders_of(numbers: &[f64]) -> Vec<Vec<f64>> {
    if numbers.is_empty() {
        return vec![Vec::new()];
    }
    let with_first = |first: usize| {
        let mut rest = numbers.to_vec();
        let number = rest.remove(first);
        orders_of(&rest).into_iter().map(move |order| [vec![number], order].concat())
    };
    (0..numbers.len()).flat_map(with_first).collect()
}

fn agreement(one: &Opinion, other: &Opinion) -> Option<f64> {
    let gains = |opinion: &Opinion| -> BTreeMap<DemoId, f64> {
        opinion.ranking.entries.iter().map(|entry| (entry.demo, entry.gain)).collect()
    };
    let (one, other) = (gains(one), gains(other));
    let of_both = one.iter().filter_map(|(demo, gain)| Some((*gain, *other.get(demo)?)));
    let (one, other): (Vec<f64>, Vec<f64>) = of_both.unzip();
    Some(agreement::spearman(&one, &other)).filter(|agreement| agreement.is_finite())
}

/// Of a judge that judged some, K is how many of these are among the first K of the one before it.
fn disagreements(opinions: [&Opinion; 2], k: usize) -> Vec<Disagreement> {
    let level = opinions[0].uncertainty.level;
    let chances = |opinion: &Opinion| -> BTreeMap<DemoId, Option<f64>> {
        let k = opinions[0].ranking.of_first(k, &opinion.ranking.demos());
        opinion.uncertainty.demonstrations.iter().map(|doubt| (doubt.demo, doubt.top.at(k))).collect()
    };
    let chances = opinions.map(chances);
    let differ = |demo: DemoId| {
        let [one, other] = chances.each_ref().map(|of| of.get(&demo).copied().flatten().unwrap_or(0.5));
        let kept_by = |winner: &Opinion| Disagreement { demo, kept_by: winner.judge };
        match (one, other) {
            (sure, not) if sure >= level && not <= 1.0 - level => Some(kept_by(opinions[0])),
            (not, sure) if sure >= level && not <= 1.0 - level => Some(kept_by(opinions[1])),
            _ => None,
        }
    };
    let mut demos: Vec<DemoId> = opinions[0].ranking.entries.iter().map(|entry| entry.demo).collect();
    demos.sort_unstable();
    demos.into_iter().filter_map(differ).collect()
}

#[cfg(test)]
mod tests;
