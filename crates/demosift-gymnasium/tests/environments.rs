//! Environments in Python processes: they play what the same physics play here, and each way to fail is one sentence.

#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod support;

use std::time::{Duration, Instant};

use demosift::Error;
use demosift::basics::seed::Seed;
use demosift::data::observation_filter::ObservationFilter;
use demosift::data::trajectory::{Ended, Trajectory};
use demosift::math::rows::Rows;
use demosift::world::environment::{
    EnvVariant, Environment, Specification, StepOutcome, Stepped, Task, Worker,
};
use demosift::world::heuristic::{Heuristic, Score};
use demosift::world::policy::{Acting, Policy, PolicyShape};
use demosift::world::rollout::{self, Playground};
use demosift_gymnasium::check;
use demosift_gymnasium::source::Source;
use demosift_gymnasium::task::{GymnasiumTask, Wanted};
use demosift_gymnasium::trial::Repeats;

/// An environment of `environments/point.py`.
fn wanted(python: std::path::PathBuf, name: &str) -> Wanted {
    Wanted {
        source: Source::File { file: support::environments().canonicalize().unwrap(), name: name.to_owned() },
        python,
        heuristic: None,
        measure: None,
        horizon: Some(30),
        time_limit: Duration::from_secs(60),
    }
}

fn open(name: &str) -> Option<GymnasiumTask> {
    Some(GymnasiumTask::open(&wanted(support::interpreter()?, name)).unwrap())
}

/// Why it cannot be opened.
fn refused(name: &str, change: impl Fn(&mut Wanted)) -> Option<Error> {
    let mut wanted = wanted(support::interpreter()?, name);
    change(&mut wanted);
    Some(GymnasiumTask::open(&wanted).err().unwrap_or_else(|| panic!("{name} can be opened")))
}

fn policy() -> Policy {
    let shape = PolicyShape { hidden: vec![8], initial_std: 0.5 };
    Policy::untrained(&shape, ObservationFilter::identity(4), 2, Seed::new(1))
}

fn played(task: &dyn Task, count: usize) -> demosift::Result<Vec<Trajectory>> {
    let playground = Playground::with_workers(task, 2)?;
    rollout::play(&playground, &policy(), Acting::Sampled, EnvVariant(0), Seed::new(2).many(count))
}

/// The same physics here: the point of the library, at rest in the origin.
struct Native(Specification);

struct Point {
    position: [f32; 2],
    velocity: [f32; 2],
}

struct Nothing;

impl Heuristic for Nothing {
    fn score(&self, _: &Rows) -> Score {
        0.0
    }
}

impl Task for Native {
    fn specification(&self) -> &Specification {
        &self.0
    }
    fn worker(&self) -> demosift::Result<Box<dyn Worker>> {
        Ok(Box::new(Stepped::new(Point { position: [0.0; 2], velocity: [0.0; 2] }, &self.0)))
    }
    fn heuristic(&self) -> &dyn Heuristic {
        &Nothing
    }
    fn succeeded(&self, _: &Rows) -> Option<bool> {
        None
    }
}

impl Environment for Point {
    fn reset(&mut self, _: EnvVariant, _: Seed, observation: &mut [f32], _: &mut [f32]) {
        *self = Self { position: [0.0; 2], velocity: [0.0; 2] };
        observation.fill(0.0);
    }
    fn step(&mut self, action: &[f32], observation: &mut [f32], _: &mut [f32]) -> StepOutcome {
        for ((action, velocity), position) in action.iter().zip(&mut self.velocity).zip(&mut self.position) {
            let force = action.clamp(-1.0, 1.0) * 2.0;
            *velocity += (force - *velocity) * 0.1;
            *position += *velocity * 0.1;
        }
        observation[..2].copy_from_slice(&self.position);
        observation[2..].copy_from_slice(&self.velocity);
        StepOutcome { task_reward: 0.0, terminated: false }
    }
}

#[test]
fn the_same_physics_in_python_and_here_play_the_same_bits() {
    let Some(python) = open("Still") else { return };
    let native = Native(python.specification().clone());
    let (there, here) = (played(&python, 4).unwrap(), played(&native, 4).unwrap());
    for (there, here) in there.iter().zip(&here) {
        assert_eq!((there.observations(), there.actions()), (here.observations(), here.actions()));
        assert_eq!((there.steps(), there.ended()), (30, Ended::Horizon));
    }
    let again = played(&python, 4).unwrap();
    assert_eq!(there, again, "by any of the workers");
}

#[test]
fn an_environment_says_what_it_is_made_of() {
    let Some(interpreter) = support::interpreter() else { return };
    let wanted = Wanted {
        horizon: None,
        heuristic: Some("negated min distance".to_owned()),
        ..wanted(interpreter, "limited")
    };
    let task = GymnasiumTask::open(&wanted).unwrap();
    let Specification {
        name,
        observation_size,
        control_ranges,
        measurements,
        horizon,
        control_step_secs,
        is_control_step_told,
        ..
    } = task.specification();
    assert_eq!((name.as_str(), *observation_size, *horizon), ("point", 4, 30));
    assert_eq!((control_ranges, *control_step_secs), (&vec![[-2.0, 2.0]; 2], 0.1));
    assert!(!is_control_step_told, "it has a rate of pictures alone");
    assert_eq!(measurements, &["reward", "terminated", "distance", "is_success"]);
    assert_eq!(task.info(), ["distance", "is_success"], "a word is no number");
    assert!(task.versions().contains_key("gymnasium") && task.versions().contains_key("python"));
    let episode = &played(&task, 1).unwrap()[0];
    let column = |column: usize| episode.measurements().iter().skip(1).map(move |row| f64::from(row[column]));
    assert_eq!(task.heuristic().score(episode.measurements()), -column(2).fold(f64::INFINITY, f64::min));
    assert_eq!(task.true_return(episode.measurements()).unwrap(), column(0).sum::<f64>());
    assert_eq!(task.succeeded(episode.measurements()), Some(column(3).any(|success| success > 0.0)));
    assert_eq!(episode.measurements().row(0), [0.0; 4]);
    assert_eq!(episode.ended(), Ended::Horizon, "its own limit is the horizon");
}

#[test]
fn terminal_states_and_limits_are_told_apart() {
    let Some(task) = open("Ends") else { return };
    let episodes = played(&task, 12).unwrap();
    for episode in &episodes {
        match episode.ended() {
            Ended::Terminated => assert_eq!((episode.steps(), episode.measurements().row(3)[1]), (3, 1.0)),
            Ended::Truncated => assert_eq!((episode.steps(), episode.measurements().row(4)[1]), (4, 0.0)),
            Ended::Horizon => panic!("it ends before"),
        }
    }
    let terminated = episodes.iter().filter(|episode| episode.terminated()).count();
    assert!((1..12).contains(&terminated), "{terminated}: seeds are odd and even");
}

#[test]
fn a_number_that_is_there_at_the_end_alone_can_be_asked_for() {
    let Some(interpreter) = support::interpreter() else { return };
    let wanted = Wanted { heuristic: Some("last late".to_owned()), ..wanted(interpreter, "Ends") };
    let task = GymnasiumTask::open(&wanted).unwrap();
    for episode in played(&task, 3).unwrap() {
        assert_eq!(task.heuristic().score(episode.measurements()), episode.steps() as f64);
    }
}

#[test]
fn nested_observations_are_flat_by_name() {
    let Some(task) = open("Nested") else { return };
    let parts = [("a/_index_0".to_owned(), 1), ("a/_index_1".to_owned(), 3), ("b".to_owned(), 2)];
    assert_eq!(task.specification().observation_parts, parts);
    let playground = Playground::new(&task);
    let shape = PolicyShape { hidden: vec![8], initial_std: 0.5 };
    let policy = Policy::untrained(&shape, ObservationFilter::identity(6), 2, Seed::new(1));
    let episodes =
        rollout::play(&playground, &policy, Acting::Mean, EnvVariant(0), Seed::new(2).many(1)).unwrap();
    let row = episodes[0].observations().row(0);
    assert_eq!(row[..4], [0.5, 0.0, 0.0, 1.0]);
    assert!(row[4] > 6.0 && row[5] > 6.0, "{row:?}");
}

#[test]
fn each_failure_in_play_is_one_sentence() {
    let Some(python) = support::interpreter() else { return };
    for (name, said) in [
        (
            "raises_late",
            "point: the environment failed in a step: RuntimeError: the arm is gone (point.py, line ",
        ),
        ("exits", "point: the environment failed in a step: SystemExit: 3 (point.py, line "),
        (
            "kills_itself",
            "point: the environment's process ended by signal 9 (SIGKILL, perhaps for want of memory) during a step; its last words: out of luck",
        ),
        (
            "kills_itself_beside_a_child",
            "point: the environment's process ended by signal 9 (SIGKILL, perhaps for want of memory) during a step",
        ),
        (
            "NotANumber",
            "point: the environment returned nan as 'bad' in info after step 25; wanted a finite number",
        ),
        (
            "loses_sight_late",
            "point: the environment returned inf as number 2 of the observation after step 25; wanted finite numbers",
        ),
    ] {
        let heuristic = (name == "NotANumber").then(|| "sum bad".to_owned());
        let task = GymnasiumTask::open(&Wanted { heuristic, ..wanted(python.clone(), name) }).unwrap();
        let error = played(&task, 2).unwrap_err();
        assert!(error.is_simulation() && error.to_string().starts_with(said), "{name}: {error}");
        assert!(!error.to_string().contains('\n'), "{error}");
    }
}

#[test]
fn a_number_that_nobody_asks_for_may_be_none() {
    let Some(task) = open("NotANumber") else { return };
    assert_eq!(played(&task, 1).unwrap()[0].steps(), 30);
}

#[test]
fn an_environment_that_hangs_is_ended_after_its_time() {
    let Some(python) = support::interpreter() else { return };
    let mut wanted = wanted(python, "hangs");
    // The start imports Gymnasium, which takes longer on a busy machine.
    wanted.time_limit = Duration::from_secs(20);
    let task = GymnasiumTask::open(&wanted).unwrap();
    let start = Instant::now();
    let error = played(&task, 1).unwrap_err();
    assert_eq!(error.to_string(), "point: the environment did not finish a step within 20 s");
    assert_eq!(error.hint(), Some("--time-limit SECONDS gives it longer"));
    assert!(start.elapsed() < Duration::from_secs(500), "it would sleep for 1000 s");
}

#[test]
fn an_environment_that_prints_disturbs_nothing() {
    let (Some(loud), Some(silent)) = (open("prints"), open("Still")) else { return };
    assert_eq!(played(&loud, 2).unwrap(), played(&silent, 2).unwrap());
}

#[test]
fn an_environment_that_reads_its_arguments_finds_none() {
    let (Some(reading), Some(plain)) = (open("reads_its_arguments"), open("make")) else { return };
    assert_eq!(played(&reading, 1).unwrap(), played(&plain, 1).unwrap());
}

#[test]
fn a_child_that_an_environment_forks_answers_nobody() {
    let (Some(forking), Some(silent)) = (open("forks"), open("Still")) else { return };
    assert_eq!(played(&forking, 2).unwrap(), played(&silent, 2).unwrap());
}

#[test]
fn whether_an_environment_repeats_is_seen() {
    for (name, wanted) in
        [("make", Repeats::Exactly), ("ignores_its_seed", Repeats::No), ("drifts", Repeats::StartOnly)]
    {
        let Some(task) = open(name) else { return };
        let found = check::check(&task, &Seed::new(0)).unwrap();
        assert_eq!((task.repeats(), found.trial.repeats), (wanted, wanted), "{name}");
        assert_eq!(found.alike, (wanted == Repeats::Exactly).then_some(true), "{name}");
        assert_eq!((found.episodes, found.steps, found.terminated), (5, 150, 0));
    }
}

/// Twenty steps after such a reset are at most a hundred a second, however fast the steps are.
#[test]
fn a_slow_reset_makes_no_slow_environment() {
    let Some(interpreter) = support::interpreter() else { return };
    let wanted = Wanted { horizon: Some(2000), ..wanted(interpreter, "ResetsSlowly") };
    let task = GymnasiumTask::open(&wanted).unwrap();
    assert!(task.trial().steps_per_sec > 100.0, "{:?}", task.trial());
}

#[test]
fn numbers_that_are_not_finite_are_named_before_anybody_asks_whether_they_repeat() {
    for (name, said) in [
        ("loses_sight", "the environment returned nan as number 2 of the observation after step 5; wanted"),
        ("loses_its_reward", "the environment returned the reward nan after step 5; wanted a finite number"),
    ] {
        let Some(error) = refused(name, |_| {}) else { return };
        assert!(error.is_simulation() && error.to_string().starts_with(said), "{name}: {error}");
        assert!(error.hint().unwrap().contains("terminated"), "{name}: {:?}", error.hint());
    }
}

#[test]
fn success_that_is_told_at_the_end_alone_is_seen() {
    let Some(task) = open("TellsAtTheEnd") else { return };
    assert!(task.tells_success() && task.info().is_empty());
    assert_eq!(task.specification().measurements, ["reward", "terminated", "success"]);
    for episode in played(&task, 3).unwrap() {
        assert_eq!(task.succeeded(episode.measurements()), Some(true));
    }
    let found = check::check(&task, &Seed::new(0)).unwrap();
    assert_eq!((found.successes, found.alike), (Some(5), Some(true)));
}

#[test]
fn what_cannot_be_used_is_refused_with_a_way_out() {
    for (name, said, hint) in [
        ("discrete", "the action space is Discrete", "gymnasium.spaces.Box with finite bounds"),
        ("unbounded", "action 0 has the bounds -inf and inf", "the bounds that it has in truth"),
        ("whole_numbers", "actions are of type int64", ""),
        (
            "pictures",
            "the part 'camera' of an observation is an image of shape (64, 64, 3)",
            "FilterObservation",
        ),
        ("no_environment", "what was made is of type int, without 'reset'", "wanted a gymnasium.Env"),
        (
            "broken",
            "cannot be made: NameError: name 'undefined_name' is not defined (point.py, line",
            "--python",
        ),
        (
            "broken_at_length",
            "cannot be made: RuntimeError: the arm is out of memory | … | or compile with care (point.py, line",
            "--python",
        ),
        (
            "OldStep",
            ":OldStep returned 4 values from step(); wanted the 5 of Gymnasium: observation,",
            "shimmy",
        ),
        ("OldReset", "returned an object of type ndarray from reset(); wanted the 2 of Gymnasium", "shimmy"),
        (
            "old_within_a_limit",
            "was made, and fails when it is tried: ValueError: not enough values",
            "shimmy",
        ),
        (
            "TakesNoSeed",
            "TypeError: TakesNoSeed.reset() got an unexpected keyword argument 'seed'",
            "reset(seed=..., options=...)",
        ),
        (
            "acts_in_gym",
            ":acts_in_gym: the action space is the Box of gym, and wanted is that of gymnasium",
            "shimmy",
        ),
        ("observes_in_gym", "the observation space is the Box of gym, and wanted is", "shimmy"),
        ("has_no_reward", "returned a reward of type NoneType after step 1; wanted a number", "a float"),
        ("has_two_rewards", "returned a reward of type ndarray of shape (2,) after step 1", "a float"),
        ("several", "what was made is a vector of 2 environments, and one is wanted", "--workers"),
        ("nothing", "cannot be made: AttributeError: module 'point' has no attribute 'nothing'", "--python"),
    ] {
        let Some(error) = refused(name, |_| {}) else { return };
        assert!(error.is_bad_input() && error.to_string().contains(said), "{name}: {error}");
        assert!(error.hint().unwrap_or("").contains(hint), "{name}: {:?}", error.hint());
    }
    let Some(error) = refused("raises", |_| {}) else { return };
    let said = "the environment failed in a step: RuntimeError: the arm is gone (point.py, line ";
    assert!(error.to_string().starts_with(said), "{error}");
}

#[test]
fn what_does_not_fit_the_environment_is_refused_with_what_would() {
    let refused =
        |name, change: &dyn Fn(&mut Wanted)| refused(name, change).map(|error| (error.to_string(), error));
    let Some((said, error)) = refused("make", &|wanted| wanted.horizon = None) else { return };
    assert!(said.contains("does not say after how many steps"), "{said}");
    assert!(error.is_bad_config() && error.hint().unwrap().starts_with("add --horizon N"));
    let (said, _) = refused("limited", &|wanted| wanted.horizon = Some(31)).unwrap();
    assert!(said.starts_with("--horizon 31: ") && said.contains("after 30 steps by itself"), "{said}");
    let (said, error) = refused("make", &|wanted| wanted.heuristic = Some("max distanc".to_owned())).unwrap();
    let list = "did you mean 'distance'? the environment has: reward, terminated, distance, is_success";
    assert!(error.is_bad_config() && said.ends_with(list), "{said}");
    let (said, _) = refused("make", &|wanted| wanted.python = "/no/such/python".into()).unwrap();
    assert_eq!(said, "there is no such Python interpreter: /no/such/python");
    let (said, error) =
        refused("make", &|wanted| wanted.source = Source::Gymnasium("no_such_module:Reach-v0".to_owned()))
            .unwrap();
    assert!(said.contains("ModuleNotFoundError") || said.contains("no_such_module"), "{said}");
    assert!(error.is_bad_input());
}

/// A function of `environments/point.py`, as it is typed.
fn own(name: &str) -> String {
    format!("{}:{name}", support::environments().display())
}

#[test]
fn what_is_measured_beside_an_environment_is_what_it_measures_itself() {
    let Some(python) = support::interpreter() else { return };
    let with = |heuristic: &str, measure: Option<&str>| {
        let (heuristic, measure) = (Some(heuristic.to_owned()), measure.map(own));
        GymnasiumTask::open(&Wanted { heuristic, measure, ..wanted(python.clone(), "make") }).unwrap()
    };
    let plain = with("negated min distance", None);
    let measured = with("negated min gap", Some("measure"));
    let scored = with(&own("nearest"), None);
    let scores = |task: &GymnasiumTask| -> Vec<f64> {
        played(task, 4).unwrap().iter().map(|one| task.heuristic().score(one.measurements())).collect()
    };
    let wanted = scores(&plain);
    assert_eq!(scores(&measured), wanted);
    // Worked out in 32 bits.
    assert!(scores(&scored).iter().zip(&wanted).all(|(one, other)| (one - other).abs() < 1e-6), "{wanted:?}");
    assert_eq!(measured.specification().measurements, ["reward", "terminated", "gap", "is_success"]);
    assert_eq!(measured.info(), ["distance", "gap", "is_success", "offset", "paid"]);
    assert_eq!(scored.specification().measurements, ["reward", "terminated", "score", "is_success"]);
    let episode = &played(&scored, 1).unwrap()[0];
    let before = episode.measurements().iter().take(30).map(|row| row[2]);
    assert!(before.into_iter().all(|score| score == 0.0), "until the last step");
    assert_eq!(scored.heuristic_name(), "point.py:nearest");
    assert_eq!(measured.files(), [support::environments().canonicalize().unwrap()], "one file, once");
}

#[test]
fn an_episode_that_ends_early_is_scored_at_its_end() {
    let Some(python) = support::interpreter() else { return };
    let heuristic = Some(own("nearest"));
    let task = GymnasiumTask::open(&Wanted { heuristic, ..wanted(python, "Ends") }).unwrap();
    for episode in played(&task, 6).unwrap() {
        assert!(matches!(episode.steps(), 3 | 4));
        let nearest = episode.observations().iter().skip(1).map(|row| (row[0] - 1.0).hypot(row[1]));
        let wanted = -f64::from(nearest.fold(f32::INFINITY, f32::min));
        assert!((task.heuristic().score(episode.measurements()) - wanted).abs() < 1e-6);
    }
}

#[test]
fn each_fault_of_a_measure_or_a_score_is_one_sentence_that_names_it() {
    for (name, said) in [
        (
            "measure_list",
            "point.py:measure_list returned an object of type list after step 1; wanted a dict of numbers",
        ),
        ("measure_nan", "point.py:measure_nan: 'gap' is nan after step 1; wanted a finite number"),
        ("measure_word", "point.py:measure_word: 'gap' is of type str after step 1; wanted a number"),
        ("measure_taken", "returned 'distance' after step 1, which is measured already; wanted another name"),
        (
            "measure_nothing",
            "point.py:measure_nothing returned an empty dict after step 1; wanted at least one number",
        ),
        (
            "measure_number",
            "point.py:measure_number is of type int; wanted a function measure(env, obs, reward, info)",
        ),
        (
            "missing",
            "point.py:missing cannot be imported: AttributeError: module 'point' has no attribute 'missing'",
        ),
    ] {
        let Some(error) = refused("make", |wanted| wanted.measure = Some(own(name))) else { return };
        assert!(error.is_bad_input() && error.to_string().contains(said), "{name}: {error}");
    }
    for (name, said) in [
        ("measure_raises", "point.py:measure_raises failed after step 3: ZeroDivisionError: "),
        (
            "measure_other",
            "point.py:measure_other returned 'gap', 'late' after step 5, and 'gap' after the first; wanted",
        ),
    ] {
        let error = refused("make", |wanted| wanted.measure = Some(own(name))).unwrap();
        assert!(error.is_simulation() && error.to_string().starts_with(said), "{name}: {error}");
    }
    let Some(python) = support::interpreter() else { return };
    for (name, said) in [
        ("score_raises", "failed on an episode of 30 steps: ValueError: no such episode (point.py, line "),
        ("score_nan", "returned inf on an episode of 30 steps; wanted a finite number"),
        ("score_none", "returned an object of type NoneType on an episode of 30 steps; wanted a number"),
    ] {
        let heuristic = Some(own(name));
        let task = GymnasiumTask::open(&Wanted { heuristic, ..wanted(python.clone(), "make") }).unwrap();
        let error = played(&task, 1).unwrap_err().to_string();
        assert!(error.contains(said) && !error.contains('\n'), "{name}: {error}");
    }
}
