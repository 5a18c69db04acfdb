//! The whole flow as one function: a noisy set goes in; a ranking, a subset and a better policy come out.
//!
//! Each arrow of the flow makes one result, and a [`Ledger`] stores the results: what a ledger already holds is not made
//! again, and what was begun goes on from its last checkpoint to the identical result.
//!
//! [`sift`] is the whole job, shown on the first page of this crate; its stages can be taken one by one:
//!
//! ```
//! use demosift::basics::ledger::InMemory;
//! use demosift::basics::observer::Silent;
//! use demosift::basics::seed::Seed;
//! use demosift::results::panel::Judge;
//! use demosift::run::experiment::{Run, panel, scores, selection};
//! use demosift::run::preset::Preset;
//! use demosift::stages::select::Keep;
//! use demosift::world::point_mass::{PointMass, planted_set};
//! use demosift::world::rollout::Playground;
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
//! let table = scores(&mut run, Judge::Paper)?; // Algorithms 1 and 2
//! let said = panel(&mut run)?; // both judges beside each other
//! let selected = selection(&mut run, &said)?; // Eq. 9
//! assert!(selected.subset.demos.iter().all(|demo| [1, 3].contains(&demo.0)));
//!
//! // The ledger has all of it now, so asking again plays nothing.
//! let played = playground.steps_taken();
//! assert_eq!(scores(&mut run, Judge::Paper)?, table);
//! assert_eq!(playground.steps_taken(), played);
//! # Ok::<(), demosift::Error>(())
//! ```

pub(crate) mod arrows;
mod asked_trainer;
mod checkpointing;
mod checks;
mod chosen;
mod judging;
mod made_with;
mod near_cut;
mod oracle;
mod sparing;
mod verdict;

use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::basics::ledger::Ledger;
use crate::basics::observer::Observer;
use crate::basics::seed::Seed;
use crate::data::demonstration::{DemoId, DemonstrationSet};
use crate::learning::adapt::{InnerUpdate, MetaPrior};
use crate::learning::behavioral_cloning::Cloning;
use crate::results::artifact::{self, Artifact, onnx};
use crate::results::data_only::{self, DataOnly};
use crate::results::panel::{Judge, Judges, Order, Panel};
use crate::results::uncertainty::Uncertainty;
use crate::stages::imitate::{self, Imitation, ImitationState, LearningCurve, Lesson};
use crate::stages::judge::{self, Judging};
use crate::stages::meta_train::{MetaTraining, MutualInformation};
use crate::stages::method::{Costs, Method, Spent};
use crate::stages::referee::{self, Refereeing, Verdict};
use crate::stages::select::{self, Keep, Ranking, Subset};
use crate::stages::subset_selection::{self, SubsetSelection, Weighing, WeighingState};
use crate::world::policy::PolicyShape;
use crate::world::rollout::Playground;

use arrows::Arrow;
pub use asked_trainer::{TrainerJudge, check_judged_by};
pub use checkpointing::{Checkpointing, forget_checkpoint};
pub(crate) use checkpointing::{OfPart, begun, note_work_on, stage_name, states_of_parts, worked_on_by};
pub use checks::{check, check_demonstrator, check_fits, check_has_weights};
pub(crate) use chosen::cut;
use chosen::cut_of_judging;
pub use chosen::{kept_part, worth_training_on};
pub use judging::{
    first_start, hand_on, hand_on_prior, judging, judging_seed, opinion, panel, prior, scores,
};
pub(crate) use made_with::{
    Preparation, cloning_update, information, judged_by, learning_by, learning_seed, preparation, weighed_by,
};
pub use made_with::{budget, check_budget};
pub(crate) use near_cut::NEAR_CUT;
pub use near_cut::how_many;
pub(crate) use oracle::{OracleTraining, oracle_part, oracle_trainings, random_part};
pub use oracle::{oracle, oracle_curve, policy_from_kept, random_subset};
pub(crate) use sparing::FULL_EFFORT_UP_TO;
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
    /// Which judges are asked.
    pub judges: Judges,
    /// How many demonstrations to keep.
    pub keep: Keep,
    /// How many were to be kept when they were judged, where that was asked for differently than now: further repeats went
    /// to those near that cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub judged_for: Option<Keep>,
    /// Whether the process computes the same bits on every x86-64 processor with AVX2 and FMA; who begins the process has it do so
    /// ([`crate::math::arithmetic::make_portable`]).
    #[serde(default)]
    pub portable: bool,
    /// How many demonstrations of a larger set the judge of the paper judges where both judges are asked: those nearest to the
    /// cut of the judge by cloning.
    #[serde(default = "near_cut::near_cut")]
    pub near_cut: usize,
    /// The policy's shape, in meta-training and from scratch.
    pub policy: PolicyShape,
    /// The inner update, in meta-training and in judging.
    pub inner: InnerUpdate,
    /// Meta-training.
    pub meta_train: MetaTraining,
    /// How meta-training is regularized by mutual information, where the method is `maml-mi`.
    pub mutual_information: MutualInformation,
    /// Judging by the paper's judge.
    pub judge: Judging,
    /// Judging by behavioral cloning.
    pub cloning_judge: CloningJudge,
    /// Judging by somebody else's trainer.
    #[serde(default)]
    pub trainer_judge: TrainerJudge,
    /// Selection of a subset by weights (Algorithm 3), where it is asked for.
    pub subset_selection: SubsetSelection,
    /// Imitation from scratch.
    pub imitate: Imitation,
    /// How often final policies are trained to say whether selecting helps.
    pub referee: Refereeing,
}

/// How demonstrations are judged by behavioral cloning from scratch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CloningJudge {
    /// How long, how often and on what it is evaluated.
    pub judging: Judging,
    /// The update.
    pub cloning: Cloning,
    /// Each of so many demonstrations is judged as it says above. In a larger set each is imitated half as often, and at least
    /// three times, before further repeats go to those near the cut, and by no more updates than go over its pairs 600 times.
    #[serde(default = "sparing::full_effort_up_to")]
    pub full_effort_up_to: usize,
}

/// What a run is about, and where it stores and tells what it finds.
pub struct Run<'a> {
    /// V.
    pub set: &'a DemonstrationSet,
    /// The task at play.
    pub playground: &'a Playground<'a>,
    /// How.
    pub config: &'a Config,
    /// Stores the results.
    pub ledger: &'a mut dyn Ledger,
    /// Receives the progress.
    pub observer: &'a mut dyn Observer,
}

/// What comes out of the whole flow.
#[derive(Clone, Debug, PartialEq)]
pub struct Sifted {
    /// What each judge says.
    pub panel: Panel,
    /// What was concluded from it.
    pub selection: Selection,
    /// What scorers of the recorded data alone say; beside the ranking, never in it.
    pub data_only: DataOnly,
    /// What to train on, by which imitator, and whether selecting helps.
    pub verdict: Verdict,
}

/// What is concluded from the judges' scores.
#[derive(Clone, Debug, PartialEq)]
pub struct Selection {
    /// From the most to the least suitable, by those who decide.
    pub ranking: Ranking,
    /// How sure that is.
    pub uncertainty: Uncertainty,
    /// What is kept.
    pub subset: Subset,
}

/// The whole job.
pub fn sift(run: &mut Run<'_>) -> Result<Sifted> {
    check(run.set, run.playground.specification(), run.config)?;
    let panel = panel(run)?;
    let data_only = data_only(run)?;
    let selection = selection(run, &panel)?;
    let verdict = verdict(run, &worth_training_on(run, &panel, &selection)?)?;
    Ok(Sifted { panel, selection, data_only, verdict })
}

/// Makes all that is wanted and not there.
fn make(run: &mut Run<'_>, wanted: &[Arrow]) -> Result<()> {
    for arrow in arrows::missing(run, wanted)? {
        match arrow {
            Arrow::Prior => drop(prior(run)?),
            Arrow::Scores(judge) => drop(scores(run, judge)?),
            Arrow::Weighing => {
                let prior = prior(run)?;
                weighing(run, &prior)?;
            }
        }
    }
    arrows::tidy(run, wanted)
}

/// Whether all that a stored result names are demonstrations of the set.
fn check_known(set: &DemonstrationSet, demos: impl IntoIterator<Item = DemoId>, what: &str) -> Result<()> {
    match demos.into_iter().find(|demo| !set.holds(*demo)) {
        None => Ok(()),
        Some(demo) => Err(Error::bad_input(format!(
            "{what} name demonstration {demo}, which is not of the set of {} demonstrations",
            set.len()
        ))
        .with_hint("the run folder holds files of another run; run it again with another folder for --out")),
    }
}

/// MetaPrior → Weighing: a subset by weights (Algorithm 3), with the trends of the weights.
pub fn weighing(run: &mut Run<'_>, prior: &MetaPrior) -> Result<Weighing> {
    if let Some(weighing) = Weighing::recall(run.ledger, "")? {
        forget_checkpoint(run.ledger, subset_selection::STAGE, "");
        check_known(run.set, weighing.demos.iter().copied(), "weights.json")?;
        return Ok(weighing);
    }
    if let Some(part) = run.ledger.part() {
        return Err(Error::bad_input(format!(
            "part {part} of the run needs the weights of the demonstrations, which are found once, and the run has none"
        ))
        .with_hint("make them with `demosift weigh` and the same options but --part, and start the parts then"));
    }
    check_has_weights(run.config.method)?;
    let Run { set, playground, config, ledger, observer } = run;
    let by = weighed_by(config);
    let seed = &by.seed;
    let start = || Ok(WeighingState::start(set, prior.clone(), information(config), &seed.of("start")));
    let stage = subset_selection::STAGE;
    let (state, mut checkpointing) = Checkpointing::begin(*ledger, *observer, playground, stage, "", start)?;
    let weighing =
        subset_selection::select_subset(set, playground, &by.means, state, seed, &mut checkpointing)?;
    checkpointing.finish("", &weighing)?;
    Ok(weighing)
}

/// What the stages that the ledger holds have really played, beside the budget of the run's method.
pub fn costs(run: &Run<'_>) -> Result<Costs> {
    let method = run.config.method;
    let [cloning, judging, by_trainer] = Judge::ALL.map(|judge| stage_name(judge::STAGE, judge.name()));
    let before = method.stage().map(str::to_owned);
    let stages = [by_trainer, cloning]
        .into_iter()
        .chain(before)
        .chain([judging.clone(), subset_selection::STAGE.to_owned()]);
    let imitations = [kept_part(run.config), "all".to_owned()].map(|part| stage_name(imitate::STAGE, &part));
    let recall = |stage: String| Ok(Spent::recall(run.ledger, &stage)?.map(|spent| (stage, spent)));
    let stages = stages.chain(imitations).chain([referee::STAGE.to_owned()]);
    let spent = stages.filter_map(|stage| recall(stage).transpose());
    let spent = spent.collect::<Result<_>>()?;
    let demonstrations = near_cut::how_many(run.config, run.set, Judge::Paper);
    Ok(Costs { method, budget: budget(run), judging, spent, demonstrations })
}

/// What scorers of the recorded data alone say of the set; nothing of it enters a ranking.
pub fn data_only(run: &mut Run<'_>) -> Result<DataOnly> {
    if let Some(found) = Artifact::recall(run.ledger, "")? {
        return Ok(found);
    }
    let found = data_only::data_only(run.set)?;
    found.store(run.ledger, "")?;
    Ok(found)
}

/// What would be kept of an order, where not weights decide.
pub(super) fn kept(run: &Run<'_>, order: Order<'_>) -> Result<Subset> {
    match run.config.keep {
        Keep::Auto => Ok(Subset { demos: order.uncertainty.worth_keeping() }),
        _ => select::top_k(order.ranking, cut(run)),
    }
}

/// Panel → Ranking, Uncertainty, Subset: the order that is taken, and what is kept of it.
pub fn selection(run: &mut Run<'_>, panel: &Panel) -> Result<Selection> {
    make(run, &arrows::for_selection(run.config))?;
    let Order { ranking, uncertainty } = panel.deciding();
    let subset = match run.config.keep {
        Keep::Quarter | Keep::Count(_) | Keep::Auto => kept(run, panel.deciding())?,
        Keep::Weights => {
            let prior = prior(run)?;
            Subset { demos: weighing(run, &prior)?.demos }
        }
    };
    ranking.store(run.ledger, "")?;
    uncertainty.store(run.ledger, "")?;
    subset.store(run.ledger, "")?;
    Ok(Selection { ranking: ranking.clone(), uncertainty: uncertainty.clone(), subset })
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

fn learning_curve_with(
    run: &mut Run<'_>,
    part: &str,
    demos: &[DemoId],
    seed: &Seed,
) -> Result<LearningCurve> {
    let Run { set, playground, config, ledger, observer } = run;
    let fits = |curve: &LearningCurve| curve.demos == demos;
    if let Some(curve) = artifact::recall_fitting(*ledger, part, fits)? {
        // Again, in case that the run was killed between the two.
        forget_checkpoint(*ledger, imitate::STAGE, part);
        onnx::store_policy(*ledger, part, &curve.best, playground.specification())?;
        return Ok(curve);
    }
    let imitation = &config.imitate;
    let start = || Ok(ImitationState::start(set, demos, &config.policy, imitation, &seed.of("start")));
    let (mut state, mut checkpointing) =
        Checkpointing::begin(*ledger, *observer, playground, imitate::STAGE, part, start)?;
    if state.demos() != demos {
        state = start()?;
    }
    let lesson = Lesson { set, playground, imitation, part, seed };
    let curve = imitate::imitate(&lesson, state, &mut checkpointing)?;
    checkpointing.finish(part, &curve)?;
    onnx::store_policy(*ledger, part, &curve.best, playground.specification())?;
    Ok(curve)
}
