//! Outcomes of units as they come: put into the state, told in the order of the units, and stored.

use std::collections::BTreeSet;

use super::unit::{Outcome, Unit};
use super::{JudgingState, STAGE, Trial};
use crate::basics::error::Result;
use crate::basics::observer::{Event, Observer};

/// A checkpoint is written when the state has grown by such a share since the last one, so that writing stays linear in the
/// number of units ...
const GROWTH: usize = 16;

/// ... or when so many environment steps were played since then for each unit that is written: a unit takes up to 14 kB,
/// and the quickest simulator a millisecond for these steps, so that writing takes a small share of the time.
/// A unit that took long is thus stored as soon as it is finished.
const STEPS_PER_WRITTEN_UNIT: u64 = 30;

/// Takes outcomes in whatever order they come, and tells of them in that of the units.
pub(super) struct Collecting<'a> {
    part: &'a str,
    /// Whether each unit is stored as it is finished, since nobody knows how long a training by somebody else's trainer took.
    at_once: bool,
    units: &'a [Unit],
    /// Those of them that are not finished.
    missing: BTreeSet<Unit>,
    told: usize,
    /// Units in the last checkpoint.
    stored: usize,
    /// Environment steps of the units that came since then.
    played: u64,
    state: &'a mut JudgingState,
    observer: &'a mut dyn Observer,
}

impl<'a> Collecting<'a> {
    pub(super) fn new(
        trial: &Trial<'a>,
        units: &'a [Unit],
        state: &'a mut JudgingState,
        observer: &'a mut dyn Observer,
    ) -> Result<Self> {
        let stored = state.done();
        let missing = units.iter().filter(|unit| !state.finished.contains_key(unit)).copied().collect();
        let (part, at_once) = (trial.part, trial.imitating.trainer().is_some());
        let mut collecting =
            Self { part, at_once, units, missing, told: 0, stored, played: 0, state, observer };
        collecting.tell()?;
        Ok(collecting)
    }

    /// The units that are not finished, in their order.
    pub(super) fn missing(&self) -> Vec<Unit> {
        self.units.iter().filter(|unit| self.missing.contains(unit)).copied().collect()
    }

    /// Takes in an outcome; one of a unit that is finished, or that nobody asked for, changes nothing.
    pub(super) fn take(&mut self, unit: Unit, outcome: Outcome) -> Result<()> {
        if !self.missing.remove(&unit) {
            return Ok(());
        }
        self.played += outcome.played;
        self.state.finished.insert(unit, outcome);
        self.tell()?;
        let done = self.state.done();
        self.observer.on(Event::Advanced { stage: STAGE, done })?;
        let has_grown = (done - self.stored) * GROWTH >= self.stored.max(1);
        if self.at_once || has_grown || self.played >= done as u64 * STEPS_PER_WRITTEN_UNIT {
            self.checkpoint()?;
        }
        Ok(())
    }

    /// Stores what came since the last checkpoint.
    pub(super) fn checkpoint(&mut self) -> Result<()> {
        if self.state.done() > self.stored {
            (self.stored, self.played) = (self.state.done(), 0);
            self.observer.on(Event::Checkpoint { stage: STAGE, part: self.part, state: self.state })?;
        }
        Ok(())
    }

    /// Passes on the numbers of all units up to the first that is not finished.
    fn tell(&mut self) -> Result<()> {
        while let Some(unit) = self.units.get(self.told) {
            let Some(outcome) = self.state.finished.get(unit) else { break };
            report(self.part, unit, outcome, self.observer)?;
            self.told += 1;
        }
        Ok(())
    }
}

pub(super) fn report(
    judging: &str,
    unit: &Unit,
    outcome: &Outcome,
    observer: &mut dyn Observer,
) -> Result<()> {
    let Some(demo) = unit.demo else { return Ok(()) };
    let unit = format!("variant {} demonstration {demo} repeat {}", unit.variant.0, unit.repeat);
    let part = if judging.is_empty() { unit } else { format!("{judging} {unit}") };
    for (iteration, update) in outcome.curve.iter().enumerate() {
        let numbers = &update.numbers();
        observer.on(Event::Measured { stage: STAGE, part: &part, iteration, numbers })?;
    }
    Ok(())
}
