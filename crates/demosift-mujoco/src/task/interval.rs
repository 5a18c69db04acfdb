//! A range of numbers, as `task.toml` writes it: `[low, high]`, where an end may be infinite.

use demosift::{Error, Result};
use serde::Serialize;

/// The numbers between two ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Interval {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl Interval {
    /// Every number.
    pub(crate) const EVERYTHING: Self = Self { low: f64::NEG_INFINITY, high: f64::INFINITY };

    /// Checks the two ends.
    ///
    /// # Errors
    /// If an end is not a number, nothing lies between the two, or everything does.
    pub(crate) fn resolve([low, high]: [f64; 2]) -> Result<Self> {
        let interval = Self { low, high };
        let problem = if low.is_nan() || high.is_nan() {
            "its ends must be numbers"
        } else if low >= high {
            "nothing lies between its ends; the lower one comes first"
        } else if interval == Self::EVERYTHING {
            "every number lies in it; one end must be finite"
        } else {
            return Ok(interval);
        };
        Err(Error::bad_config(format!("{}: {problem}", interval.words())))
    }

    /// Such as `[0.8, inf]`.
    pub(crate) fn words(self) -> String {
        format!("[{}, {}]", self.low, self.high)
    }

    /// Whether a number lies strictly between the ends.
    pub(crate) fn holds(self, value: f64) -> bool {
        self.low < value && value < self.high
    }

    /// The number of the interval that is nearest.
    pub(crate) fn clip(self, value: f64) -> f64 {
        value.clamp(self.low, self.high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_are_outside_and_numbers_are_clipped_to_them() {
        let interval = Interval::resolve([-1.0, f64::INFINITY]).expect("one finite end");
        assert!(interval.holds(-0.5) && interval.holds(1e300) && !interval.holds(-1.0));
        assert_eq!((interval.clip(-3.0), interval.clip(3.0)), (-1.0, 3.0));
        assert_eq!(interval.words(), "[-1, inf]");
    }

    #[test]
    fn an_interval_that_says_nothing_is_refused() {
        let said = |ends| Interval::resolve(ends).expect_err("no use").to_string();
        assert_eq!(said([2.0, 1.0]), "[2, 1]: nothing lies between its ends; the lower one comes first");
        assert_eq!(said([1.0, 1.0]), "[1, 1]: nothing lies between its ends; the lower one comes first");
        assert_eq!(said([f64::NAN, 1.0]), "[NaN, 1]: its ends must be numbers");
        assert!(said([f64::NEG_INFINITY, f64::INFINITY]).contains("one end must be finite"));
    }
}
