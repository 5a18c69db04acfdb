//! What `--json` shows, a type for each command; `docs/json.md` says what each field is.

#[cfg(test)]
mod schema_tests;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use demosift::data::demonstration::DemoId;
use demosift::data::demonstration::inspection::{Inspection, Look};
use demosift::data::demonstration::listing::ColumnSeen;
use demosift::data::likeness::Likeness;
use demosift::math::arithmetic::Arithmetic;
use demosift::results::data_only::Column;
use demosift::results::gain::Gain;
use demosift::results::panel::{self, Disagreement, Opinion, Panel, Together, Vote};
use demosift::results::report::Report;
use demosift::results::standing::Standing;
use demosift::results::uncertainty::{Top, Uncertainty};
use demosift::run::experiment::Selection;
use demosift::run::forecast::Forecast;
use demosift::run::study::Study;
use demosift::run::study::claims::Decided;
use demosift::run::study::summary::Summary;
use demosift::run::study::told::Told;
use demosift::stages::imitate::CurvePoint;
use demosift::stages::judge::ScoreTable;
use demosift::stages::method::{Account, Costs, Method};
use demosift::stages::referee::Verdict;
use demosift::stages::select::{Ranked, Ranking};
use demosift::stages::subset_selection::Weighing;
use demosift::world::heuristic::Score;
use demosift_mujoco::check::{Finding, Recorded, Seen, Tried};
use serde::Serialize;
use serde_json::{Map, Value};

use crate::job::Job;
use crate::job::identity::Data;
use crate::job::own_heuristic::Beside;
use crate::tables;
use crate::tables::standing::Found;
use crate::task::simulator::Simulator;

/// What a command found, and which run it is about.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct OfRun<'a, T> {
    #[serde(flatten)]
    found: T,
    unit: &'a str,
    variant: Option<&'a str>,
    run_folder: &'a Path,
}

impl<'a, T: Serialize> OfRun<'a, T> {
    pub(crate) fn new(job: &'a Job, found: T) -> Self {
        Self { found, unit: job.unit(), variant: job.variant(), run_folder: job.folder().path() }
    }

    pub(crate) fn value(&self) -> Value {
        serde_json::to_value(self).expect("plain data always serializes")
    }
}

/// A task of several goals: what was found for each.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Goals<'a> {
    pub(crate) goals: Map<String, Value>,
    pub(crate) judges: &'a Panel,
    pub(crate) run_folder: &'a Path,
}

/// `demosift sift`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Sift<'a> {
    #[serde(flatten)]
    pub(crate) selected: Select<'a>,
    #[serde(flatten)]
    pub(crate) columns: Columns<'a>,
    pub(crate) judges: &'a Panel,
    pub(crate) verdict: &'a Verdict,
    pub(crate) report: &'a Path,
}

/// `demosift select`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Select<'a> {
    ranking: &'a [Ranked],
    uncertainty: &'a Uncertainty,
    best: Option<Top>,
    caveat: Option<String>,
    kept: &'a [DemoId],
    weighing: Option<&'a Weighing>,
    costs: Spending,
}

impl<'a> Select<'a> {
    pub(crate) fn new(selection: &'a Selection, weighing: Option<&'a Weighing>, costs: &Costs) -> Self {
        let Selection { ranking, uncertainty, subset } = selection;
        Self {
            ranking: &ranking.entries,
            uncertainty,
            best: uncertainty.top(subset.demos.len()),
            caveat: uncertainty.caveat(),
            kept: &subset.demos,
            weighing,
            costs: Spending::of(costs),
        }
    }
}

/// What stands beside a ranking and never enters it.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Columns<'a> {
    data_only: Vec<BesideRanking<'a>>,
    own_heuristic: Option<BesideRanking<'a>>,
}

impl<'a> Columns<'a> {
    pub(crate) fn new(ranking: &Ranking, beside: &'a Beside) -> Self {
        let column = |column| BesideRanking::new(ranking, column);
        Self {
            data_only: beside.data_only.columns.iter().map(column).collect(),
            own_heuristic: beside.own.as_ref().map(column),
        }
    }
}

/// One number for each demonstration, in the order of the set.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct BesideRanking<'a> {
    #[serde(flatten)]
    column: &'a Column,
    spearman: Option<f64>,
}

impl<'a> BesideRanking<'a> {
    fn new(ranking: &Ranking, column: &'a Column) -> Self {
        Self { column, spearman: column.agreement(ranking) }
    }
}

/// `demosift judge --prior`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Standings<'a> {
    pub(crate) prior: &'a Path,
    pub(crate) decides: Option<panel::Judges>,
    pub(crate) judges: Vec<StandingsOfJudge<'a>>,
    pub(crate) likeness: Option<&'a [Likeness]>,
    pub(crate) costs: Spending,
}

/// Where new demonstrations stand under one goal by one judge, or by both together.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct StandingsOfJudge<'a> {
    judge: panel::Judges,
    goal: Option<&'a str>,
    kept_by_run: usize,
    standings: &'a [Standing],
}

impl<'a> StandingsOfJudge<'a> {
    pub(crate) fn new(found: &'a Found) -> Self {
        let Found { judges, goal, standings, kept, .. } = found;
        Self { judge: *judges, goal: goal.as_deref(), kept_by_run: *kept, standings }
    }
}

/// `demosift judge`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Judge<'a> {
    pub(crate) judges: Vec<OfJudge<'a>>,
    pub(crate) decides: panel::Judges,
    pub(crate) together: Option<&'a Together>,
    pub(crate) agreement: Option<f64>,
    pub(crate) disagreements: &'a [Disagreement],
    #[serde(flatten)]
    pub(crate) columns: Columns<'a>,
    pub(crate) costs: Spending,
}

/// What one judge says.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct OfJudge<'a> {
    judge: panel::Judge,
    vote: Vote,
    agrees_with_itself: Option<f64>,
    scores: &'a ScoreTable,
    adapted_behaviors_distance: f64,
    uncertainty: &'a Uncertainty,
    best: Option<Top>,
    caveat: Option<String>,
}

impl<'a> OfJudge<'a> {
    /// `k` is how many of the best of those that it judged are asked about.
    pub(crate) fn new(opinion: &'a Opinion, scores: &'a ScoreTable, k: usize) -> Self {
        Self {
            judge: opinion.judge,
            vote: opinion.vote,
            agrees_with_itself: opinion.agrees_with_itself,
            scores,
            adapted_behaviors_distance: scores.adapted_behaviors_distance(),
            uncertainty: &opinion.uncertainty,
            best: opinion.uncertainty.top(k),
            caveat: opinion.uncertainty.caveat(),
        }
    }
}

/// `demosift weigh`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Weigh<'a> {
    pub(crate) weighing: &'a Weighing,
    pub(crate) kept: &'a [DemoId],
    pub(crate) costs: Spending,
}

/// `demosift referee`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Referee<'a> {
    pub(crate) verdict: &'a Verdict,
}

/// `demosift meta-train`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct MetaTrain {
    pub(crate) costs: Spending,
}

/// `demosift imitate` of the kept demonstrations
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Imitate<'a> {
    pub(crate) kept: &'a [DemoId],
    pub(crate) from_subset: CurvePoint,
    pub(crate) from_all: CurvePoint,
    pub(crate) gain: Gain,
}

/// `demosift imitate` of demonstrations that are named
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct ImitateNamed<'a> {
    pub(crate) demonstrations: &'a [DemoId],
    pub(crate) outcome: CurvePoint,
}

/// Environment steps, beside the budget that all methods have.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Spending {
    method: Method,
    quota: u64,
    spent_of_quota: u64,
    environment_steps: BTreeMap<String, u64>,
    /// What of it is paid once and what for each demonstration, where the judge of the paper judged.
    account: Option<Account>,
    /// What it was computed with; of several, the same seed need not give the same bits elsewhere.
    arithmetic: BTreeSet<Arithmetic>,
}

impl Spending {
    pub(crate) fn of(costs: &Costs) -> Self {
        let stages = costs.spent.iter().map(|(stage, spent)| (stage.clone(), spent.environment_steps));
        Self {
            method: costs.method,
            quota: costs.budget.quota,
            spent_of_quota: costs.of_quota(),
            environment_steps: stages.collect(),
            arithmetic: costs.arithmetic(),
            account: costs.account(),
        }
    }
}

/// `--dry-run`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct DryRun<'a> {
    #[serde(flatten)]
    pub(crate) forecast: &'a Forecast,
    pub(crate) dry_run: bool,
    pub(crate) episodes_may_end_early: bool,
    pub(crate) threads: usize,
    /// Those of a task that has several; empty where it has one.
    pub(crate) goals: &'a [String],
    pub(crate) run_folder: &'a Path,
}

/// `demosift report`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct ReportMade<'a> {
    pub(crate) report: &'a Report,
    /// None where it could not be written.
    pub(crate) page: Option<&'a Path>,
}

/// `demosift record`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Record<'a, Provenance, Unseen> {
    pub(crate) provenance: &'a Provenance,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) unseen: Option<&'a Unseen>,
    pub(crate) run_folder: &'a Path,
}

/// `demosift inspect`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Inspect<'a> {
    pub(crate) path: &'a Path,
    pub(crate) inspection: &'a Inspection,
    pub(crate) columns_of_file: &'a [ColumnSeen],
    pub(crate) episodes_by_oddness: &'a [Look],
    pub(crate) learnable: bool,
    pub(crate) why_not: Option<&'a str>,
    pub(crate) way_out: Option<&'a str>,
    pub(crate) task: Option<&'a str>,
    pub(crate) fits_task: Option<bool>,
    pub(crate) why_it_does_not_fit: Option<&'a str>,
    pub(crate) findings: &'a [Finding],
}

/// `demosift convert`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Convert<'a> {
    pub(crate) episodes: usize,
    pub(crate) steps: usize,
    pub(crate) out: &'a Path,
}

/// `demosift play`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Play<'a> {
    pub(crate) episodes: Vec<Episode>,
    pub(crate) unit: &'a str,
    pub(crate) pictures: Option<&'a Path>,
}

/// An episode that was played or replayed.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Episode {
    pub(crate) episode: String,
    pub(crate) steps: usize,
    pub(crate) score: Score,
    pub(crate) succeeded: Option<bool>,
}

/// `demosift export --as json`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Export<'a> {
    pub(crate) demosift: &'a str,
    pub(crate) task: &'a str,
    pub(crate) task_sha256: Option<&'a str>,
    pub(crate) variant: Option<&'a str>,
    pub(crate) data: &'a Data,
    #[cfg_attr(test, schemars(with = "Value"))]
    pub(crate) seed: Option<&'a toml::Value>,
    #[cfg_attr(test, schemars(with = "Map<String, Value>"))]
    pub(crate) configuration: &'a toml::Table,
    pub(crate) chosen: &'a str,
    pub(crate) demonstrations: Vec<Exported>,
}

/// A demonstration that was judged, in the order of the ranking.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Exported {
    pub(crate) demonstration: DemoId,
    pub(crate) label: String,
    pub(crate) steps: usize,
    pub(crate) rank: usize,
    pub(crate) kept: bool,
    pub(crate) score: Score,
    pub(crate) low: Option<f64>,
    pub(crate) high: Option<f64>,
    pub(crate) before: Score,
    pub(crate) after: Score,
    pub(crate) improves: Option<f64>,
    pub(crate) weight: Option<f64>,
}

/// `demosift task check`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct TaskCheck<'a> {
    pub(crate) task: &'a Seen,
    pub(crate) played: &'a Tried,
    pub(crate) steps_per_sec: f64,
    pub(crate) recorded: Option<&'a Recorded>,
    pub(crate) findings: &'a [Finding],
}

/// `demosift task check --env`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct EnvironmentCheck<'a> {
    pub(crate) environment: &'a str,
    pub(crate) simulator: &'a Simulator,
    pub(crate) observation_parts: &'a [(String, usize)],
    pub(crate) control_ranges: &'a [[f64; 2]],
    pub(crate) info: &'a [String],
    pub(crate) tried: &'a demosift_gymnasium::check::Checked,
    pub(crate) compared: Option<&'a demosift_gymnasium::check::Recorded>,
    pub(crate) findings: &'a [Finding],
}

/// `demosift study`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct StudyShown<'a> {
    pub(crate) study: &'a Study,
    pub(crate) demosift: &'a str,
    pub(crate) notes: &'a [String],
    pub(crate) summary: &'a Summary,
    pub(crate) study_folder: Option<&'a Path>,
}

/// `demosift study --dry-run`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct StudyDryRun<'a> {
    pub(crate) study: &'a str,
    pub(crate) dry_run: bool,
    pub(crate) finished: usize,
    pub(crate) missing: &'a [tables::study::Kind],
    pub(crate) trainings_that_depend_on_them_at_most: usize,
    pub(crate) notes: &'a [String],
    pub(crate) study_folder: &'a Path,
}

/// `demosift judge`, `oracle` and `referee` with `--part`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct PartDone<'a> {
    pub(crate) part: String,
    /// What other parts have not finished, in words.
    pub(crate) left: &'a [String],
    pub(crate) run_folder: &'a Path,
}

/// `demosift reproduce`
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Reproduced<'a> {
    pub(crate) experiment: &'a str,
    pub(crate) preset: Option<&'a str>,
    pub(crate) partial: bool,
    pub(crate) told: &'a Told,
    pub(crate) claims: &'a [Decided],
    pub(crate) failures: &'a [(String, String)],
    pub(crate) notes: &'a [String],
    pub(crate) page: Option<&'a Path>,
}
