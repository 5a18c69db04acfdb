use super::*;
use crate::data::demonstration::DemoId;
use crate::data::weights::Weights;
use crate::learning::adapt::{InnerUpdate, Learner};
use crate::math::nn::check::{derivative, gradient_error};
use crate::math::nn::gaussian;
use crate::math::nn::mlp::Tape;
use crate::math::rows::Rows;
use crate::run::preset::Preset;
use crate::world::point_mass::{PointMass, planted_set};
use crate::world::policy::{Policy, PolicyShape};
use crate::world::rollout::Playground;

const BEARINGS: [f32; 3] = [0.0, 120.0, 240.0];

fn information() -> MutualInformation {
    let quick = Preset::Quick.config().mutual_information;
    let posterior =
        PosteriorFitting { lstm: 8, dense: 6, readings: 10, steps: 15, batch: 24, ..quick.posterior };
    MutualInformation { batch_steps: 150, posterior, ..quick }
}

fn inner() -> InnerUpdate {
    InnerUpdate { batch_steps: 180, ..Preset::Quick.config().inner }
}

/// A round up to line 9, behind it lines 10 to 14.
struct Scene {
    prior: Learner,
    adapted: Vec<Policy>,
    informed: Vec<Policy>,
    state: PosteriorState,
    encodings: Vec<f32>,
    report: Report,
    steps_taken: u64,
}

fn scene(how: &MutualInformation, goals: usize) -> Scene {
    scene_of(how, goals, Seed::new(2))
}

fn scene_of(how: &MutualInformation, goals: usize, seed: Seed) -> Scene {
    let set = planted_set(&BEARINGS, Seed::new(1)).expect("a valid set");
    let (task, inner) = (PointMass::with_goals(goals), inner());
    let playground = &Playground::new(&task);
    let shape = PolicyShape { hidden: vec![6], initial_std: 0.5 };
    let prior = Learner::untrained(&set, &shape, &[8], &Seed::new(1));
    let target = |demo: DemoId| Target { demo, variant: EnvVariant(demo.0 % goals) };
    let targets: Vec<_> = set.ids().into_iter().map(target).collect();
    let weights = &Weights::ones(&set);
    let round = Round { prior: &prior, targets: &targets, weights, playground, inner: &inner, seed: &seed };
    let before = super::super::play_before(&round).expect("finite numbers");
    let demonstrated = prior.demonstrated_pairs(&set);
    let mut imitators = super::super::imitate(&round, &before, &demonstrated).expect("finite numbers");
    let adapted = imitators.iter().map(|one| one.adapted.policy.clone()).collect();
    let encodings = mutual_information::encodings(&set);
    let mut state = PosteriorState::start(&set, &how.posterior, Seed::new(3));
    let played_before = playground.steps_taken();
    let regularizer = Regularizer { how, state: &mut state, encodings: &encodings };
    let report = regularize(&round, &mut imitators, regularizer).expect("finite numbers");
    let steps_taken = playground.steps_taken() - played_before;
    let informed = imitators.iter().map(|one| one.adapted.policy.clone()).collect();
    Scene { prior: prior.clone(), adapted, informed, state, encodings, report, steps_taken }
}

fn doubles(values: &[f32]) -> Vec<f64> {
    values.iter().map(|value| f64::from(*value)).collect()
}

/// log π(a|s) of each action, in f64.
fn log_probabilities(policy: &Policy, displacement: &[f64], observations: &Rows, actions: &Rows) -> Vec<f64> {
    let parameters: Vec<f64> =
        doubles(policy.parameters()).iter().zip(displacement).map(|(here, by)| here + by).collect();
    let (network, log_std) = parameters.split_at(policy.network().parameter_count());
    let mut tape = Tape::default();
    let means = policy.network().forward(network, &doubles(observations.flat()), &mut tape);
    let rows = means.chunks_exact(2).zip(actions.iter());
    rows.map(|(mean, action)| gaussian::log_probability(mean, log_std, &doubles(action))).collect()
}

/// Line 10 or 12 again, under the only variant: the policy with less noise, and what it did.
fn play_again(
    playground: &Playground<'_>,
    policy: &Policy,
    name: &str,
    side: &str,
    how: &MutualInformation,
) -> (Policy, Played) {
    let quiet = policy.with_spread(how.noise);
    let seeds = Seed::new(2).of(name).of(side).at(0).many(how.episodes(30));
    let played = rollout::play(playground, &quiet, Acting::Sampled, EnvVariant(0), seeds);
    let played = Played::new(playground, &quiet, &played.expect("the point mass plays"));
    (quiet, played)
}

fn read(played: &Played, how: &MutualInformation) -> Sequences {
    Sequences::read(&played.observations, &played.lengths, 30, how.posterior.readings)
}

/// The step on the old trajectories goes from θ along the gradient of E_old[π_θ/π_old · R_MI], here by finite differences
/// of the likelihood ratio of whole trajectories in f64, and it is θ'_i that moves by it.
///
/// A damping that dwarfs the Fisher matrix makes TRPO's direction that of the gradient; it counts as curvature, so that the
/// step is small all the same.
#[test]
fn eq_6_eq_7_the_gradient_on_the_old_trajectories_moves_the_adapted_policy() {
    moves_along_the_gradient(Paid::Before);
}

/// The same at θ'_i on its own trajectories.
#[test]
fn algorithm_1_line_14_as_written_takes_the_gradient_at_the_adapted_policy() {
    moves_along_the_gradient(Paid::After);
}

fn moves_along_the_gradient(paid: Paid) {
    let region = TrustRegion { max_kl: 1.0, damping: 1e6, ..TrustRegion::default() };
    let how = MutualInformation { trust_region: region, paid, ..information() };
    let scene = scene(&how, 1);
    // The held-out trajectories, played again.
    let task = PointMass::new();
    let playground = Playground::new(&task);
    let play = |policy: &Policy, side: &str| play_again(&playground, policy, "inform_held_out", side, &how);
    let (old_policy, old) = play(&scene.prior.policy, "before");
    let posterior = &scene.state.posterior;
    for (demo, (adapted, informed)) in scene.adapted.iter().zip(&scene.informed).enumerate() {
        let (new_policy, new) = play(adapted, "after");
        let (before, after) = match how.paid {
            Paid::Before => (read(&old, &how), read(&new, &how).averaged()),
            Paid::After => (read(&old, &how).averaged(), read(&new, &how)),
        };
        let rewards = information_rewards(posterior, &before, &after, scene.encodings[demo]);
        let mean = rewards.iter().sum::<f64>() / rewards.len() as f64;
        let objective = |displacement: &[f64]| {
            let (policy, played) = match paid {
                Paid::Before => (&old_policy, &old),
                Paid::After => (&new_policy, &new),
            };
            // The spread of the actions is not moved.
            let whole = |by: &[f64]| [by, &vec![0.0; policy.action_size()]].concat();
            let of =
                |by: &[f64]| log_probabilities(policy, &whole(by), &played.observations, &played.actions);
            let zeros = vec![0.0; displacement.len()];
            let ratios: Vec<f64> =
                of(displacement).iter().zip(of(&zeros)).map(|(new, old)| new - old).collect();
            let episodes = ratios.chunks(30).zip(&rewards);
            // Σ_t of the log ratio has the gradient of the trajectory's ratio.
            episodes.map(|(log_ratios, reward)| log_ratios.iter().sum::<f64>() * (reward - mean)).sum::<f64>()
        };
        assert_eq!(informed.log_std(), adapted.log_std());
        let displacement: Vec<f64> = informed
            .network_parameters()
            .iter()
            .zip(adapted.network_parameters())
            .map(|(there, here)| f64::from(there - here))
            .collect();
        let squared: f64 = displacement.iter().map(|value| value * value).sum();
        assert!(squared > 0.0, "demonstration {demo} was moved");
        let zeros = vec![0.0; displacement.len()];
        let length = squared.sqrt();
        let direction: Vec<f64> = displacement.iter().map(|value| value / length).collect();
        let slope = derivative(&mut { objective }, &zeros, &direction);
        assert!(slope > 0.0, "E[log Q] rises");
        let gradient: Vec<f64> = direction.iter().map(|value| value * slope).collect();
        let error = gradient_error(objective, &zeros, &gradient);
        assert!(error < 2e-3 * slope.max(1.0), "demonstration {demo}: error {error}, slope {slope}");
    }
}

/// Lines 10 and 12 are played and counted; line 12 by other random numbers than those on which Q was fitted.
#[test]
fn algorithm_1_lines_10_and_12_play_fresh_trajectories_and_count_them() {
    let how = information();
    for goals in [1, 2] {
        let scene = scene(&how, goals);
        let episodes = 150 / 30;
        assert_eq!(scene.report.environment_steps, 2 * (3 + goals) * episodes * 30);
        assert_eq!(scene.steps_taken, scene.report.environment_steps as u64);
        assert!(scene.report.kl > 0.0 && scene.report.kl <= how.trust_region.max_kl);
    }
}

/// What is reported is what the posterior does on held-out pairs, worked out from these played again.
#[test]
fn algorithm_1_line_13_judges_the_posterior_on_held_out_pairs() {
    let posterior = PosteriorFitting { steps: 100, learning_rate: 0.01, ..information().posterior };
    let how = MutualInformation { batch_steps: 1500, posterior, ..information() };
    let scene = scene(&how, 1);
    let task = PointMass::new();
    let playground = Playground::new(&task);
    let unexplained = |name: &str| {
        let (_, before) = play_again(&playground, &scene.prior.policy, name, "before", &how);
        let squared_error = |(demo, policy): (usize, &Policy)| {
            let (_, after) = play_again(&playground, policy, name, "after", &how);
            let (before, after) = (read(&before, &how).averaged(), read(&after, &how));
            let posterior = &scene.state.posterior;
            mutual_information::mean_squared_error(posterior, &before, &after, scene.encodings[demo])
        };
        scene.adapted.iter().enumerate().map(squared_error).sum::<f64>() / 3.0
    };
    // The encodings have variance 1.
    let (train, held_out) = (unexplained("inform_train"), unexplained("inform_held_out"));
    assert!((scene.report.explained - (1.0 - held_out)).abs() < 1e-4, "{held_out}: {:?}", scene.report);
    assert!((train - held_out).abs() > 1e-3, "{train} on the pairs of the fit, {held_out} on others");
    assert!(scene.report.explained > 0.5, "{:?}", scene.report);
}

/// On trajectories that neither Q nor the step has seen, with the same random numbers for the policy at θ' and at θ''.
#[test]
fn algorithm_1_line_14_as_written_raises_log_q_on_fresh_pairs() {
    let posterior = PosteriorFitting { steps: 100, learning_rate: 0.01, ..information().posterior };
    let how = MutualInformation { paid: Paid::After, batch_steps: 3000, posterior, ..information() };
    let scene = scene(&how, 1);
    let task = PointMass::new();
    let playground = Playground::new(&task);
    let posterior = &scene.state.posterior;
    let fresh =
        |policy: &Policy, side: &str| read(&play_again(&playground, policy, "fresh", side, &how).1, &how);
    let before = fresh(&scene.prior.policy, "before").averaged();
    let log_q = |policies: &[Policy]| {
        let of = |(policy, encoding): (&Policy, &f32)| {
            let rewards = information_rewards(posterior, &before, &fresh(policy, "after"), *encoding);
            rewards.iter().sum::<f64>() / rewards.len() as f64
        };
        policies.iter().zip(&scene.encodings).map(of).sum::<f64>() / policies.len() as f64
    };
    let (adapted, informed) = (log_q(&scene.adapted), log_q(&scene.informed));
    assert!(informed > adapted, "{adapted} after imitating, {informed} after the step");
}

/// Q that knows nothing pays noise: θ'_i stays where it is.
#[test]
fn algorithm_1_line_14_is_not_taken_where_the_posterior_explains_nothing() {
    let posterior = PosteriorFitting { steps: 0, ..information().posterior };
    let how = MutualInformation { posterior, ..information() };
    let scene = scene(&how, 1);
    assert!(scene.report.explained <= 0.0, "{:?}", scene.report);
    assert_eq!(scene.report.kl, 0.0);
    assert_eq!(scene.informed, scene.adapted);
    assert!(scene.report.environment_steps > 0, "it was played to find out");
}

/// Mean trajectories after imitating each demonstration lie farther apart: than without the step, and than after steps as
/// long that the same rewards, paid to other episodes, ask for. Full noise, in which Q finds the point mass out as well.
#[test]
fn section_4_2_line_14_spreads_adapted_behaviors_beyond_what_any_step_as_long_does() {
    let posterior = PosteriorFitting { steps: 100, learning_rate: 0.01, ..information().posterior };
    let region = TrustRegion { max_kl: 0.04, ..information().trust_region };
    let how =
        MutualInformation { noise: 1.0, batch_steps: 3000, trust_region: region, posterior, ..information() };
    let task = PointMass::new();
    let playground = Playground::new(&task);
    let mut spreads = [0.0; 3];
    for number in 0..4 {
        let seed = Seed::new(20 + number);
        let scene = scene_of(&how, 1, Seed::new(20 + number));
        let played = |policy: &Policy, name: &str, side: &str| {
            let seeds = seed.of(name).of(side).at(0).many(how.episodes(30));
            let played = rollout::play(&playground, policy, Acting::Sampled, EnvVariant(0), seeds);
            Played::new(&playground, policy, &played.expect("the point mass plays"))
        };
        let before = read(&played(&scene.prior.policy, "inform_held_out", "before"), &how).averaged();
        let by_chance = |(policy, encoding): (&Policy, &f32)| {
            let after = played(policy, "inform_held_out", "after");
            let mut rewards =
                information_rewards(&scene.state.posterior, &before, &read(&after, &how), *encoding);
            rewards.rotate_right(1);
            let advantages = advantages(&rewards, &after.lengths, how.credit);
            let step = trpo::step(&after.experiences(policy, &advantages, 1.0), &how.trust_region, 1.0);
            policy.moved(&step.expect("finite numbers").displacement)
        };
        let chance: Vec<Policy> = scene.adapted.iter().zip(&scene.encodings).map(by_chance).collect();
        for (spread, policies) in spreads.iter_mut().zip([&scene.adapted, &chance, &scene.informed]) {
            let means = policies.iter().map(|policy| read(&played(policy, "fresh", "after"), &how).mean());
            *spread += spread_of(&means.collect::<Vec<_>>()) / 4.0;
        }
    }
    let [without, by_chance, informed] = spreads;
    assert!(informed > 1.2 * without && informed > 1.1 * by_chance, "{spreads:.3?}");
}

fn spread_of(means: &[Vec<f64>]) -> f64 {
    let deviations = (0..means[0].len()).map(|at| {
        let center = means.iter().map(|mean| mean[at]).sum::<f64>() / means.len() as f64;
        means.iter().map(|mean| (mean[at] - center).powi(2)).sum::<f64>()
    });
    (deviations.sum::<f64>() / (means.len() * means[0].len()) as f64).sqrt()
}
