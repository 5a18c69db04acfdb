//! What is still to be done, by counting; the minutes are left to [`super`].

use serde::Serialize;

use super::By;
use crate::basics::error::Result;
use crate::basics::ledger::Ledger;
use crate::data::demonstration::DemoId;
use crate::learning::adapt::Rule;
use crate::results::artifact::Artifact;
use crate::results::panel::{Judge, Order, Panel};
use crate::results::recording;
use crate::run::experiment::arrows::{self, Arrow};
use crate::run::experiment::{self, OracleTraining, Preparation, Run, Selection, begun, stage_name};
use crate::stages::demonstrator::{self, DemonstratorState, Stage};
use crate::stages::imitate::{self, ImitationState, LearningCurve};
use crate::stages::judge::{self, Effort, Judging, JudgingState};
use crate::stages::meta_train::{self, MetaState};
use crate::stages::pre_train::{self, PreTrainState, PreTraining};
use crate::stages::referee::{self, DECISIVE, Meant, NamedSubset, imitation_by, steps_by_trainer};
use crate::stages::select::{Keep, Subset};
use crate::stages::subset_selection::{self, WeighingState};
use crate::world::rollout::Playground;
use crate::world::trainer::Trainer;

/// How far along the flow a command goes.
#[derive(Clone, Copy, Debug)]
pub enum Goal<'a> {
    /// The meta-parameters.
    Prior,
    /// The scores.
    Scores,
    /// The subset that is kept.
    Selection,
    /// The subset by weights.
    Weighing,
    /// The policy from the subset beside that from all, by one training each.
    Comparison,
    /// What the referee says.
    Verdict,
    /// The policy from the subset and that from all, after all was judged elsewhere.
    OneTraining,
    /// The final policies alone, after all was judged elsewhere.
    Referee,
    /// One policy from these demonstrations, under the name of its part.
    Policy(&'a str, &'a [DemoId]),
    /// Each demonstration alone so often, and so many random subsets.
    Oracle {
        /// How often.
        repeats: usize,
        /// How many.
        random: usize,
    },
}

/// A stage that is still to be done, or the rest of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Planned {
    /// Its name, as in [`crate::stages::method::Costs`].
    pub stage: String,
    /// Environment steps that it will play, evaluations among them, where episodes last to the horizon.
    pub environment_steps: u64,
    /// Updates that it will make: rounds of meta-training, and steps of policies elsewhere.
    pub updates: u64,
    /// Whether it may end earlier.
    pub at_most: bool,
    /// Trainings by somebody else's trainer, whose time nobody knows; playing their policies is counted.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub by_trainer: usize,
    #[serde(skip)]
    pub(super) pieces: Vec<(Piece, f64)>,
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// A kind of work that is timed, with what decides how long a unit of it takes.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Piece {
    /// A round of meta-training over so many demonstrations.
    Round { meta_batch: usize },
    /// Playing for and making one update of judging, as many at once as there are threads.
    Inner { judge: Judge },
    /// The same in pre-training, one after the other, toward so many demonstrations.
    PreTraining { demonstrations: usize },
    /// The same in imitation from scratch by a rule, so many at once.
    Imitation { rule: Rule, at_once: usize, demonstrations: usize },
    /// An environment step of an evaluation of so many episodes.
    Evaluation { episodes: usize },
    /// An environment step of a demonstrator that learns.
    Demonstrator,
}

/// What a run has still to do until a goal is reached.
pub fn planned(run: &Run<'_>, goal: Goal<'_>) -> Result<Vec<Planned>> {
    let count = run.set.len();
    let mut stages = Vec::new();
    match goal {
        Goal::Prior => stages = left_of(run, &[Arrow::Prior])?,
        Goal::Scores => stages = left_of(run, &arrows::all_scores(run.config))?,
        Goal::Weighing => stages = left_of(run, &[Arrow::Weighing])?,
        Goal::Selection => stages = left_of(run, &arrows::for_selection(run.config))?,
        Goal::Comparison => {
            stages = planned(run, Goal::Selection)?;
            stages.extend(planned(run, Goal::OneTraining)?);
        }
        Goal::OneTraining => {
            let kept = Subset::recall(run.ledger, "")?.map(|subset| subset.demos);
            let size = kept.as_ref().map_or_else(|| likely_size(run), Vec::len);
            stages.extend(imitation(run, &experiment::kept_part(run.config), kept.as_deref(), size)?);
            stages.extend(imitation(run, "all", Some(&run.set.ids()), count)?);
        }
        Goal::Referee => stages.extend(verdict(run)?),
        Goal::Verdict => {
            stages = planned(run, Goal::Selection)?;
            stages.extend(verdict(run)?);
        }
        Goal::Policy(part, demos) => stages.extend(imitation(run, part, Some(demos), demos.len())?),
        Goal::Oracle { repeats, random } => {
            let mut alone = Vec::new();
            for OracleTraining { demo, repeat } in experiment::oracle_trainings(run, repeats) {
                alone.extend(imitation(run, &experiment::oracle_part(demo, repeat), Some(&[demo]), 1)?);
            }
            stages.extend(together("oracle", alone));
            let kept = experiment::policy_from_kept(run, 0)?.map_or(1, |curve| curve.demos.len());
            let random =
                (0..random).map(|number| imitation(run, &experiment::random_part(kept, number), None, kept));
            let random = random.collect::<Result<Vec<_>>>()?;
            stages.extend(together("random_subsets", random.into_iter().flatten().collect()));
        }
    }
    Ok(stages)
}

/// What is left of what the flow will make to have all that is wanted.
fn left_of(run: &Run<'_>, wanted: &[Arrow]) -> Result<Vec<Planned>> {
    let left = arrows::missing(run, wanted)?.into_iter().map(|arrow| match arrow {
        Arrow::Prior => prior(run),
        Arrow::Scores(judge) => scores(run, judge),
        Arrow::Weighing => weighing(run),
    });
    left.filter_map(Result::transpose).collect()
}

/// Several parts of a stage as one.
fn together(stage: &str, parts: Vec<Planned>) -> Option<Planned> {
    parts
        .into_iter()
        .reduce(|sum, part| Planned {
            environment_steps: sum.environment_steps + part.environment_steps,
            updates: sum.updates + part.updates,
            at_most: sum.at_most || part.at_most,
            by_trainer: sum.by_trainer + part.by_trainer,
            pieces: [sum.pieces, part.pieces].concat(),
            ..sum
        })
        .map(|sum| Planned { stage: stage.to_owned(), ..sum })
}

/// A whole stage, as if nothing of it were done.
struct Whole {
    stage: String,
    environment_steps: u64,
    updates: u64,
    at_most: bool,
    pieces: Vec<(Piece, f64)>,
}

impl Whole {
    /// What is left of it after so many steps and such a share of the work; nothing, if it is finished.
    fn rest(self, spent: u64, done: usize, total: usize) -> Option<Planned> {
        let share = 1.0 - done.min(total) as f64 / total.max(1) as f64;
        let left = |whole: u64| (whole as f64 * share).round() as u64;
        (total > 0).then(|| Planned {
            stage: self.stage,
            environment_steps: self.environment_steps.saturating_sub(spent),
            updates: left(self.updates),
            at_most: self.at_most,
            by_trainer: 0,
            pieces: self.pieces.into_iter().map(|(piece, units)| (piece, units * share)).collect(),
        })
    }
}

fn prior(run: &Run<'_>) -> Result<Option<Planned>> {
    let config = run.config;
    match experiment::preparation(run) {
        Preparation::Nothing => Ok(None),
        Preparation::MetaTraining(training) => {
            let (learning, seed) =
                (experiment::learning_by(config, &training), experiment::learning_seed(config));
            let steps = meta_train::steps_by_round(run.set, run.playground, &learning, &seed);
            let whole = Whole {
                stage: meta_train::STAGE.to_owned(),
                environment_steps: steps.take(training.rounds).sum(),
                updates: training.rounds as u64,
                at_most: false,
                pieces: vec![(Piece::Round { meta_batch: training.meta_batch }, training.rounds as f64)],
            };
            let (spent, done) = begun(run.ledger, meta_train::STAGE, "", |state: MetaState| state.rounds)?;
            Ok(whole.rest(spent, done, training.rounds))
        }
        Preparation::PreTraining(PreTraining { updates, inner, .. }) => {
            let each = pre_train::steps_of_update(inner, run.playground.specification().horizon);
            let whole = Whole {
                stage: pre_train::STAGE.to_owned(),
                environment_steps: each * updates as u64,
                updates: updates as u64,
                at_most: false,
                pieces: vec![(Piece::PreTraining { demonstrations: run.set.len() }, updates as f64)],
            };
            let (spent, done) =
                begun(run.ledger, pre_train::STAGE, "", |state: PreTrainState| state.updates)?;
            Ok(whole.rest(spent, done, updates))
        }
    }
}

fn scores(run: &Run<'_>, judge: Judge) -> Result<Option<Planned>> {
    let by = experiment::judged_by(run, judge);
    let (effort, mut imitated) = (by.effort(run), 0);
    let whole = Whole {
        stage: stage_name(judge::STAGE, judge.name()),
        environment_steps: effort.steps(),
        updates: effort.updates as u64,
        at_most: by.judging.most_repeats > by.judging.repeats,
        pieces: pieces(judge, &by.judging, &effort),
    };
    let trainer = run.playground.trainer().filter(|_| by.inner.is_none()).map(Trainer::identity);
    let (spent, done) = begun(run.ledger, judge::STAGE, judge.name(), |state: JudgingState| {
        let state = state.if_by(trainer);
        imitated = state.imitated();
        state.done()
    })?;
    let spent = if done == 0 { 0 } else { spent };
    let by_trainer = effort.by_trainer.saturating_sub(imitated);
    Ok(whole.rest(spent, done, effort.units).map(|rest| Planned { by_trainer, ..rest }))
}

fn pieces(judge: Judge, judging: &Judging, effort: &Effort) -> Vec<(Piece, f64)> {
    vec![
        (Piece::Inner { judge }, effort.updates as f64),
        (Piece::Evaluation { episodes: judging.evaluations }, effort.evaluating_steps as f64),
    ]
}

fn weighing(run: &Run<'_>) -> Result<Option<Planned>> {
    let by = experiment::weighed_by(run.config);
    let effort = by.effort(run);
    let rounds = effort.rounds as f64;
    let mut parts = vec![(Piece::Round { meta_batch: effort.meta_batch }, effort.meta_updates as f64)];
    let assessed = pieces(Judge::Paper, &effort.judging, &effort.assessing);
    parts.extend(assessed.into_iter().map(|(piece, units)| (piece, units * rounds)));
    let whole = Whole {
        stage: subset_selection::STAGE.to_owned(),
        environment_steps: effort.steps(),
        updates: (effort.meta_updates + effort.assessing.updates * effort.rounds) as u64,
        at_most: by.means.selection.steady_rounds < effort.rounds,
        pieces: parts,
    };
    let (spent, done) =
        begun(run.ledger, subset_selection::STAGE, "", |state: WeighingState| state.rounds.len())?;
    Ok(whole.rest(spent, done, effort.rounds))
}

/// Imitation from scratch; `demos` are what is imitated, if that is known by now, and `size` how many.
fn imitation(run: &Run<'_>, part: &str, demos: Option<&[DemoId]>, size: usize) -> Result<Option<Planned>> {
    let is_meant =
        |found: &[DemoId]| demos.is_none_or(|demos| demos == found || is_sorted_from(found, demos));
    if LearningCurve::recall(run.ledger, part)?.is_some_and(|curve| is_meant(&curve.demos)) {
        return Ok(None);
    }
    let (task, imitation) = (run.playground.specification(), &run.config.imitate);
    let effort = imitate::Effort::of(task, imitation);
    let piece = Piece::Imitation { rule: imitation.update.imitation, at_once: 1, demonstrations: size };
    let whole = Whole {
        stage: stage_name(imitate::STAGE, part),
        environment_steps: effort.steps(),
        updates: effort.updates as u64,
        at_most: false,
        pieces: vec![
            (piece, effort.updates as f64),
            (Piece::Evaluation { episodes: imitation.evaluations }, effort.evaluating_steps as f64),
        ],
    };
    let (spent, done) =
        begun(
            run.ledger,
            imitate::STAGE,
            part,
            |state: ImitationState| {
                if is_meant(state.demos()) { state.updates() } else { 0 }
            },
        )?;
    let (spent, done) = if done == 0 { (0, 0) } else { (spent, done) };
    Ok(whole.rest(spent, done, effort.updates.max(1)))
}

/// The referee's trainings; before anything is kept, as if as many demonstrations were kept as is likely.
fn verdict(run: &Run<'_>) -> Result<Option<Planned>> {
    let ids = run.set.ids();
    let candidates = referee::candidates(&ids, &foreseen(run)?)?;
    let task = run.playground.specification();
    let at_once = rayon::current_num_threads();
    let several = Panel::recall(run.ledger, "")?.is_none();
    let of_training = |meant: Meant| {
        // Judges that keep the same have one candidate, and who is surely hopeless is dropped.
        let at_most = several || run.config.referee.trainings(meant.imitator) > DECISIVE;
        let (stage, evaluations) = (referee::STAGE.to_owned(), run.config.imitate.evaluations);
        let evaluation = Piece::Evaluation { episodes: evaluations };
        let Some(rule) = meant.imitator.rule() else {
            let environment_steps = steps_by_trainer(task, evaluations);
            let pieces = vec![(evaluation, environment_steps as f64)];
            return Planned { stage, environment_steps, updates: 0, at_most, by_trainer: 1, pieces };
        };
        let imitation = imitation_by(rule, &run.config.imitate);
        let effort = imitate::Effort::of(task, &imitation);
        let demonstrations = candidates[meant.candidates[0]].size;
        let piece = Piece::Imitation { rule, at_once, demonstrations };
        Planned {
            stage,
            environment_steps: effort.steps(),
            updates: effort.updates as u64,
            at_most,
            by_trainer: 0,
            pieces: vec![
                (piece, effort.updates as f64 / at_once as f64),
                (evaluation, effort.evaluating_steps as f64),
            ],
        }
    };
    let rest = experiment::rest_of_verdict(run, &candidates)?;
    Ok(together(referee::STAGE, rest.into_iter().map(of_training).collect()))
}

/// What final policies will be trained on: as it was selected, or else as if the judges agreed on nothing.
fn foreseen(run: &Run<'_>) -> Result<Vec<NamedSubset>> {
    let (panel, subset) = (Panel::recall(run.ledger, "")?, Subset::recall(run.ledger, "")?);
    if let (Some(panel), Some(subset)) = (panel, subset) {
        let Order { ranking, uncertainty } = panel.deciding();
        let (ranking, uncertainty) = (ranking.clone(), uncertainty.clone());
        return experiment::worth_training_on(run, &panel, &Selection { ranking, uncertainty, subset });
    }
    let (ids, size) = (run.set.ids(), likely_size(run));
    let judges = run.config.judges.each();
    let names = judges.iter().map(|judge| judge.name()).chain((judges.len() > 1).then_some("both"));
    let of_judge = |(shift, name): (usize, &str)| {
        let demos: Vec<DemoId> = ids.iter().cycle().skip(shift).take(size).copied().collect();
        NamedSubset::new(name, &demos)
    };
    let mut subsets: Vec<NamedSubset> = names.enumerate().map(of_judge).collect();
    // Of another size, which asks for random subsets of its own.
    let auto = if ids.len().div_ceil(2) == size { size + 1 } else { ids.len().div_ceil(2) };
    subsets.push(NamedSubset::new("auto", &ids[..auto.min(ids.len())]));
    Ok(subsets)
}

fn is_sorted_from(found: &[DemoId], demos: &[DemoId]) -> bool {
    let mut demos = demos.to_vec();
    demos.sort_unstable();
    demos == found
}

/// How many will be kept, as far as that can be said before judging.
fn likely_size(run: &Run<'_>) -> usize {
    match run.config.keep {
        Keep::Auto | Keep::Weights => run.set.len().div_ceil(2),
        keep @ (Keep::Quarter | Keep::Count(_)) => keep.count_before_judging(run.set.len()),
    }
}

/// What a recording asks for.
#[derive(Clone, Copy, Debug)]
pub struct Recording<'a> {
    /// Who demonstrates.
    pub by: By<'a>,
    /// Demonstrations to record, those of guests and unseen ones among them.
    pub demonstrations: usize,
    /// Demonstrators that are assessed when they are finished, guests among them.
    pub demonstrators: usize,
    /// Episodes of such an assessment.
    pub assessed: usize,
}

/// What a recording has still to do.
///
/// The steps in which a demonstrator confirms that it succeeds are not known before, and not among them.
pub fn planned_recording(
    playground: &Playground<'_>,
    recording: &Recording<'_>,
    ledger: &dyn Ledger,
) -> Result<Vec<Planned>> {
    let task = playground.specification();
    let mut stages = Vec::new();
    if let By::Training(training) = recording.by
        && Vec::<Stage>::recall(ledger, "")?.is_none()
    {
        let steps = demonstrator::steps(task, training);
        let whole = Whole {
            stage: demonstrator::STAGE.to_owned(),
            environment_steps: steps,
            updates: training.updates as u64,
            at_most: true,
            pieces: vec![(Piece::Demonstrator, steps as f64)],
        };
        let (spent, done) =
            begun(ledger, demonstrator::STAGE, "", |state: DemonstratorState| state.updates())?;
        stages.extend(whole.rest(spent, done, training.updates.max(1)));
    }
    let assessing = recording.demonstrators * recording.assessed * task.horizon;
    let steps = assessing + recording.demonstrations * recording::steps_of_demonstration(task.horizon);
    stages.push(Planned {
        stage: "record".to_owned(),
        environment_steps: steps as u64,
        updates: 0,
        at_most: false,
        by_trainer: 0,
        pieces: vec![(Piece::Evaluation { episodes: recording.assessed }, steps as f64)],
    });
    Ok(stages)
}
