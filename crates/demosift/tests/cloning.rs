//! Behavioral cloning as the inner update, and exact meta-gradients, through the whole flow on the point mass.

use std::panic::{AssertUnwindSafe, catch_unwind};

use demosift::basics::ledger::{InMemory, Ledger};
use demosift::basics::observer::{Event, Observer, Silent};
use demosift::basics::seed::Seed;
use demosift::data::demonstration::{DemoId, DemonstrationSet};
use demosift::learning::adapt::{MetaPrior, Rule};
use demosift::learning::behavioral_cloning::{Cloning, Descent};
use demosift::results::artifact::Artifact as _;
use demosift::results::panel::Judge;
use demosift::run::experiment::{self, Config, Run, Sifted};
use demosift::run::preset::Preset;
use demosift::stages::judge::ScoreTable;
use demosift::stages::meta_train::Order;
use demosift::stages::method::Method;
use demosift::stages::referee::Refereeing;
use demosift::stages::select::{self, Keep};
use demosift::world::environment::Task;
use demosift::world::point_mass::{PointMass, planted_set};
use demosift::world::policy::PolicyShape;
use demosift::world::rollout::Playground;

use crate::fixtures::Killed;

/// Everything by behavioral cloning, with the exact meta-gradient.
fn cloning(seed: u64) -> Config {
    let mut config = Preset::Quick.config();
    (config.seed, config.keep) = (seed, Keep::Count(2));
    config.policy = PolicyShape { hidden: vec![16, 16], initial_std: 0.5 };
    for update in [&mut config.inner, &mut config.imitate.update] {
        update.imitation = Rule::BehavioralCloning;
    }
    config.inner.cloning.learning_rate = 0.1; // as in `configs/point_mass.toml`
    config.meta_train.order = Order::Second;
    (config.meta_train.rounds, config.meta_train.checkpoint_every) = (10, 3);
    (config.judge.iterations, config.judge.averaged) = (10, 1);
    config.imitate.cloning_updates = 60;
    config.referee = Refereeing { cloning: 1, gail: 3, trainer: 0 };
    config
}

/// The same by GAIL, whose meta-gradient is of first order.
fn gail(seed: u64) -> Config {
    let mut config = cloning(seed);
    config.meta_train.order = Order::First;
    for update in [&mut config.inner, &mut config.imitate.update] {
        (update.imitation, update.batch_steps) = (Rule::Gail, 240);
        update.discriminator.batch = 100;
    }
    config.inner.alphas = vec![1.0, 0.5];
    config.imitate.environment_steps = 3000;
    config
}

/// Little of everything, for tests that repeat it.
fn brief(mut config: Config) -> Config {
    (config.meta_train.rounds, config.meta_train.checkpoint_every) = (3, 2);
    config.meta_train.discriminator_hidden = vec![16];
    config.mutual_information.batch_steps = 150;
    let posterior = &mut config.mutual_information.posterior;
    (posterior.lstm, posterior.dense, posterior.readings) = (8, 6, 6);
    (posterior.steps, posterior.batch) = (5, 12);
    (config.judge.iterations, config.judge.repeats, config.judge.evaluations) = (2, 1, 4);
    (config.imitate.environment_steps, config.imitate.evaluations) = (1200, 4);
    for update in [&mut config.inner, &mut config.imitate.update] {
        update.discriminator.steps = 3;
    }
    config.imitate.discriminator_hidden = vec![16];
    (config.imitate.cloning_updates, config.imitate.checkpoint_every) = (5, 2);
    config
}

fn informed(mut config: Config) -> Config {
    config.method = Method::MamlMi;
    config
}

fn scores(set: &DemonstrationSet, playground: &Playground<'_>, config: &Config) -> (ScoreTable, u64) {
    let (ledger, observer) = (&mut InMemory::default(), &mut Silent);
    let run = &mut Run { set, playground, config, ledger, observer };
    experiment::prior(run).unwrap();
    let learned = playground.steps_taken();
    (experiment::scores(run, Judge::Paper).unwrap(), learned)
}

/// Degrees away from the goal; Spearman's order is that of their size.
#[test]
fn planted_demonstrations_rank_by_how_near_the_goal_they_lead_with_cloning() {
    let bearings = [180.0_f32, 10.0, 120.0, -45.0, -90.0];
    let mut by_bearing: Vec<usize> = (0..bearings.len()).collect();
    by_bearing.sort_by(|a, b| bearings[*a].abs().total_cmp(&bearings[*b].abs()));
    for seed in 0..4 {
        let set = planted_set(&bearings, Seed::new(50 + seed)).unwrap();
        let task = PointMass::new();
        let playground = Playground::new(&task);
        let mut config = cloning(seed);
        (config.judge.repeats, config.judge.evaluations) = (4, 20);
        let (table, learned) = scores(&set, &playground, &config);
        let ranked: Vec<usize> = select::rank(&table).entries.iter().map(|entry| entry.demo.0).collect();
        assert_eq!(ranked, by_bearing, "seed {seed}");
        assert_eq!(learned, 0, "meta-training by cloning plays nothing");
        let episodes = 1 + bearings.len() * config.judge.repeats;
        let scored = episodes * config.judge.evaluations * task.specification().horizon;
        assert_eq!(playground.steps_taken(), scored as u64, "only scoring plays");
    }
}

#[test]
fn the_adaptation_curve_plays_when_it_is_asked_for() {
    let set = planted_set(&[0.0, 180.0], Seed::new(3)).unwrap();
    let task = PointMass::new();
    let curves = |episodes: usize| {
        let mut config = cloning(1);
        config.inner.cloning.curve_episodes = episodes;
        config.judge.iterations = 40;
        let (table, _) = scores(&set, &Playground::new(&task), &config);
        table.suitabilities.into_iter().map(|one| one.curves[0].clone()).collect::<Vec<_>>()
    };
    for curve in curves(0) {
        assert!(curve.iter().all(|update| update.score.is_none()));
        let losses: Vec<f64> = curve.iter().map(|update| update.cloning_loss.unwrap()).collect();
        assert!(losses[39] < 0.8 * losses[0], "{losses:?}");
    }
    let [good, bad] = &curves(4)[..] else { panic!("two demonstrations") };
    let [start, good, bad] = [&good[0], &good[39], &bad[39]].map(|update| update.score.unwrap());
    assert!(good > bad + 0.3 && good > start + 0.1, "{start} became {good} and {bad}");
}

/// Either order brings down the loss after one update, and the exact gradient of that very loss brings it further down.
#[test]
fn meta_training_by_cloning_lowers_the_loss_after_adaptation() {
    for seed in 0..3 {
        let set = planted_set(&[0.0, 120.0, 240.0], Seed::new(seed)).unwrap();
        let loss_after = |rounds: usize, order: Order| {
            let mut config = cloning(seed);
            (config.meta_train.rounds, config.meta_train.order) = (rounds, order);
            (config.judge.iterations, config.judge.repeats) = (1, 1);
            let task = PointMass::new();
            let (table, _) = scores(&set, &Playground::new(&task), &config);
            let losses = table.suitabilities.iter().map(|one| one.curves[0][0].cloning_loss_after.unwrap());
            losses.sum::<f64>() / 3.0
        };
        let (without, first, second) =
            (loss_after(0, Order::First), loss_after(100, Order::First), loss_after(100, Order::Second));
        eprintln!("seed {seed}: without {without:.4}, first order {first:.4}, second order {second:.4}");
        assert!(first < without && second < 0.9 * without, "seed {seed}: {without} without");
        assert!(second < first, "seed {seed}: {first} by first order, {second} by second");
    }
}

#[test]
fn cloning_the_good_demonstration_from_scratch_beats_cloning_a_bad_one() {
    let set = planted_set(&[0.0, 180.0], Seed::new(9)).unwrap();
    let (task, config) = (PointMass::new(), cloning(4));
    let [good, bad] = [0, 1].map(|demo| {
        let playground = &Playground::new(&task);
        let (ledger, observer) = (&mut InMemory::default(), &mut Silent);
        let run = &mut Run { set: &set, playground, config: &config, ledger, observer };
        experiment::oracle_curve(run, DemoId(demo), 0).unwrap()
    });
    assert!(good.outcome.score > bad.outcome.score + 0.5, "{:?} and {:?}", good.outcome, bad.outcome);
    assert!(good.outcome.score > -0.3, "{:?}", good.outcome);
    assert_eq!(
        good.points.iter().map(|point| point.updates).collect::<Vec<_>>(),
        [0, 10, 20, 30, 40, 50, 60]
    );
    assert!(good.points.iter().all(|point| point.environment_steps == 0));
    let best = good.points.iter().map(|point| point.score).fold(f64::NEG_INFINITY, f64::max);
    assert!(best > good.points[0].score + 0.3, "the curve rises");
}

#[test]
fn adam_clones_within_an_adaptation_too() {
    let set = planted_set(&[0.0, 180.0], Seed::new(9)).unwrap();
    let mut config = brief(cloning(4));
    config.meta_train.order = Order::First;
    config.inner.cloning =
        Cloning { descent: Descent::Adam, learning_rate: 3e-3, steps: 50, batch: 10, curve_episodes: 0 };
    let task = PointMass::new();
    let (table, _) = scores(&set, &Playground::new(&task), &config);
    let [good, bad] = [0, 1].map(|demo| table.suitabilities[demo].mean_after());
    assert!(good > bad + 0.3, "{good} and {bad}");
}

fn sift(config: &Config, ledger: &mut InMemory, observer: &mut dyn Observer) -> Sifted {
    let set = planted_set(&[0.0, 120.0, 180.0], Seed::new(9)).unwrap();
    let task = PointMass::with_goals(2);
    let playground = &Playground::new(&task);
    experiment::sift(&mut Run { set: &set, playground, config, ledger, observer }).unwrap()
}

const NOUNS: [&str; 5] = [
    "prior.safetensors",
    "scores_paper.json",
    "verdict.json",
    "policy_best.safetensors",
    "policy_referee_random_2_gail_1.safetensors",
];

fn results(ledger: &InMemory) -> Vec<Vec<u8>> {
    NOUNS.iter().map(|name| ledger.recall(name).unwrap().expect(name)).collect()
}

fn kinds() -> [Config; 4] {
    [brief(cloning(4)), informed(brief(cloning(4))), brief(gail(4)), informed(brief(gail(4)))]
}

#[test]
fn one_thread_makes_what_four_threads_make() {
    let on = |threads: usize, config: &Config| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut ledger = InMemory::default();
            sift(config, &mut ledger, &mut Silent);
            (results(&ledger), MetaPrior::recall(&ledger, "").unwrap().unwrap())
        })
    };
    let found = kinds().map(|config| {
        let (one, prior) = on(1, &config);
        assert_eq!(one, on(4, &config).0);
        (one, prior.policy)
    });
    assert_ne!(found[0].1, found[1].1, "mutual information makes another prior by cloning");
    let mut first = brief(cloning(4));
    first.meta_train.order = Order::First;
    assert_ne!(found[0].1, on(1, &first).1.policy, "the orders differ by cloning");
}

fn is_checkpoint(event: &Event<'_>) -> bool {
    matches!(event, Event::Checkpoint { .. })
}

#[test]
fn a_run_killed_at_any_checkpoint_goes_on_to_the_same_bytes() {
    for config in kinds() {
        let (mut whole, mut never) = (InMemory::default(), Killed::never(is_checkpoint));
        let sifted = sift(&config, &mut whole, &mut never);
        assert!(never.seen >= 4, "meta-training and judging have checkpoints: {}", never.seen);
        for checkpoint in 1..=never.seen {
            let mut ledger = InMemory::default();
            let mut killed = Killed::at(checkpoint, is_checkpoint);
            catch_unwind(AssertUnwindSafe(|| sift(&config, &mut ledger, &mut killed))).expect_err("killed");
            assert_eq!(sift(&config, &mut ledger, &mut Silent), sifted, "killed at checkpoint {checkpoint}");
            assert_eq!(results(&ledger), results(&whole), "killed at checkpoint {checkpoint}");
        }
    }
}
