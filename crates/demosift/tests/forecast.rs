//! What a forecast counts is what a run then plays, to the step; and it keeps nothing and plays the same by any clock.

use std::collections::BTreeMap;

use demosift::Result;
use demosift::basics::ledger::{InMemory, Ledger};
use demosift::basics::observer::Silent;
use demosift::basics::seed::Seed;
use demosift::data::demonstration::{DemoId, DemonstrationSet};
use demosift::learning::adapt::{InnerUpdate, Rule};
use demosift::learning::behavioral_cloning::Cloning;
use demosift::learning::mutual_information::PosteriorFitting;
use demosift::learning::trpo::TrustRegion;
use demosift::results::artifact::Artifact as _;
use demosift::results::panel::Judges;
use demosift::results::recording::{self, Cast};
use demosift::run::experiment::{self, Checkpointing, CloningJudge, Config, Run};
use demosift::run::forecast::{self, By, Goal, Planned, Recording};
use demosift::run::preset::Preset;
use demosift::stages::demonstrator::{self, DemonstratorState, DemonstratorTraining};
use demosift::stages::imitate::Imitation;
use demosift::stages::judge::Judging;
use demosift::stages::meta_train::{MetaTraining, MutualInformation};
use demosift::stages::method::Method;
use demosift::stages::referee::{self, Refereeing};
use demosift::stages::select::Keep;
use demosift::stages::subset_selection::SubsetSelection;
use demosift::world::point_mass::{PointMass, planted_set};
use demosift::world::policy::PolicyShape;
use demosift::world::rollout::Playground;

fn tiny(method: Method, rule: Rule) -> Config {
    let quick = Preset::Quick.config();
    let posterior = PosteriorFitting { lstm: 4, dense: 4, readings: 5, ..quick.mutual_information.posterior };
    // Under behavioral cloning something is played for the curve alone.
    let cloning = Cloning { curve_episodes: 2, ..quick.inner.cloning.clone() };
    let update = Cloning { curve_episodes: 1, ..quick.imitate.update.cloning.clone() };
    Config {
        method,
        policy: PolicyShape { hidden: vec![4], initial_std: 0.5 },
        inner: InnerUpdate { imitation: rule, batch_steps: 100, cloning, ..quick.inner },
        meta_train: MetaTraining {
            rounds: 9,
            meta_batch: 3,
            discriminator_hidden: vec![4],
            checkpoint_every: 2,
            ..quick.meta_train
        },
        mutual_information: MutualInformation { batch_steps: 70, posterior, ..quick.mutual_information },
        judge: Judging { iterations: 3, averaged: 2, evaluations: 3, repeats: 2, ..quick.judge },
        // No repeats are added, so that all of them are known before.
        cloning_judge: CloningJudge {
            judging: Judging {
                iterations: 2,
                averaged: 1,
                repeats: 2,
                most_repeats: 0,
                ..quick.cloning_judge.judging
            },
            ..quick.cloning_judge
        },
        // Never steady, so that all rounds are made.
        subset_selection: SubsetSelection {
            rounds: 2,
            steady_rounds: 3,
            meta_updates: 2,
            iterations: 2,
            ..quick.subset_selection
        },
        imitate: Imitation {
            environment_steps: 1000,
            cloning_updates: 5,
            update: InnerUpdate {
                imitation: rule,
                batch_steps: 100,
                cloning: update,
                ..quick.imitate.update
            },
            discriminator_hidden: vec![4],
            evaluate_every: 3,
            evaluations: 4,
            checkpoint_every: 2,
            ..quick.imitate
        },
        referee: Refereeing { cloning: 3, gail: 1, trainer: 0 },
        ..quick
    }
}

fn set() -> DemonstrationSet {
    planted_set(&[0.0, 90.0, 180.0, 270.0, 45.0], Seed::new(1)).unwrap()
}

/// Environment steps by stage.
fn counted(planned: &[Planned]) -> BTreeMap<String, u64> {
    planned.iter().map(|planned| (planned.stage.clone(), planned.environment_steps)).collect()
}

/// What each stage of a whole job is said to cost before, and what it then plays.
fn before_and_after(
    set: &DemonstrationSet,
    task: &PointMass,
    config: &Config,
) -> (BTreeMap<String, u64>, BTreeMap<String, u64>) {
    let playground = Playground::new(task);
    let (ledger, observer) = (&mut InMemory::default(), &mut Silent);
    let run = &mut Run { set, playground: &playground, config, ledger, observer };
    let planned = forecast::planned(run, Goal::Verdict).unwrap();
    assert_eq!(playground.steps_taken(), 0, "counting plays nothing");
    experiment::sift(run).unwrap();
    assert_eq!(forecast::planned(run, Goal::Verdict).unwrap(), [], "a finished run costs nothing");
    let costs = experiment::costs(run).unwrap();
    let spent: BTreeMap<String, u64> =
        costs.spent.into_iter().map(|(stage, spent)| (stage, spent.environment_steps)).collect();
    assert_eq!(spent.values().sum::<u64>(), playground.steps_taken());
    (counted(&planned), spent)
}

/// To the step, but for the referee: how many candidates it has depends on how far the judges agree, and it has at most what
/// is counted.
fn assert_counted((planned, spent): &(BTreeMap<String, u64>, BTreeMap<String, u64>), what: &str) {
    assert_eq!(planned.keys().collect::<Vec<_>>(), spent.keys().collect::<Vec<_>>(), "{what}");
    for (stage, counted) in planned {
        match stage.as_str() {
            referee::STAGE => {
                assert!((1..=*counted).contains(&spent[stage]), "{what}: {planned:?}, {spent:?}")
            }
            _ => assert_eq!(*counted, spent[stage], "{what}, {stage}"),
        }
    }
}

#[test]
fn what_is_counted_is_what_is_played() {
    for (task, rule) in [
        (PointMass::new(), Rule::Gail),
        (PointMass::with_goals(3), Rule::Gail),
        (PointMass::with_goals(2), Rule::BehavioralCloning),
    ] {
        for (name, method) in Method::ALL {
            assert_counted(
                &before_and_after(&set(), &task, &tiny(method, rule)),
                &format!("{name}, {rule:?}"),
            );
        }
        for method in [Method::Maml, Method::MamlMi] {
            let config = Config { keep: Keep::Weights, ..tiny(method, rule) };
            let found = before_and_after(&set(), &task, &config);
            assert!(found.0.contains_key("subset_selection"), "{:?}", found.0);
            assert_counted(&found, &format!("by weights, {rule:?}"));
        }
    }
}

/// Sizes of the set, goals, judges, repeats, updates, episodes and batches in combination, without the referee, whose trainings
/// are not known before: stage by stage, to the step.
#[test]
fn over_a_grid_of_configurations_what_is_counted_is_what_is_played() {
    let directions = [0.0, 90.0, 180.0, 270.0, 45.0];
    let methods = Method::ALL.map(|(_, method)| method);
    let mut stages = BTreeMap::new();
    for (index, (count, goals, judges, repeats)) in grid().into_iter().enumerate() {
        let (set, task) =
            (planted_set(&directions[..count], Seed::new(2)).unwrap(), PointMass::with_goals(goals));
        let mut config = tiny(methods[index % methods.len()], Rule::Gail);
        (config.judges, config.referee, config.seed) = (judges, "none".parse().unwrap(), index as u64);
        let has_prior = judges != Judges::Cloning && config.method.stage() == Some("meta_train");
        config.keep = if has_prior && index % 3 == 0 { Keep::Weights } else { Keep::Count(1) };
        (config.judge.repeats, config.judge.evaluations) = (repeats, 1 + index % 3);
        config.near_cut = 1 + index % 4;
        (config.meta_train.meta_batch, config.inner.batch_steps) = (1 + index % 6, 60 + 50 * (index % 3));
        let cloning = &mut config.cloning_judge.judging;
        (cloning.repeats, cloning.iterations, cloning.evaluations) = (1 + index % 2, 1 + index % 4, repeats);
        config.subset_selection.meta_updates = 1 + index % 2;
        let (planned, spent) = before_and_after(&set, &task, &config);
        assert_eq!(planned, spent, "{count} demonstrations, {goals} goals, {config:?}");
        planned.into_keys().for_each(|stage| *stages.entry(stage).or_insert(0) += 1);
    }
    // The grid is about something: each stage was there several times.
    let wanted = ["judge_cloning", "judge_paper", "meta_train", "pre_train", "subset_selection"];
    assert_eq!(stages.keys().collect::<Vec<_>>(), wanted.iter().collect::<Vec<_>>());
    assert!(stages.values().all(|times| *times >= 2), "{stages:?}");
}

fn grid() -> Vec<(usize, usize, Judges, usize)> {
    let mut grid = Vec::new();
    for count in [2, 5] {
        for goals in [1, 3] {
            for judges in [Judges::Cloning, Judges::Paper, Judges::Both] {
                grid.extend([1, 3].map(|repeats| (count, goals, judges, repeats)));
            }
        }
    }
    grid
}

/// Repeats that a race spares are not known before.
#[test]
fn a_race_plays_at_most_what_is_counted() {
    let mut config = tiny(Method::Maml, Rule::Gail);
    config.judges = Judges::Cloning;
    (config.cloning_judge.judging.repeats, config.cloning_judge.judging.most_repeats) = (2, 5);
    let (set, task) = (set(), PointMass::new());
    let playground = Playground::new(&task);
    let (ledger, observer) = (&mut InMemory::default(), &mut Silent);
    let run = &mut Run { set: &set, playground: &playground, config: &config, ledger, observer };
    let planned = forecast::planned(run, Goal::Scores).unwrap();
    assert!(planned.len() == 1 && planned[0].at_most, "{planned:?}");
    experiment::panel(run).unwrap();
    assert!((1..=planned[0].environment_steps).contains(&playground.steps_taken()));
    assert_eq!(forecast::planned(run, Goal::Scores).unwrap(), []);
}

/// Remembers checkpoints that a run forgets when it is done, and can forget the results instead, as if it had been killed.
#[derive(Default)]
struct Killed(BTreeMap<String, Vec<u8>>);

impl Ledger for Killed {
    fn recall(&self, name: &str) -> Result<Option<Vec<u8>>> {
        Ok(self.0.get(name).cloned())
    }

    fn store(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        self.0.insert(name.to_owned(), bytes.to_vec());
        Ok(())
    }

    fn forget(&mut self, _: &str) -> Result<()> {
        Ok(())
    }
}

#[test]
fn what_a_killed_run_has_done_is_not_counted_again() {
    let (set, task) = (set(), PointMass::new());
    let config = tiny(Method::Maml, Rule::Gail);
    let mut ledger = Killed::default();
    let playground = Playground::new(&task);
    let observer = &mut Silent;
    let fresh = {
        let run =
            &mut Run { set: &set, playground: &playground, config: &config, ledger: &mut ledger, observer };
        let fresh = forecast::planned(run, Goal::Verdict).unwrap();
        experiment::sift(run).unwrap();
        fresh
    };
    ledger.0.retain(|name, _| name.starts_with("checkpoint"));
    let again = Playground::new(&task);
    let run = &mut Run { set: &set, playground: &again, config: &config, ledger: &mut ledger, observer };
    let rest = forecast::planned(run, Goal::Selection).unwrap();
    let panel = experiment::panel(run).unwrap();
    experiment::selection(run, &panel).unwrap();
    // Judging leaves a checkpoint behind its last demonstration, and so nothing to do.
    let counted: u64 = rest.iter().map(|planned| planned.environment_steps).sum();
    assert_eq!(counted, again.steps_taken());
    assert!(counted > 0 && counted < playground.steps_taken(), "{counted}");
    for planned in &rest {
        let whole = fresh.iter().find(|whole| whole.stage == planned.stage).unwrap();
        assert!(planned.updates < whole.updates, "{planned:?} of {whole:?}");
    }
}

#[test]
fn the_trainings_that_a_killed_referee_has_made_are_not_counted_again() {
    let (set, task) = (set(), PointMass::new());
    let mut ledger = Killed::default();
    for (method, at_most) in [("cloning=3,gail=1", true), ("cloning=1,gail=4", true), ("none", false)] {
        let config = Config { referee: method.parse().unwrap(), ..tiny(Method::FromScratch, Rule::Gail) };
        let playground = Playground::new(&task);
        let observer = &mut Silent;
        let run =
            &mut Run { set: &set, playground: &playground, config: &config, ledger: &mut ledger, observer };
        experiment::sift(run).unwrap();
        let killed = ["verdict.json", "learning_curve_referee_all_cloning_0.json"];
        ledger.0.retain(|name, _| !killed.contains(&name.as_str()));
        let again = Playground::new(&task);
        let run = &mut Run { set: &set, playground: &again, config: &config, ledger: &mut ledger, observer };
        let rest = forecast::planned(run, Goal::Verdict).unwrap();
        experiment::sift(run).unwrap();
        assert_eq!(rest.iter().map(|planned| planned.environment_steps).sum::<u64>(), again.steps_taken());
        // One of cloning was forgotten, which ends when it ends.
        assert!(rest.iter().all(|planned| !planned.at_most), "{rest:?}");
        ledger.0.clear();
        let run = &Run { set: &set, playground: &again, config: &config, ledger: &mut ledger, observer };
        let fresh = forecast::planned(run, Goal::Verdict).unwrap();
        assert_eq!(fresh.iter().any(|planned| planned.at_most), at_most, "{fresh:?}");
    }
}

#[test]
fn the_oracle_and_named_demonstrations_are_counted_and_not_twice() {
    let (set, task) = (set(), PointMass::with_goals(2));
    let config = tiny(Method::Maml, Rule::Gail);
    let playground = Playground::new(&task);
    let (ledger, observer) = (&mut InMemory::default(), &mut Silent);
    let run = &mut Run { set: &set, playground: &playground, config: &config, ledger, observer };
    let goal = Goal::Oracle { repeats: 2, random: 0 };
    let all = forecast::planned(run, goal).unwrap();
    experiment::oracle_curve(run, DemoId(1), 0).unwrap();
    let one = playground.steps_taken();
    assert_eq!(all[0].environment_steps, 10 * one);
    assert_eq!(forecast::planned(run, goal).unwrap()[0].environment_steps, 9 * one);
    let demos = [DemoId(2), DemoId(0)];
    let named = forecast::planned(run, Goal::Policy("two", &demos)).unwrap();
    experiment::learning_curve(run, "two", &demos).unwrap();
    assert_eq!(named[0].environment_steps, playground.steps_taken() - one);
    assert_eq!(forecast::planned(run, Goal::Policy("two", &demos)).unwrap(), []);
}

/// Demonstrations keep the numbers of their file where some are left out.
#[test]
fn an_oracle_of_a_set_with_gaps_is_counted_and_compares_with_the_best_alone() {
    let whole = set();
    let ids = [1, 3, 4].map(DemoId);
    let chosen =
        DemonstrationSet::chosen(ids.to_vec(), ids.map(|id| whole.get(id).clone()).to_vec()).unwrap();
    let (task, config) = (PointMass::new(), tiny(Method::FromScratch, Rule::Gail));
    let playground = Playground::new(&task);
    let (ledger, observer) = (&mut InMemory::default(), &mut Silent);
    let run = &mut Run { set: &chosen, playground: &playground, config: &config, ledger, observer };
    experiment::learning_curve(run, "subset", &[DemoId(4)]).unwrap();
    let before = playground.steps_taken();
    let planned = forecast::planned(run, Goal::Oracle { repeats: 2, random: 1 }).unwrap();
    let oracle = experiment::oracle(run, 2, 1).unwrap();
    let counted: u64 = planned.iter().map(|planned| planned.environment_steps).sum();
    assert_eq!(counted, playground.steps_taken() - before);
    assert_eq!(oracle.alone.iter().map(|alone| alone.demo).collect::<Vec<_>>(), ids);
    let best = oracle.kept.unwrap().best_alone;
    assert!(
        oracle.alone.iter().all(|alone| alone.mean <= oracle.alone[ids.binary_search(&best).unwrap()].mean)
    );
}

#[test]
fn minutes_follow_the_clock_and_nothing_is_kept() {
    let (set, task) = (set(), PointMass::new());
    let config = tiny(Method::MamlMi, Rule::Gail);
    let mut ledger = Killed::default();
    let playground = Playground::new(&task);
    let run = &Run {
        set: &set,
        playground: &playground,
        config: &config,
        ledger: &mut ledger,
        observer: &mut Silent,
    };
    let by_ticks = |secs: f64| {
        let mut now = 0.0;
        let mut clock = || {
            now += secs;
            now
        };
        forecast::forecast(run, Goal::Verdict, &mut clock).unwrap()
    };
    // Whatever is tried takes as long as one look at the clock.
    let (slow, slower) = (by_ticks(2.0), by_ticks(4.0));
    let learning = slow.stages.iter().find(|stage| stage.planned.stage == "meta_train").unwrap();
    let rounds = learning.planned.updates as f64;
    assert!((learning.minutes - rounds * 2.0 / 60.0).abs() < 1e-9, "{slow:?}");
    assert!((slower.minutes - 2.0 * slow.minutes).abs() < 1e-9);
    assert_eq!(slow.environment_steps, slower.environment_steps);
    assert!(ledger.0.is_empty());
}

#[test]
fn a_recording_is_counted() {
    let task = PointMass::with_goals(3);
    let training = DemonstratorTraining {
        updates: 4,
        batch_steps: 200,
        policy: PolicyShape { hidden: vec![4], initial_std: 0.5 },
        trust_region: TrustRegion::default(),
        advantage: Default::default(),
        enough_success: 2.0,
        snapshot_every: 1,
        filter_updates: 2,
        checkpoint_every: 3,
    };
    let playground = Playground::new(&task);
    let asked = Recording { by: By::Training(&training), demonstrations: 4, demonstrators: 1, assessed: 10 };
    let mut ledger = InMemory::default();
    let planned = forecast::planned_recording(&playground, &asked, &ledger).unwrap();
    let seed = Seed::new(1);
    let stages = {
        let observer = &mut Silent;
        let start = || DemonstratorState::start(&playground, &training, &seed.of("start"));
        let (state, mut checkpointing) =
            Checkpointing::begin(&mut ledger, observer, &playground, demonstrator::STAGE, "", start).unwrap();
        let stages = demonstrator::train(&playground, &training, state, &seed, &mut checkpointing).unwrap();
        checkpointing.finish("", &stages).unwrap();
        stages
    };
    assert_eq!(planned[0].environment_steps, playground.steps_taken());
    let trained = playground.steps_taken();
    demonstrator::assess(&playground, &stages[4].policy, 10, &seed).unwrap();
    let part = Cast { playground: &playground, stages: stages.iter().take(4).collect() };
    recording::record(&[part], &seed).unwrap();
    assert_eq!(planned[1].environment_steps, playground.steps_taken() - trained);
    let rest = forecast::planned_recording(&playground, &asked, &ledger).unwrap();
    assert_eq!(rest, planned[1..], "a demonstrator that is trained is not trained again");
    assert!(Vec::<demosift::stages::demonstrator::Stage>::recall(&ledger, "").unwrap().is_some());
}
