use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::AtomicUsize;
use std::sync::{Arc, Barrier};

use super::*;
use crate::data::observation_filter::ObservationFilter;
use crate::data::trajectory::Ended;
use crate::math::rows::Rows;
use crate::world::environment::{Environment, SimulatorState, StepOutcome, Stepped};
use crate::world::heuristic::Heuristic;
use crate::world::point_mass::PointMass;
use crate::world::policy::PolicyShape;

/// The point mass with workers of another make.
struct PlayedBy<Make> {
    task: PointMass,
    make: Make,
}

impl<Make: Fn(&PointMass) -> Box<dyn Worker> + Send + Sync> PlayedBy<Make> {
    fn new(make: Make) -> Self {
        Self { task: PointMass::new(), make }
    }
}

impl<Make: Fn(&PointMass) -> Box<dyn Worker> + Send + Sync> Task for PlayedBy<Make> {
    fn specification(&self) -> &Specification {
        self.task.specification()
    }
    fn worker(&self) -> Result<Box<dyn Worker>> {
        Ok((self.make)(&self.task))
    }
    fn heuristic(&self) -> &dyn Heuristic {
        self.task.heuristic()
    }
    fn succeeded(&self, measurements: &Rows) -> Option<bool> {
        self.task.succeeded(measurements)
    }
}

fn point(task: &PointMass) -> Box<dyn Worker> {
    task.worker().expect("a point")
}

/// A worker that does something else with what it is asked for.
struct Doing<Do> {
    width: usize,
    worker: Box<dyn Worker>,
    how: Do,
}

impl<Do> Worker for Doing<Do>
where
    Do: FnMut(&mut dyn Worker, &[Episode<'_>]) -> Result<Vec<Rollout>> + Send,
{
    fn width(&self) -> usize {
        self.width
    }
    fn play(&mut self, episodes: &[Episode<'_>]) -> Result<Vec<Rollout>> {
        (self.how)(self.worker.as_mut(), episodes)
    }
}

fn policy() -> Policy {
    let shape = PolicyShape { hidden: vec![8], initial_std: 0.5 };
    Policy::untrained(&shape, ObservationFilter::identity(4), 2, Seed::new(1))
}

fn some(playground: &Playground<'_>, count: usize) -> Result<Vec<Trajectory>> {
    play(playground, &policy(), Acting::Sampled, EnvVariant(0), Seed::new(5).many(count))
}

fn on_threads<T: Send>(count: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("threads").install(work)
}

/// How the third episode of a worker goes wrong.
#[derive(Clone, Copy)]
enum Failure {
    Error,
    Panic,
}

/// Fails on its third episode, and on any further one, as a process that has died.
fn fails_on_its_third(task: &PointMass, failure: Failure) -> Box<dyn Worker> {
    let mut played = 0;
    let how = move |worker: &mut dyn Worker, episodes: &[Episode<'_>]| {
        played += episodes.len();
        match failure {
            _ if played < 3 => worker.play(episodes),
            Failure::Error => Err(Error::simulation("the environment's process has died")),
            Failure::Panic => panic!("the environment has panicked"),
        }
    };
    Box::new(Doing { width: 1, worker: point(task), how })
}

#[test]
fn a_worker_that_failed_is_thrown_away_and_another_one_plays_on() {
    for failure in [Failure::Error, Failure::Panic] {
        let made = Arc::new(AtomicUsize::new(0));
        let counter = Arc::clone(&made);
        let task = PlayedBy::new(move |task: &PointMass| {
            counter.fetch_add(1, Ordering::Relaxed);
            fails_on_its_third(task, failure)
        });
        let healthy = PointMass::new();
        let wanted = some(&Playground::new(&healthy), 2).expect("a healthy point plays");
        on_threads(1, || {
            let playground = Playground::new(&task);
            for round in 1..4 {
                assert_eq!(some(&playground, 2).expect("two go well"), wanted);
                assert_eq!(made.load(Ordering::Relaxed), round);
                match failure {
                    Failure::Error => {
                        let error = some(&playground, 1).expect_err("the third one goes wrong");
                        assert!(error.is_simulation() && error.to_string().contains("has died"), "{error}");
                    }
                    Failure::Panic => {
                        let outcome = catch_unwind(AssertUnwindSafe(|| some(&playground, 1)));
                        assert!(outcome.is_err(), "the third one panics");
                    }
                }
            }
            assert_eq!(playground.steps_taken(), 6 * 30, "what failed is not counted");
        });
    }
}

/// A point whose simulation runs away with some seeds.
fn runs_away(task: &PointMass, width: usize, with: fn(&Seed) -> bool) -> Box<dyn Worker> {
    let how = move |worker: &mut dyn Worker, episodes: &[Episode<'_>]| match episodes
        .iter()
        .any(|episode| with(episode.seed))
    {
        true => Err(Error::diverged("observation 0 at step 17 is not a finite number")),
        false => worker.play(episodes),
    };
    Box::new(Doing { width, worker: point(task), how })
}

#[test]
fn an_episode_that_runs_away_is_begun_again_from_another_start_and_the_others_are_not() {
    let healthy = PointMass::new();
    let mut wanted = some(&Playground::new(&healthy), 3).expect("a healthy point plays");
    let other = Seed::new(5).at(1).of("again").at(1);
    let other = play(&Playground::new(&healthy), &policy(), Acting::Sampled, EnvVariant(0), vec![other]);
    wanted[1] = other.expect("a healthy point plays").remove(0);
    for (width, threads) in [(1, 1), (1, 3), (3, 2)] {
        let task =
            PlayedBy::new(move |task: &PointMass| runs_away(task, width, |seed| *seed == Seed::new(5).at(1)));
        on_threads(threads, || {
            let playground = Playground::new(&task);
            assert_eq!(some(&playground, 3).expect("the next start is a good one"), wanted);
            let PlayedAgain { times, why } = playground.played_again();
            assert_eq!((times, playground.steps_taken()), (1, 3 * 30));
            assert!(why.contains("observation 0 at step 17"), "{why}");
        });
    }
}

#[test]
fn what_runs_away_each_time_is_an_error() {
    let begun = Arc::new(AtomicUsize::new(0));
    let counter = Arc::clone(&begun);
    let task = PlayedBy::new(move |task: &PointMass| {
        counter.fetch_add(1, Ordering::Relaxed);
        runs_away(task, 1, |_| true)
    });
    let error = some(&Playground::new(&task), 1).expect_err("no start is a good one");
    assert!(error.is_diverged() && error.hint().is_some(), "{error}");
    // The one that was asked for with others, and then each attempt, with a worker of its own.
    assert_eq!(begun.load(Ordering::Relaxed), 1 + ATTEMPTS);
}

#[test]
fn wide_workers_play_the_same_in_the_same_order_and_in_chunks_that_no_thread_decides() {
    let narrow = PointMass::new();
    let wanted = some(&Playground::new(&narrow), 10).expect("the point mass plays");
    for threads in [1, 3] {
        let sizes = Arc::new(Mutex::new(Vec::new()));
        let seen = Arc::clone(&sizes);
        let task = PlayedBy::new(move |task: &PointMass| -> Box<dyn Worker> {
            let seen = Arc::clone(&seen);
            let how = move |worker: &mut dyn Worker, episodes: &[Episode<'_>]| {
                seen.lock().expect("no panic").push(episodes.len());
                worker.play(episodes)
            };
            Box::new(Doing { width: 4, worker: point(task), how })
        });
        let found = on_threads(threads, || some(&Playground::new(&task), 10)).expect("it plays");
        assert_eq!(found, wanted);
        let mut sizes = sizes.lock().expect("no panic").clone();
        sizes.sort_unstable();
        assert_eq!(sizes, [2, 4, 4], "{threads} threads");
    }
}

#[test]
fn an_answer_that_does_not_fit_what_was_asked_is_an_error_and_no_result() {
    type Answer = fn(&mut dyn Worker, &[Episode<'_>]) -> Result<Vec<Rollout>>;
    let short: Answer = |worker, episodes| {
        let mut rollouts = worker.play(episodes)?;
        rollouts.pop();
        Ok(rollouts)
    };
    let wide: Answer = |_, _| {
        let rows = |len: usize, width| Rows::from_flat(vec![0.0; len * width], width).expect("whole rows");
        let parts = crate::data::trajectory::Parts {
            observations: rows(2, 5),
            actions: rows(1, 2),
            measurements: rows(2, 3),
            task_rewards: vec![0.0],
            ended: Ended::Truncated,
        };
        Ok(vec![Rollout { trajectory: Trajectory::new(parts)?, states: None }])
    };
    for (answer, said) in [
        (short, "a worker was asked for 1 episodes and played 0"),
        (wide, "5 observations a step, and the task 'point_mass' has 4"),
    ] {
        let task = PlayedBy::new(move |task: &PointMass| -> Box<dyn Worker> {
            Box::new(Doing { width: 1, worker: point(task), how: answer })
        });
        let error = some(&Playground::new(&task), 1).expect_err("it does not fit");
        assert!(error.is_simulation() && error.to_string().contains(said), "{error}");
    }
}

/// Each worker waits until three others play as well, so that fewer than four at once would wait for ever.
#[test]
fn workers_that_wait_can_be_more_than_the_threads_that_learn() {
    let all = Arc::new(Barrier::new(4));
    let task = PlayedBy::new(move |task: &PointMass| -> Box<dyn Worker> {
        let all = Arc::clone(&all);
        let how = move |worker: &mut dyn Worker, episodes: &[Episode<'_>]| {
            all.wait();
            worker.play(episodes)
        };
        Box::new(Doing { width: 1, worker: point(task), how })
    });
    let alone = PointMass::new();
    let wanted = some(&Playground::new(&alone), 8).expect("the point mass plays");
    let playground = Playground::with_workers(&task, 4).expect("four threads");
    assert_eq!(on_threads(1, || some(&playground, 8)).expect("it plays"), wanted);
    let error = Playground::with_workers(&alone, 0).err().expect("nobody to play");
    assert!(error.is_bad_config() && error.to_string().contains("at least 1"), "{error}");
}

/// Counts steps, shows the count as its state, and ends after as many as it is told.
struct Counting {
    steps: u8,
    last: u8,
}

impl Environment for Counting {
    fn reset(&mut self, _: EnvVariant, _: Seed, observation: &mut [f32], measurements: &mut [f32]) {
        self.steps = 0;
        observation.fill(0.0);
        measurements.fill(0.0);
    }
    fn step(&mut self, _: &[f32], observation: &mut [f32], _: &mut [f32]) -> StepOutcome {
        self.steps += 1;
        observation.fill(f32::from(self.steps));
        StepOutcome { task_reward: 1.0, terminated: self.steps == self.last }
    }
    fn simulator_state(&self) -> Option<SimulatorState<'_>> {
        const STATES: [[f64; 1]; 4] = [[0.0], [1.0], [2.0], [3.0]];
        let state = &STATES[usize::from(self.steps) % 4];
        Some(SimulatorState { qpos: state, qvel: &[] })
    }
}

fn counted(last: u8, keep_states: bool) -> Rollout {
    let task = PointMass::new();
    let mut worker = Stepped::new(Counting { steps: 9, last }, task.specification());
    let (policy, seed) = (policy(), Seed::new(2));
    let (acting, variant) = (Acting::Mean, EnvVariant(0));
    let episode = Episode { policy: &policy, acting, variant, seed: &seed, keep_states };
    worker.play(&[episode]).expect("it counts").remove(0)
}

#[test]
fn states_come_with_the_episode_one_for_each_action_and_only_if_they_are_asked_for() {
    let Rollout { trajectory, states } = counted(4, true);
    assert_eq!(states.expect("asked for").qpos, [0.0, 1.0, 2.0, 3.0], "each from which an action was taken");
    assert_eq!(counted(4, false), Rollout { trajectory, states: None });
    let task = PointMass::new();
    let (policy, seed) = (policy(), Seed::new(2));
    let (acting, variant) = (Acting::Mean, EnvVariant(0));
    let episode = Episode { policy: &policy, acting, variant, seed: &seed, keep_states: true };
    let played = play_episodes(&Playground::new(&task), &[episode]).expect("the point mass plays");
    assert_eq!(played[0].states, None, "there is no simulator");
}

#[test]
fn a_trajectory_says_how_it_ended() {
    let early = counted(4, false).trajectory;
    assert_eq!((early.steps(), early.ended(), early.terminated()), (4, Ended::Terminated, true));
    let late = counted(200, false).trajectory;
    assert_eq!((late.steps(), late.ended(), late.terminated()), (30, Ended::Horizon, false));
    let both = counted(30, false).trajectory;
    assert_eq!((both.steps(), both.ended()), (30, Ended::Terminated));
}
