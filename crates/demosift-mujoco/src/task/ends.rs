//! When an episode ends before its horizon: `[ends]` of `task.toml`, as Gymnasium's `healthy_z_range`.
//!
//! Each entry is the name of a measurement and the range that it must stay in.
//! The measurements are looked at after each control step, and the step that leads out of a range is the last one.
//! The ends of a range are outside of it, as in Gymnasium.

use std::collections::BTreeMap;

use demosift::Result;

use crate::task::columns::column;
use crate::task::interval::Interval;

/// The ranges of `[ends]`; none if an episode always lasts to its horizon.
#[derive(Debug, Default)]
pub(crate) struct Ends(Vec<Bound>);

/// A measurement and the range that it stays in while an episode goes on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bound {
    pub(crate) column: usize,
    pub(crate) within: Interval,
}

impl Ends {
    /// Looks up the names of the ranges.
    ///
    /// # Errors
    /// If a measurement is unknown (lists those there are), or a range is none.
    pub(crate) fn resolve(file: &BTreeMap<String, [f64; 2]>, measurements: &[String]) -> Result<Self> {
        let bound = file.iter().map(|(name, ends)| {
            let within = Interval::resolve(*ends).map_err(|error| error.during(name))?;
            Ok(Bound { column: column(name, measurements)?, within })
        });
        bound.collect::<Result<_>>().map(Self)
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(crate) fn ranges(&self) -> &[Bound] {
        &self.0
    }

    /// The first range that a row of measurements is outside of.
    pub(crate) fn left(&self, row: &[f64]) -> Option<Bound> {
        self.0.iter().find(|bound| !bound.within.holds(row[bound.column])).copied()
    }

    /// When an episode ends, such as `height leaves [0.8, 2]`.
    pub(crate) fn words(&self, measurements: &[String]) -> Vec<String> {
        self.0.iter().map(|bound| bound.words(measurements)).collect()
    }
}

impl Bound {
    /// Such as `height leaves [0.8, 2]`.
    pub(crate) fn words(self, measurements: &[String]) -> String {
        format!("{} leaves {}", measurements[self.column], self.within.words())
    }
}
