//! The referee's trainings, each stored as a file of its own as it is finished, and what they say.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

use super::{Config, Run};
use crate::basics::error::{Error, Result};
use crate::basics::ledger::Ledger;
use crate::basics::observer::{Event, Observer, Silent};
use crate::basics::seed::Seed;
use crate::data::demonstration::{DemoId, DemonstrationSet};
use crate::learning::adapt::Rule;
use crate::results::artifact::{self, Artifact, onnx};
use crate::stages::imitate::{self, Effort, ImitationState, LearningCurve, Lesson};
use crate::stages::method::Spent;
use crate::stages::referee::{
    self, Candidate, Contest, Meant, NamedSubset, STAGE, Training, Unit, Verdict, imitation_by, imitator_name,
};
use crate::world::rollout::Playground;

/// Under which name the policy is stored that the referee would hand over.
pub const BEST: &str = "best";

/// Subsets → Verdict: trains final policies on what was kept, on the whole set and on random subsets, and says what to train
/// on, by which imitator, and whether selecting helps.
///
/// Trainings run side by side, and each is stored as it is finished.
///
/// # Errors
/// `is_bad_input` if a subset is empty, `is_diverged` if a training diverges.
pub fn verdict(run: &mut Run<'_>, kept: &[NamedSubset]) -> Result<Verdict> {
    let candidates = referee::candidates(&run.set.ids(), kept)?;
    if let Some(verdict) = recalled(run, &candidates)? {
        // Again, in case that it was changed since.
        store_best(run, &verdict)?;
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
        let curves = train_all(run, contest.candidates(), &units, &mut done)?;
        for (unit, curve) in units.into_iter().zip(&curves) {
            measured(run.observer, contest.candidates(), unit, curve)?;
            played += curve.played;
            contest.add(unit, Training::of(curve));
        }
    }
    run.observer.on(Event::Finished { stage: STAGE })?;
    let verdict = contest.decide(run.playground.task().heuristic().unit());
    store(run, &verdict, played)?;
    Ok(verdict)
}

/// The verdict of before, if it was about the same candidates and as many trainings.
fn recalled(run: &Run<'_>, candidates: &[Candidate]) -> Result<Option<Verdict>> {
    let is_it = |found: &Verdict| found.candidates == candidates && found.asked == Some(run.config.referee);
    Ok(Verdict::recall(run.ledger, "")?.filter(is_it))
}

/// Stores what the trainings cost, the policy to be handed over, and at last the verdict, which says that all is done.
fn store(run: &mut Run<'_>, verdict: &Verdict, played: u64) -> Result<()> {
    store_best(run, verdict)?;
    if played > 0 {
        Spent { environment_steps: played }.store(run.ledger, STAGE)?;
    }
    verdict.store(run.ledger, "")
}

/// Stores the policy to be handed over, as far as its training is stored.
fn store_best(run: &mut Run<'_>, verdict: &Verdict) -> Result<()> {
    if let Some((winner, training)) = verdict.winner.zip(verdict.best_training) {
        let pair = &verdict.pairs[winner].trained;
        let part = part(&verdict.candidates[pair.candidate], pair.imitator, training);
        if let Some(curve) = LearningCurve::recall(run.ledger, &part)? {
            let name = format!("policy_{BEST}.safetensors");
            run.ledger.store(&name, &artifact::write_policy(&curve.best))?;
            onnx::store_policy(run.ledger, BEST, &curve.best, run.playground.specification())?;
        }
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
            let found = LearningCurve::recall(run.ledger, &part(candidate, meant.imitator, meant.training))?;
            is_stored |= found.is_some_and(|curve| curve.demos == candidate.demos_of(&ids, &seed));
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
    let steps = |meant: &Meant| Effort::of(task, &imitation_by(meant.imitator, &run.config.imitate)).steps();
    trainings.iter().map(steps).sum::<u64>() as usize
}

/// Under which name a training is stored.
fn part(candidate: &Candidate, imitator: Rule, training: usize) -> String {
    format!("{STAGE}_{}_{}_{training}", candidate.key, imitator_name(imitator).to_lowercase())
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
) -> Result<Vec<LearningCurve>> {
    let Run { set, playground, config, ledger, observer } = run;
    let ground = Ground { set, playground, config, candidates };
    let is_own = |place: usize| ledger.part().is_none_or(|part| part.takes(place));
    let own: Vec<bool> = (0..units.len()).map(is_own).collect();
    let shared = Mutex::new(Shared { ledger: *ledger, observer: *observer, done });
    let has_failed = AtomicBool::new(false);
    let queue = units.iter().enumerate().take_while(|_| !has_failed.load(Ordering::Relaxed));
    let mut trained: Vec<(usize, Result<Option<LearningCurve>>)> = queue
        .par_bridge()
        .map(|(place, unit)| {
            let curve = train(ground, *unit, own[place], &shared);
            has_failed.fetch_or(curve.is_err(), Ordering::Relaxed);
            (place, curve)
        })
        .collect();
    trained.sort_by_key(|(place, _)| *place);
    let curves = trained.into_iter().map(|(_, curve)| curve).collect::<Result<Vec<_>>>()?;
    match curves.iter().filter(|curve| curve.is_none()).count() {
        0 => Ok(curves.into_iter().flatten().collect()),
        left => Err(Error::left_to_others(format!("{left} trainings are left to the other parts"))),
    }
}

fn lock<'m, 'a>(shared: &'m Mutex<Shared<'a>>) -> MutexGuard<'m, Shared<'a>> {
    // A training that panicked while it held this has written whole files or none.
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A finished training, made now unless it was made before; none of what is neither made nor our `own`.
fn train(
    ground: Ground<'_>,
    unit: Unit,
    own: bool,
    shared: &Mutex<Shared<'_>>,
) -> Result<Option<LearningCurve>> {
    let Ground { set, playground, config, candidates } = ground;
    let (candidate, seed) = (&candidates[unit.candidate], training_seed(config, unit.training));
    let demos: Vec<DemoId> = candidate.demos_of(&set.ids(), &seed);
    let part = part(candidate, unit.imitator, unit.training);
    let found = LearningCurve::recall(lock(shared).ledger, &part)?;
    if let Some(curve) = found.filter(|curve| curve.demos == demos) {
        return Ok(Some(curve));
    }
    if !own {
        return Ok(None);
    }
    let imitation = imitation_by(unit.imitator, &config.imitate);
    let start = ImitationState::start(set, &demos, &config.policy, &imitation, &seed.of("start"));
    let lesson = Lesson { set, playground, imitation: &imitation, part: &part, seed: &seed };
    let curve = imitate::imitate(&lesson, start, &mut Silent).map_err(|error| error.during(&part))?;
    let mut shared = lock(shared);
    curve.store(shared.ledger, &part)?;
    *shared.done += Effort::of(playground.specification(), &imitation).steps() as usize;
    let done = *shared.done;
    shared.observer.on(Event::Advanced { stage: STAGE, done })?;
    Ok(Some(curve))
}

fn measured(
    observer: &mut dyn Observer,
    candidates: &[Candidate],
    unit: Unit,
    curve: &LearningCurve,
) -> Result<()> {
    let part = format!("{}_{}", candidates[unit.candidate].key, imitator_name(unit.imitator).to_lowercase());
    let numbers = [
        ("score", curve.outcome.score),
        ("standard_error", curve.outcome.standard_error),
        ("success", curve.outcome.success.unwrap_or(f64::NAN)),
        ("end", curve.end.score),
    ];
    let iteration = unit.training;
    observer.on(Event::Measured { stage: STAGE, part: &part, iteration, numbers: &numbers })
}
