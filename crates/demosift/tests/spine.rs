//! The whole flow on the point mass: good demonstrations come first, whatever the order, the threads and the kills.

use std::panic::{AssertUnwindSafe, catch_unwind};

use demosift::basics::ledger::{InMemory, Ledger};
use demosift::basics::observer::{Event, Observer, Silent};
use demosift::basics::seed::Seed;
use demosift::data::demonstration::{DemoId, DemonstrationSet};
use demosift::learning::adapt::{InnerUpdate, MetaPrior};
use demosift::learning::mutual_information::PosteriorFitting;
use demosift::learning::trpo::TrustRegion;
use demosift::results::artifact::Artifact as _;
use demosift::results::panel::{Judge, Judges};
use demosift::results::recording;
use demosift::run::experiment::{self, Checkpointing, CloningJudge, Config, Run, Sifted, TrainerJudge};
use demosift::run::preset::Preset;
use demosift::stages::demonstrator::{self, DemonstratorState, DemonstratorTraining, Stage};
use demosift::stages::imitate::Imitation;
use demosift::stages::judge::Judging;
use demosift::stages::meta_train::{MetaTraining, MutualInformation};
use demosift::stages::method::Method;
use demosift::stages::referee::{self, Refereeing};
use demosift::stages::select::{self, Keep};
use demosift::stages::subset_selection::SubsetSelection;
use demosift::world::environment::{EnvVariant, Task};
use demosift::world::point_mass::{PointMass, planted_set};
use demosift::world::policy::PolicyShape;
use demosift::world::rollout::Playground;

use crate::fixtures::Killed;

/// Small enough for a test, large enough to rank.
fn small(seed: u64) -> Config {
    let quick = Preset::Quick.config();
    let fitting = demosift::learning::gail::Fitting {
        learning_rate: 0.01,
        steps: 20,
        batch: 100,
        entropy: 0.3,
        most_told: 1.0,
    };
    Config {
        seed,
        method: Method::Maml,
        keep: Keep::Count(2),
        judged_for: None,
        portable: false,
        near_cut: 100,
        policy: PolicyShape { hidden: vec![16, 16], initial_std: 0.5 },
        inner: InnerUpdate {
            batch_steps: 240,
            alphas: vec![1.0, 0.5],
            discriminator: fitting.clone(),
            ..quick.inner
        },
        meta_train: MetaTraining {
            rounds: 10,
            discriminator_hidden: vec![32, 32],
            checkpoint_every: 3,
            // Eight episodes say too little for the presets' wide steps.
            trust_region: TrustRegion { max_kl: 0.03, ..quick.meta_train.trust_region },
            ..quick.meta_train
        },
        mutual_information: MutualInformation {
            batch_steps: 150,
            posterior: PosteriorFitting {
                lstm: 12,
                dense: 8,
                readings: 10,
                batch: 48,
                ..quick.mutual_information.posterior
            },
            ..quick.mutual_information
        },
        judges: Judges::Both,
        judge: Judging { iterations: 6, evaluations: 10, repeats: 2, ..quick.judge },
        cloning_judge: CloningJudge {
            judging: Judging {
                iterations: 10,
                averaged: 3,
                repeats: 2,
                most_repeats: 4,
                ..quick.cloning_judge.judging
            },
            ..quick.cloning_judge
        },
        trainer_judge: TrainerJudge::default(),
        subset_selection: SubsetSelection {
            rounds: 5,
            meta_updates: 2,
            iterations: 3,
            ..quick.subset_selection
        },
        imitate: Imitation {
            environment_steps: 6000,
            update: InnerUpdate { batch_steps: 600, discriminator: fitting, ..quick.imitate.update },
            discriminator_hidden: vec![32, 32],
            evaluate_every: 4,
            evaluations: 10,
            checkpoint_every: 3,
            cloning_updates: 20,
            ..quick.imitate
        },
        referee: Refereeing { cloning: 3, gail: 1, trainer: 0 },
    }
}

/// The parts of the flow that make scores.
fn scores(set: &DemonstrationSet, task: &dyn Task, config: &Config) -> demosift::stages::judge::ScoreTable {
    let run = &mut Run {
        set,
        playground: &Playground::new(task),
        config,
        ledger: &mut InMemory::default(),
        observer: &mut Silent,
    };
    experiment::scores(run, Judge::Paper).unwrap()
}

fn order(ranking: &select::Ranking) -> Vec<usize> {
    ranking.entries.iter().map(|entry| entry.demo.0).collect()
}

#[test]
fn planted_good_demonstrations_come_first() {
    // Degrees away from the goal; the good ones stand among the bad ones.
    let bearings = [180.0, 10.0, 120.0, -15.0, -130.0];
    for seed in 0..4 {
        let set = planted_set(&bearings, Seed::new(50 + seed)).unwrap();
        let found = order(&select::rank(&scores(&set, &PointMass::new(), &small(seed))));
        let mut first = found[..2].to_vec();
        first.sort_unstable();
        assert_eq!(first, [1, 3], "seed {seed}: {found:?}");
    }
}

/// The judge by cloning, each repeat of which starts from another policy that knows nothing.
#[test]
fn c_4_planted_good_demonstrations_come_first_by_cloning_too() {
    let bearings = [180.0, 10.0, 120.0, -15.0, -130.0];
    for seed in 0..4 {
        let set = planted_set(&bearings, Seed::new(50 + seed)).unwrap();
        let (task, config) = (PointMass::new(), small(seed));
        let run = &mut Run {
            set: &set,
            playground: &Playground::new(&task),
            config: &config,
            ledger: &mut InMemory::default(),
            observer: &mut Silent,
        };
        let table = experiment::scores(run, Judge::Cloning).unwrap();
        assert!(run.ledger.recall("prior.safetensors").unwrap().is_none(), "it needs no prior");
        let found = order(&select::rank(&table));
        let mut first = found[..2].to_vec();
        first.sort_unstable();
        assert_eq!(first, [1, 3], "seed {seed}: {found:?}");
        for of in &table.suitabilities {
            assert!((2..=4).contains(&of.after.len()), "{} repeats", of.after.len());
            assert_ne!(of.before[0], of.before[1], "each repeat starts from a policy of its own");
        }
        let panel = experiment::panel(run).unwrap();
        assert!(panel.decides.each().contains(&Judge::Cloning), "{:?}", panel.decides);
        assert!(panel.opinions[0].agrees_with_itself.unwrap() > 0.5);
    }
}

/// Of a set that is larger than what is near the cut, the judge of the paper is asked about those alone, and about them it says
/// what it says as a judge of all.
#[test]
fn the_judge_of_the_paper_judges_those_near_the_cut_of_a_large_set() {
    let bearings = [180.0, 10.0, 120.0, -15.0, -130.0, 60.0, -90.0, 35.0];
    let set = planted_set(&bearings, Seed::new(50)).unwrap();
    let (task, mut config) = (PointMass::new(), small(1));
    (config.near_cut, config.meta_train.rounds) = (4, 3);
    let playground = Playground::new(&task);
    let ledger = &mut InMemory::default();
    let run = &mut Run { set: &set, playground: &playground, config: &config, ledger, observer: &mut Silent };
    // Asked at once, it asks the judge by cloning first.
    let table = experiment::scores(run, Judge::Paper).unwrap();
    let cloning = select::rank(&experiment::scores(run, Judge::Cloning).unwrap());
    let mut near: Vec<DemoId> = cloning.entries[..4].iter().map(|entry| entry.demo).collect();
    near.sort_unstable();
    assert_eq!(table.demos(), near, "two are kept, so two above the cut and two below");

    let sifted = experiment::sift(run).unwrap();
    let paper = sifted.panel.of(Judge::Paper).unwrap();
    assert_eq!((sifted.panel.decides, paper.judged()), (Judges::Cloning, 4));
    assert_eq!(sifted.selection.ranking.entries.len(), 8);
    assert_eq!(experiment::costs(run).unwrap().demonstrations, 4, "its account is about these");

    // What surely helps is not asked of a judge of some, so it is not what both keep.
    let auto = Config { keep: Keep::Auto, ..config.clone() };
    let ledger = &mut InMemory::default();
    let run = &mut Run { set: &set, playground: &playground, config: &auto, ledger, observer: &mut Silent };
    let sifted = experiment::sift(run).unwrap();
    let asked = experiment::worth_training_on(run, &sifted.panel, &sifted.selection).unwrap();
    assert_eq!(asked[0].name, "kept by cloning");

    let all = Config { near_cut: 8, ..config.clone() };
    let whole = scores(&set, &task, &all);
    let of_near: Vec<_> = whole.suitabilities.into_iter().filter(|of| near.contains(&of.demo)).collect();
    assert_eq!(table.suitabilities, of_near);
}

/// More updates bring the agent nearer to each demonstration, the good and the bad.
#[test]
fn table_1_the_adapted_agent_is_nearer_to_what_it_imitated() {
    let set = planted_set(&[180.0, 10.0, 120.0, -15.0], Seed::new(50)).unwrap();
    let judged = |iterations: usize| {
        let mut config = small(2);
        config.judge.iterations = iterations;
        scores(&set, &PointMass::new(), &config)
    };
    let (little, much) = (judged(1), judged(12));
    for (little, much) in little.suitabilities.iter().zip(&much.suitabilities) {
        assert_eq!((little.distances.len(), much.distances.len()), (2, 2), "one per repeat");
        let nearer = little.distances.iter().zip(&much.distances).all(|(little, much)| much < little);
        assert!(nearer, "{:?} became {:?}", little.distances, much.distances);
    }
    let mean = much.suitabilities.iter().flat_map(|of| &of.distances).sum::<f64>() / 8.0;
    assert!((much.adapted_behaviors_distance() - mean).abs() < 1e-12);
}

fn permuted(set: &DemonstrationSet, permutation: &[usize]) -> DemonstrationSet {
    let demonstrations = permutation.iter().map(|id| set.get(DemoId(*id)).clone()).collect();
    DemonstrationSet::new(demonstrations).unwrap()
}

/// Judging is the same to the bit, wherever a demonstration stands.
#[test]
fn scores_do_not_depend_on_the_order_of_the_demonstrations() {
    let set = planted_set(&[0.0, 55.0, 110.0, 180.0], Seed::new(1)).unwrap();
    let (task, config) = (PointMass::new(), small(1));
    let run = |set: &DemonstrationSet, prior: Option<&MetaPrior>| {
        let playground = &Playground::new(&task);
        let (ledger, observer) = (&mut InMemory::default(), &mut Silent);
        let mut run = Run { set, playground, config: &config, ledger, observer };
        if let Some(prior) = prior {
            prior.store(run.ledger, "").unwrap();
        }
        let table = experiment::scores(&mut run, Judge::Paper).unwrap();
        (experiment::prior(&mut run).unwrap(), table)
    };
    let (prior, table) = run(&set, None);
    let ranked = order(&select::rank(&table));
    for permutation in [[3, 1, 0, 2], [2, 3, 1, 0]] {
        let (_, again) = run(&permuted(&set, &permutation), Some(&prior));
        for (place, id) in permutation.iter().enumerate() {
            let (there, here) = (&again.suitabilities[place], &table.suitabilities[*id]);
            assert_eq!((&there.before, &there.after), (&here.before, &here.after));
            assert_eq!(there.curves, here.curves);
        }
        let mapped: Vec<usize> = order(&select::rank(&again)).iter().map(|id| permutation[*id]).collect();
        assert_eq!(mapped, ranked);
    }
}

/// Meta-training sums over the demonstrations in their order, so another order rounds otherwise and close ranks may
/// trade places; the good ones come first all the same.
#[test]
fn the_good_ones_come_first_in_any_order() {
    let set = planted_set(&[5.0, -20.0, 130.0, 180.0], Seed::new(1)).unwrap();
    for permutation in [[0, 1, 2, 3], [3, 1, 0, 2], [2, 3, 1, 0]] {
        let table = scores(&permuted(&set, &permutation), &PointMass::new(), &small(1));
        let mapped: Vec<usize> = order(&select::rank(&table)).iter().map(|id| permutation[*id]).collect();
        assert!(mapped[..2].iter().all(|id| *id < 2), "{mapped:?}");
    }
}

#[test]
fn eq_9_each_goal_prefers_the_demonstration_that_goes_there() {
    let set = planted_set(&[0.0, 90.0, 180.0, 270.0], Seed::new(3)).unwrap();
    let table = scores(&set, &PointMass::with_goals(4), &small(2));
    assert_eq!(table.suitabilities.len(), 16);
    for variant in 0..4 {
        let ranking = select::rank_under(&table, EnvVariant(variant));
        assert_eq!(ranking.entries[0].demo, DemoId(variant), "{:?}", order(&ranking));
        let score = |demo| ranking.entries.iter().find(|entry| entry.demo == DemoId(demo)).unwrap().gain;
        assert!(score(variant) > score((variant + 2) % 4) + 0.5, "{ranking:?}");
    }
}

#[test]
fn eq_8_all_demonstrations_are_compared_with_the_same_episodes_before() {
    let set = planted_set(&[0.0, 90.0, 180.0], Seed::new(3)).unwrap();
    let mut config = small(2);
    (config.meta_train.rounds, config.judge.iterations) = (1, 1);
    let table = scores(&set, &PointMass::with_goals(2), &config);
    for suitability in &table.suitabilities {
        let first = &table.suitabilities[3 * suitability.variant.0];
        assert_eq!(suitability.before, first.before);
        assert_eq!((suitability.after.len(), suitability.after[0].len()), (2, 10));
        let mean = |scores: &[f64]| scores.iter().sum::<f64>() / scores.len() as f64;
        let gain = mean(&suitability.after.concat()) - mean(&suitability.before.concat());
        assert!((suitability.gain() - gain).abs() < 1e-12);
    }
    assert_ne!(table.suitabilities[0].before, table.suitabilities[3].before, "another goal");
}

/// Under Algorithm 2 a demonstration that stands twice in a set gets the same score twice.
#[test]
fn algorithm_2_what_is_demonstrated_twice_scores_the_same_twice() {
    let planted = planted_set(&[0.0, 180.0], Seed::new(3)).unwrap();
    let twice = [0, 1, 0].map(|id| planted.get(DemoId(id)).clone());
    let set = DemonstrationSet::new(twice.to_vec()).unwrap();
    let mut config = small(2);
    (config.meta_train.rounds, config.judge.iterations) = (2, 2);
    let table = scores(&set, &PointMass::new(), &config);
    let [one, other] = [0, 2].map(|id| &table.suitabilities[id]);
    assert_eq!((&one.after, &one.curves), (&other.after, &other.curves));
    assert_ne!(one.after, table.suitabilities[1].after);
}

/// A discriminator that starts from D_meta pays an agent's pairs less alike after one update than one that starts
/// undecided. This says nothing about the meta-trained policy.
#[test]
fn algorithm_1_one_update_from_the_meta_discriminator_pays_less_alike() {
    let set = planted_set(&[0.0, 90.0, 180.0, 270.0], Seed::new(3)).unwrap();
    for seed in 0..4 {
        let spread = |rounds| {
            let mut config = small(seed);
            (config.meta_train.rounds, config.judge.iterations) = (rounds, 1);
            let table = scores(&set, &PointMass::new(), &config);
            let curves = table.suitabilities.iter().flat_map(|suitability| &suitability.curves);
            curves.map(|curve| curve[0].reward_std.unwrap()).sum::<f64>()
        };
        let (without, with) = (spread(0), spread(25));
        assert!(with > without, "seed {seed}: {without} without meta-training, {with} with it");
    }
}

/// Whether something was written down: a checkpoint, or one of the referee's trainings.
fn is_kept(event: &Event<'_>) -> bool {
    matches!(event, Event::Checkpoint { .. } | Event::Advanced { stage: referee::STAGE, .. })
}

fn brief(seed: u64) -> Config {
    let mut config = small(seed);
    config.meta_train.rounds = 5;
    config.meta_train.checkpoint_every = 2;
    (config.judge.iterations, config.judge.repeats) = (2, 1);
    config.imitate.environment_steps = 3000;
    config.imitate.checkpoint_every = 2;
    config
}

/// The same with mutual information.
fn informed(seed: u64) -> Config {
    let mut config = brief(seed);
    config.method = Method::MamlMi;
    config
}

fn sift(config: &Config, ledger: &mut InMemory, observer: &mut dyn Observer) -> Sifted {
    let set = planted_set(&[0.0, 120.0, 180.0], Seed::new(9)).unwrap();
    let task = PointMass::new();
    let playground = &Playground::new(&task);
    experiment::sift(&mut Run { set: &set, playground, config, ledger, observer }).unwrap()
}

const NOUNS: [&str; 14] = [
    "prior.safetensors",
    "scores_cloning.json",
    "adapted_cloning.safetensors",
    "scores_paper.json",
    "panel.json",
    "ranking.json",
    "subset.json",
    "verdict.json",
    "spent_referee.json",
    "policy_best.safetensors",
    "policy_best.onnx",
    "policy_referee_all_cloning_2.safetensors",
    "learning_curve_referee_all_gail_0.json",
    "learning_curve_referee_random_2_cloning_1.json",
];

fn results(ledger: &InMemory) -> Vec<Vec<u8>> {
    NOUNS.iter().map(|name| ledger.recall(name).unwrap().expect(name)).collect()
}

#[test]
fn one_thread_makes_what_four_threads_make() {
    let on = |threads: usize, config: &Config| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut ledger = InMemory::default();
            sift(config, &mut ledger, &mut Silent);
            results(&ledger)
        })
    };
    let (plain, informed) = (on(1, &brief(4)), on(1, &informed(4)));
    assert_eq!(plain, on(4, &brief(4)));
    assert_eq!(informed, on(4, &self::informed(4)));
    assert_ne!(plain[0], informed[0], "mutual information makes another prior");
}

#[test]
fn a_run_killed_at_any_checkpoint_goes_on_to_the_same_bytes() {
    for config in [brief(4), informed(4)] {
        goes_on_to_the_same_bytes(&config);
    }
}

fn goes_on_to_the_same_bytes(config: &Config) {
    let (mut whole, mut count) = (InMemory::default(), Killed::never(is_kept));
    let sifted = sift(config, &mut whole, &mut count);
    assert!(
        count.seen >= 13,
        "meta-training and judging have checkpoints, and the referee eleven trainings: {}",
        count.seen
    );
    for kill in 1..=count.seen {
        let mut ledger = InMemory::default();
        let mut killed = Killed::at(kill, is_kept);
        catch_unwind(AssertUnwindSafe(|| sift(config, &mut ledger, &mut killed))).expect_err("killed");
        assert_eq!(sift(config, &mut ledger, &mut Silent), sifted, "killed at checkpoint {kill}");
        assert_eq!(results(&ledger), results(&whole), "killed at checkpoint {kill}");
    }
}

#[test]
fn nothing_is_made_twice_and_no_checkpoint_is_left() {
    let mut ledger = InMemory::default();
    let sifted = sift(&brief(4), &mut ledger, &mut Silent);
    assert!(!format!("{ledger:?}").contains("checkpoint"));
    let mut again = Killed::never(is_kept);
    assert_eq!(sift(&brief(4), &mut ledger, &mut again), sifted);
    assert_eq!(again.seen, 0, "everything was recalled");
}

#[test]
fn a_checkpoint_of_other_demonstrations_is_not_gone_on_with() {
    let set = planted_set(&[0.0, 120.0, 180.0], Seed::new(9)).unwrap();
    let (task, config) = (PointMass::new(), brief(4));
    let curve = |ledger: &mut InMemory, observer: &mut dyn Observer, demo: usize| {
        let playground = &Playground::new(&task);
        let run = &mut Run { set: &set, playground, config: &config, ledger, observer };
        experiment::learning_curve(run, "x", &[DemoId(demo)]).unwrap()
    };
    let fresh = curve(&mut InMemory::default(), &mut Silent, 2);
    let mut ledger = InMemory::default();
    let mut killed = Killed::at(1, is_kept);
    catch_unwind(AssertUnwindSafe(|| curve(&mut ledger, &mut killed, 0))).expect_err("killed");
    assert_eq!(curve(&mut ledger, &mut Silent, 2), fresh);
}

#[test]
fn imitating_the_good_demonstration_alone_beats_imitating_a_bad_one() {
    let set = planted_set(&[0.0, 180.0], Seed::new(9)).unwrap();
    let (task, config) = (PointMass::new(), small(4));
    let mut outcomes = [0, 1].map(|demo| {
        let playground = &Playground::new(&task);
        let (ledger, observer) = (&mut InMemory::default(), &mut Silent);
        let run = &mut Run { set: &set, playground, config: &config, ledger, observer };
        experiment::oracle_curve(run, DemoId(demo), 0).unwrap()
    });
    let [good, bad] = &mut outcomes;
    assert!(good.end.score > bad.end.score + 0.3, "{:?} and {:?}", good.end, bad.end);
    // The curve starts at nothing learned, ends at the budget, and its best point is the policy that is kept.
    assert_eq!(good.points[0].environment_steps, 0);
    assert_eq!(good.points.last().unwrap().environment_steps, 6000);
    assert_eq!(good.demos, [DemoId(0)]);
    let best = good.points.iter().map(|point| point.score).fold(f64::NEG_INFINITY, f64::max);
    assert!(best > good.points[0].score + 0.3);
    assert_eq!(good.best_point().unwrap().score, best);
    // All that was played: twenty batches of 300 steps, and evaluations of ten episodes of 30 steps.
    assert_eq!(good.played, 6000 + 300 * (good.points.len() as u64 + 2));
}

/// The last policy plays the episodes that the best one is scored on, so where they are the same the scores are.
#[test]
fn the_end_of_a_curve_is_the_last_policy_on_the_episodes_of_the_outcome() {
    let set = planted_set(&[0.0, 180.0], Seed::new(9)).unwrap();
    let (task, mut config) = (PointMass::new(), small(4));
    let curve = |config: &Config| {
        let playground = &Playground::new(&task);
        let (ledger, observer) = (&mut InMemory::default(), &mut Silent);
        let run = &mut Run { set: &set, playground, config, ledger, observer };
        experiment::learning_curve(run, "x", &[DemoId(1)]).unwrap()
    };
    // Imitating what leads away is best when it has not begun.
    let away = curve(&config);
    assert_eq!(away.best_point(), away.points.first());
    assert!(away.end.score < away.outcome.score - 0.3, "{:?} and {:?}", away.end, away.outcome);
    config.imitate.environment_steps = 0;
    let still = curve(&config);
    assert_eq!((still.points.len(), still.end), (1, still.outcome));
    assert_eq!(still.played, 3 * 10 * 30, "the one point, the best and the last");
}

fn training() -> DemonstratorTraining {
    DemonstratorTraining {
        updates: 40,
        batch_steps: 600,
        policy: PolicyShape { hidden: vec![16, 16], initial_std: 0.5 },
        trust_region: TrustRegion { max_kl: 0.05, ..TrustRegion::default() },
        advantage: Default::default(),
        enough_success: 0.95,
        snapshot_every: 2,
        filter_updates: 5,
        checkpoint_every: 3,
    }
}

fn train(ledger: &mut InMemory, observer: &mut dyn Observer, goals: usize) -> Vec<Stage> {
    let (task, training, seed) = (PointMass::with_goals(goals), training(), Seed::new(6));
    let playground = Playground::new(&task);
    let start = || DemonstratorState::start(&playground, &training, &seed);
    let (state, mut checkpointing) =
        Checkpointing::begin(ledger, observer, &playground, demonstrator::STAGE, "", start).unwrap();
    demonstrator::train(&playground, &training, state, &seed, &mut checkpointing).unwrap()
}

#[test]
fn a_demonstrator_learns_the_task_from_its_reward() {
    let stages = train(&mut InMemory::default(), &mut Silent, 1);
    let (first, last) = (&stages[0], stages.last().unwrap());
    assert_eq!(first.updates, 0);
    assert!(first.success.unwrap() < 0.2, "{:?}", first.success);
    assert!(last.success.unwrap() >= 0.95, "{:?}", last.success);
    assert!(last.score > first.score + 0.5 && last.task_return > first.task_return + 0.5);
    assert_eq!(last.environment_steps, last.updates * 20 * 30);
    let all: Vec<&Stage> = stages.iter().collect();
    let chosen = recording::choose_stages(&all, 3).unwrap();
    assert!(chosen[0].score < chosen[1].score && chosen[1].score < chosen[2].score);
}

#[test]
fn a_demonstrator_killed_at_a_checkpoint_goes_on_to_the_same_stages() {
    let whole = train(&mut InMemory::default(), &mut Silent, 1);
    for kill in [1, 2] {
        let mut ledger = InMemory::default();
        let mut killed = Killed::at(kill, is_kept);
        catch_unwind(AssertUnwindSafe(|| train(&mut ledger, &mut killed, 1))).expect_err("killed");
        assert_eq!(train(&mut ledger, &mut Silent, 1), whole);
    }
}

/// Table 3 and A.2.1, from which the paper's preset takes its values.
#[test]
fn table_3_is_what_the_presets_build() {
    for (_, preset) in Preset::ALL {
        let config = preset.config();
        assert_eq!(config.policy.hidden, [32, 32]);
        assert_eq!(config.meta_train.discriminator_hidden, [100, 100]);
        assert_eq!(config.imitate.discriminator_hidden, [100, 100]);
    }
}
