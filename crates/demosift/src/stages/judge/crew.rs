//! Who judges the units: threads here, those of one part of a run, or whatever else can call a function of one unit.

use std::sync::Mutex;

use rayon::prelude::*;

use super::unit::{Outcome, Unit};
use crate::basics::error::{Error, Result};
use crate::basics::part::Part;

/// Judges one unit; it may be called from any thread, in any order and more than once, with the same outcome.
pub type JudgeUnit<'a> = dyn Fn(&Unit) -> Result<Outcome> + Sync + 'a;

/// Takes the outcome of a unit as soon as it is there; of a unit that comes twice it takes the first.
/// It fails if the outcome cannot be stored, and then no further unit is to be judged.
pub type HandIn<'a> = dyn FnMut(Unit, Outcome) -> Result<()> + Send + 'a;

/// Where units are judged.
///
/// The outcomes of units do not depend on each other, and [`judge`](super::judge) puts them in order, so a crew may take them
/// in any order.
/// One whose units are judged in other processes or on other machines ignores `one`: there
/// [`judge_unit`](super::judge_unit) is called with the same trial.
pub trait Crew {
    /// Judges units and hands in each as it is finished. Those that it leaves out it is asked for again.
    ///
    /// # Errors
    /// The first that a unit meets; what was handed in before stays.
    fn judge(&self, units: &[Unit], one: &JudgeUnit<'_>, hand_in: &mut HandIn<'_>) -> Result<()>;

    /// Why judging cannot go on, of a crew that handed in none of so many units.
    fn left_behind(&self, units: usize) -> Error {
        Error::simulation(format!("none of {units} units came back from those who judge them"))
    }
}

/// The threads of this process: as many units at once as there are threads, begun in their order.
#[derive(Clone, Copy, Debug, Default)]
pub struct Threads;

impl Crew for Threads {
    fn judge(&self, units: &[Unit], one: &JudgeUnit<'_>, hand_in: &mut HandIn<'_>) -> Result<()> {
        let hand_in = Mutex::new(hand_in);
        units.iter().par_bridge().try_for_each(|unit| {
            let outcome = one(unit)?;
            hand_in.lock().expect("no thread panics while it holds the lock")(*unit, outcome)
        })
    }
}

/// The threads of a process that does one part of a run: they judge every n-th unit, and leave the others to other parts.
#[derive(Clone, Copy, Debug)]
pub struct ShareOfThreads {
    /// Which part.
    pub part: Part,
    /// Demonstrations of the set.
    pub demonstrations: usize,
    /// Variants of the task.
    pub variants: usize,
}

impl ShareOfThreads {
    /// The place of a unit among all, whichever of them are finished.
    fn number(&self, unit: &Unit) -> usize {
        let demo = unit.demo.map_or(0, |demo| demo.0 + 1);
        (unit.repeat * self.variants + unit.variant.0) * (self.demonstrations + 1) + demo
    }
}

impl Crew for ShareOfThreads {
    fn judge(&self, units: &[Unit], one: &JudgeUnit<'_>, hand_in: &mut HandIn<'_>) -> Result<()> {
        let own = units.iter().filter(|unit| self.part.takes(self.number(unit)));
        Threads.judge(&own.copied().collect::<Vec<_>>(), one, hand_in)
    }

    fn left_behind(&self, units: usize) -> Error {
        Error::left_to_others(format!("{units} imitations are left to the other parts"))
    }
}
