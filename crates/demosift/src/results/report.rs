//! All that a run found, gathered into one value to be shown to a person.
//!
//! The report concludes nothing that the results of the flow do not say: it puts them side by side, in the order of the
//! ranking, and works out what only a picture needs, such as the band of an adaptation curve over its repeats.
//! How it looks is not said here; the command writes it into a page.
//!
//! A run may stand anywhere behind judging: what it has not found yet is not there.

mod shown;

use std::collections::BTreeSet;

use serde::Serialize;

use crate::basics::error::{Error, Result};
use crate::basics::ledger::Ledger;
use crate::data::demonstration::{DemoId, DemonstrationSet};
use crate::learning::adapt::UpdateReport;
use crate::math::arithmetic::Arithmetic;
use crate::math::statistics;
use crate::results::artifact::Artifact;
use crate::results::data_only::{Column, DataOnly};
use crate::results::gain;
use crate::results::gain::Gain;
use crate::results::panel::{self, Disagreement, Judge, Order, Panel, Vote};
use crate::stages::imitate::{CurvePoint, LearningCurve};
use crate::stages::judge::{Judged, ScoreTable, Suitability};
use crate::stages::method::{Account, Costs};
use crate::stages::referee::Verdict;
use crate::stages::select::{self, Keep, Ranking, Subset};
use crate::stages::subset_selection::{Weighing, WeighingEnd};
use crate::world::environment::{EnvVariant, Task};
use crate::world::heuristic::Score;
use crate::world::trainer::TrainerIdentity;

pub use shown::{MOST_WORTH_A_LOOK, Moment, Shown, agent_episodes, typical_evaluation, worth_a_look};

/// What a report is made of.
pub struct Sources<'a> {
    /// Stores the results of the run.
    pub ledger: &'a dyn Ledger,
    /// V.
    pub set: &'a DemonstrationSet,
    /// The task that was played.
    pub task: &'a dyn Task,
    /// How many were to be kept.
    pub keep: Keep,
    /// Under which name the policy is stored that one training made of the kept.
    pub kept_part: &'a str,
    /// What the judges say.
    pub panel: &'a Panel,
    /// What scorers of the recordings alone say.
    pub data_only: &'a DataOnly,
    /// What the recorded demonstrations themselves scored, where the simulator could tell.
    pub own_heuristic: Option<&'a Column>,
    /// What was played.
    pub costs: &'a Costs,
}

/// All that a run found.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// The task's name.
    pub task: String,
    /// Names of its variants.
    pub variants: Vec<String>,
    /// Control steps in an episode.
    pub horizon: usize,
    /// Simulated seconds of a control step.
    pub control_step_secs: f64,
    /// Of the heuristic.
    pub unit: String,
    /// How the agent of the paper's judge was prepared.
    pub method: String,
    /// Those that judged, in the order in which they were asked.
    pub judges: Vec<JudgeShown>,
    /// Spearman's rank correlation between the judges, where there are two.
    pub agreement: Option<f64>,
    /// Where one judge is sure that a demonstration belongs to the best, and the other that it does not.
    pub disagreements: Vec<Disagreement>,
    /// How many were to be kept, as it was asked for.
    pub keep: String,
    /// K of [`Entry::top`]: as many as were kept; before anything is kept, a quarter of the set.
    pub k: usize,
    /// Whether anything was kept yet.
    pub has_subset: bool,
    /// Mean heuristic of the deciding judges' agents before imitating anything, over variants.
    pub before: Score,
    /// The probability in each interval.
    pub level: f64,
    /// Why the intervals are too narrow, if they are.
    pub caveat: Option<String>,
    /// The demonstrations, the most suitable first.
    pub entries: Vec<Entry>,
    /// How many groups of demonstrations could be told apart.
    pub groups: usize,
    /// How probable it is that the first K are the K best.
    pub top_set: f64,
    /// The adapted behaviors distance (Table 1) over the set, by the judge that decides; of both the paper's.
    pub adapted_behaviors_distance: f64,
    /// One per judge, demonstration and variant, in the order of judging.
    pub curves: Vec<AdaptationCurve>,
    /// What the recordings alone say.
    pub data_only: Vec<ColumnShown>,
    /// What the recorded demonstrations themselves scored, where the simulator could tell.
    pub own_heuristic: Option<ColumnShown>,
    /// What the referee says, where it was asked.
    pub verdict: Option<Verdict>,
    /// The policy from the kept demonstrations beside the one from all, by one training each, where both were trained.
    pub learning: Option<Learning>,
    /// How the weights went (Algorithm 3), where they were asked for.
    pub weights: Option<WeightTrends>,
    /// What was played.
    pub costs: Spending,
}

/// A place of the ranking.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Entry {
    /// v_i.
    pub demo: DemoId,
    /// T of the recording, control steps.
    pub steps: usize,
    /// Mean heuristic after imitating it.
    pub after: Score,
    /// S (Eq. 8), the mean over variants.
    pub gain: Score,
    /// Lower end of the interval of S.
    pub low: Score,
    /// Upper end of the interval of S.
    pub high: Score,
    /// Probability that S > 0.
    pub improves: f64,
    /// Probability that it belongs to the K best.
    pub top: f64,
    /// The group of demonstrations that it cannot be told from, counted from 1.
    pub group: usize,
    /// Whether it was kept.
    pub kept: bool,
    /// What each judge says of it, in the order of [`Report::judges`]; `None` where it did not judge it.
    pub by_judge: Vec<Option<Said>>,
    /// S under each variant, in the order of the variants; empty where there is only one.
    pub by_variant: Vec<Score>,
}

/// A judge of the set.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JudgeShown {
    /// Who.
    pub judge: Judge,
    /// Which trainer, where it is somebody else's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trainer: Option<TrainerIdentity>,
    /// Whether its order is the one that is taken, or its gains are in the mean of both that gives it.
    pub decides: bool,
    /// How many demonstrations it judged: all, or those near the cut.
    pub judged: usize,
    /// The adapted behaviors distance (Table 1) over those that it judged.
    pub adapted_behaviors_distance: f64,
    /// Whether what it says counts.
    pub vote: Vote,
    /// How far its repeats agree with each other.
    pub agrees_with_itself: Option<f64>,
}

/// What one judge says of a demonstration.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Said {
    /// Its place, from 1.
    pub place: usize,
    /// S (Eq. 8).
    pub gain: Score,
    /// Lower end of the interval of S.
    pub low: Score,
    /// Upper end of the interval of S.
    pub high: Score,
}

/// What the repeats of an adaptation went through.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct AdaptationCurve {
    /// Whose.
    pub judge: Judge,
    /// v_i.
    pub demo: DemoId,
    /// e_j.
    pub variant: EnvVariant,
    /// Mean K of the agent that these curves start from, as it was scored.
    pub before: Score,
    /// Mean K after imitating, as it was scored.
    pub after: Score,
    /// The heuristic of what was played before each update, `[iterations]`; empty where nothing was played.
    pub score: Vec<Band>,
    /// Share of pairs that the discriminator told right, `[iterations]`; empty where there was none.
    pub accuracy: Vec<Band>,
}

/// A number over the repeats.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Band {
    /// The least.
    pub low: f64,
    /// The mean.
    pub mean: f64,
    /// The largest.
    pub high: f64,
}

/// A column of numbers beside the ranking.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ColumnShown {
    /// The scorer.
    pub name: String,
    /// What its number is.
    pub meaning: String,
    /// One an entry of the ranking, in its order; higher is better by the scorer's lights.
    pub scores: Vec<f64>,
    /// The place that the scorer would give each, from 1; those alike share the mean of their places.
    pub places: Vec<f64>,
    /// Spearman's rank correlation with the gains; `None` where the scorer finds all alike.
    pub spearman: Option<f64>,
}

/// The policy from the kept demonstrations beside the one from all.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Learning {
    /// Learning curve of the kept.
    pub subset: Vec<CurvePoint>,
    /// Learning curve of all.
    pub all: Vec<CurvePoint>,
    /// The best policy from the kept, on episodes that did not choose it.
    pub from_subset: CurvePoint,
    /// The best policy from all, likewise.
    pub from_all: CurvePoint,
    /// How much better the first is.
    pub gain: Gain,
    /// Whether all were kept, so that there is nothing to compare.
    pub is_all: bool,
}

/// W over the rounds of Algorithm 3.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct WeightTrends {
    /// After each round, `[rounds][n]`, in the order of the set.
    pub rounds: Vec<Vec<f64>>,
    /// Why there were no more.
    pub end: WeighingEnd,
    /// What ended up heavy enough.
    pub demos: Vec<DemoId>,
}

/// Environment steps.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Spending {
    /// What every method may spend on learning to imitate and on judging.
    pub quota: u64,
    /// What was spent of that.
    pub of_quota: u64,
    /// Each finished stage.
    pub stages: Vec<(String, u64)>,
    /// What of it is paid once and what for each demonstration, where the judge of the paper judged.
    pub account: Option<Account>,
    /// What it was computed with; of several, the same seed need not give the same bits elsewhere.
    pub arithmetic: BTreeSet<Arithmetic>,
}

/// Gathers what the ledger holds.
///
/// # Errors
/// `is_bad_input` if the run has not judged yet, or a file of it is damaged.
pub fn report(sources: &Sources<'_>) -> Result<Report> {
    let Sources { ledger, set, task, panel, .. } = *sources;
    let Order { ranking, uncertainty } = panel.deciding();
    let tables: Vec<ScoreTable> =
        panel.decides.each().iter().map(|judge| Ok(judged(ledger, *judge)?.scores)).collect::<Result<_>>()?;
    let deciding: Vec<&ScoreTable> = tables.iter().collect();
    let subset = Subset::recall(ledger, "")?;
    let kept = subset.as_ref().map_or(&[][..], |subset| &subset.demos);
    let k = if kept.is_empty() { select::quarter(set.len()) } else { kept.len() };
    let specification = task.specification();
    let before: Vec<Score> = ranking.entries.iter().map(|entry| entry.before).collect();
    Ok(Report {
        task: specification.name.clone(),
        variants: specification.variants.clone(),
        horizon: specification.horizon,
        control_step_secs: specification.control_step_secs,
        unit: task.heuristic().unit().to_owned(),
        method: sources.costs.method.to_string(),
        judges: shown_judges(ledger, panel)?,
        agreement: panel.agreement,
        disagreements: panel.disagreements.clone(),
        keep: sources.keep.to_string(),
        k,
        has_subset: subset.is_some(),
        before: statistics::mean(&before),
        level: uncertainty.level,
        caveat: uncertainty.caveat(),
        entries: entries(sources, &deciding, kept, k)?,
        groups: uncertainty.groups.len(),
        top_set: uncertainty.top_set.get(k - 1).copied().unwrap_or(f64::NAN),
        adapted_behaviors_distance: tables.last().map_or(f64::NAN, ScoreTable::adapted_behaviors_distance),
        curves: curves(sources)?,
        data_only: sources.data_only.columns.iter().map(|column| beside(ranking, column)).collect(),
        own_heuristic: sources.own_heuristic.map(|column| beside(ranking, column)),
        verdict: Verdict::recall(ledger, "")?,
        learning: learning(sources)?,
        weights: Weighing::recall(ledger, "")?.map(trends),
        costs: spending(sources.costs),
    })
}

/// What a judge found; the error says that it has not found anything yet.
pub fn judged(ledger: &dyn Ledger, judge: Judge) -> Result<Judged> {
    Judged::recall(ledger, judge.name())?.ok_or_else(|| {
        Error::bad_input("the run has not judged its demonstrations yet, so there is nothing to report")
            .with_hint("go on with it by `demosift sift --resume`")
    })
}

fn shown_judges(ledger: &dyn Ledger, panel: &Panel) -> Result<Vec<JudgeShown>> {
    let shown = |opinion: &panel::Opinion| {
        let panel::Opinion { judge, vote, agrees_with_itself, .. } = *opinion;
        let scores = judged(ledger, judge)?.scores;
        Ok(JudgeShown {
            judge,
            adapted_behaviors_distance: scores.adapted_behaviors_distance(),
            trainer: scores.trainer,
            decides: panel.decides.each().contains(&judge),
            judged: opinion.judged(),
            vote,
            agrees_with_itself,
        })
    };
    panel.opinions.iter().map(shown).collect()
}

/// The adaptation curves of all judges.
fn curves(sources: &Sources<'_>) -> Result<Vec<AdaptationCurve>> {
    let mut curves = Vec::new();
    for opinion in &sources.panel.opinions {
        let scores = judged(sources.ledger, opinion.judge)?.scores;
        curves.extend(scores.suitabilities.iter().map(|of| curve(opinion.judge, of)));
    }
    Ok(curves)
}

fn entries(sources: &Sources<'_>, deciding: &[&ScoreTable], kept: &[DemoId], k: usize) -> Result<Vec<Entry>> {
    let Order { ranking, uncertainty } = sources.panel.deciding();
    let variants = sources.task.specification().variants.len();
    let under: Vec<Ranking> = match variants {
        1 => Vec::new(),
        count => {
            (0..count).map(|variant| select::rank_together_under(deciding, EnvVariant(variant))).collect()
        }
    };
    let entry = |entry: &select::Ranked| {
        let demo = entry.demo;
        let doubt = uncertainty.of(demo).ok_or_else(|| foreign(demo))?;
        let gain = |ranking: &Ranking| {
            ranking.entries.iter().find(|entry| entry.demo == demo).map_or(f64::NAN, |entry| entry.gain)
        };
        let group = uncertainty.groups.iter().position(|group| group.contains(&demo));
        Ok(Entry {
            demo,
            steps: sources.set.get(demo).steps(),
            after: entry.after,
            gain: entry.gain,
            low: doubt.low,
            high: doubt.high,
            improves: doubt.improves,
            top: doubt.top.at(k).ok_or_else(|| foreign(demo))?,
            group: 1 + group.ok_or_else(|| foreign(demo))?,
            kept: kept.contains(&demo),
            by_judge: sources.panel.opinions.iter().map(|opinion| said(opinion, demo)).collect(),
            by_variant: under.iter().map(gain).collect(),
        })
    };
    ranking.entries.iter().map(entry).collect()
}

fn said(opinion: &panel::Opinion, demo: DemoId) -> Option<Said> {
    let doubts = &opinion.uncertainty.demonstrations;
    let place = doubts.iter().position(|doubt| doubt.demo == demo)?;
    let doubt = &doubts[place];
    Some(Said { place: place + 1, gain: doubt.gain, low: doubt.low, high: doubt.high })
}

fn foreign(demo: DemoId) -> Error {
    Error::bad_input(format!("the uncertainty of the scores says nothing of demonstration {demo}"))
}

fn curve(judge: Judge, of: &Suitability) -> AdaptationCurve {
    AdaptationCurve {
        judge,
        demo: of.demo,
        variant: of.variant,
        before: of.mean_before(),
        after: of.mean_after(),
        score: bands(&of.curves, |update| update.score),
        accuracy: bands(&of.curves, |update| update.discriminator_accuracy),
    }
}

/// A number of each update over the repeats whose curves were kept, as far as every one of them has it.
fn bands(curves: &[Vec<UpdateReport>], number: impl Fn(&UpdateReport) -> Option<f64>) -> Vec<Band> {
    let curves: Vec<&Vec<UpdateReport>> = curves.iter().filter(|curve| !curve.is_empty()).collect();
    let updates = curves.iter().map(|curve| curve.len()).min().unwrap_or(0);
    let band = |update: usize| {
        let values: Option<Vec<f64>> = curves.iter().map(|curve| number(&curve[update])).collect();
        values.map(|values| Band {
            low: values.iter().copied().fold(f64::INFINITY, f64::min),
            mean: statistics::mean(&values),
            high: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        })
    };
    (0..updates).map_while(band).collect()
}

/// A column in the order of the ranking.
fn beside(ranking: &Ranking, column: &Column) -> ColumnShown {
    let scores = ranking.ordered(&column.scores);
    let (name, meaning) = (column.name.clone(), column.meaning.clone());
    ColumnShown { name, meaning, places: places(&scores), scores, spearman: column.agreement(ranking) }
}

/// The place of each from 1, the highest first; those alike share the mean of their places.
fn places(scores: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..scores.len()).collect();
    order.sort_by(|&one, &other| scores[other].total_cmp(&scores[one]));
    let (mut places, mut better) = (vec![0.0; scores.len()], 0);
    for alike in order.chunk_by(|&one, &other| scores[one] == scores[other]) {
        let place = better as f64 + (alike.len() as f64 + 1.0) / 2.0;
        alike.iter().for_each(|&index| places[index] = place);
        better += alike.len();
    }
    places
}

fn learning(sources: &Sources<'_>) -> Result<Option<Learning>> {
    let Sources { ledger, set, kept_part, .. } = *sources;
    let (subset, all) = (LearningCurve::recall(ledger, kept_part)?, LearningCurve::recall(ledger, "all")?);
    Ok(subset.zip(all).map(|(subset, all)| Learning {
        gain: gain::gain(&subset.outcome, &all.outcome),
        is_all: subset.demos.len() == set.len(),
        subset: subset.points,
        all: all.points,
        from_subset: subset.outcome,
        from_all: all.outcome,
    }))
}

fn trends(weighing: Weighing) -> WeightTrends {
    let rounds = weighing.rounds.iter().map(|round| round.weights.iter().map(|(_, weight)| weight).collect());
    WeightTrends { rounds: rounds.collect(), end: weighing.end, demos: weighing.demos }
}

fn spending(costs: &Costs) -> Spending {
    let stages = costs.spent.iter().map(|(stage, spent)| (stage.clone(), spent.environment_steps));
    Spending {
        quota: costs.budget.quota,
        of_quota: costs.of_quota(),
        stages: stages.collect(),
        account: costs.account(),
        arithmetic: costs.arithmetic(),
    }
}

#[cfg(test)]
mod tests;
