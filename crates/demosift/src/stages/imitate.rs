//! Imitation from scratch on a subset (§5.2): GAIL with TRPO or behavioral cloning (C.4), the learning curve of the
//! heuristic, the best policy kept.
//!
//! This is how a selection proves itself, and on one demonstration alone with the full budget it is the oracle that
//! rankings are compared with.
//! The best point of a curve chooses which policy is kept.
//! What a demonstration teaches is scored at the end of the curve, which no luck chose.

use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::basics::observer::{Event, Observer, is_due, times_due};
use crate::basics::seed::Seed;
use crate::data::demonstration::{DemoId, DemonstrationSet};
use crate::data::trajectory::Trajectory;
use crate::learning::adapt::{self, InnerUpdate, Learner, Played, Rule, Updated};
use crate::learning::gail;
use crate::math::nn::adam::Adam;
use crate::math::rows::Rows;
use crate::math::statistics;
use crate::world::environment::{EnvVariant, Specification};
use crate::world::heuristic::Score;
use crate::world::policy::{Policy, PolicyShape};
use crate::world::rollout::{self, Acting, Playground};

/// How a policy imitates a subset from scratch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Imitation {
    /// Environment steps that GAIL learns from; evaluation comes on top. Equal for whatever is compared.
    pub environment_steps: usize,
    /// Updates of behavioral cloning, which learns from no environment step; each has as many steps of Adam, whatever is
    /// imitated.
    pub cloning_updates: usize,
    /// The update, with what is played before each.
    pub update: InnerUpdate,
    /// Widths of the discriminator's hidden layers (Table 3: 100, 100).
    pub discriminator_hidden: Vec<usize>,
    /// Updates between two evaluations.
    pub evaluate_every: usize,
    /// Episodes of an evaluation.
    pub evaluations: usize,
    /// How the policy acts when it is evaluated; not in the paper, and the mean is how a policy is used.
    pub acting: Acting,
    /// Updates between two checkpoints.
    pub checkpoint_every: usize,
}

/// How a policy came along: the learning curve and the best policy on it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearningCurve {
    /// What was imitated.
    pub demos: Vec<DemoId>,
    /// Evaluations in order.
    pub points: Vec<CurvePoint>,
    /// The best policy on episodes that did not choose it.
    pub outcome: CurvePoint,
    /// The last policy on the same episodes: where learning led, with nothing chosen.
    pub end: CurvePoint,
    /// Environment steps of the whole imitation, evaluations among them.
    pub played: u64,
    /// The policy with the best score among the points.
    pub best: Policy,
}

impl LearningCurve {
    /// The point that chose the policy: the best, the last of equals; `None` where the curve has none.
    pub fn best_point(&self) -> Option<&CurvePoint> {
        self.points.iter().max_by(|a, b| a.score.total_cmp(&b.score))
    }
}

/// One evaluation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CurvePoint {
    /// Updates made so far.
    #[serde(default)]
    pub updates: usize,
    /// Environment steps learned from so far.
    pub environment_steps: usize,
    /// Mean heuristic.
    pub score: Score,
    /// Standard error of that mean over the evaluation's episodes; what another training would change comes on top.
    pub standard_error: f64,
    /// Share of episodes that reached the goal, where the task says.
    pub success: Option<f64>,
    /// Mean true return, where the task says; for reports only, and nothing chooses by it.
    #[serde(default)]
    pub true_return: Option<f64>,
}

/// Where an imitation stands; from here it goes on to the identical result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImitationState {
    demos: Vec<DemoId>,
    updates: usize,
    environment_steps: usize,
    /// Environment steps of evaluations so far.
    evaluated: u64,
    learner: Learner,
    adam: Adam,
    points: Vec<CurvePoint>,
    best: Policy,
}

/// What is imitated from scratch, where and how.
#[derive(Clone, Copy)]
pub struct Lesson<'a> {
    /// V, which holds what is imitated.
    pub set: &'a DemonstrationSet,
    /// E with K.
    pub playground: &'a Playground<'a>,
    /// How a policy imitates.
    pub imitation: &'a Imitation,
    /// Names this imitation among others in events.
    pub part: &'a str,
    /// All random numbers.
    pub seed: &'a Seed,
}

/// Name of the stage in events.
pub const STAGE: &str = "imitate";

impl ImitationState {
    /// A learner that knows nothing and is to imitate `demos`.
    pub fn start(
        set: &DemonstrationSet,
        demos: &[DemoId],
        shape: &PolicyShape,
        imitation: &Imitation,
        seed: &Seed,
    ) -> Self {
        let learner = Learner::untrained(set, shape, &imitation.discriminator_hidden, seed);
        Self {
            demos: demos.to_vec(),
            updates: 0,
            environment_steps: 0,
            evaluated: 0,
            adam: imitation.update.adam(&learner),
            points: Vec::new(),
            best: learner.policy.clone(),
            learner,
        }
    }

    /// What is imitated.
    pub fn demos(&self) -> &[DemoId] {
        &self.demos
    }

    /// Updates made so far.
    pub fn updates(&self) -> usize {
        self.updates
    }

    /// How much is done of how much there is to do: environment steps, or updates of behavioral cloning.
    fn progress(&self, imitation: &Imitation) -> (usize, usize) {
        let (done, total) = match imitation.update.imitation {
            Rule::Gail => (self.environment_steps, imitation.environment_steps),
            Rule::BehavioralCloning => (self.updates, imitation.cloning_updates),
        };
        (done.min(total), total)
    }
}

/// What an imitation takes, where episodes last to the horizon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effort {
    /// Updates.
    pub updates: usize,
    /// Environment steps that learning plays.
    pub learning_steps: u64,
    /// Environment steps that evaluating plays.
    pub evaluating_steps: u64,
}

impl Effort {
    /// One imitation in a task.
    pub fn of(task: &Specification, imitation: &Imitation) -> Self {
        let batch = imitation.update.episodes(task.horizon) * task.horizon;
        let updates = match imitation.update.imitation {
            Rule::Gail => imitation.environment_steps.div_ceil(batch),
            Rule::BehavioralCloning => imitation.cloning_updates,
        };
        // Besides those on the way one at the end, and of the best and the last policy one each on other episodes; both are
        // played even where they are the same policy, so that this count is exact.
        let evaluations = times_due(updates, imitation.evaluate_every) + 3;
        let evaluating = evaluations * imitation.evaluations * task.variants.len() * task.horizon;
        Self { updates, learning_steps: (updates * batch) as u64, evaluating_steps: evaluating as u64 }
    }

    /// Environment steps in all.
    pub fn steps(&self) -> u64 {
        self.learning_steps + self.evaluating_steps
    }
}

/// Imitates the demonstrations that `state` is about from scratch.
///
/// ```
/// use demosift::basics::observer::Silent;
/// use demosift::basics::seed::Seed;
/// use demosift::data::demonstration::DemoId;
/// use demosift::run::preset::Preset;
/// use demosift::stages::imitate::{ImitationState, Lesson, imitate};
/// use demosift::world::point_mass::{PointMass, planted_set};
/// use demosift::world::rollout::Playground;
///
/// let set = planted_set(&[180.0, 5.0, -5.0], Seed::new(1))?;
/// let task = PointMass::new();
/// let playground = Playground::new(&task);
/// let mut config = Preset::Quick.config();
/// config.imitate.environment_steps = 9000;
/// config.imitate.update.batch_steps = 600;
/// config.imitate.update.discriminator.learning_rate = 0.01;
///
/// let learn_from = |demos: &[DemoId]| {
///     let (imitation, seed) = (&config.imitate, &Seed::new(3));
///     let start = ImitationState::start(&set, demos, &config.policy, imitation, seed);
///     let lesson = Lesson { set: &set, playground: &playground, imitation, part: "subset", seed };
///     imitate(&lesson, start, &mut Silent)
/// };
/// let east = learn_from(&[DemoId(1), DemoId(2)])?;
/// let west = learn_from(&[DemoId(0)])?;
///
/// // The goal lies in the east, and the score is the distance to it, negated.
/// let (near, far) = (east.outcome.score, west.outcome.score);
/// assert!(near > far, "{near} m and {far} m");
/// // The curve has a point every so many updates; the best policy on it is what is handed over.
/// assert!(east.points.len() > 2 && east.points[0].environment_steps == 0);
/// assert_eq!(east.best.action_size(), 2);
/// # Ok::<(), demosift::Error>(())
/// ```
pub fn imitate(
    lesson: &Lesson<'_>,
    mut state: ImitationState,
    observer: &mut dyn Observer,
) -> Result<LearningCurve> {
    let Lesson { set, imitation, part, seed, .. } = *lesson;
    let demos = state.demos.clone();
    if demos.is_empty() {
        return Err(Error::bad_input("nothing to imitate: the subset is empty"));
    }
    let filter = state.learner.policy.filter().clone();
    let pairs: Vec<Rows> =
        demos.iter().map(|demo| gail::demonstrated_pairs(set.get(*demo), &filter)).collect();
    let demonstrated: Vec<&Rows> = pairs.iter().collect();
    let (done, total) = state.progress(imitation);
    observer.on(Event::Started { stage: STAGE, done, total })?;
    while state.progress(imitation).0 < total {
        if is_due(state.updates, imitation.evaluate_every) {
            evaluate(lesson, &mut state, observer)?;
        }
        improve(lesson, &mut state, &demonstrated, observer)
            .map_err(|error| error.during(&format!("imitation, update {}", state.updates)))?;
        observer.on(Event::Advanced { stage: STAGE, done: state.progress(imitation).0 })?;
        if is_due(state.updates, imitation.checkpoint_every) {
            observer.on(Event::Checkpoint { stage: STAGE, part, state: &state })?;
        }
    }
    evaluate(lesson, &mut state, observer)?;
    let outcome_seed = seed.of("outcome");
    let (best, last) = (state.best.clone(), state.learner.policy.clone());
    let outcome = point(lesson, &mut state, &best, &outcome_seed)?;
    let end = point(lesson, &mut state, &last, &outcome_seed)?;
    let played = state.environment_steps as u64 + state.evaluated;
    Ok(LearningCurve { demos, points: state.points, outcome, end, played, best })
}

/// Plays and makes one update; variants take turns.
fn improve(
    lesson: &Lesson<'_>,
    state: &mut ImitationState,
    demonstrated: &[&Rows],
    observer: &mut dyn Observer,
) -> Result<()> {
    let Lesson { playground, imitation, part, seed, .. } = *lesson;
    let variant = EnvVariant(state.updates % playground.specification().variants.len());
    let policy = &state.learner.policy;
    let play_seed = seed.of("play").at(state.updates);
    let trajectories = imitation.update.play(playground, policy, variant, play_seed)?;
    let played = Played::new(playground, policy, &trajectories);
    let (inner, adam) = (&imitation.update, &mut state.adam);
    let (alpha, fit_seed) = (inner.alpha(state.updates), seed.of("fit").at(state.updates));
    let Updated { learner, report, .. } =
        adapt::update(&state.learner, &played, demonstrated, inner, alpha, adam, fit_seed)?;
    state.learner = learner;
    state.updates += 1;
    state.environment_steps += trajectories.iter().map(Trajectory::steps).sum::<usize>();
    let mut numbers = vec![("environment_steps", state.environment_steps as f64)];
    numbers.extend(report.numbers());
    let iteration = state.updates;
    observer.on(Event::Measured { stage: "imitate_update", part, iteration, numbers: &numbers })
}

/// Adds a point to the curve and keeps the policy if it is the best so far.
fn evaluate(lesson: &Lesson<'_>, state: &mut ImitationState, observer: &mut dyn Observer) -> Result<()> {
    let policy = state.learner.policy.clone();
    let found = point(lesson, state, &policy, &lesson.seed.of("evaluate"))?;
    let best = state.points.iter().map(|point| point.score).fold(f64::NEG_INFINITY, f64::max);
    // Of equals the later: where nothing is gained by learning, the untrained policy is not the answer.
    if found.score >= best {
        state.best = policy;
    }
    state.points.push(found);
    observer.on(Event::Measured {
        stage: STAGE,
        part: lesson.part,
        iteration: state.updates,
        numbers: &[
            ("environment_steps", found.environment_steps as f64),
            ("score", found.score),
            ("success", found.success.unwrap_or(f64::NAN)),
        ],
    })
}

/// Mean heuristic and success of a policy, over all variants.
fn point(
    lesson: &Lesson<'_>,
    state: &mut ImitationState,
    policy: &Policy,
    seed: &Seed,
) -> Result<CurvePoint> {
    let Lesson { playground, imitation, .. } = *lesson;
    let mut trajectories = Vec::new();
    for variant in playground.specification().variant_ids() {
        let seeds = seed.at(variant.0).many(imitation.evaluations);
        trajectories.extend(rollout::play(playground, policy, imitation.acting, variant, seeds)?);
    }
    state.evaluated += trajectories.iter().map(Trajectory::steps).sum::<usize>() as u64;
    let scores: Vec<Score> = trajectories.iter().map(|played| playground.score(played)).collect();
    Ok(CurvePoint {
        updates: state.updates,
        environment_steps: state.environment_steps,
        score: statistics::mean(&scores),
        standard_error: statistics::standard_error(&scores),
        success: playground.success_rate(&trajectories),
        true_return: playground.mean_true_return(&trajectories),
    })
}
