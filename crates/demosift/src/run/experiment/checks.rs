//! Whether set, task and configuration fit each other, before anything is spent.

use super::Config;
use crate::basics::error::{Error, Result};
use crate::data::demonstration::DemonstrationSet;
use crate::learning::adapt::{InnerUpdate, Rule};
use crate::learning::advantage::AdvantageEstimation;
use crate::learning::behavioral_cloning::{Cloning, Descent};
use crate::learning::trpo::TrustRegion;
use crate::results::data_only;
use crate::stages::demonstrator::DemonstratorTraining;
use crate::stages::judge::Judging;
use crate::stages::meta_train::{MutualInformation, Order};
use crate::stages::method::Method;
use crate::stages::select::Keep;
use crate::stages::subset_selection::SubsetSelection;
use crate::world::environment::Specification;
use crate::world::policy::PolicyShape;

/// Whether a set was recorded in a task of these sizes.
///
/// # Errors
/// `is_bad_input` if observations or actions have another size, or nothing that is observed varies.
pub fn check_fits(set: &DemonstrationSet, task: &Specification) -> Result<()> {
    task.check_sizes(set.observation_size(), set.action_size())?;
    if !data_only::observations_vary(set) {
        return Err(Error::bad_input(
            "no number of the observations varies over the set, so nothing can be learned from it: a policy could not tell one \
             state from another",
        )
        .with_hint("check which columns were recorded; `demosift inspect` shows them"));
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
    if let Some(wanted) = config.keep.misfit(set.len()) {
        return Err(Error::bad_config(format!("keep = {}, and {wanted}", config.keep)));
    }
    match config.keep {
        Keep::Weights => check_has_weights(config.method),
        Keep::Quarter | Keep::Auto | Keep::Count(_) => Ok(()),
    }
}

/// Whether there is an exact meta-gradient of the inner update, if one is asked for.
fn check_order(config: &Config) -> Result<()> {
    let InnerUpdate { imitation, cloning, .. } = &config.inner;
    let is_through_adam = *imitation == Rule::BehavioralCloning && cloning.descent == Descent::Adam;
    match config.meta_train.order {
        Order::Second if *imitation == Rule::Gail => Err(Error::bad_config(
            "meta_train.order = second with inner.imitation = gail: the exact meta-gradient is that of cloning, and \
             meta_train.order must be first, or inner.imitation behavioral_cloning",
        )),
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
    let Config { policy, inner, meta_train, mutual_information, subset_selection, imitate, .. } = config;
    let Config { judge, cloning_judge, trainer_judge, .. } = config;
    let mut numbers = Numbers::default();
    numbers.count("near_cut", config.near_cut);
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
    numbers.judging("judge", judge);
    numbers.judging("cloning_judge.judging", &cloning_judge.judging);
    numbers.cloning("cloning_judge.cloning", &cloning_judge.cloning);
    numbers.count("trainer_judge.repeats", trainer_judge.repeats);
    numbers.count("trainer_judge.evaluations", trainer_judge.evaluations);
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
        self.number(&format!("{name}.discriminator.most_told"), discriminator.most_told, Wanted::Share);
        self.advantage(&format!("{name}.advantage"), advantage);
        self.cloning(&format!("{name}.cloning"), cloning);
    }

    fn cloning(&mut self, name: &str, cloning: &Cloning) {
        self.count(&format!("{name}.steps"), cloning.steps);
        self.count(&format!("{name}.batch"), cloning.batch);
        self.number(&format!("{name}.learning_rate"), cloning.learning_rate, Wanted::Positive);
    }

    fn judging(&mut self, name: &str, judging: &Judging) {
        self.count(&format!("{name}.iterations"), judging.iterations);
        self.count(&format!("{name}.averaged"), judging.averaged);
        self.count(&format!("{name}.evaluations"), judging.evaluations);
        self.count(&format!("{name}.repeats"), judging.repeats);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basics::seed::Seed;
    use crate::run::preset::Preset;
    use crate::world::environment::Task as _;
    use crate::world::point_mass::{PointMass, planted_set};

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
        let exact_through_gail = complaint(|config| config.meta_train.order = Order::Second);
        assert!(exact_through_gail.ends_with("must be first, or inner.imitation behavioral_cloning"));
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
