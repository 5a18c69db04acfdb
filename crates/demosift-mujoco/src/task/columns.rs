//! The measurements of a task file, as those look them up who name one.

use demosift::Result;
use demosift::world::fold::Measurements;

/// The measurements of these names, in the order of their columns.
pub(crate) fn named(names: &[String]) -> Measurements<'_> {
    Measurements { names, whose: "[measurements]" }
}

/// The column of a measurement; the error lists the measurements there are.
pub(crate) fn column(name: &str, names: &[String]) -> Result<usize> {
    named(names).column(name)
}
