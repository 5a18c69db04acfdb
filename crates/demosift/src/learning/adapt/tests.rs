use super::*;
use crate::run::preset::Preset;
use crate::world::point_mass::{PointMass, planted_set};

fn course(inner: &InnerUpdate, iterations: usize) -> Course<'_> {
    Course { inner, iterations, averaged: 1 }
}

fn inner() -> InnerUpdate {
    let discriminator = Fitting { learning_rate: 0.01, steps: 20, batch: 200, entropy: 0.3, most_told: 1.0 };
    InnerUpdate { batch_steps: 300, discriminator, ..Preset::Quick.config().inner }
}

fn untrained(set: &DemonstrationSet) -> Learner {
    Learner::untrained(set, &PolicyShape { hidden: vec![16, 16], initial_std: 0.5 }, &[32], &Seed::new(1))
}

#[test]
fn appendix_a_2_1_alpha_is_one_at_first_and_then_half_at_a_kl_of_0_15() {
    let inner = Preset::Paper.config().inner;
    assert_eq!([0, 1, 2, 9].map(|iteration| inner.alpha(iteration)), [1.0, 0.5, 0.5, 0.5]);
    assert_eq!(inner.trust_region.max_kl, 0.15);
}

#[test]
fn a_batch_has_the_steps_that_were_asked_for_though_episodes_end_early() {
    let task = PointMass::new();
    let playground = Playground::new(&task);
    let set = planted_set(&[0.0, 180.0], Seed::new(1)).expect("a valid set");
    let policy = untrained(&set).policy;
    let of = |batch_steps| InnerUpdate { batch_steps, ..inner() };
    let play = |batch_steps| {
        of(batch_steps).play(&playground, &policy, EnvVariant(0), Seed::new(3)).expect("it plays")
    };
    // Each has 30 steps.
    assert_eq!([10, 120, 121, 300].map(|steps| play(steps).len()), [4, 4, 5, 10]);
    // Had they been expected to have more, as many are played on top as their mean length asks for.
    let four = play(120);
    assert_eq!([120, 121, 240, 1000].map(|steps| of(steps).lacking(&four, 64)), [0, 1, 4, 30]);
    assert_eq!(of(100_000).lacking(&four, 64), 60, "and never more than there may be");
    let longer = play(300);
    for (one, other) in four.iter().zip(&longer) {
        assert_eq!(one.actions(), other.actions(), "episodes do not depend on how many there are");
    }
}

/// L_IL = −E[R_IL]: on fresh episodes the adapted policy is paid more by the same discriminator.
#[test]
fn eq_1_an_inner_update_lowers_the_imitation_loss() {
    let task = PointMass::new();
    let playground = Playground::new(&task);
    let set = planted_set(&[0.0, 180.0], Seed::new(1)).expect("a valid set");
    let learner = untrained(&set);
    let pairs = learner.demonstrated_pairs(&set);
    for (demo, pairs) in pairs.iter().enumerate() {
        let adapted = adapt(
            &learner,
            &[pairs],
            &playground,
            EnvVariant(0),
            &course(&inner(), 1),
            &Seed::new(demo as u64),
        )
        .expect("finite numbers");
        let reward = |policy: &Policy| {
            let seeds = Seed::new(99).many(100);
            let fresh = rollout::play(&playground, policy, Acting::Sampled, EnvVariant(0), seeds)
                .expect("the point mass plays");
            let played = Played::new(&playground, policy, &fresh);
            let rewards = gail::imitation_rewards(&adapted.learner.discriminator, &played.pairs);
            statistics::mean_of(rewards.iter().map(|reward| f64::from(*reward)))
        };
        let (before, after) = (reward(&learner.policy), reward(&adapted.learner.policy));
        assert!(after > before + 0.02, "demonstration {demo}: {before} became {after}");
    }
}

#[test]
fn eq_1_imitating_opposite_demonstrations_leads_opposite_ways() {
    let task = PointMass::new();
    let playground = Playground::new(&task);
    let set = planted_set(&[0.0, 180.0], Seed::new(1)).expect("a valid set");
    let learner = untrained(&set);
    let pairs = learner.demonstrated_pairs(&set);
    let scores = [0, 1].map(|demo| {
        let adapted =
            adapt(&learner, &[&pairs[demo]], &playground, EnvVariant(0), &course(&inner(), 6), &Seed::new(7))
                .expect("finite numbers");
        assert_eq!(adapted.curve.len(), 6);
        adapted.curve.last().expect("six reports").score.expect("GAIL plays")
    });
    assert!(scores[0] > scores[1] + 0.5, "{scores:?}");
}

/// The policy is paid by the discriminator as it is after its fit, and the report tells of that reward.
#[test]
fn the_reward_is_that_of_the_updated_discriminator() {
    let task = PointMass::new();
    let playground = Playground::new(&task);
    let set = planted_set(&[0.0, 180.0], Seed::new(1)).expect("a valid set");
    let learner = untrained(&set);
    let pairs = learner.demonstrated_pairs(&set);
    let seeds = Seed::new(3).many(10);
    let trajectories = rollout::play(&playground, &learner.policy, Acting::Sampled, EnvVariant(0), seeds)
        .expect("the point mass plays");
    let played = Played::new(&playground, &learner.policy, &trajectories);
    let mut adam = Adam::new(learner.discriminator.parameters().len());
    let Updated { learner: updated, report, .. } =
        update(&learner, &played, &[&pairs[0]], &inner(), 1.0, &mut adam, Seed::new(4))
            .expect("finite numbers");
    let mean = |discriminator: &Discriminator| {
        let logits = discriminator.logits_generated(&played.pairs);
        logits.iter().map(|logit| (-f64::from(*logit)).exp().ln_1p()).sum::<f64>() / logits.len() as f64
    };
    let reward_mean = report.reward_mean.expect("GAIL pays");
    assert!((reward_mean - mean(&updated.discriminator)).abs() < 1e-4);
    assert!((reward_mean - mean(&learner.discriminator)).abs() > 1e-2);
    assert_eq!(updated.policy.filter(), learner.policy.filter());
}

#[test]
fn played_episodes_are_filtered_paired_and_shared_out_whole() {
    let task = PointMass::new();
    let playground = Playground::new(&task);
    let set = planted_set(&[0.0, 180.0], Seed::new(1)).expect("a valid set");
    let policy = untrained(&set).policy;
    let seeds = Seed::new(3).many(50);
    let trajectories = rollout::play(&playground, &policy, Acting::Sampled, EnvVariant(0), seeds)
        .expect("the point mass plays");
    let played = Played::new(&playground, &policy, &trajectories);
    assert_eq!(played.lengths, [30; 50]);
    let mut filtered = [0.0; 4];
    policy.filter().apply(trajectories[7].observations().row(11), &mut filtered);
    let pair = played.pairs.row(7 * 30 + 11);
    assert_eq!(pair[..4], filtered);
    for (paired, drawn) in pair[4..].iter().zip(trajectories[7].actions().row(11)) {
        assert_eq!(*paired, drawn.clamp(-1.0, 1.0));
    }
    let advantages = vec![1.0; 1500];
    let experiences = played.experiences(&policy, &advantages, 0.3);
    assert!(experiences.len() > 1, "split for several threads");
    assert_eq!(experiences.iter().map(|part| part.advantages.len()).sum::<usize>(), 1500);
    assert!((experiences.iter().map(|part| part.weight).sum::<f64>() - 0.3).abs() < 1e-12);
}

/// Common random numbers: what is demonstrated twice is adapted to twice in the same way.
#[test]
fn algorithm_2_adaptation_depends_on_the_demonstration_and_the_seed_alone() {
    let task = PointMass::new();
    let playground = Playground::new(&task);
    let set = planted_set(&[0.0, 180.0], Seed::new(1)).expect("a valid set");
    let learner = untrained(&set);
    let pairs = gail::demonstrated_pairs(set.get(DemoId(0)), learner.policy.filter());
    let copy = pairs.clone();
    let [one, other] = [&pairs, &copy].map(|pairs| {
        adapt(&learner, &[pairs], &playground, EnvVariant(0), &course(&inner(), 2), &Seed::new(7))
            .expect("finite numbers")
    });
    assert_eq!(one.learner, other.learner);
    assert_eq!(one.curve, other.curve);
}
