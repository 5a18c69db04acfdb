use super::meta_update::{meta_update_discriminator, meta_update_policy};
use super::*;
use crate::data::demonstration::DemoId;
use crate::learning::gail;
use crate::math::nn::check::gradient_error;
use crate::math::nn::mlp::Tape;
use crate::run::preset::Preset;
use crate::world::point_mass::{PointMass, planted_set};

const BEARINGS: [f32; 3] = [0.0, 120.0, 240.0];

fn training() -> MetaTraining {
    Preset::Quick.config().meta_train
}

fn inner() -> InnerUpdate {
    InnerUpdate { batch_steps: 180, ..Preset::Quick.config().inner }
}

fn learning<'a>(training: &'a MetaTraining, inner: &'a InnerUpdate) -> Learning<'a> {
    Learning { training, inner, information: None }
}

fn doubles(values: &[f32]) -> Vec<f64> {
    values.iter().map(|value| f64::from(*value)).collect()
}

/// A prior after a round, and the outcomes of the next.
fn played(set: &DemonstrationSet) -> (MetaState, Vec<Rows>, PlayedRound) {
    let shape = PolicyShape { hidden: vec![6], initial_std: 0.5 };
    let state = MetaState::start(set, &shape, &[8], None, &Seed::new(1));
    let demonstrated = state.prior.demonstrated_pairs(set);
    let played = played_from(&state, set, &demonstrated);
    (state, demonstrated, played)
}

fn played_from(state: &MetaState, set: &DemonstrationSet, demonstrated: &[Rows]) -> PlayedRound {
    let (task, inner) = (PointMass::new(), inner());
    let playground = Playground::new(&task);
    let targets: Vec<_> = set.ids().into_iter().map(|demo| Target { demo, variant: EnvVariant(0) }).collect();
    let (prior, weights, seed) = (&state.prior, &Weights::ones(set), Seed::new(2));
    let (inner, playground, seed) = (&inner, &playground, &seed);
    let round = Round { prior, targets: &targets, weights, playground, inner, seed };
    round.play(demonstrated, None).expect("finite numbers")
}

/// With a damping that dwarfs the Fisher matrix the step goes along the meta-gradient, which first order takes to be the
/// mean over the demonstrations of ∇E[π_θ/π_θ'ᵢ · Âᵢ] at θ'ᵢ: here by finite differences in f64.
#[test]
fn eq_2_the_meta_step_follows_the_mean_gradient_at_the_adapted_parameters() {
    let set = planted_set(&BEARINGS, Seed::new(1)).expect("a valid set");
    let (state, _, played) = played(&set);
    let region = TrustRegion { max_kl: 1e-6, damping: 1e6, ..TrustRegion::default() };
    let (training, inner) = (MetaTraining { trust_region: region, ..training() }, inner());
    let mut policy = state.prior.policy.clone();
    let step =
        meta_update_policy(&mut policy, &played, &learning(&training, &inner)).expect("finite numbers");
    let outcomes = played.outcomes;
    let advantages: Vec<Vec<f32>> = outcomes
        .iter()
        .map(|outcome| {
            let rewards = gail::imitation_rewards(&outcome.adapted.discriminator, &outcome.after.pairs);
            outcome.after.advantages(&rewards, &inner.advantage).expect("finite numbers")
        })
        .collect();
    let objective = |displacement: &[f64]| -> f64 {
        let surrogate = |(outcome, advantages): (&Outcome, &Vec<f32>)| {
            let adapted = &outcome.adapted.policy;
            let count = adapted.network().parameter_count();
            let observations = doubles(outcome.after.observations.flat());
            let log_probabilities = |shift: f64| {
                let parameters: Vec<f64> = doubles(adapted.parameters())
                    .iter()
                    .zip(displacement)
                    .map(|(here, by)| here + shift * by)
                    .collect();
                let (network, log_std) = parameters.split_at(count);
                let mut tape = Tape::default();
                let means = adapted.network().forward(network, &observations, &mut tape);
                let rows = means.chunks_exact(2).zip(outcome.after.actions.iter());
                rows.map(|(mean, action)| {
                    crate::math::nn::gaussian::log_probability(mean, log_std, &doubles(action))
                })
                .collect::<Vec<f64>>()
            };
            let (new, old) = (log_probabilities(1.0), log_probabilities(0.0));
            let ratios = new.iter().zip(old).map(|(new, old)| (new - old).exp());
            ratios.zip(advantages).map(|(ratio, by)| ratio * f64::from(*by)).sum::<f64>()
                / advantages.len() as f64
        };
        outcomes.iter().zip(&advantages).map(surrogate).sum::<f64>() / outcomes.len() as f64
    };
    // The step's direction, scaled to the gradient's slope along it.
    let displacement = doubles(&step.displacement);
    let zeros = vec![0.0; displacement.len()];
    let squared: f64 = displacement.iter().map(|value| value * value).sum();
    let mut slope_objective = objective;
    let slope = crate::math::nn::check::derivative(&mut slope_objective, &zeros, &displacement);
    let gradient: Vec<f64> = displacement.iter().map(|value| value * slope / squared).collect();
    let error = gradient_error(objective, &zeros, &gradient);
    assert!(error < 1e-4, "error {error}");
    let moved = state.prior.policy.moved(&step.displacement);
    assert_eq!(policy, moved, "the step is taken from θ");
}

/// The gradient of Σᵢ E_τᵢ[−log D] + E_vᵢ[−log(1 − D)] − c·H at D'ᵢ, by finite differences in f64; Adam's first step
/// goes against its sign.
#[test]
fn eq_3_the_meta_discriminator_goes_down_the_sum_of_the_adapted_losses() {
    let set = planted_set(&BEARINGS, Seed::new(1)).expect("a valid set");
    let (mut state, demonstrated, PlayedRound { outcomes, .. }) = played(&set);
    let (training, inner) = (training(), inner());
    let loss = |displacement: &[f64]| -> f64 {
        let of = |outcome: &Outcome| {
            let discriminator = &outcome.adapted.discriminator;
            let parameters: Vec<f64> = doubles(discriminator.parameters())
                .iter()
                .zip(displacement)
                .map(|(here, by)| here + by)
                .collect();
            let mean = |rows: &Rows, label: f64| {
                let mut tape = Tape::default();
                let pairs = doubles(rows.flat());
                let logits = discriminator.network().forward(&parameters, &pairs, &mut tape);
                let losses = logits.iter().map(|logit| {
                    let d = 1.0 / (1.0 + (-logit).exp());
                    let entropy = -d * d.ln() - (1.0 - d) * (1.0 - d).ln();
                    -label * d.ln() - (1.0 - label) * (1.0 - d).ln() - inner.discriminator.entropy * entropy
                });
                losses.sum::<f64>() / rows.len() as f64
            };
            mean(&outcome.after.pairs, 1.0) + mean(&demonstrated[outcome.target.demo.0], 0.0)
        };
        outcomes.iter().map(of).sum()
    };
    let before = state.prior.discriminator.parameters().to_vec();
    meta_update_discriminator(&mut state, &demonstrated, &outcomes, &learning(&training, &inner))
        .expect("finite numbers");
    let mut checked = 0;
    for (index, (before, after)) in before.iter().zip(state.prior.discriminator.parameters()).enumerate() {
        let mut direction = vec![0.0; state.prior.discriminator.parameters().len()];
        direction[index] = 1.0;
        let mut function = loss;
        let slope =
            crate::math::nn::check::derivative(&mut function, &vec![0.0; direction.len()], &direction);
        if slope.abs() > 1e-3 {
            let rate = training.discriminator_learning_rate;
            assert!((f64::from(after - before) + slope.signum() * rate).abs() < 0.02 * rate);
            checked += 1;
        }
    }
    assert!(checked > 30, "only {checked} slopes were large enough");
}

/// What counts three times moves θ and D_meta as what stands in the set three times, and as nothing else does.
#[test]
fn section_4_4_a_weight_counts_as_so_many_of_the_same_demonstration() {
    let planted = planted_set(&BEARINGS, Seed::new(1)).expect("a valid set");
    let set_of = |ids: &[usize]| {
        let demonstrations = ids.iter().map(|id| planted.get(DemoId(*id)).clone()).collect();
        DemonstrationSet::new(demonstrations).expect("a valid set")
    };
    let (training, inner) = (training(), inner());
    let learning = learning(&training, &inner);
    let updated = |ids: &[usize], weights: &[f64]| {
        // The filter of a set depends on how often a demonstration stands there, so the prior is that of one set.
        let (mut state, _, _) = played(&planted);
        let demonstrated = state.prior.demonstrated_pairs(&set_of(ids));
        let mut played = played_from(&state, &set_of(ids), &demonstrated);
        for (outcome, weight) in played.outcomes.iter_mut().zip(weights) {
            outcome.weight = *weight;
        }
        let mut policy = state.prior.policy.clone();
        let step = meta_update_policy(&mut policy, &played, &learning).expect("finite numbers");
        meta_update_discriminator(&mut state, &demonstrated, &played.outcomes, &learning)
            .expect("finite numbers");
        (step.displacement, state.prior.discriminator.parameters().to_vec())
    };
    let far = |one: &[f32], other: &[f32]| {
        let distance = |pair: (&f32, &f32)| f64::from(pair.0 - pair.1).powi(2);
        one.iter().zip(other).map(distance).sum::<f64>().sqrt()
    };
    let thrice = updated(&[0, 0, 0, 1], &[1.0; 4]);
    let weighed = updated(&[0, 1], &[3.0, 1.0]);
    let (alike, other) = (updated(&[0, 1], &[1.0; 2]), updated(&[0, 1], &[0.75, 0.25]));
    assert!(far(&weighed.0, &thrice.0) < 0.02 * far(&alike.0, &thrice.0));
    assert!(far(&weighed.1, &thrice.1) < 0.2 * far(&alike.1, &thrice.1));
    assert_eq!(weighed, other, "only the shares count");
}

#[test]
fn algorithm_1_line_2_draws_distinct_demonstrations_and_in_time_every_variant() {
    let bearings: Vec<f32> = (0..9).map(|index| 40.0 * index as f32).collect();
    let set = planted_set(&bearings, Seed::new(1)).expect("a valid set");
    let task = PointMass::with_goals(3);
    let playground = Playground::new(&task);
    let (mut demos, mut variants) = (vec![0; 9], vec![0; 3]);
    for number in 0..100 {
        let targets = targets_of_round(&set, &playground, 4, Seed::new(number));
        assert_eq!(targets.len(), 4);
        assert!(targets.is_sorted_by(|a, b| a.demo < b.demo), "each demonstration once");
        for Target { demo, variant } in targets {
            demos[demo.0] += 1;
            variants[variant.0] += 1;
        }
    }
    assert!(demos.iter().all(|count| (20..70).contains(count)), "{demos:?}");
    assert!(variants.iter().all(|count| (90..180).contains(count)), "{variants:?}");
    let whole = targets_of_round(&set, &playground, 10, Seed::new(1));
    assert_eq!(whole.iter().map(|target| target.demo).collect::<Vec<_>>(), set.ids());
}

/// The same trajectories before, the same draws after: what is demonstrated twice comes out twice.
#[test]
fn algorithm_1_lines_4_to_17_use_the_same_random_numbers_for_every_demonstration() {
    let planted = planted_set(&BEARINGS, Seed::new(1)).expect("a valid set");
    let twice = [0, 1, 0].map(|id| planted.get(DemoId(id)).clone());
    let set = DemonstrationSet::new(twice.to_vec()).expect("a valid set");
    let (_, _, PlayedRound { outcomes, .. }) = played(&set);
    assert_eq!(outcomes[0].adapted, outcomes[2].adapted);
    assert_eq!(outcomes[0].after.scores, outcomes[2].after.scores);
    assert_ne!(outcomes[0].adapted, outcomes[1].adapted);
    assert_eq!(outcomes[0].update.score, outcomes[1].update.score, "played once before");
}

#[test]
fn appendix_a_2_1_ten_demonstrations_a_round_and_two_thousand_rounds() {
    let training = Preset::Paper.config().meta_train;
    assert_eq!((training.meta_batch, training.rounds), (10, 2000));
    let set = planted_set(&[0.0; 8], Seed::new(1)).expect("a valid set");
    let task = PointMass::new();
    let targets = targets_of_round(&set, &Playground::new(&task), training.meta_batch, Seed::new(1));
    assert_eq!(targets.len(), 8, "the whole set where it is smaller");
}
