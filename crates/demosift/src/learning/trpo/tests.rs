use super::*;
use crate::basics::seed::Seed;
use crate::data::observation_filter::ObservationFilter;
use crate::math::nn::check::{self, gradient_error};
use crate::math::rows::Rows;
use crate::world::policy::PolicyShape;
use rand_distr::{Distribution, StandardNormal};

const OBSERVATIONS: usize = 3;
const ACTIONS: usize = 2;

/// What an experience borrows.
struct Sample {
    policy: Policy,
    observations: Vec<f32>,
    actions: Vec<f32>,
    advantages: Vec<f32>,
}

impl Sample {
    /// A policy far from its start, what it did, and advantages that are noise.
    fn new(seed: u64, rows: usize) -> Self {
        let mut rng = Seed::new(seed).of("sample").into_rng();
        let mut normal = |count: usize, scale: f32| -> Vec<f32> {
            (0..count).map(|_| scale * Distribution::<f32>::sample(&StandardNormal, &mut rng)).collect()
        };
        let shape = PolicyShape { hidden: vec![8, 6], initial_std: 0.7 };
        let filter = ObservationFilter::identity(OBSERVATIONS);
        let policy = Policy::untrained(&shape, filter, ACTIONS, Seed::new(seed));
        let policy = policy.moved(&normal(policy.parameters().len(), 0.3));
        let observations = normal(rows * OBSERVATIONS, 1.0);
        let advantages = normal(rows, 1.0);
        let means = policy.means(&Rows::from_flat(observations.clone(), OBSERVATIONS).expect("whole rows"));
        let mut actions = vec![0.0; rows * ACTIONS];
        let mut rng = Seed::new(seed).of("act").into_rng();
        for (mean, action) in means.iter().zip(actions.chunks_exact_mut(ACTIONS)) {
            gaussian::sample(mean, policy.log_std(), &mut rng, action);
        }
        Self { policy, observations, actions, advantages }
    }

    fn experience(&self, weight: f64) -> Experience<'_> {
        self.rows(0, self.advantages.len(), weight)
    }

    fn rows(&self, from: usize, to: usize, weight: f64) -> Experience<'_> {
        Experience {
            policy: &self.policy,
            observations: &self.observations[from * OBSERVATIONS..to * OBSERVATIONS],
            actions: &self.actions[from * ACTIONS..to * ACTIONS],
            advantages: &self.advantages[from..to],
            weight,
        }
    }
}

fn doubles(values: &[f32]) -> Vec<f64> {
    values.iter().map(|value| f64::from(*value)).collect()
}

/// Surrogate improvement and KL at θ + δ, in f64 and from the definitions alone.
fn improvement_and_kl_of(experiences: &[Experience<'_>], displacement: &[f64]) -> (f64, f64) {
    let mut sums = (0.0, 0.0);
    for Experience { policy, observations, actions, advantages, weight } in experiences {
        let (observations, actions) = (doubles(observations), doubles(actions));
        let old = doubles(policy.parameters());
        let new: Vec<f64> = old.iter().zip(displacement).map(|(here, by)| here + by).collect();
        let count = policy.network().parameter_count();
        let means = |parameters: &[f64]| {
            let mut tape = Tape::default();
            policy.network().forward(&parameters[..count], &observations, &mut tape).to_vec()
        };
        let (old_means, new_means) = (means(&old), means(&new));
        for (row, advantage) in advantages.iter().enumerate() {
            let (mut log_ratio, mut kl) = (0.0, 0.0);
            for column in 0..ACTIONS {
                let at = row * ACTIONS + column;
                let (old_std, new_std) = (old[count + column].exp(), new[count + column].exp());
                let squared = |mean: f64, std: f64| ((actions[at] - mean) / std).powi(2);
                log_ratio += (squared(old_means[at], old_std) - squared(new_means[at], new_std)) / 2.0
                    - (new_std / old_std).ln();
                let shift = (old_means[at] - new_means[at]).powi(2);
                kl +=
                    (new_std / old_std).ln() + (old_std * old_std + shift) / (2.0 * new_std * new_std) - 0.5;
            }
            let share = weight / advantages.len() as f64;
            sums.0 += share * (log_ratio.exp() - 1.0) * f64::from(*advantage);
            sums.1 += share * kl;
        }
    }
    sums
}

#[test]
fn surrogate_gradient_is_that_of_the_likelihood_ratio() {
    let (one, other) = (Sample::new(1, 300), Sample::new(2, 170));
    let experiences = [one.experience(0.7), other.experience(0.3)];
    let mut batches: Vec<Batch<'_>> = experiences.iter().map(Batch::new).collect();
    let gradient = doubles(&total(&mut batches, Batch::surrogate_gradient));
    let objective = |at: &[f64]| improvement_and_kl_of(&experiences, at).0;
    let error = gradient_error(objective, &vec![0.0; gradient.len()], &gradient);
    assert!(error < 1e-5, "error {error}");
}

#[test]
fn fisher_product_is_the_second_derivative_of_the_kl_divergence() {
    let (one, other) = (Sample::new(3, 300), Sample::new(4, 170));
    let experiences = [one.experience(0.4), other.experience(0.6)];
    let mut batches: Vec<Batch<'_>> = experiences.iter().map(Batch::new).collect();
    let parameters = one.policy.parameters().len();
    let directions: Vec<Vec<f64>> =
        (0..6).map(|index| check::normal(parameters, &format!("fisher {index}"))).collect();
    // vᵀFv ≈ (KL(hv) + KL(−hv)) / h², and uᵀFv from the values at u + v and u − v.
    let curvature = |u: &[f64], v: &[f64], sign: f64| {
        let at = |h: f64| {
            let point: Vec<f64> = u.iter().zip(v).map(|(u, v)| h * (u + sign * v)).collect();
            improvement_and_kl_of(&experiences, &point).1
        };
        (at(1e-4) + at(-1e-4)) / 1e-8
    };
    for u in &directions {
        let direction: Vec<f32> = u.iter().map(|value| *value as f32).collect();
        let product = doubles(&total(&mut batches, |batch| batch.fisher_vector_product(&direction)));
        for v in &directions {
            let numeric = (curvature(u, v, 1.0) - curvature(u, v, -1.0)) / 4.0;
            let found = check::dot(&product, v);
            let scale = check::dot(&product, u).abs();
            assert!((numeric - found).abs() < 1e-3 * scale, "{found}, numerically {numeric}");
        }
    }
}

#[test]
fn accepted_steps_improve_and_never_reach_more_kl_than_allowed() {
    let mut moved = 0;
    for seed in 0..60 {
        let samples: Vec<Sample> = (0..1 + seed % 3).map(|part| Sample::new(100 * seed + part, 64)).collect();
        let weight = 1.0 / samples.len() as f64;
        let experiences: Vec<_> = samples.iter().map(|sample| sample.experience(weight)).collect();
        let alpha = [0.5, 1.0, 2.0][(seed / 3 % 3) as usize];
        let region =
            TrustRegion { max_kl: [0.15, 0.01, 1.0][(seed / 9 % 3) as usize], ..TrustRegion::default() };
        let step = step(&experiences, &region, alpha).expect("finite numbers");
        let (improvement, kl) = improvement_and_kl_of(&experiences, &doubles(&step.displacement));
        assert!((kl - step.kl).abs() < 1e-5 + 1e-3 * kl, "KL {kl}, reported {}", step.kl);
        assert!((improvement - step.improvement).abs() < 1e-5 + 1e-3 * improvement.abs());
        assert!(kl <= alpha * alpha * region.max_kl * (1.0 + 1e-4), "KL {kl}");
        match step.end {
            StepEnd::Moved => assert!(improvement > 0.0),
            _ => assert!(step.displacement.iter().all(|value| *value == 0.0)),
        }
        moved += usize::from(step.end == StepEnd::Moved);
    }
    assert!(moved >= 55, "only {moved} of 60 steps were accepted");
}

#[test]
fn appendix_a_2_1_alpha_scales_the_step_and_its_square_the_kl() {
    let sample = Sample::new(5, 400);
    let region = TrustRegion { max_kl: 1e-3, ..TrustRegion::default() };
    let of = |alpha| step(&[sample.experience(1.0)], &region, alpha).expect("finite numbers");
    let (whole, half) = (of(1.0), of(0.5));
    assert_eq!((whole.end, half.end), (StepEnd::Moved, StepEnd::Moved));
    for (whole, half) in whole.displacement.iter().zip(&half.displacement) {
        assert!((whole - 2.0 * half).abs() <= 1e-6 * whole.abs().max(1e-3));
    }
    assert!((whole.kl / half.kl - 4.0).abs() < 0.1, "{} and {}", whole.kl, half.kl);
}

/// (F + λI) δ = η g.
#[test]
fn the_size_of_a_step_is_how_far_it_went_along_the_natural_gradient() {
    let sample = Sample::new(5, 400);
    let region = TrustRegion { conjugate_gradient_iterations: 100, ..TrustRegion::default() };
    let experiences = [sample.experience(1.0)];
    let step = step(&experiences, &region, 0.5).expect("finite numbers");
    let mut batch = Batch::new(&experiences[0]);
    let gradient = batch.surrogate_gradient();
    let product = batch.fisher_vector_product(&step.displacement);
    assert!(step.size > 0.0);
    let (mut error, mut scale) = (0.0, 0.0);
    for ((product, by), slope) in product.iter().zip(&step.displacement).zip(gradient) {
        let wanted = step.size * f64::from(slope);
        error += (f64::from(product + region.damping as f32 * by) - wanted).powi(2);
        scale += wanted.powi(2);
    }
    assert!(error.sqrt() < 1e-3 * scale.sqrt(), "{} of {}", error.sqrt(), scale.sqrt());
}

#[test]
fn without_advantages_there_is_no_gradient_and_no_step() {
    let mut sample = Sample::new(6, 50);
    sample.advantages.fill(0.0);
    let step = step(&[sample.experience(1.0)], &TrustRegion::default(), 1.0).expect("finite numbers");
    assert_eq!(step, Step::none(sample.policy.parameters().len(), StepEnd::NoGradient));
}

#[test]
fn advantages_that_are_no_numbers_are_divergence() {
    for broken in [f32::NAN, f32::INFINITY] {
        let mut sample = Sample::new(7, 50);
        sample.advantages[3] = broken;
        let error = step(&[sample.experience(1.0)], &TrustRegion::default(), 1.0).expect_err("diverged");
        assert!(error.is_diverged(), "{error}");
    }
}

#[test]
fn a_batch_in_two_parts_gives_the_same_step() {
    let sample = Sample::new(8, 500);
    let parts = [sample.rows(0, 320, 0.64), sample.rows(320, 500, 0.36)];
    let region = TrustRegion::default();
    let whole = step(&[sample.experience(1.0)], &region, 1.0).expect("finite numbers");
    let parted = step(&parts, &region, 1.0).expect("finite numbers");
    let length = dot(&whole.displacement, &whole.displacement).sqrt();
    let difference: Vec<f32> =
        whole.displacement.iter().zip(&parted.displacement).map(|(a, b)| a - b).collect();
    assert!(dot(&difference, &difference).sqrt() < 1e-3 * length);
    assert!((whole.kl - parted.kl).abs() < 1e-3 * whole.kl);
}

#[test]
fn a_policy_without_weight_does_not_pull_on_the_shared_step() {
    let (one, other) = (Sample::new(9, 200), Sample::new(10, 200));
    let region = TrustRegion::default();
    let alone = step(&[one.experience(1.0)], &region, 1.0).expect("finite numbers");
    let both = step(&[one.experience(1.0), other.experience(0.0)], &region, 1.0).expect("finite numbers");
    assert_eq!(alone, both);
    let half = step(&[one.experience(0.5), other.experience(0.5)], &region, 1.0).expect("finite numbers");
    assert_ne!(half.displacement, alone.displacement);
}

#[test]
fn the_spread_of_the_actions_is_part_of_the_step() {
    let mut sample = Sample::new(11, 2000);
    let observations = Rows::from_flat(sample.observations.clone(), OBSERVATIONS).expect("whole rows");
    let means = sample.policy.means(&observations);
    let means = means.flat();
    // Actions near the mean are good: the spread should shrink in every dimension.
    for row in 0..sample.advantages.len() {
        let columns = row * ACTIONS..(row + 1) * ACTIONS;
        let far: f32 = columns.map(|at| (sample.actions[at] - means[at]).powi(2)).sum();
        sample.advantages[row] = 1.0 - far;
    }
    let step = step(&[sample.experience(1.0)], &TrustRegion::default(), 1.0).expect("finite numbers");
    let spread = &step.displacement[sample.policy.network().parameter_count()..];
    assert!(spread.iter().all(|change| *change < -0.01), "{spread:?}");
}

/// One observation, one action, paid −(a − 0.7)²: the best mean is 0.7, and the best spread none.
#[test]
fn a_bandit_is_learned() {
    let shape = PolicyShape { hidden: vec![4], initial_std: 0.5 };
    let mut policy = Policy::untrained(&shape, ObservationFilter::identity(1), 1, Seed::new(1));
    let mut rng = Seed::new(2).into_rng();
    let observations = vec![1.0; 400];
    let mean_of = |policy: &Policy| {
        policy.network().forward(policy.network_parameters(), &[1.0], &mut Tape::<f32>::default())[0]
    };
    for _ in 0..40 {
        let mut actions = vec![0.0; 400];
        let means = [mean_of(&policy)];
        for action in actions.chunks_exact_mut(1) {
            gaussian::sample(&means, policy.log_std(), &mut rng, action);
        }
        let rewards: Vec<f32> = actions.iter().map(|action| -(action - 0.7) * (action - 0.7)).collect();
        let mean = rewards.iter().sum::<f32>() / 400.0;
        let advantages: Vec<f32> = rewards.iter().map(|reward| reward - mean).collect();
        let experience = Experience {
            policy: &policy,
            observations: &observations,
            actions: &actions,
            advantages: &advantages,
            weight: 1.0,
        };
        let region = TrustRegion { max_kl: 0.05, damping: 1e-3, ..TrustRegion::default() };
        let step = step(&[experience], &region, 1.0).expect("finite numbers");
        policy = policy.moved(&step.displacement);
    }
    let (mean, std) = (mean_of(&policy), policy.log_std()[0].exp());
    assert!((mean - 0.7).abs() < 0.05, "mean {mean}");
    assert!(std < 0.1, "standard deviation {std}");
}
