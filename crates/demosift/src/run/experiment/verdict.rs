//! The referee's trainings, each stored as a file of its own as it is finished, and what they say.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

use super::asked_trainer::{self, Asks};
use super::{Config, Run, forget_checkpoint, note_work_on, worked_on_by};
use crate::basics::error::{Error, Result};
use crate::basics::files;
use crate::basics::ledger::Ledger;
use crate::basics::observer::{Event, Observer, Silent};
use crate::basics::seed::Seed;
use crate::data::demonstration::{DemoId, DemonstrationSet};
use crate::math::arithmetic::Arithmetic;
use crate::results::artifact::{self, Artifact, onnx};
use crate::stages::imitate::{self, Effort, Imitation, ImitationState, LearningCurve, Lesson};
use crate::stages::method::Spent;
use crate::stages::referee::{
    self, ByTrainer, Candidate, Contest, Imitator, Meant, NamedSubset, STAGE, Training, Unit, Verdict,
    imitation_by, steps_by_trainer,
};
use crate::world::environment::Specification;
use crate::world::rollout::Playground;
use crate::world::trainer::{Trainer, TrainerIdentity};

/// Under which name the policy is stored that the referee would hand over.
pub const BEST: &str = "best";

/// Subsets → Verdict: trains final policies on what was kept, on the whole set and on random subsets, and says what to train
/// on, by which imitator, and whether selecting helps.
///
/// Trainings run side by side, and each is stored as it is finished.
///
/// # Errors
/// `is_bad_input` if a subset is empty, `is_diverged` if a training diverges, `is_bad_config` if trainings by a trainer are
/// asked for and the playground has none; those of the trainer.
pub fn verdict(run: &mut Run<'_>, kept: &[NamedSubset]) -> Result<Verdict> {
    if run.config.referee.trainer > 0 {
        asked_trainer::of(run.playground, Asks::Referee)?;
    }
    let candidates = referee::candidates(&run.set.ids(), kept)?;
    if let Some(verdict) = recalled(run, &candidates)? {
        // Again, in case that it was changed since, or that the run was killed between the two.
        store_best(run, &verdict)?;
        forget_work(run);
        return Ok(verdict);
    }
    run.ledger.claim()?;
    let total = meant_steps(run, &referee::meant(&candidates, &run.config.referee));
    let left = meant_steps(run, &rest(run, &candidates)?);
    let mut done = total - left;
    run.observer.on(Event::Started { stage: STAGE, done, total })?;
    let mut contest = Contest::new(candidates, run.config.referee);
    let mut played = 0;
    loop {
        let units = contest.next_units();
        if units.is_empty() {
            break;
        }
        let made = train_all(run, contest.candidates(), &units, &mut done)?;
        for (unit, made) in units.into_iter().zip(&made) {
            let part = part_of_pair(&contest.candidates()[unit.candidate], unit.imitator, identity(run));
            measured(run.observer, &part, unit.training, &made.training)?;
            played += made.played;
            contest.add(unit, made.training);
        }
    }
    run.observer.on(Event::Finished { stage: STAGE })?;
    let verdict = contest.decide(run.playground.task().heuristic().unit(), identity(run).cloned());
    store(run, &verdict, played)?;
    Ok(verdict)
}

/// Which trainer the run has.
fn identity<'a>(run: &Run<'a>) -> Option<&'a TrainerIdentity> {
    run.playground.trainer().map(Trainer::identity)
}

/// The verdict of before, if it was about the same candidates, as many trainings and the same trainer.
fn recalled(run: &Run<'_>, candidates: &[Candidate]) -> Result<Option<Verdict>> {
    let is_it = |found: &Verdict| {
        found.candidates == candidates
            && found.asked == Some(run.config.referee)
            && (run.config.referee.trainer == 0 || found.trainer.as_ref() == identity(run))
    };
    Ok(Verdict::recall(run.ledger, "")?.filter(is_it))
}

/// Stores what the trainings cost, the policy to be handed over, and at last the verdict, which says that all is done.
fn store(run: &mut Run<'_>, verdict: &Verdict, played: u64) -> Result<()> {
    store_best(run, verdict)?;
    if played > 0 {
        let mut arithmetic = worked_on_by(run.ledger, STAGE)?;
        arithmetic.insert(Arithmetic::of_this_process());
        Spent { environment_steps: played, arithmetic }.store(run.ledger, STAGE)?;
    }
    verdict.store(run.ledger, "")?;
    forget_work(run);
    Ok(())
}

/// Forgets who made trainings, once the verdict says so; that of a part is for whoever collects.
fn forget_work(run: &mut Run<'_>) {
    if run.ledger.part().is_none() {
        forget_checkpoint(run.ledger, STAGE, "");
    }
}

/// Stores the policy to be handed over, as far as its training is stored. That of a trainer is handed over where it is a file
/// of ONNX; elsewhere it lives in the trainer alone.
fn store_best(run: &mut Run<'_>, verdict: &Verdict) -> Result<()> {
    let Some((winner, training)) = verdict.winner.zip(verdict.best_training) else { return Ok(()) };
    let pair = &verdict.pairs[winner].trained;
    let part = part(&verdict.candidates[pair.candidate], pair.imitator, training);
    let name = format!("policy_{BEST}.safetensors");
    if pair.imitator == Imitator::Trainer {
        // Of a verdict of before.
        run.ledger.forget(&name)?;
        let of_onnx = format!("policy_{BEST}.onnx");
        let fits = |by: &ByTrainer| Some(&by.trainer) == verdict.trainer.as_ref();
        return match artifact::recall_fitting(run.ledger, &part, fits)?.and_then(|by| by.onnx) {
            Some(onnx) => run.ledger.store(&of_onnx, &onnx),
            None => run.ledger.forget(&of_onnx),
        };
    }
    if let Some(curve) = LearningCurve::recall(run.ledger, &part)? {
        run.ledger.store(&name, &artifact::write_policy(&curve.best))?;
        onnx::store_policy(run.ledger, BEST, &curve.best, run.playground.specification())?;
    }
    Ok(())
}

/// Trainings that are still to be made, as far as can be said before they are: those of pairs that will be dropped count.
pub(crate) fn rest(run: &Run<'_>, candidates: &[Candidate]) -> Result<Vec<Meant>> {
    if recalled(run, candidates)?.is_some() {
        return Ok(Vec::new());
    }
    let ids = run.set.ids();
    let mut left = Vec::new();
    for meant in referee::meant(candidates, &run.config.referee) {
        let seed = training_seed(run.config, meant.training);
        let mut is_stored = false;
        for candidate in meant.candidates.iter().map(|index| &candidates[*index]) {
            let part = part(candidate, meant.imitator, meant.training);
            let demos = candidate.demos_of(&ids, &seed);
            is_stored |=
                recalled_training(run.ledger, meant.imitator, &part, &demos, identity(run))?.is_some();
        }
        if !is_stored {
            left.push(meant);
        }
    }
    Ok(left)
}

/// Environment steps of these trainings, where episodes last to the horizon.
fn meant_steps(run: &Run<'_>, trainings: &[Meant]) -> usize {
    let task = run.playground.specification();
    let steps = |meant: &Meant| steps_of_training(task, meant.imitator, &run.config.imitate);
    trainings.iter().map(steps).sum::<u64>() as usize
}

fn steps_of_training(task: &Specification, imitator: Imitator, imitation: &Imitation) -> u64 {
    match imitator.rule() {
        Some(rule) => Effort::of(task, &imitation_by(rule, imitation)).steps(),
        None => steps_by_trainer(task, imitation.evaluations),
    }
}

/// Under which name a training is stored.
fn part(candidate: &Candidate, imitator: Imitator, training: usize) -> String {
    format!("{STAGE}_{}_{}_{training}", candidate.key, imitator.name().to_lowercase())
}

/// What a training came to, whoever made it.
#[derive(Clone, Copy)]
struct Made {
    training: Training,
    played: u64,
}

impl From<&LearningCurve> for Made {
    fn from(curve: &LearningCurve) -> Self {
        Self { training: Training::of(curve), played: curve.played }
    }
}

impl From<&ByTrainer> for Made {
    fn from(by: &ByTrainer) -> Self {
        Self { training: by.into(), played: by.played }
    }
}

/// A training that is stored, if it is one of these demonstrations, and by this trainer where it is a trainer's.
fn recalled_training(
    ledger: &dyn Ledger,
    imitator: Imitator,
    part: &str,
    demos: &[DemoId],
    trainer: Option<&TrainerIdentity>,
) -> Result<Option<Made>> {
    if imitator == Imitator::Trainer {
        let fits = |by: &ByTrainer| by.demos == demos && Some(&by.trainer) == trainer;
        return Ok(artifact::recall_fitting(ledger, part, fits)?.as_ref().map(Made::from));
    }
    let fits = |curve: &LearningCurve| curve.demos == demos;
    Ok(artifact::recall_fitting(ledger, part, fits)?.as_ref().map(Made::from))
}

/// The random numbers of a training: the same for every pair.
fn training_seed(config: &Config, training: usize) -> Seed {
    Seed::new(config.seed).of(STAGE).at(training)
}

/// What trainings that run side by side share; nothing runs in parallel while it is locked.
struct Shared<'a> {
    ledger: &'a mut dyn Ledger,
    observer: &'a mut dyn Observer,
    done: &'a mut usize,
}

/// What a training needs and changes nothing of.
#[derive(Clone, Copy)]
struct Ground<'a> {
    set: &'a DemonstrationSet,
    playground: &'a Playground<'a>,
    config: &'a Config,
    candidates: &'a [Candidate],
}

/// Trains the units side by side, taken in order; what comes of them is in their order. A part of a run trains its share of
/// them.
///
/// # Errors
/// `is_left_to_others` if other parts have not finished theirs.
fn train_all(
    run: &mut Run<'_>,
    candidates: &[Candidate],
    units: &[Unit],
    done: &mut usize,
) -> Result<Vec<Made>> {
    let Run { set, playground, config, ledger, observer } = run;
    let ground = Ground { set, playground, config, candidates };
    let is_own = |place: usize| ledger.part().is_none_or(|part| part.takes(place));
    let own: Vec<bool> = (0..units.len()).map(is_own).collect();
    let shared = Mutex::new(Shared { ledger: *ledger, observer: *observer, done });
    let has_failed = AtomicBool::new(false);
    let queue = units.iter().enumerate().take_while(|_| !has_failed.load(Ordering::Relaxed));
    let mut trained: Vec<(usize, Result<Option<Made>>)> = queue
        .par_bridge()
        .map(|(place, unit)| {
            let made = train(ground, *unit, own[place], &shared);
            has_failed.fetch_or(made.is_err(), Ordering::Relaxed);
            (place, made)
        })
        .collect();
    trained.sort_by_key(|(place, _)| *place);
    let made = trained.into_iter().map(|(_, made)| made).collect::<Result<Vec<_>>>()?;
    match made.iter().filter(|made| made.is_none()).count() {
        0 => Ok(made.into_iter().flatten().collect()),
        left => Err(Error::left_to_others(format!("{left} trainings are left to the other parts"))),
    }
}

fn lock<'m, 'a>(shared: &'m Mutex<Shared<'a>>) -> MutexGuard<'m, Shared<'a>> {
    // A training that panicked while it held this has written whole files or none.
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A finished training, made now unless it was made before; none of what is neither made nor our `own`.
fn train(ground: Ground<'_>, unit: Unit, own: bool, shared: &Mutex<Shared<'_>>) -> Result<Option<Made>> {
    let Ground { set, playground, config, candidates } = ground;
    let (candidate, seed) = (&candidates[unit.candidate], training_seed(config, unit.training));
    let demos: Vec<DemoId> = candidate.demos_of(&set.ids(), &seed);
    let part = part(candidate, unit.imitator, unit.training);
    let trainer = playground.trainer();
    let identity = trainer.map(Trainer::identity);
    if let Some(made) = recalled_training(lock(shared).ledger, unit.imitator, &part, &demos, identity)? {
        return Ok(Some(made));
    }
    if !own {
        return Ok(None);
    }
    let (made, mut shared) = match unit.imitator.rule() {
        Some(rule) => {
            let imitation = imitation_by(rule, &config.imitate);
            let start = ImitationState::start(set, &demos, &config.policy, &imitation, &seed.of("start"));
            let lesson = Lesson { set, playground, imitation: &imitation, part: &part, seed: &seed };
            let curve = imitate::imitate(&lesson, start, &mut Silent).map_err(|error| error.during(&part))?;
            let mut shared = lock(shared);
            note_work_on(shared.ledger, STAGE)?;
            curve.store(shared.ledger, &part)?;
            (Made::from(&curve), shared)
        }
        None => {
            let trainer = asked_trainer::of(playground, Asks::Referee)?;
            let evaluations = config.imitate.evaluations;
            let by = referee::train_by(trainer, set, &demos, playground, evaluations, &seed)?;
            let mut shared = lock(shared);
            note_work_on(shared.ledger, STAGE)?;
            by.store(shared.ledger, &part)?;
            (Made::from(&by), shared)
        }
    };
    *shared.done += steps_of_training(playground.specification(), unit.imitator, &config.imitate) as usize;
    let done = *shared.done;
    shared.observer.on(Event::Advanced { stage: STAGE, done })?;
    Ok(Some(made))
}

/// Under which name a pair is measured. A measurement is known by its name and stays, so another trainer, or one whose file has
/// changed, needs another.
fn part_of_pair(candidate: &Candidate, imitator: Imitator, trainer: Option<&TrainerIdentity>) -> String {
    let part = format!("{}_{}", candidate.key, imitator.name().to_lowercase());
    match trainer.filter(|_| imitator == Imitator::Trainer) {
        Some(trainer) => format!("{part}_{}", short_hash(trainer)),
        None => part,
    }
}

/// Tells trainers apart.
fn short_hash(TrainerIdentity { name, sha256 }: &TrainerIdentity) -> String {
    const DIGITS: usize = 8;
    let whole = format!("{name}\n{}", sha256.as_deref().unwrap_or_default());
    files::sha256_of(whole.as_bytes()).chars().take(DIGITS).collect()
}

fn measured(
    observer: &mut dyn Observer,
    part: &str,
    iteration: usize,
    Training { outcome, end, .. }: &Training,
) -> Result<()> {
    let numbers = [
        ("score", outcome.score),
        ("standard_error", outcome.standard_error),
        ("success", outcome.success.unwrap_or(f64::NAN)),
        ("end", end.score),
    ];
    observer.on(Event::Measured { stage: STAGE, part, iteration, numbers: &numbers })
}
