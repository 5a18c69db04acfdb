//! Which share of learning is physics: meta-updates without and with mutual information and with the exact gradient, and
//! imitation updates (GAIL + TRPO) with the sizes of the preset `standard`, on environments that time themselves.
//!
//! The demonstrations are episodes of policies that know nothing: what an update costs hardly depends on what was shown.
//!
//! `cargo bench -p demosift-mujoco --bench meta_update [-- TASK..]`
#![allow(clippy::print_stdout, clippy::unwrap_used, missing_docs)]

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use demosift::Result;
use demosift::basics::observer::{Event, Observer};
use demosift::basics::seed::Seed;
use demosift::data::demonstration::{Demonstration, DemonstrationSet};
use demosift::data::observation_filter::ObservationFilter;
use demosift::math::rows::Rows;
use demosift::run::experiment::Config;
use demosift::run::preset::Preset;
use demosift::stages::imitate::{self, Imitation, ImitationState, Lesson};
use demosift::stages::meta_train::{self, Learning, MetaState, MetaTraining};
use demosift::world::environment::{
    EnvVariant, Environment, Specification, StepOutcome, Stepped, Task, Worker,
};
use demosift::world::heuristic::Heuristic;
use demosift::world::policy::Policy;
use demosift::world::rollout::{self, Acting, Playground};
use demosift_mujoco::environment::MujocoEnvironment;
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::registry;

const SHARE_GOAL: f64 = 0.75;
const SHARE_GOAL_WITH_INFORMATION: f64 = 0.6;
/// 15 times what `imitation` 1.0.1 with sb3-contrib's TRPO makes of HalfCheetah on two cores.
const STEPS_PER_SEC_GOAL: f64 = 21_750.0;
/// Updates of an imitation that are measured; the median is printed.
const UPDATES: usize = 3;
/// Task, how many demonstrations its set has, and meta-updates that are measured: one of HalfCheetah takes 22,000 steps.
const SETS: [(&str, usize, usize); 2] = [("half_cheetah", 10, 1), ("free_throw", 8, 5)];

/// The standard preset with the batch of `configs/half_cheetah.toml`, whose layers only the command reads.
fn config_of(task: &dyn Task) -> Config {
    let mut config = Preset::Standard.config();
    if task.specification().name == "half_cheetah" {
        (config.inner.batch_steps, config.imitate.update.batch_steps) = (4000, 4000);
        config.mutual_information.batch_steps = 4000;
    }
    config
}

fn main() {
    println!(
        "physics: time inside the environments over all threads / (threads x wall); the goal is 0.75 and more,"
    );
    println!("with mutual information 0.6 and more");
    println!("of HalfCheetah the goal is {STEPS_PER_SEC_GOAL:.0} steps/s");
    println!(
        "{:15} {:12} {:>7} {:>10} {:>10} {:>9} {:>16}",
        "update", "task", "threads", "wall ms", "steps/s", "physics", "learner us/step"
    );
    let wanted: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    for (name, demonstrations, rounds) in SETS {
        if !wanted.is_empty() && !wanted.iter().any(|task| task == name) {
            continue;
        }
        let task = Timed { task: registry::load(name).unwrap(), nanos: Arc::default() };
        let set = episodes_of_untrained(&task, demonstrations);
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let report = |update: &str, goal: f64, spans: Vec<Span>| {
                print_row(update, name, goal, threads, spans);
            };
            report("imitation", SHARE_GOAL, pool.install(|| imitation_updates(&task, &set)));
            report("meta-training", SHARE_GOAL, pool.install(|| meta_updates(&task, &set, rounds, false)));
            let informed = pool.install(|| meta_updates(&task, &set, rounds, true));
            report("the same, MI", SHARE_GOAL_WITH_INFORMATION, informed);
        }
    }
}

/// What one update took.
struct Span {
    wall_secs: f64,
    physics_secs: f64,
    steps: u64,
}

fn print_row(update: &str, task: &str, goal: f64, threads: usize, mut spans: Vec<Span>) {
    let share = |span: &Span| span.physics_secs / span.wall_secs / threads as f64;
    spans.sort_by(|a, b| share(a).total_cmp(&share(b)));
    let median = &spans[spans.len() / 2];
    let Span { wall_secs, physics_secs, steps } = *median;
    let note = if share(median) < goal { "below the goal" } else { "" };
    println!(
        "{update:15} {task:12} {threads:>7} {:>10.0} {:>10.0} {:>9.3} {:>16.2} {note}",
        wall_secs * 1e3,
        steps as f64 / wall_secs,
        share(median),
        (threads as f64 * wall_secs - physics_secs) / steps as f64 * 1e6,
    );
}

fn meta_updates(task: &Timed, set: &DemonstrationSet, rounds: usize, informed: bool) -> Vec<Span> {
    let Config { policy, inner, meta_train, mutual_information, .. } = config_of(task);
    let information = informed.then_some(&mutual_information);
    let training = MetaTraining { rounds, checkpoint_every: usize::MAX, ..meta_train };
    let (playground, seed) = (Playground::new(task), Seed::new(0));
    let state = MetaState::start(set, &policy, &training.discriminator_hidden, information, &seed);
    let mut watch = Watch::new(task, &playground);
    let learning = Learning { training: &training, inner: &inner, information };
    meta_train::meta_train(set, &playground, &learning, state, &seed, &mut watch).unwrap();
    watch.spans
}

fn imitation_updates(task: &Timed, set: &DemonstrationSet) -> Vec<Span> {
    let Config { policy, imitate, .. } = config_of(task);
    let imitation = Imitation {
        environment_steps: UPDATES
            * imitate.update.episodes(task.specification().horizon)
            * task.specification().horizon,
        evaluate_every: usize::MAX,
        evaluations: 1,
        checkpoint_every: usize::MAX,
        ..imitate
    };
    let (playground, seed) = (Playground::new(task), Seed::new(0));
    let state = ImitationState::start(set, &set.ids(), &policy, &imitation, &seed);
    let mut watch = Watch::new(task, &playground);
    let lesson = Lesson { set, playground: &playground, imitation: &imitation, part: "", seed: &seed };
    imitate::imitate(&lesson, state, &mut watch).unwrap();
    watch.spans
}

/// Measures from where an update may start to where it says that it is done.
struct Watch<'a> {
    task: &'a Timed,
    playground: &'a Playground<'a>,
    since: (Instant, f64, u64),
    spans: Vec<Span>,
}

impl<'a> Watch<'a> {
    fn new(task: &'a Timed, playground: &'a Playground<'a>) -> Self {
        let since = (Instant::now(), task.physics_secs(), playground.steps_taken());
        Self { task, playground, since, spans: Vec::new() }
    }
}

impl Observer for Watch<'_> {
    fn on(&mut self, event: Event<'_>) -> demosift::Result<()> {
        let (start, physics_secs, steps) = self.since;
        match event {
            Event::Advanced { .. } => self.spans.push(Span {
                wall_secs: start.elapsed().as_secs_f64(),
                physics_secs: self.task.physics_secs() - physics_secs,
                steps: self.playground.steps_taken() - steps,
            }),
            // An evaluation has just ended: it is no part of an update.
            Event::Measured { stage: imitate::STAGE, .. } | Event::Started { .. } => {}
            _ => return Ok(()),
        }
        self.since = (Instant::now(), self.task.physics_secs(), self.playground.steps_taken());
        Ok(())
    }
}

/// A task whose environments add up the time that they take.
struct Timed {
    task: MujocoTask,
    nanos: Arc<AtomicU64>,
}

impl Timed {
    fn physics_secs(&self) -> f64 {
        self.nanos.load(Ordering::Relaxed) as f64 * 1e-9
    }
}

impl Task for Timed {
    fn specification(&self) -> &Specification {
        self.task.specification()
    }

    fn worker(&self) -> Result<Box<dyn Worker>> {
        let environment = self.task.mujoco_environment()?;
        let timed = TimedEnvironment { environment, nanos: Arc::clone(&self.nanos) };
        Ok(Box::new(Stepped::new(timed, self.task.specification())))
    }

    fn heuristic(&self) -> &dyn Heuristic {
        self.task.heuristic()
    }

    fn succeeded(&self, measurements: &Rows) -> Option<bool> {
        self.task.succeeded(measurements)
    }
}

struct TimedEnvironment {
    environment: MujocoEnvironment,
    nanos: Arc<AtomicU64>,
}

impl TimedEnvironment {
    fn timed<R>(&mut self, work: impl FnOnce(&mut dyn Environment) -> R) -> R {
        let start = Instant::now();
        let result = work(&mut self.environment);
        self.nanos.fetch_add(start.elapsed().as_nanos() as u64, Ordering::Relaxed);
        result
    }
}

impl Environment for TimedEnvironment {
    fn reset(&mut self, variant: EnvVariant, seed: Seed, observation: &mut [f32], measurements: &mut [f32]) {
        self.timed(|environment| environment.reset(variant, seed, observation, measurements));
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32], measurements: &mut [f32]) -> StepOutcome {
        self.timed(|environment| environment.step(action, observation, measurements))
    }
}

fn episodes_of_untrained(task: &Timed, count: usize) -> DemonstrationSet {
    let specification = task.specification();
    let (shape, playground) = (Preset::Standard.config().policy, Playground::new(task));
    let demonstrations = Seed::new(1).many(count).into_iter().map(|seed| {
        let filter = ObservationFilter::identity(specification.observation_size);
        let policy = Policy::untrained(&shape, filter, specification.action_size, seed.of("policy"));
        let seeds = seed.of("play").many(1);
        let played = rollout::play(&playground, &policy, Acting::Sampled, EnvVariant(0), seeds).unwrap();
        Demonstration::new(played[0].observations().head(played[0].steps()), played[0].actions().clone())
            .unwrap()
    });
    DemonstrationSet::new(demonstrations.collect()).unwrap()
}
