//! Every column that a file holds, with its shape and kind, and which are used: what a user needs to name others.

use serde::Serialize;

use crate::data::demonstration::episode::Columns;
use crate::data::demonstration::named::Named;

/// A column of a file.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ColumnSeen {
    /// As the options name it.
    pub name: String,
    /// Of the first episode, or of the whole file where it has no groups for them; `None` where the file does not say.
    pub shape: Option<Vec<u64>>,
    /// The kind of its elements, as the format calls it.
    pub kind: String,
    /// What it is read as.
    pub used: Used,
}

/// What a column is read as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Used {
    /// A part of an observation.
    Observation,
    /// A part of an action.
    Action,
    /// Not at all, and cannot be: it holds more than two dimensions, as images do.
    Image,
    /// Not at all, and cannot be: it holds text or other things that are no numbers.
    NoNumbers,
    /// Not at all: the description of the set names it, and its tables do not hold it.
    NotThere,
    /// Not at all.
    Not,
}

impl ColumnSeen {
    /// A column that is held against those that are read.
    pub(super) fn new(
        name: String,
        shape: Option<Vec<u64>>,
        kind: String,
        of_numbers: bool,
        read: &Columns,
    ) -> Self {
        let named = |columns: &[String]| {
            columns.iter().any(|column| *column == name || Named::new(column).column == name)
        };
        let is_image = shape.as_ref().is_some_and(|shape| shape.len() > 2);
        let used = match () {
            () if named(&read.observations) => Used::Observation,
            () if named(&read.actions) => Used::Action,
            () if is_image => Used::Image,
            () if !of_numbers => Used::NoNumbers,
            () => Used::Not,
        };
        Self { name, shape, kind, used }
    }
}
