//! The whole flow as one function: a noisy set goes in; a ranking, a subset and a better policy come out.
//!
//! Each arrow of the flow makes one noun, and a [`Ledger`] keeps the nouns: what a ledger already holds is not made
//! again, and what was begun goes on from its last checkpoint to the identical result.
//!
//! [`sift`] is the whole job, shown on the first page of this crate; its stages can be taken one by one:
//!
//! ```
//! use demosift::experiment::{Run, prior, scores, selection};
//! use demosift::ledger::InMemory;
//! use demosift::observer::Silent;
//! use demosift::point_mass::{PointMass, planted_set};
//! use demosift::preset::Preset;
//! use demosift::rollout::Playground;
//! use demosift::{seed::Seed, select::Keep};
//!
//! let (set, task) = (planted_set(&[150.0, 5.0, -120.0, -10.0], Seed::new(1))?, PointMass::new());
//! let playground = Playground::new(&task);
//! let mut config = Preset::Quick.config();
//! (config.meta_train.rounds, config.keep, config.inner.alphas) = (4, Keep::Count(2), vec![1.0, 0.5]);
//! (config.inner.batch_steps, config.judge.iterations, config.judge.averaged) = (600, 8, 3);
//! let mut run = Run {
//!     set: &set,
//!     playground: &playground,
//!     config: &config,
//!     ledger: &mut InMemory::default(),
//!     observer: &mut Silent,
//! };
//!
//! let learner = prior(&mut run)?; // Algorithm 1
//! let table = scores(&mut run, &learner)?; // Algorithm 2
//! let selected = selection(&mut run, &table)?; // Eq. 9
//! assert!(selected.subset.demos.iter().all(|demo| [1, 3].contains(&demo.0)));
//!
//! // The ledger has all of it now, so asking again plays nothing.
//! let played = playground.steps_taken();
//! assert_eq!(scores(&mut run, &learner)?, table);
//! assert_eq!(playground.steps_taken(), played);
//! # Ok::<(), demosift::Error>(())
//! ```

mod checks;
mod keeping;
mod verdict;

use serde::{Deserialize, Serialize};

use crate::adapt::{InnerUpdate, Learner, MetaPrior};
use crate::artifact::{Artifact, onnx};
use crate::data_only::{self, DataOnly};
use crate::demonstration::{DemoId, DemonstrationSet};
use crate::error::Result;
use crate::imitate::{self, Imitation, ImitationState, LearningCurve};
use crate::judge::{self, Judged, Judging, ScoreTable};
use crate::ledger::Ledger;
use crate::meta_train::{self, MetaState, MetaTraining, MutualInformation};
use crate::method::{self, Asked, Costs, Method, Plan, Spent};
use crate::observer::Observer;
use crate::policy::PolicyShape;
use crate::pre_train::{self, PreTrainState, PreTraining};
use crate::referee::{self, KEPT, NamedSubset, Refereeing, Verdict};
use crate::rollout::Playground;
use crate::seed::Seed;
use crate::select::{self, Keep, Ranking, Subset};
use crate::subset_selection::{self, Means, SubsetSelection, Weighing, WeighingState};
use crate::uncertainty::{self, Resampling, Uncertainty};

pub use checks::{check, check_demonstrator, check_fits, check_has_weights};
pub use keeping::Keeping;
pub(crate) use keeping::{begun, stage_name};
pub(crate) use verdict::rest as rest_of_verdict;
pub use verdict::{BEST, verdict};

/// Everything that a run depends on, besides the demonstrations and the task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// The root of all random numbers.
    pub seed: u64,
    /// How the parameters are made that judging adapts.
    pub method: Method,
    /// How many demonstrations to keep.
    pub keep: Keep,
    /// The policy's shape, in meta-training and from scratch.
    pub policy: PolicyShape,
    /// The inner update, in meta-training and in judging.
    pub inner: InnerUpdate,
    /// Meta-training.
    pub meta_train: MetaTraining,
    /// How meta-training is regularized by mutual information, where the method is `maml-mi`.
    pub mutual_information: MutualInformation,
    /// Judging.
    pub judge: Judging,
    /// Selection of a subset by weights (Algorithm 3), where it is asked for.
    pub subset_selection: SubsetSelection,
    /// Imitation from scratch.
    pub imitate: Imitation,
    /// How often final policies are trained to say whether selecting helps.
    pub referee: Refereeing,
}

/// What a run is about, and where it keeps and tells what it finds.
pub struct Run<'a> {
    /// V.
    pub set: &'a DemonstrationSet,
    /// The task at play.
    pub playground: &'a Playground<'a>,
    /// How.
    pub config: &'a Config,
    /// Keeps the nouns.
    pub ledger: &'a mut dyn Ledger,
    /// Hears of progress.
    pub observer: &'a mut dyn Observer,
}

/// What comes out of the whole flow.
#[derive(Clone, Debug, PartialEq)]
pub struct Sifted {
    /// S of every demonstration.
    pub scores: ScoreTable,
    /// What was concluded from them.
    pub selection: Selection,
    /// What scorers of the recorded data alone say; beside the ranking, never in it.
    pub data_only: DataOnly,
    /// What to train on, by which imitator, and whether selecting helps.
    pub verdict: Verdict,
}

/// What is concluded from the scores.
#[derive(Clone, Debug, PartialEq)]
pub struct Selection {
    /// From the most to the least suitable.
    pub ranking: Ranking,
    /// How sure that is.
    pub uncertainty: Uncertainty,
    /// What is kept.
    pub subset: Subset,
}

/// The whole job.
pub fn sift(run: &mut Run<'_>) -> Result<Sifted> {
    check(run.set, run.playground.specification(), run.config)?;
    let prior = prior(run)?;
    let scores = scores(run, &prior)?;
    let data_only = data_only(run)?;
    let selection = selection(run, &scores)?;
    let verdict = verdict(run, &[NamedSubset::new(KEPT, &selection.subset.demos)])?;
    Ok(Sifted { scores, selection, data_only, verdict })
}

/// How the run's method spends its budget.
pub fn plan(run: &Run<'_>) -> Plan {
    let Run { set, playground, config, .. } = run;
    method::plan(config.method, set, playground, &asked(config), &learning_seed(config))
}

/// Whether the budget of the run's method pays for any learning; the error says what would.
pub fn check_budget(set: &DemonstrationSet, playground: &Playground<'_>, config: &Config) -> Result<()> {
    method::check_budget(config.method, set, playground, &asked(config), &learning_seed(config))
}

fn asked(config: &Config) -> Asked<'_> {
    let Config { meta_train, inner, mutual_information, judge, .. } = config;
    Asked { training: meta_train, inner, information: mutual_information, judging: judge }
}

pub(crate) fn learning_seed(config: &Config) -> Seed {
    Seed::new(config.seed).of("meta_train")
}

/// Mutual information, where the method has any.
pub(crate) fn information(config: &Config) -> Option<&MutualInformation> {
    (config.method == Method::MamlMi).then_some(&config.mutual_information)
}

/// DemonstrationSet → MetaPrior, by the run's method.
pub fn prior(run: &mut Run<'_>) -> Result<MetaPrior> {
    if let Some(prior) = Artifact::recall(run.ledger, "")? {
        return Ok(prior);
    }
    check_budget(run.set, run.playground, run.config)?;
    let config = run.config;
    let seed = learning_seed(config);
    let hidden = &config.meta_train.discriminator_hidden;
    let untrained = Learner::untrained(run.set, &config.policy, hidden, &seed.of("start"));
    match config.method {
        Method::Maml | Method::MamlMi => meta_trained(run, untrained, &seed),
        Method::AvgFineTune => pre_trained(run, untrained, &seed),
        Method::FromScratch => {
            untrained.keep(run.ledger, "")?;
            Ok(untrained)
        }
    }
}

/// Algorithm 1.
fn meta_trained(run: &mut Run<'_>, untrained: Learner, seed: &Seed) -> Result<MetaPrior> {
    let training = MetaTraining { rounds: plan(run).updates, ..run.config.meta_train.clone() };
    let Run { set, playground, config, ledger, observer } = run;
    let start = || Ok(MetaState::from_prior(set, untrained, information(config), &seed.of("start")));
    let (state, mut keeping) =
        Keeping::begin((*ledger, *observer), playground, meta_train::STAGE, "", start)?;
    let learning = (&training, &config.inner, &config.mutual_information);
    let prior = meta_train::meta_train(set, playground, learning, state, seed, &mut keeping)?.prior;
    keeping.finish("", &prior)?;
    Ok(prior)
}

/// Imitation of the entire set (§5, Avg Fine-Tune).
fn pre_trained(run: &mut Run<'_>, untrained: Learner, seed: &Seed) -> Result<MetaPrior> {
    let updates = plan(run).updates;
    let Run { set, playground, config, ledger, observer } = run;
    let start = || Ok(PreTrainState::start(untrained, &config.inner));
    let (state, mut keeping) = Keeping::begin((*ledger, *observer), playground, pre_train::STAGE, "", start)?;
    let checkpoint_every = config.meta_train.checkpoint_every;
    let training = PreTraining { updates, inner: &config.inner, checkpoint_every };
    let prior = pre_train::pre_train(set, playground, training, state, seed, &mut keeping)?;
    keeping.finish("", &prior)?;
    Ok(prior)
}

/// MetaPrior → ScoreTable.
pub fn scores(run: &mut Run<'_>, prior: &MetaPrior) -> Result<ScoreTable> {
    if let Some(Judged { scores, .. }) = Artifact::recall(run.ledger, "")? {
        return Ok(scores);
    }
    let judging = Judging { iterations: plan(run).iterations, ..run.config.judge.clone() };
    let Run { set, playground, config, ledger, observer } = run;
    let start = || Ok(Judged::default());
    let (judged, mut keeping) = Keeping::begin((*ledger, *observer), playground, judge::STAGE, "", start)?;
    let seed = judging_seed(config);
    let judging = (&judging, &config.inner);
    let judged = judge::judge(prior, set, playground, judging, judged, (&seed, &mut keeping))?;
    keeping.finish("", &judged)?;
    Ok(judged.scores)
}

/// The random numbers of judging.
pub fn judging_seed(config: &Config) -> Seed {
    Seed::new(config.seed).of("judge")
}

/// The random numbers of the selection by weights.
pub(crate) fn weighing_seed(config: &Config) -> Seed {
    Seed::new(config.seed).of(subset_selection::STAGE)
}

/// MetaPrior → Weighing: a subset by weights (Algorithm 3), with the trends of the weights.
pub fn weighing(run: &mut Run<'_>, prior: &MetaPrior) -> Result<Weighing> {
    if let Some(weighing) = Artifact::recall(run.ledger, "")? {
        return Ok(weighing);
    }
    check_has_weights(run.config.method)?;
    let Run { set, playground, config, ledger, observer } = run;
    let seed = weighing_seed(config);
    let start = || Ok(WeighingState::start(set, prior.clone(), information(config), &seed.of("start")));
    let stage = subset_selection::STAGE;
    let (state, mut keeping) = Keeping::begin((*ledger, *observer), playground, stage, "", start)?;
    let means = Means {
        selection: &config.subset_selection,
        training: &config.meta_train,
        inner: &config.inner,
        information: &config.mutual_information,
        judging: &config.judge,
    };
    let weighing = subset_selection::select_subset(set, playground, &means, state, &seed, &mut keeping)?;
    keeping.finish("", &weighing)?;
    Ok(weighing)
}

/// What the stages that the ledger holds have really played, beside the budget of the run's method.
pub fn costs(run: &Run<'_>) -> Result<Costs> {
    let method = run.config.method;
    let stages = method.stage().into_iter().chain([judge::STAGE, subset_selection::STAGE]).map(str::to_owned);
    let imitations = ["subset", "all"].map(|part| stage_name(imitate::STAGE, part));
    let recall = |stage: String| Ok(Spent::recall(run.ledger, &stage)?.map(|spent| (stage, spent)));
    let stages = stages.chain(imitations).chain([referee::STAGE.to_owned()]);
    let spent = stages.filter_map(|stage| recall(stage).transpose());
    Ok(Costs { method, plan: plan(run), spent: spent.collect::<Result<_>>()? })
}

/// What scorers of the recorded data alone say of the set; nothing of it enters a ranking.
pub fn data_only(run: &mut Run<'_>) -> Result<DataOnly> {
    if let Some(found) = Artifact::recall(run.ledger, "")? {
        return Ok(found);
    }
    let found = data_only::data_only(run.set)?;
    found.keep(run.ledger, "")?;
    Ok(found)
}

/// How sure the scores are; the same for every stage that asks.
pub fn doubts(run: &Run<'_>, scores: &ScoreTable) -> Result<Uncertainty> {
    let seed = Seed::new(run.config.seed).of("uncertainty");
    uncertainty::uncertainty(scores, &Resampling::default(), &seed)
}

/// ScoreTable → Ranking, Uncertainty, Subset.
pub fn selection(run: &mut Run<'_>, scores: &ScoreTable) -> Result<Selection> {
    let (ranking, uncertainty) = (select::rank(scores), doubts(run, scores)?);
    let subset = match run.config.keep {
        Keep::Quarter => select::top_k(&ranking, run.set.len().div_ceil(4))?,
        Keep::Count(count) => select::top_k(&ranking, count)?,
        Keep::Auto => Subset { demos: uncertainty.worth_keeping() },
        Keep::Weights => {
            let prior = prior(run)?;
            Subset { demos: weighing(run, &prior)?.demos }
        }
    };
    ranking.keep(run.ledger, "")?;
    uncertainty.keep(run.ledger, "")?;
    subset.keep(run.ledger, "")?;
    Ok(Selection { ranking, uncertainty, subset })
}

/// Subset → LearningCurve; `part` names it among others, such as `subset` or `all`.
///
/// Every part starts from the same policy and plays with the same random numbers; a subset is imitated in the order of the
/// set, so that how it was ranked does not matter.
pub fn learning_curve(run: &mut Run<'_>, part: &str, demos: &[DemoId]) -> Result<LearningCurve> {
    let seed = Seed::new(run.config.seed).of("imitate");
    let mut demos = demos.to_vec();
    demos.sort_unstable();
    learning_curve_with(run, part, &demos, &seed)
}

/// The oracle (from scratch on one demonstration alone) with a seed of its own, which no other stage shares.
pub fn oracle(run: &mut Run<'_>, demo: DemoId, repeat: usize) -> Result<LearningCurve> {
    let seed = Seed::new(run.config.seed).of("oracle").at(repeat);
    learning_curve_with(run, &oracle_part(demo, repeat), &[demo], &seed)
}

/// Under which name the oracle's imitations are kept.
pub(crate) fn oracle_part(demo: DemoId, repeat: usize) -> String {
    format!("oracle_{demo}_{repeat}")
}

/// From scratch on a random subset of so many demonstrations, with the random numbers of the kept one; `number` tells
/// several apart.
pub fn random_subset(run: &mut Run<'_>, size: usize, number: usize) -> Result<LearningCurve> {
    use rand::seq::IndexedRandom;
    let mut rng = Seed::new(run.config.seed).of("random_subset").at(number).into_rng();
    let demos: Vec<DemoId> = run.set.ids().sample(&mut rng, size).copied().collect();
    learning_curve(run, &random_part(number), &demos)
}

/// Under which name the imitations of random subsets are kept.
pub(crate) fn random_part(number: usize) -> String {
    format!("random_{number}")
}

fn learning_curve_with(
    run: &mut Run<'_>,
    part: &str,
    demos: &[DemoId],
    seed: &Seed,
) -> Result<LearningCurve> {
    let Run { set, playground, config, ledger, observer } = run;
    if let Some(curve) = LearningCurve::recall(*ledger, part)?
        && curve.demos == demos
    {
        // Again, in case that the run was killed between the two.
        onnx::keep_policy(*ledger, part, &curve.best, playground.specification())?;
        return Ok(curve);
    }
    let imitation = &config.imitate;
    let start = || Ok(ImitationState::start((set, demos), &config.policy, imitation, &seed.of("start")));
    let (mut state, mut keeping) =
        Keeping::begin((*ledger, *observer), playground, imitate::STAGE, part, start)?;
    if state.demos() != demos {
        state = start()?;
    }
    let curve = imitate::imitate(set, playground, imitation, state, seed, (part, &mut keeping))?;
    keeping.finish(part, &curve)?;
    onnx::keep_policy(*ledger, part, &curve.best, playground.specification())?;
    Ok(curve)
}
