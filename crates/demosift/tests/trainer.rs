//! Somebody else's trainer as a judge, on the point mass: who leads to the goal comes first, and what another trainer found
//! does not count.

use std::sync::Mutex;

use demosift::basics::ledger::{InMemory, Ledger as _};
use demosift::basics::observer::{Event, Silent};
use demosift::basics::seed::Seed;
use demosift::data::demonstration::{DemoId, DemonstrationSet};
use demosift::math::rows::Rows;
use demosift::results::panel::{Judge, Judges, Vote};
use demosift::run::experiment::{self, Config, Run};
use demosift::run::forecast::{self, Goal};
use demosift::run::preset::Preset;
use demosift::stages::judge::ScoreTable;
use demosift::stages::select::{self, Keep};
use demosift::world::environment::Task;
use demosift::world::point_mass::{PointMass, planted_set};
use demosift::world::rollout::Playground;
use demosift::world::trainer::{Apprentice, Trainer, TrainerIdentity};
use demosift::{Error, Result};
use rand::Rng as _;

use crate::fixtures::Killed;

/// Learns by heart what it is shown, and slips a little by its seed.
struct ByHeart {
    identity: TrainerIdentity,
    /// What each training was about, in the order in which they began.
    trainings: Mutex<Vec<(Vec<DemoId>, u64)>>,
    /// The training that fails, from 0.
    fails_at: Option<usize>,
    /// What is wrong with its policies.
    acts: fn(f32) -> f32,
}

impl ByHeart {
    fn named(name: &str) -> Self {
        let identity = TrainerIdentity { name: name.to_owned(), sha256: None };
        Self { identity, trainings: Mutex::default(), fails_at: None, acts: |action| action }
    }

    fn trainings(&self) -> Vec<(Vec<DemoId>, u64)> {
        self.trainings.lock().unwrap().clone()
    }
}

impl Trainer for ByHeart {
    fn identity(&self) -> &TrainerIdentity {
        &self.identity
    }

    fn train(&self, set: &DemonstrationSet, demos: &[DemoId], seed: &Seed) -> Result<Box<dyn Apprentice>> {
        let drawn = seed.of("slip").into_rng().next_u64();
        let mut trainings = self.trainings.lock().unwrap();
        trainings.push((demos.to_vec(), drawn));
        if self.fails_at == Some(trainings.len() - 1) {
            return Err(Error::simulation("out of memory of my own"));
        }
        let slip = (drawn % 100) as f32 / 1000.0;
        let (actions, acts) = (set.get(demos[0]).actions().clone(), self.acts);
        Ok(Box::new(Recital { actions, slip, acts, step: 0 }))
    }
}

struct Recital {
    actions: Rows,
    slip: f32,
    acts: fn(f32) -> f32,
    step: usize,
}

impl Apprentice for Recital {
    fn begin(&mut self) -> Result<()> {
        self.step = 0;
        Ok(())
    }

    fn act(&mut self, _: &[f32], action: &mut [f32]) -> Result<()> {
        let last = self.actions.len() - 1;
        let shown = self.actions.row(self.step.min(last));
        action.iter_mut().zip(shown).for_each(|(action, shown)| *action = (self.acts)(shown + self.slip));
        self.step += 1;
        Ok(())
    }
}

fn config() -> Config {
    let mut config = Preset::Quick.config();
    (config.judges, config.keep, config.seed) = (Judges::Trainer, Keep::Count(2), 3);
    (config.trainer_judge.evaluations, config.trainer_judge.repeats) = (4, 3);
    config.referee = "none".parse().unwrap();
    config
}

/// Degrees away from the goal; the good ones stand among the bad ones.
fn set() -> DemonstrationSet {
    planted_set(&[180.0, 10.0, 120.0, -15.0, -130.0], Seed::new(50)).unwrap()
}

/// Does something with a run that has this trainer.
fn with_run<T>(
    task: &dyn Task,
    trainer: Option<&dyn Trainer>,
    ledger: &mut InMemory,
    work: impl FnOnce(&mut Run<'_>) -> T,
) -> T {
    let (set, config, observer) = (set(), config(), &mut Silent);
    let playground = Playground::new(task);
    let playground = match trainer {
        Some(trainer) => playground.with_trainer(trainer),
        None => playground,
    };
    work(&mut Run { set: &set, playground: &playground, config: &config, ledger, observer })
}

fn judged(trainer: &dyn Trainer, ledger: &mut InMemory) -> Result<ScoreTable> {
    with_run(&PointMass::new(), Some(trainer), ledger, |run| experiment::scores(run, Judge::Trainer))
}

#[test]
fn what_leads_a_trainer_to_the_goal_comes_first() {
    let (trainer, mut ledger) = (ByHeart::named("by heart"), InMemory::default());
    with_run(&PointMass::new(), Some(&trainer), &mut ledger, |run| {
        let planned = forecast::planned(run, Goal::Verdict).unwrap();
        let [planned] = planned.as_slice() else { panic!("{planned:?}") };
        assert_eq!((planned.stage.as_str(), planned.by_trainer, planned.updates), ("judge_trainer", 15, 0));
        let sifted = experiment::sift(run).unwrap();
        assert_eq!(planned.environment_steps, run.playground.steps_taken());
        let mut kept: Vec<usize> = sifted.selection.subset.demos.iter().map(|demo| demo.0).collect();
        kept.sort_unstable();
        assert_eq!(kept, [1, 3]);
        assert_eq!(sifted.panel.decides, Judges::Trainer);
        assert_eq!(sifted.panel.opinions[0].vote, Vote::Counts);
        let table = experiment::scores(run, Judge::Trainer).unwrap();
        assert_eq!(table.trainer.as_ref(), Some(&trainer.identity));
        assert!(table.suitabilities.iter().all(|of| of.before.len() == 3 && of.after.len() == 3));
        assert!(table.suitabilities.iter().all(|of| of.distances.iter().all(|distance| *distance > 0.0)));
        assert_eq!(forecast::planned(run, Goal::Verdict).unwrap(), [], "a finished run costs nothing");
        let costs = experiment::costs(run).unwrap();
        let spent: Vec<(&str, u64)> =
            costs.spent.iter().map(|(stage, spent)| (stage.as_str(), spent.environment_steps)).collect();
        assert_eq!(spent, [("judge_trainer", planned.environment_steps)]);
    });
    let trainings = trainer.trainings();
    assert_eq!(trainings.len(), 15);
    assert!(trainings.iter().all(|(demos, _)| demos.len() == 1), "each on one demonstration");
    // A repeat has the same random numbers for all, and the next one others.
    let mut seeds: Vec<u64> = trainings.iter().map(|(_, seed)| *seed).collect();
    seeds.sort_unstable();
    seeds.dedup();
    assert_eq!(seeds.len(), 3);
    // Its policies are not ours to store.
    assert!(ledger.recall("adapted_trainer.safetensors").unwrap().is_none());
}

#[test]
fn under_each_goal_it_trains_by_itself() {
    let (trainer, mut ledger) = (ByHeart::named("by heart"), InMemory::default());
    let task = PointMass::with_goals(2);
    with_run(&task, Some(&trainer), &mut ledger, |run| {
        let planned = forecast::planned(run, Goal::Scores).unwrap();
        assert_eq!(planned[0].by_trainer, 30);
        experiment::panel(run).unwrap();
        assert_eq!(planned[0].environment_steps, run.playground.steps_taken());
    });
    assert_eq!(trainer.trainings().len(), 30);
    let mut goal = InMemory::default();
    experiment::hand_on(&ledger, &mut goal, demosift::world::environment::EnvVariant(1)).unwrap();
    let under = with_run(&PointMass::new(), None, &mut goal, |run| experiment::scores(run, Judge::Trainer));
    let under = under.unwrap();
    assert_eq!((under.suitabilities.len(), under.trainer), (5, Some(trainer.identity.clone())));
}

#[test]
fn what_it_finds_does_not_depend_on_the_threads() {
    let found = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| judged(&ByHeart::named("by heart"), &mut InMemory::default()).unwrap())
    };
    assert_eq!(found(1), found(4));
}

#[test]
fn a_run_without_a_trainer_plays_nothing() {
    let mut ledger = InMemory::default();
    with_run(&PointMass::new(), None, &mut ledger, |run| {
        let error = experiment::sift(run).unwrap_err();
        assert!(error.is_bad_config(), "{error}");
        assert_eq!(error.to_string(), "judges = trainer asks for trainings by a trainer, and there is none");
        assert_eq!(run.playground.steps_taken(), 0);
    });
}

#[test]
fn a_trainer_that_fails_leaves_what_it_has_finished() {
    let whole = judged(&ByHeart::named("by heart"), &mut InMemory::default()).unwrap();
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let mut ledger = InMemory::default();
    let failing = ByHeart { fails_at: Some(2), ..ByHeart::named("by heart") };
    let error = alone.install(|| judged(&failing, &mut ledger).unwrap_err());
    assert_eq!(error.to_string(), "judging demonstration 2: out of memory of my own");
    let again = ByHeart::named("by heart");
    with_run(&PointMass::new(), Some(&again), &mut ledger, |run| {
        assert_eq!(forecast::planned(run, Goal::Scores).unwrap()[0].by_trainer, 13);
        assert_eq!(experiment::scores(run, Judge::Trainer).unwrap(), whole);
    });
    assert_eq!(again.trainings().len(), 13, "two were finished");
}

#[test]
fn what_another_trainer_has_begun_is_made_again_and_what_it_has_finished_is_refused() {
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let mut ledger = InMemory::default();
    let failing = ByHeart { fails_at: Some(2), ..ByHeart::named("by heart") };
    alone.install(|| judged(&failing, &mut ledger).unwrap_err());
    let other = ByHeart::named("another");
    with_run(&PointMass::new(), Some(&other), &mut ledger, |run| {
        let planned = forecast::planned(run, Goal::Scores).unwrap();
        experiment::scores(run, Judge::Trainer).unwrap();
        assert_eq!((planned[0].by_trainer, planned[0].environment_steps), (15, run.playground.steps_taken()));
    });
    assert_eq!(other.trainings().len(), 15);
    let third = ByHeart::named("a third");
    let error = judged(&third, &mut ledger).unwrap_err();
    assert!(error.is_bad_config(), "{error}");
    let wanted = "the demonstrations were judged by the trainer another, and the trainer is a third now";
    assert_eq!(error.to_string(), wanted);
    assert!(third.trainings().is_empty());
    // Who looks at what was found needs no trainer.
    with_run(&PointMass::new(), None, &mut ledger, |run| {
        let panel = experiment::panel(run).unwrap();
        experiment::selection(run, &panel).unwrap();
    });
}

#[test]
fn a_policy_that_is_not_a_number_is_one_error() {
    let broken = ByHeart { acts: |_| f32::NAN, ..ByHeart::named("by heart") };
    let error = judged(&broken, &mut InMemory::default()).unwrap_err().to_string();
    assert!(error.starts_with("judging demonstration "), "{error}");
}

/// Nobody knows how long a training took, so none is lost to a kill.
#[test]
fn each_training_is_stored_as_it_is_finished() {
    let trainer = ByHeart::named("by heart");
    let (set, config, task) = (set(), config(), PointMass::new());
    let playground = Playground::new(&task).with_trainer(&trainer);
    let mut counting = Killed::never(|event| matches!(event, Event::Checkpoint { .. }));
    let (ledger, observer) = (&mut InMemory::default(), &mut counting);
    let run = &mut Run { set: &set, playground: &playground, config: &config, ledger, observer };
    experiment::scores(run, Judge::Trainer).unwrap();
    // With those of the agent before, one for each repeat.
    assert_eq!(counting.seen, 15 + 3);
}

#[test]
fn further_repeats_go_to_those_near_the_cut_where_they_are_asked_for() {
    let (trainer, mut ledger) = (ByHeart::named("by heart"), InMemory::default());
    let (set, mut config) = (set(), config());
    (config.trainer_judge.repeats, config.trainer_judge.most_repeats) = (2, 4);
    let task = PointMass::new();
    let playground = Playground::new(&task).with_trainer(&trainer);
    let (ledger, observer) = (&mut ledger, &mut Silent);
    let run = &mut Run { set: &set, playground: &playground, config: &config, ledger, observer };
    let planned = forecast::planned(run, Goal::Scores).unwrap();
    assert!(planned[0].at_most && planned[0].by_trainer == 20, "{planned:?}");
    let table = experiment::scores(run, Judge::Trainer).unwrap();
    assert!((10..=20).contains(&trainer.trainings().len()));
    assert_eq!(select::rank(&table).entries.len(), 5);
}
