//! The whole flow as one function: a noisy set goes in; a ranking, a subset and a better policy come out.
//!
//! Each arrow of the flow makes one noun, and a [`Ledger`] keeps the nouns: what a ledger already holds is not made
//! again, and what was begun goes on from its last checkpoint to the identical result.

mod keeping;

use serde::{Deserialize, Serialize};

use crate::adapt::{InnerUpdate, Learner, MetaPrior, Rule};
use crate::advantage::AdvantageEstimation;
use crate::artifact::{Artifact, onnx};
use crate::behavioral_cloning::Descent;
use crate::data_only::{self, DataOnly};
use crate::demonstration::{DemoId, DemonstrationSet};
use crate::demonstrator::DemonstratorTraining;
use crate::environment::Specification;
use crate::error::{Error, Result};
use crate::imitate::{self, Imitation, ImitationState, LearningCurve};
use crate::judge::{self, Judged, Judging, ScoreTable};
use crate::ledger::Ledger;
use crate::meta_train::{self, MetaState, MetaTraining, MutualInformation, Order};
use crate::method::{self, Asked, Costs, Method, Plan, Spent};
use crate::metrics::{self, Gain};
use crate::observer::Observer;
use crate::policy::PolicyShape;
use crate::pre_train::{self, PreTrainState, PreTraining};
use crate::rollout::Playground;
use crate::seed::Seed;
use crate::select::{self, Keep, Ranking, Subset};
use crate::subset_selection::{self, Means, SubsetSelection, Weighing, WeighingState};
use crate::trpo::TrustRegion;
use crate::uncertainty::{self, Resampling, Uncertainty};

pub use keeping::Keeping;
pub(crate) use keeping::{begun, stage_name};

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
    /// Imitation from scratch of the subset.
    pub from_subset: LearningCurve,
    /// Imitation from scratch of the whole set, with as many environment steps.
    pub from_all: LearningCurve,
    /// How much better the policy from the subset is.
    pub gain: Gain,
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
    let from_subset = learning_curve(run, "subset", &selection.subset.demos)?;
    let from_all = learning_curve(run, "all", &run.set.ids())?;
    let gain = metrics::gain(&from_subset.outcome, &from_all.outcome);
    Ok(Sifted { scores, selection, data_only, from_subset, from_all, gain })
}

/// Whether a set was recorded in a task of these sizes.
///
/// # Errors
/// `is_bad_input` if observations or actions have another size.
pub fn check_fits(set: &DemonstrationSet, task: &Specification) -> Result<()> {
    let sizes = [
        ("observation", set.observation_size(), task.observation_size),
        ("action", set.action_size(), task.action_size),
    ];
    for (what, found, wanted) in sizes {
        if found != wanted {
            return Err(Error::bad_input(format!(
                "the demonstrations have {found} numbers in an {what}, but the task '{}' has {wanted}",
                task.name
            ))
            .with_hint("check that the set was recorded in this task"));
        }
    }
    Ok(())
}

/// Whether set, task and configuration fit each other; the error says what would.
pub fn check(set: &DemonstrationSet, task: &Specification, config: &Config) -> Result<()> {
    check_fits(set, task)?;
    check_numbers(config)?;
    check_order(config)?;
    let SubsetSelection { smallest, floor, epsilon, .. } = config.subset_selection;
    if floor >= epsilon {
        return Err(Error::bad_config(format!(
            "subset_selection.floor = {floor}, and must be below subset_selection.epsilon = {epsilon}, or all are kept"
        )));
    }
    if smallest > set.len() {
        return Err(Error::bad_config(format!(
            "subset_selection.smallest = {smallest}, and must be at most the {} demonstrations there are",
            set.len()
        )));
    }
    match config.keep {
        Keep::Weights => check_has_weights(config.method),
        Keep::Count(count) if !(1..=set.len()).contains(&count) => Err(Error::bad_config(format!(
            "keep = {count}, and must be from 1 to the {} demonstrations there are, {}",
            set.len(),
            Keep::WORDS
        ))),
        _ => Ok(()),
    }
}

/// Whether there is an exact meta-gradient of the inner update, if one is asked for.
fn check_order(config: &Config) -> Result<()> {
    let InnerUpdate { imitation, cloning, .. } = &config.inner;
    let is_through_adam = *imitation == Rule::BehavioralCloning && cloning.descent == Descent::Adam;
    match config.meta_train.order {
        Order::Second if is_through_adam => Err(Error::bad_config(
            "meta_train.order = second with inner.cloning.descent = adam: Adam is not differentiated through, \
             and inner.cloning.descent must be gradient, or meta_train.order first",
        )),
        _ => Ok(()),
    }
}

/// Whether a method has meta-updates, which the weights of Algorithm 3 enter.
pub fn check_has_weights(method: Method) -> Result<()> {
    match method {
        Method::Maml | Method::MamlMi => Ok(()),
        Method::AvgFineTune | Method::FromScratch => Err(Error::bad_config(format!(
            "method = {method}, and must be maml or maml-mi to select by weights, which enter the meta-update"
        ))),
    }
}

/// Whether each number of the configuration means something by itself.
fn check_numbers(config: &Config) -> Result<()> {
    let Config { policy, inner, meta_train, mutual_information, judge, subset_selection, imitate, .. } =
        config;
    let mut numbers = Numbers::default();
    numbers.policy("policy", policy);
    numbers.update("inner", inner);
    numbers.count("meta_train.meta_batch", meta_train.meta_batch);
    numbers.trust_region("meta_train.trust_region", &meta_train.trust_region);
    numbers.number(
        "meta_train.discriminator_learning_rate",
        meta_train.discriminator_learning_rate,
        Wanted::Positive,
    );
    numbers.number("meta_train.policy_learning_rate", meta_train.policy_learning_rate, Wanted::Positive);
    numbers.widths("meta_train.discriminator_hidden", &meta_train.discriminator_hidden);
    numbers.information("mutual_information", mutual_information);
    numbers.count("judge.iterations", judge.iterations);
    numbers.count("judge.averaged", judge.averaged);
    numbers.count("judge.evaluations", judge.evaluations);
    numbers.count("judge.repeats", judge.repeats);
    numbers.subset_selection("subset_selection", subset_selection);
    numbers.count("imitate.evaluations", imitate.evaluations);
    numbers.update("imitate.update", &imitate.update);
    numbers.widths("imitate.discriminator_hidden", &imitate.discriminator_hidden);
    numbers.check()
}

/// Whether each number of a demonstrator's training means something by itself; the error says what would.
pub fn check_demonstrator(training: &DemonstratorTraining) -> Result<()> {
    let mut numbers = Numbers::default();
    numbers.count("demonstrator.batch_steps", training.batch_steps);
    numbers.policy("demonstrator.policy", &training.policy);
    numbers.trust_region("demonstrator.trust_region", &training.trust_region);
    numbers.advantage("demonstrator.advantage", &training.advantage);
    numbers.check()
}

/// Numbers of a configuration by name, each with what it must be.
#[derive(Default)]
struct Numbers {
    counts: Vec<(String, usize)>,
    numbers: Vec<(String, f64, Wanted)>,
}

/// What a number of a configuration must be.
#[derive(Clone, Copy)]
enum Wanted {
    Positive,
    NotNegative,
    AtLeastOne,
    Share,
}

impl Numbers {
    fn count(&mut self, name: &str, count: usize) {
        self.counts.push((name.to_owned(), count));
    }

    fn number(&mut self, name: &str, number: f64, wanted: Wanted) {
        self.numbers.push((name.to_owned(), number, wanted));
    }

    fn widths(&mut self, name: &str, widths: &[usize]) {
        widths.iter().for_each(|width| self.count(&format!("one of {name}"), *width));
    }

    fn policy(&mut self, name: &str, shape: &PolicyShape) {
        self.widths(&format!("{name}.hidden"), &shape.hidden);
        self.number(&format!("{name}.initial_std"), shape.initial_std, Wanted::Positive);
    }

    fn trust_region(&mut self, name: &str, region: &TrustRegion) {
        self.count(&format!("{name}.conjugate_gradient_iterations"), region.conjugate_gradient_iterations);
        self.number(&format!("{name}.max_kl"), region.max_kl, Wanted::Positive);
        self.number(&format!("{name}.damping"), region.damping, Wanted::NotNegative);
        self.number(&format!("{name}.accept_ratio"), region.accept_ratio, Wanted::Share);
    }

    fn advantage(&mut self, name: &str, estimation: &AdvantageEstimation) {
        self.number(&format!("{name}.discount"), estimation.discount, Wanted::Share);
        self.number(&format!("{name}.lambda"), estimation.lambda, Wanted::Share);
    }

    fn update(&mut self, name: &str, update: &InnerUpdate) {
        let InnerUpdate { batch_steps, alphas, trust_region, discriminator, advantage, cloning, .. } = update;
        self.count(&format!("{name}.batch_steps"), *batch_steps);
        self.count(&format!("the number of {name}.alphas"), alphas.len());
        for alpha in alphas {
            self.number(&format!("one of {name}.alphas"), *alpha, Wanted::Positive);
        }
        self.trust_region(&format!("{name}.trust_region"), trust_region);
        self.count(&format!("{name}.discriminator.steps"), discriminator.steps);
        self.count(&format!("{name}.discriminator.batch"), discriminator.batch);
        let rate = discriminator.learning_rate;
        self.number(&format!("{name}.discriminator.learning_rate"), rate, Wanted::Positive);
        self.number(&format!("{name}.discriminator.entropy"), discriminator.entropy, Wanted::NotNegative);
        self.advantage(&format!("{name}.advantage"), advantage);
        self.count(&format!("{name}.cloning.steps"), cloning.steps);
        self.count(&format!("{name}.cloning.batch"), cloning.batch);
        let rate = cloning.learning_rate;
        self.number(&format!("{name}.cloning.learning_rate"), rate, Wanted::Positive);
    }

    fn information(&mut self, name: &str, information: &MutualInformation) {
        let MutualInformation { batch_steps, noise, posterior, trust_region, .. } = information;
        self.count(&format!("{name}.batch_steps"), *batch_steps);
        for (field, count) in [
            ("lstm", posterior.lstm),
            ("dense", posterior.dense),
            ("readings", posterior.readings),
            ("steps", posterior.steps),
            ("batch", posterior.batch),
        ] {
            self.count(&format!("{name}.posterior.{field}"), count);
        }
        let rate = posterior.learning_rate;
        self.number(&format!("{name}.posterior.learning_rate"), rate, Wanted::Positive);
        self.number(&format!("{name}.noise"), *noise, Wanted::Positive);
        self.trust_region(&format!("{name}.trust_region"), trust_region);
    }

    fn subset_selection(&mut self, name: &str, selection: &SubsetSelection) {
        for (field, count) in [
            ("rounds", selection.rounds),
            ("steady_rounds", selection.steady_rounds),
            ("meta_updates", selection.meta_updates),
            ("iterations", selection.iterations),
            ("smallest", selection.smallest),
        ] {
            self.count(&format!("{name}.{field}"), count);
        }
        self.number(&format!("{name}.beta"), selection.beta, Wanted::AtLeastOne);
        self.number(&format!("{name}.epsilon"), selection.epsilon, Wanted::Positive);
        self.number(&format!("{name}.floor"), selection.floor, Wanted::Positive);
    }

    fn check(&self) -> Result<()> {
        if let Some((name, _)) = self.counts.iter().find(|(_, count)| *count == 0) {
            return Err(Error::bad_config(format!("{name} = 0, and must be at least 1")));
        }
        match self.numbers.iter().find(|(_, number, wanted)| !wanted.holds(*number)) {
            Some((name, number, wanted)) => {
                Err(Error::bad_config(format!("{name} = {number}, and must be {}", wanted.in_words())))
            }
            None => Ok(()),
        }
    }
}

impl Wanted {
    fn holds(self, number: f64) -> bool {
        match self {
            Self::Positive => number.is_finite() && number > 0.0,
            Self::NotNegative => number.is_finite() && number >= 0.0,
            Self::AtLeastOne => number.is_finite() && number >= 1.0,
            Self::Share => (0.0..=1.0).contains(&number),
        }
    }

    fn in_words(self) -> &'static str {
        match self {
            Self::Positive => "a number above 0",
            Self::NotNegative => "a number of at least 0",
            Self::AtLeastOne => "a number of at least 1",
            Self::Share => "a number from 0 to 1",
        }
    }
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
    let spent = stages.chain(imitations).filter_map(|stage| recall(stage).transpose());
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::environment::Task as _;
    use crate::point_mass::{PointMass, planted_set};
    use crate::preset::Preset;

    fn complaint(change: impl FnOnce(&mut Config)) -> String {
        let set = planted_set(&[0.0, 90.0, 180.0], Seed::new(1)).expect("a valid set");
        let mut config = Preset::Quick.config();
        change(&mut config);
        let error = check(&set, PointMass::new().specification(), &config).expect_err("a mistake");
        assert!(error.is_bad_config(), "{error}");
        error.to_string()
    }

    #[test]
    fn every_preset_passes_the_check() {
        let set = planted_set(&[0.0, 90.0, 180.0], Seed::new(1)).expect("a valid set");
        for (_, preset) in Preset::ALL {
            check(&set, PointMass::new().specification(), &preset.config()).expect("a preset is right");
        }
    }

    #[test]
    fn a_wrong_number_is_told_with_its_name_and_what_would_be_right() {
        let zero = |name: &str| format!("{name} = 0, and must be at least 1");
        assert_eq!(complaint(|config| config.inner.batch_steps = 0), zero("inner.batch_steps"));
        assert_eq!(
            complaint(|config| config.inner.discriminator.batch = 0),
            zero("inner.discriminator.batch")
        );
        assert_eq!(complaint(|config| config.judge.repeats = 0), zero("judge.repeats"));
        assert_eq!(complaint(|config| config.inner.cloning.batch = 0), zero("inner.cloning.batch"));
        let exact_through_adam = complaint(|config| {
            (config.inner.imitation, config.inner.cloning.descent) = (Rule::BehavioralCloning, Descent::Adam);
            config.meta_train.order = Order::Second;
        });
        assert!(exact_through_adam.ends_with("must be gradient, or meta_train.order first"));
        assert_eq!(complaint(|config| config.policy.hidden[1] = 0), zero("one of policy.hidden"));
        assert_eq!(
            complaint(|config| config.imitate.update.alphas.clear()),
            zero("the number of imitate.update.alphas")
        );
        assert_eq!(
            complaint(|config| config.policy.initial_std = -1.0),
            "policy.initial_std = -1, and must be a number above 0"
        );
        assert_eq!(
            complaint(|config| config.inner.trust_region.max_kl = f64::NAN),
            "inner.trust_region.max_kl = NaN, and must be a number above 0"
        );
        assert_eq!(
            complaint(|config| config.imitate.update.advantage.discount = 7.0),
            "imitate.update.advantage.discount = 7, and must be a number from 0 to 1"
        );
        assert_eq!(
            complaint(|config| config.inner.discriminator.entropy = -0.1),
            "inner.discriminator.entropy = -0.1, and must be a number of at least 0"
        );
        assert_eq!(
            complaint(|config| config.mutual_information.posterior.readings = 0),
            zero("mutual_information.posterior.readings")
        );
        assert_eq!(
            complaint(|config| config.keep = Keep::Count(4)),
            "keep = 4, and must be from 1 to the 3 demonstrations there are, auto, weights, or quarter"
        );
    }

    #[test]
    fn a_set_of_another_task_is_told_with_both_sizes() {
        let set = planted_set(&[0.0, 90.0], Seed::new(1)).expect("a valid set");
        let mut task = PointMass::new().specification().clone();
        task.observation_size = 7;
        let error = check(&set, &task, &Preset::Quick.config()).expect_err("a mistake");
        assert!(error.is_bad_input());
        assert_eq!(
            error.to_string(),
            "the demonstrations have 4 numbers in an observation, but the task 'point_mass' has 7"
        );
    }
}
