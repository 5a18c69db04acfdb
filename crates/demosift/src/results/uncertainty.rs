//! How sure a judgment is: an interval of each gain, the probability of belonging to the top K, and which
//! demonstrations this budget cannot tell apart (not in the paper, which shows one ranking without a doubt in it).
//!
//! The judgment is drawn again many times from what was measured, and every statement is a share of those draws.
//! Three things vary, and each is drawn as its number allows.
//!
//! | what varies | what is exchangeable | how it is drawn |
//! |---|---|---|
//! | evaluation episodes, or batches | the M evaluation seeds of a variant | bootstrap: M of them with replacement, the same for all demonstrations and for the agent before, so that luck in a reset falls on all alike; widened as Student's t with M − 1 degrees of freedom is, since few of them do not tell their own spread |
//! | adaptations, the larger noise | the repeats of one demonstration under one variant | Student's t with the spread of the repeats, for each demonstration by itself |
//! | the agents before, where each repeat begins with another | these agents under one variant | Student's t with their spread, the same for all demonstrations |
//!
//! Variants are the ones that the task has, and not a sample, so they are never drawn.
//!
//! Two repeats cannot be resampled: with replacement they have three outcomes, and the interval between the two
//! covers the mean of many in half of all cases. So repeats are not bootstrapped but drawn from Student's t, and the
//! spread of a demonstration's few repeats is drawn toward the mean spread of the set's
//! (Smyth 2004, "Linear models and empirical Bayes methods", with a fixed weight in place of a fitted one).
//! Adaptations share their random numbers between demonstrations too, but after the first update they go ways of
//! their own, so they are drawn independently; where they do go together, differences are a little surer than said.
//!
//! **What is not in the intervals**: the meta-parameters are taken as they are.
//! Meta-training again with another seed moves scores as well, and only another `--seed` shows how far.

mod chances;
mod drawing;

pub use chances::Chances;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::basics::seed::Seed;
use crate::data::demonstration::DemoId;
use crate::math::statistics::{mean, mean_of, quantile, squared_deviations};
use crate::stages::judge::{ScoreTable, Suitability};
use crate::world::heuristic::Score;
use chances::top_probabilities;
use drawing::draw;

/// How the judgment is drawn again; nothing of it is in the paper.
#[derive(Clone, Debug, PartialEq)]
pub struct Resampling {
    /// Draws; 4000 put a standard error of half a percent on a probability near 0.1 or 0.9. Of a large set there are fewer, and
    /// 1000 at least, for one percent.
    pub draws: usize,
    /// What counts as sure: the probability in an interval, and that with which groups and `--keep auto` are decided.
    pub level: f64,
    /// How many degrees of freedom the mean spread of the set's repeats is worth beside a demonstration's own.
    pub pooling: f64,
}

impl Default for Resampling {
    fn default() -> Self {
        Self { draws: 4000, level: 0.9, pooling: 4.0 }
    }
}

/// Scores that are drawn at most ...
const MOST_SCORES: usize = 10_000_000;
/// ... but each demonstration's so often at least.
const LEAST_DRAWS: usize = 1000;

impl Resampling {
    /// Draws for so many demonstrations.
    fn draws_of(&self, demonstrations: usize) -> usize {
        self.draws.min((MOST_SCORES / demonstrations).max(LEAST_DRAWS))
    }
}

/// How sure a judgment is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Uncertainty {
    /// The probability in each interval.
    pub level: f64,
    /// Whether a part of the noise could not be seen, so that intervals are too narrow; [`Uncertainty::caveat`] says why.
    pub too_narrow: bool,
    /// Adaptations per demonstration and variant; the least where some got more.
    pub repeats: usize,
    /// M.
    pub evaluations: usize,
    /// The demonstrations, the most suitable first, ties by id.
    pub demonstrations: Vec<Doubt>,
    /// For each K from 1: how probable it is that the first K are the K best. Not stored, as [`Doubt::top`].
    #[serde(skip)]
    pub top_set: Vec<f64>,
    /// The same demonstrations in groups that this budget cannot tell apart: a group is led by the best demonstration
    /// that is in no group yet, and holds those after it down to the first whose difference from the leader has an
    /// interval without 0. Neighbors on two sides of a border may be as close as neighbors within a group.
    pub groups: Vec<Vec<DemoId>>,
}

/// How sure the judgment of one demonstration is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Doubt {
    /// v_i.
    pub demo: DemoId,
    /// S, the mean over variants (Eq. 8).
    #[serde(rename = "score")]
    pub gain: Score,
    /// Lower end of the interval of S.
    pub low: Score,
    /// Upper end of the interval of S.
    pub high: Score,
    /// Probability that imitating it makes the agent better: that S > 0.
    pub improves: f64,
    /// Probability that it is nearer to the best of the set than to the median one.
    pub near_best: f64,
    /// For each K from 1: probability that it belongs to the K best; ties share the places that they compete for.
    ///
    /// Not stored, as [`uncertainty`] makes them again from the scores. It is empty in what was read from a file.
    #[serde(skip)]
    pub top: Chances,
}

/// How probable it is to be among the K best, for one K.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Top {
    /// K.
    pub k: usize,
    /// Probability that the first K are the K best.
    pub first_k: f64,
    /// For each demonstration, in the order of the ranking, the probability that it is one of the K best.
    pub demonstrations: Vec<InTop>,
}

/// How probable it is that one demonstration is among the K best.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct InTop {
    /// v_i.
    pub demo: DemoId,
    /// That probability.
    pub probability: f64,
}

impl Uncertainty {
    /// Says why the intervals are too narrow, if they are.
    pub fn caveat(&self) -> Option<String> {
        let (what, key) = match (self.repeats, self.evaluations) {
            (1, 1) => ("imitated once and evaluated on one episode", "repeats and evaluations"),
            (1, _) => ("imitated once", "repeats"),
            (_, 1) => ("evaluated on one episode", "evaluations"),
            _ => return None,
        };
        // Two judges may decide together, and the one with fewer is not known here.
        Some(format!(
            "Each demonstration was {what}, so what another try would change is not in these intervals and \
             probabilities: they look surer than they are. With {key} of 2 or more in judge, cloning_judge.judging or \
             trainer_judge, whichever decides, they are honest."
        ))
    }

    /// What is known of one demonstration.
    pub fn of(&self, demo: DemoId) -> Option<&Doubt> {
        self.demonstrations.iter().find(|doubt| doubt.demo == demo)
    }

    /// How probable each demonstration is among the K best; `None` where there is no such K, or this was read from a file.
    pub fn top(&self, k: usize) -> Option<Top> {
        let among = |doubt: &Doubt| Some(InTop { demo: doubt.demo, probability: doubt.top.at(k)? });
        let demonstrations = self.demonstrations.iter().map(among).collect::<Option<_>>()?;
        Some(Top { k, first_k: *self.top_set.get(k.checked_sub(1)?)?, demonstrations })
    }

    /// Which demonstrations to learn from, by their probabilities alone; the most suitable first, never none.
    ///
    /// The rule of `--keep auto`: a demonstration is kept if it surely makes the agent better, and is not surely nearer to
    /// the median of the set than to its best, where sure is a probability of [`Uncertainty::level`].
    /// The first half keeps out what does harm or nothing; the second keeps out the mediocre, and with a small budget,
    /// which can rule out little, it keeps more rather than fewer.
    /// Where nothing surely makes the agent better, the second half decides alone.
    pub fn worth_keeping(&self) -> Vec<DemoId> {
        let of = |doubts: Vec<&Doubt>| doubts.into_iter().map(|doubt| doubt.demo).collect::<Vec<_>>();
        let near = of(self.demonstrations.iter().filter(|doubt| self.may_be_near_the_best(doubt)).collect());
        let first = of(self.demonstrations.iter().take(1).collect());
        [self.surely_helpful(), near, first].into_iter().find(|kept| !kept.is_empty()).unwrap_or_default()
    }

    /// What surely makes the agent better and is not surely nearer to the median of the set than to its best; none where
    /// nothing surely helps.
    pub fn surely_helpful(&self) -> Vec<DemoId> {
        let improves = |doubt: &&Doubt| doubt.improves >= self.level && self.may_be_near_the_best(doubt);
        self.demonstrations.iter().filter(improves).map(|doubt| doubt.demo).collect()
    }

    fn may_be_near_the_best(&self, doubt: &Doubt) -> bool {
        doubt.near_best > 1.0 - self.level
    }
}

/// Draws the judgment again and counts; the same table in another order gives the same bits.
///
/// # Errors
/// Bad input if the table is not whole: every demonstration under every variant, with as many repeats and evaluations.
///
/// ```
/// use demosift::basics::seed::Seed;
/// use demosift::data::demonstration::DemoId;
/// use demosift::results::uncertainty::{Resampling, uncertainty};
/// use demosift::stages::judge::{ScoreTable, Suitability};
/// use demosift::world::environment::EnvVariant;
///
/// // Imitated twice, and evaluated on two episodes each time.
/// let found = |demo, after: [[f64; 2]; 2]| Suitability {
///     demo: DemoId(demo),
///     variant: EnvVariant(0),
///     before: vec![vec![0.0, 0.2]],
///     after: after.map(|scores| scores.to_vec()).to_vec(),
///     distances: vec![0.0; 2],
///     curves: vec![vec![]; 2],
///     evaluated: None,
/// };
/// let table = ScoreTable::new(vec![
///     found(0, [[1.0, 1.2], [0.8, 1.1]]),
///     found(1, [[0.0, 0.1], [0.1, 0.2]]),
///     found(2, [[1.1, 1.3], [0.8, 1.0]]),
/// ]);
/// let found = uncertainty(&table, &Resampling::default(), &Seed::new(1))?;
///
/// // The first and the third made the agent better, and which of the two is better nobody knows after so few tries.
/// assert_eq!(found.groups, [vec![DemoId(2), DemoId(0)], vec![DemoId(1)]]);
/// assert_eq!(found.worth_keeping(), [DemoId(2), DemoId(0)]);
/// let first = &found.demonstrations[0];
/// assert!(first.low < first.gain && first.gain < first.high);
/// let best = first.top.at(1).expect("the best one");
/// assert!((0.3..0.8).contains(&best), "to be the best: {best}");
/// # Ok::<(), demosift::Error>(())
/// ```
pub fn uncertainty(table: &ScoreTable, resampling: &Resampling, seed: &Seed) -> Result<Uncertainty> {
    together(&[Measured { table, seed }], resampling)
}

/// A table, and the random numbers by which it is drawn again.
#[derive(Clone, Copy, Debug)]
pub struct Measured<'a> {
    /// S of each demonstration.
    pub table: &'a ScoreTable,
    /// Of the draws.
    pub seed: &'a Seed,
}

/// How sure the mean of several judgments of the same demonstrations is, each of which is drawn again by itself.
///
/// # Errors
/// Bad input if there is no table, one is not whole, or they are about different demonstrations.
pub fn together(measured: &[Measured<'_>], resampling: &Resampling) -> Result<Uncertainty> {
    let drawn = measured.iter().map(|measured| drawn(measured, resampling)).collect::<Result<Vec<_>>>()?;
    let Drawn { demos, gains, draws, repeats, evaluations } = mean_of_drawn(drawn)?;
    let mut top = top_probabilities(&draws);
    let improves = share(&draws, |_| 0.0, |score, bar| score > bar);
    let near_best = share(&draws, between_median_and_best, |score, bar| score >= bar);
    let order = places(&demos, &gains);
    let mut doubt = |&index: &usize| {
        let (low, high) = interval(draws.iter().map(|draw| draw[index]).collect(), resampling.level);
        Doubt {
            demo: demos[index],
            gain: gains[index],
            low,
            high,
            improves: improves[index],
            near_best: near_best[index],
            top: std::mem::take(&mut top[index]),
        }
    };
    let top_set = top_set_probabilities(&draws, &order);
    let demonstrations: Vec<Doubt> = order.iter().map(&mut doubt).collect();
    let groups = groups(&draws, &order, resampling.level);
    let groups =
        groups.into_iter().map(|group| group.into_iter().map(|index| demos[index]).collect()).collect();
    let too_narrow = repeats == 1 || evaluations == 1;
    let level = resampling.level;
    Ok(Uncertainty { level, too_narrow, repeats, evaluations, demonstrations, top_set, groups })
}

/// A judgment, drawn again.
struct Drawn {
    /// In an order that does not depend on ids.
    demos: Vec<DemoId>,
    /// S of each.
    gains: Vec<Score>,
    /// `[draws][demonstrations]`.
    draws: Vec<Vec<Score>>,
    repeats: usize,
    evaluations: usize,
}

fn drawn(measured: &Measured<'_>, resampling: &Resampling) -> Result<Drawn> {
    let (judged, repeats, evaluations) = judged(measured.table)?;
    let draws = draw(&judged, evaluations, resampling, measured.seed)?;
    let (demos, gains) = judged.iter().map(|judged| (judged.demo, judged.gain)).unzip();
    Ok(Drawn { demos, gains, draws, repeats, evaluations })
}

/// In the order of the first; of repeats and evaluations the fewest.
fn mean_of_drawn(drawn: Vec<Drawn>) -> Result<Drawn> {
    let count = drawn.len() as f64;
    let mut drawn = drawn.into_iter();
    let mut sum = drawn.next().ok_or_else(|| Error::bad_input("there is no judgment to be sure of"))?;
    for other in drawn {
        let place_of: BTreeMap<DemoId, usize> =
            other.demos.iter().enumerate().map(|(place, demo)| (*demo, place)).collect();
        let places: Option<Vec<usize>> = sum.demos.iter().map(|demo| place_of.get(demo).copied()).collect();
        let places = places.filter(|places| places.len() == place_of.len()).ok_or_else(|| {
            Error::bad_input("the judgments are about different demonstrations, and have no mean")
        })?;
        let add = |sum: &mut [Score], other: &[Score]| {
            sum.iter_mut().zip(&places).for_each(|(sum, place)| *sum += other[*place]);
        };
        add(&mut sum.gains, &other.gains);
        sum.draws.iter_mut().zip(&other.draws).for_each(|(sum, other)| add(sum, other));
        sum.repeats = sum.repeats.min(other.repeats);
        sum.evaluations = sum.evaluations.min(other.evaluations);
    }
    let scores = sum.draws.iter_mut().flatten().chain(&mut sum.gains);
    scores.for_each(|score| *score /= count);
    Ok(sum)
}

/// What was measured of one demonstration.
struct Judged {
    demo: DemoId,
    gain: Score,
    variants: Vec<UnderVariant>,
}

/// What was measured of one demonstration under one variant.
struct UnderVariant {
    /// After less before on each evaluation seed, the mean over repeats, `[M]`.
    gains: Vec<Score>,
    /// Squared deviations of the repeats' means from their mean, summed.
    repeat_squares: f64,
    /// How many repeats there were.
    repeats: usize,
    /// The mean score of each agent before, of which there is one or one a repeat.
    starts: Vec<Score>,
}

/// The table by demonstration, in an order that does not depend on ids, with the numbers of repeats and evaluations.
fn judged(table: &ScoreTable) -> Result<(Vec<Judged>, usize, usize)> {
    let first = table.suitabilities.first().ok_or_else(|| Error::bad_input("the score table is empty"))?;
    let repeats = table.repeats();
    let evaluations = first.before.first().map_or(0, Vec::len);
    if repeats == 0 || evaluations == 0 {
        return Err(Error::bad_input(
            "the score table holds no scores; at least 1 repeat and 1 evaluation are needed",
        ));
    }
    let variants = table.variants();
    let mut by_demo: BTreeMap<DemoId, Vec<&Suitability>> = BTreeMap::new();
    table.suitabilities.iter().for_each(|of| by_demo.entry(of.demo).or_default().push(of));
    let mut judged = Vec::with_capacity(by_demo.len());
    for (demo, found) in by_demo {
        let mut of_demo = Vec::with_capacity(variants.len());
        for &variant in &variants {
            let mut found = found.iter().filter(|s| s.variant == variant).copied();
            let (Some(one), None) = (found.next(), found.next()) else {
                return Err(Error::bad_input(format!(
                    "the score table must hold demonstration {demo} under variant {} exactly once",
                    variant.0
                )));
            };
            check_shape(one, evaluations)?;
            of_demo.push(one);
        }
        let gain = mean_of(of_demo.iter().map(|s| s.gain()));
        judged.push(Judged { demo, gain, variants: of_demo.into_iter().map(under_variant).collect() });
    }
    judged.sort_by(compare);
    Ok((judged, repeats, evaluations))
}

fn check_shape(one: &Suitability, evaluations: usize) -> Result<()> {
    if one.after.iter().chain(&one.before).all(|scores| scores.len() == evaluations) {
        return Ok(());
    }
    Err(Error::bad_input(format!(
        "the score table must hold {evaluations} evaluations in each repeat of each demonstration, and holds others for \
         demonstration {}",
        one.demo
    )))
}

fn under_variant(suitability: &Suitability) -> UnderVariant {
    let Suitability { before, after, .. } = suitability;
    let at =
        |repeats: &[Vec<Score>], evaluation: usize| mean_of(repeats.iter().map(|scores| scores[evaluation]));
    let evaluations = before.first().map_or(0, Vec::len);
    let repeats: Vec<f64> = after.iter().map(|scores| mean(scores)).collect();
    UnderVariant {
        gains: (0..evaluations).map(|evaluation| at(after, evaluation) - at(before, evaluation)).collect(),
        repeat_squares: squared_deviations(&repeats),
        repeats: repeats.len(),
        starts: before.iter().map(|scores| mean(scores)).collect(),
    }
}

/// By everything that was measured, so that the order of the demonstrations in the set does not count.
fn compare(left: &Judged, right: &Judged) -> std::cmp::Ordering {
    let numbers = |judged: &Judged| -> Vec<f64> {
        let of = |under: &UnderVariant| {
            [under.repeat_squares].into_iter().chain(under.gains.clone()).collect::<Vec<_>>()
        };
        [judged.gain].into_iter().chain(judged.variants.iter().flat_map(of)).collect()
    };
    let (left, right) = (numbers(left), numbers(right));
    let unequal = left.iter().zip(&right).map(|(left, right)| left.total_cmp(right));
    unequal.into_iter().find(|order| order.is_ne()).unwrap_or(std::cmp::Ordering::Equal)
}

/// The middle part of some draws that holds `level` of them.
fn interval(mut draws: Vec<f64>, level: f64) -> (f64, f64) {
    draws.sort_unstable_by(f64::total_cmp);
    (quantile(&draws, (1.0 - level) / 2.0), quantile(&draws, (1.0 + level) / 2.0))
}

/// For each demonstration the share of draws in which its score passes the bar that the draw sets.
fn share(
    draws: &[Vec<Score>],
    bar: impl Fn(&[Score]) -> Score,
    passes: impl Fn(Score, Score) -> bool,
) -> Vec<f64> {
    let mut counts = vec![0.0; draws[0].len()];
    for draw in draws {
        let bar = bar(draw);
        counts.iter_mut().zip(draw).for_each(|(count, score)| *count += f64::from(passes(*score, bar)));
    }
    counts.into_iter().map(|count| count / draws.len() as f64).collect()
}

/// Half of the way from the median of the scores to the best.
fn between_median_and_best(scores: &[Score]) -> Score {
    let best = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut scores = scores.to_vec();
    let (lower, middle) = ((scores.len() - 1) / 2, scores.len() / 2);
    let (below, upper, _) = scores.select_nth_unstable_by(middle, f64::total_cmp);
    let lower = if lower < middle { below.iter().copied().fold(f64::NEG_INFINITY, f64::max) } else { *upper };
    let median = (lower + *upper) / 2.0;
    (median + best) / 2.0
}

/// Indices from the most to the least suitable, ties by id.
fn places(demos: &[DemoId], gains: &[Score]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..demos.len()).collect();
    order.sort_by(|&a, &b| gains[b].total_cmp(&gains[a]).then(demos[a].cmp(&demos[b])));
    order
}

/// For each K from 1 the share of draws in which all of the first K are above all others.
fn top_set_probabilities(draws: &[Vec<Score>], order: &[usize]) -> Vec<f64> {
    let mut counts = vec![0.0; order.len()];
    for draw in draws {
        let mut best_below = vec![f64::NEG_INFINITY; order.len() + 1];
        for (place, &demonstration) in order.iter().enumerate().rev() {
            best_below[place] = best_below[place + 1].max(draw[demonstration]);
        }
        let mut worst_above = f64::INFINITY;
        for (place, &demonstration) in order.iter().enumerate() {
            worst_above = worst_above.min(draw[demonstration]);
            counts[place] += f64::from(worst_above > best_below[place + 1]);
        }
    }
    counts.into_iter().map(|count| count / draws.len() as f64).collect()
}

/// Walks down the ranking and begins a group at each demonstration that can be told from the leader of the last one.
///
/// Chaining neighbors that cannot be told apart would put a whole ranking into one group as soon as its steps are
/// small, however far its ends are apart.
fn groups(draws: &[Vec<Score>], order: &[usize], level: f64) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for &demonstration in order {
        let is_worse = |leader: usize| {
            let differences = draws.iter().map(|draw| draw[leader] - draw[demonstration]).collect();
            interval(differences, level).0 > 0.0
        };
        match groups.last_mut() {
            Some(group) if !is_worse(group[0]) => group.push(demonstration),
            _ => groups.push(vec![demonstration]),
        }
    }
    groups
}

#[cfg(test)]
mod tests;
