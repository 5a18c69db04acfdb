//! The units of judging, played as many at once as there are threads (Algorithm 2, lines 3 to 11).

use std::sync::Mutex;

use rayon::prelude::*;

use super::{Judging, JudgingState, Outcome, STAGE, Trial, Unit, evaluation_seeds, seed_under};
use crate::basics::error::Result;
use crate::basics::observer::{Event, Observer};
use crate::basics::seed::Seed;
use crate::data::demonstration::DemoId;
use crate::data::trajectory::Trajectory;
use crate::learning::adapt::{self, Course, Learner};
use crate::math::rows::Rows;
use crate::world::adapted_behaviors;
use crate::world::environment::EnvVariant;
use crate::world::heuristic::Score;
use crate::world::policy::Policy;
use crate::world::rollout::{self, Playground};

/// What all units share.
pub(super) struct Bench<'a> {
    trial: &'a Trial<'a>,
    /// The pairs of each demonstration behind the filter of the set, which all learners share.
    pairs: Vec<Rows>,
}

impl<'a> Bench<'a> {
    pub(super) fn new(trial: &'a Trial<'a>) -> Self {
        let learner = trial.start.learner(trial.set, 0, trial.seed);
        Self { trial, pairs: learner.demonstrated_pairs(trial.set) }
    }

    /// Plays the units that are not finished yet, as many at once as there are threads, begun in their order.
    pub(super) fn play(
        &self,
        units: &[Unit],
        state: &mut JudgingState,
        observer: &mut dyn Observer,
    ) -> Result<()> {
        let missing: Vec<Unit> =
            units.iter().filter(|unit| !state.finished.contains_key(unit)).copied().collect();
        let collecting = Mutex::new(Collecting::new(self.trial.part, units, state, observer));
        let played = missing.iter().par_bridge().try_for_each(|unit| {
            let outcome = self.outcome(unit).map_err(|error| error.during(&unit.in_words()))?;
            collecting.lock().expect("no thread panics while it holds the lock").take(*unit, outcome);
            Ok(())
        });
        // Also after an error: what is finished need not be done again.
        collecting.into_inner().expect("no thread panics while it holds the lock").checkpoint();
        played
    }

    /// Lines 3 to 11 once; nothing is imitated where the unit is about the agent before.
    fn outcome(&self, unit: &Unit) -> Result<Outcome> {
        let Trial { set, start, seed, .. } = self.trial;
        let learner = start.learner(set, unit.repeat, seed);
        let seed = seed_under(seed, self.trial.playground, unit.variant);
        match unit.demo {
            Some(demo) => imitate_once(self.trial, &learner, demo, &self.pairs[demo.0], unit, &seed),
            None => {
                let played = evaluate(self.trial, &learner.policy, unit.variant, &seed)?;
                let scores = score(self.trial.playground, &played);
                let played = steps_of(&played);
                Ok(Outcome { scores, distance: 0.0, curve: Vec::new(), policy: None, played })
            }
        }
    }
}

/// Of a set of so many demonstrations the curve of every repeat is kept; of a larger one that of the first, or a run folder
/// would hold little else.
const ALL_CURVES: usize = 200;

/// Lines 3 to 11 for one demonstration with its pairs.
fn imitate_once(
    trial: &Trial<'_>,
    learner: &Learner,
    demo: DemoId,
    pairs: &Rows,
    unit: &Unit,
    seed: &Seed,
) -> Result<Outcome> {
    let Judging { iterations, averaged, .. } = *trial.judging;
    let course = Course { inner: trial.inner, iterations, averaged };
    let adapting = seed.of("adapt").at(unit.repeat);
    let adapted = adapt::adapt(learner, &[pairs], trial.playground, unit.variant, &course, &adapting)?;
    let policy = adapted.learner.policy;
    let played = evaluate(trial, &policy, unit.variant, seed)?;
    let distance = adapted_behaviors::distance(trial.set.get(demo), &played)?;
    let scores = score(trial.playground, &played);
    let policy = (unit.repeat == 0).then_some(policy);
    let played = adapted.played + steps_of(&played);
    let is_told = unit.repeat == 0 || trial.set.len() <= ALL_CURVES;
    let curve = if is_told { adapted.curve } else { Vec::new() };
    Ok(Outcome { scores, distance, curve, policy, played })
}

fn steps_of(played: &[Trajectory]) -> u64 {
    played.iter().map(|played| played.steps() as u64).sum()
}

/// Line 11: a policy on the M evaluation seeds, which are the same for everybody.
fn evaluate(trial: &Trial<'_>, policy: &Policy, variant: EnvVariant, seed: &Seed) -> Result<Vec<Trajectory>> {
    let seeds = evaluation_seeds(seed, trial.judging.evaluations);
    rollout::play(trial.playground, policy, trial.judging.acting, variant, seeds)
}

/// K.
fn score(playground: &Playground<'_>, played: &[Trajectory]) -> Vec<Score> {
    played.iter().map(|played| playground.score(played)).collect()
}

impl Unit {
    fn in_words(self) -> String {
        match self.demo {
            Some(demo) => format!("judging demonstration {demo}"),
            None => "evaluating the agent before it imitates".to_owned(),
        }
    }
}

/// A checkpoint is written when the state has grown by such a share since the last one, so that writing stays linear in the
/// number of units, and at most that share is lost by a kill.
const GROWTH: usize = 16;

/// Takes outcomes in whatever order they come, and tells of them in that of the units.
struct Collecting<'a> {
    part: &'a str,
    units: &'a [Unit],
    told: usize,
    kept: usize,
    state: &'a mut JudgingState,
    observer: &'a mut dyn Observer,
}

impl<'a> Collecting<'a> {
    fn new(
        part: &'a str,
        units: &'a [Unit],
        state: &'a mut JudgingState,
        observer: &'a mut dyn Observer,
    ) -> Self {
        let mut collecting = Self { part, units, told: 0, kept: state.done(), state, observer };
        collecting.tell();
        collecting
    }

    fn take(&mut self, unit: Unit, outcome: Outcome) {
        self.state.finished.insert(unit, outcome);
        self.tell();
        let done = self.state.done();
        self.observer.on(Event::Advanced { stage: STAGE, done });
        if (done - self.kept) * GROWTH >= self.kept.max(1) {
            self.checkpoint();
        }
    }

    fn checkpoint(&mut self) {
        if self.state.done() > self.kept {
            self.kept = self.state.done();
            self.observer.on(Event::Checkpoint { stage: STAGE, part: self.part, state: self.state });
        }
    }

    /// Passes on the numbers of all units up to the first that is not finished.
    fn tell(&mut self) {
        while let Some(unit) = self.units.get(self.told) {
            let Some(outcome) = self.state.finished.get(unit) else { return };
            report(self.part, unit, outcome, self.observer);
            self.told += 1;
        }
    }
}

fn report(judging: &str, unit: &Unit, outcome: &Outcome, observer: &mut dyn Observer) {
    let Some(demo) = unit.demo else { return };
    let unit = format!("variant {} demonstration {demo} repeat {}", unit.variant.0, unit.repeat);
    let part = if judging.is_empty() { unit } else { format!("{judging} {unit}") };
    for (iteration, update) in outcome.curve.iter().enumerate() {
        let numbers = &update.numbers();
        observer.on(Event::Measured { stage: STAGE, part: &part, iteration, numbers });
    }
}
