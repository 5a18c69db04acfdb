//! One number out of the measurements of an episode: the heuristic K (§4.3, A.1) and the value that success is judged by.
//!
//! A pure fold over rows, written once and used twice: over a finished episode, and row by row as an environment plays.
//! It is written as a table of a task file or in a few words ([`FoldOf`]), and becomes a [`Fold`] where the names of the
//! measurements are known; any simulator that writes measurements has its heuristic here.

mod written;

pub use written::{ConditionOf, FoldKind, FoldOf, OneOrMore};

use crate::basics::error::{Error, Result};
use crate::basics::names::instead;
use crate::math::rows::Rows;
use crate::world::heuristic::{Heuristic, Score};

/// The measurements that a fold may be of.
#[derive(Clone, Copy, Debug)]
pub struct Measurements<'a> {
    /// Their names, in the order of their columns.
    pub names: &'a [String],
    /// Who has them, for errors, such as `the task 'reach'`.
    pub whose: &'a str,
}

impl Measurements<'_> {
    /// The column of a measurement.
    ///
    /// # Errors
    /// `is_bad_config` if there is none of this name; lists those there are.
    pub fn column(&self, name: &str) -> Result<usize> {
        self.names.iter().position(|known| known == name).ok_or_else(|| {
            let instead = instead(name, self.whose, self.names);
            Error::bad_config(format!("no measurement is called '{name}'; {instead}"))
        })
    }
}

/// A fold whose names have become columns.
///
/// ```
/// use demosift::math::rows::Rows;
/// use demosift::world::fold::{Fold, FoldOf, Measurements};
/// use demosift::world::heuristic::Heuristic;
///
/// let names = ["gap", "height"].map(str::to_owned);
/// let measured = Measurements { names: &names, whose: "the simulator" };
/// let nearest: FoldOf = "negated min gap".parse()?;
/// let nearest = Fold::resolve(&nearest, &measured)?;
///
/// // Three rows of gap and height.
/// let episode = Rows::from_flat(vec![0.5, 1.0, 0.25, 1.5, 0.75, 1.25], 2)?;
/// assert_eq!(nearest.score(&episode), -0.25);
/// # Ok::<(), demosift::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Fold {
    kind: FoldKind,
    /// Columns that are added up to the value of a row.
    columns: Vec<usize>,
    negate: bool,
    /// A row is counted if all of these hold ...
    when: Vec<Condition>,
    /// ... and all of these have held in every row so far.
    as_long_as: Vec<Condition>,
    otherwise: f64,
    unit: String,
}

/// A condition on one column.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Condition {
    column: usize,
    bound: Bound,
}

/// What a number is compared with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// It has to be this, as exactly as measurements are kept, in f32.
    Is(f64),
    /// It has to be more than this.
    Above(f64),
    /// It has to be less than this.
    Below(f64),
}

/// A fold in progress.
#[derive(Clone, Copy, Debug)]
pub struct FoldState {
    counted: usize,
    over: bool,
    first: f64,
    last: f64,
    min: f64,
    max: f64,
    sum: f64,
}

impl Fold {
    /// Looks up the names of a fold in the measurements there are.
    ///
    /// # Errors
    /// `is_bad_config` if a measurement is unknown, `of` is missing (or given to a count, which needs none), a condition has not exactly
    /// one bound, or `otherwise` is missing where a fold with conditions may find nothing to count.
    pub fn resolve(written: &FoldOf, measurements: &Measurements<'_>) -> Result<Self> {
        let names = written.of.names();
        match (written.fold, names) {
            (FoldKind::Count, [_, ..]) => {
                return Err(Error::bad_config(
                    "of: a count is of rows, so it takes no measurement; use `when`",
                ));
            }
            (FoldKind::Count, []) => {}
            (_, []) => return Err(Error::bad_config("of: missing or empty; name at least one measurement")),
            _ => {}
        }
        let columns = names.iter().map(|name| measurements.column(name));
        let columns = columns.collect::<Result<_>>().map_err(|error| error.during("of"))?;
        let conditions = |conditions: &[ConditionOf], key| -> Result<Vec<_>> {
            let resolved = conditions.iter().map(|condition| Condition::resolve(condition, measurements));
            resolved.collect::<Result<_>>().map_err(|error| error.during(key))
        };
        let when = conditions(&written.when, "when")?;
        let as_long_as = conditions(&written.as_long_as, "while")?;
        let empty_is_zero =
            matches!(written.fold, FoldKind::Sum | FoldKind::LastMinusFirst | FoldKind::Count);
        let may_be_empty = !when.is_empty() || !as_long_as.is_empty();
        let otherwise = match written.otherwise {
            Some(value) => value,
            None if empty_is_zero || !may_be_empty => 0.0,
            None => {
                return Err(Error::bad_config(
                    "`otherwise` is missing: the number of an episode in which the conditions never hold",
                ));
            }
        };
        let unit = written.unit.clone();
        Ok(Self { kind: written.fold, columns, negate: written.negate, when, as_long_as, otherwise, unit })
    }

    /// The fold before the first row.
    pub fn start(&self) -> FoldState {
        FoldState {
            counted: 0,
            over: false,
            first: 0.0,
            last: 0.0,
            min: f64::INFINITY,
            max: f64::NEG_INFINITY,
            sum: 0.0,
        }
    }

    /// Takes in one row of measurements.
    pub fn push(&self, state: &mut FoldState, row: &[f32]) {
        state.over |= !self.as_long_as.iter().all(|condition| condition.holds(row));
        if state.over || !self.when.iter().all(|condition| condition.holds(row)) {
            return;
        }
        let value: f64 = self.columns.iter().map(|column| f64::from(row[*column])).sum();
        if state.counted == 0 {
            state.first = value;
        }
        state.counted += 1;
        state.last = value;
        state.min = state.min.min(value);
        state.max = state.max.max(value);
        state.sum += value;
    }

    /// The number that the rows so far make.
    pub fn value(&self, state: &FoldState) -> f64 {
        let value = match self.kind {
            _ if state.counted == 0 => self.otherwise,
            FoldKind::LastMinusFirst => state.last - state.first,
            FoldKind::Min => state.min,
            FoldKind::Max => state.max,
            FoldKind::Sum => state.sum,
            FoldKind::Mean => state.sum / state.counted as f64,
            FoldKind::Last => state.last,
            FoldKind::Count => state.counted as f64,
        };
        if self.negate { -value } else { value }
    }

    /// Whether a bound that holds after some rows will hold after any further ones.
    pub fn is_settled_by(&self, state: &FoldState, bound: Bound) -> bool {
        let falls = matches!(
            (self.kind, self.negate),
            (FoldKind::Min, false) | (FoldKind::Max | FoldKind::Count, true)
        );
        let rises = matches!(
            (self.kind, self.negate),
            (FoldKind::Max | FoldKind::Count, false) | (FoldKind::Min, true)
        );
        state.counted > 0
            && match bound {
                Bound::Below(_) => falls,
                Bound::Above(_) => rises,
                Bound::Is(_) => false,
            }
    }

    /// What it says of an episode, such as `the least reach, negated`.
    pub fn words(&self, measurements: &[String]) -> String {
        let names: Vec<&str> = self.columns.iter().map(|column| measurements[*column].as_str()).collect();
        let of = names.join(" + ");
        let fold = match self.kind {
            FoldKind::LastMinusFirst => format!("the last {of} less the first"),
            FoldKind::Min => format!("the least {of}"),
            FoldKind::Max => format!("the greatest {of}"),
            FoldKind::Sum => format!("the sum of {of} over the steps"),
            FoldKind::Mean => format!("the mean of {of} over the steps"),
            FoldKind::Last => format!("the last {of}"),
            FoldKind::Count => "the number of steps".to_owned(),
        };
        let all = |conditions: &[Condition]| {
            let words: Vec<String> =
                conditions.iter().map(|condition| condition.words(measurements)).collect();
            words.join(" and ")
        };
        let when = if self.when.is_empty() { String::new() } else { format!(" where {}", all(&self.when)) };
        let as_long_as = if self.as_long_as.is_empty() {
            String::new()
        } else {
            format!(" as long as {}", all(&self.as_long_as))
        };
        let otherwise = if self.when.is_empty() && self.as_long_as.is_empty() {
            String::new()
        } else {
            format!(" (or {} if there is no such step)", self.otherwise)
        };
        let negated = if self.negate { ", negated" } else { "" };
        format!("{fold}{when}{as_long_as}{otherwise}{negated}")
    }

    /// The columns that it reads for its value.
    pub fn columns(&self) -> &[usize] {
        &self.columns
    }

    /// Whether it rises with its columns: then a distance in them would be rated the better the larger it is.
    pub fn rises_with_its_columns(&self) -> bool {
        !self.negate && self.kind != FoldKind::Count
    }

    /// Why an episode that ends early may be rated too well, where it may: its remaining steps are not there to count against it.
    pub fn favors_an_early_end(&self) -> Option<&'static str> {
        match (self.kind, self.negate) {
            (FoldKind::Mean, _) => {
                Some("a mean over the steps that were played, so that falling at once costs nothing")
            }
            (FoldKind::Sum | FoldKind::Count, true) => Some(
                "a negated sum over the steps that were played, so that the sooner it ends the less it costs",
            ),
            (FoldKind::Min, false) | (FoldKind::Max, true) => Some(
                "the worst of the steps that were played, so that the sooner it ends the less can go wrong",
            ),
            _ => None,
        }
    }

    /// Whether it may be the same in many episodes by design: it counts, or looks only where conditions hold.
    pub fn is_sparse(&self) -> bool {
        self.kind == FoldKind::Count || !self.when.is_empty() || !self.as_long_as.is_empty()
    }

    /// The number that all rows make.
    pub fn over(&self, rows: &Rows) -> f64 {
        let mut state = self.start();
        rows.iter().for_each(|row| self.push(&mut state, row));
        self.value(&state)
    }
}

impl Heuristic for Fold {
    fn score(&self, measurements: &Rows) -> Score {
        self.over(measurements)
    }

    fn unit(&self) -> &str {
        &self.unit
    }
}

impl Condition {
    fn resolve(written: &ConditionOf, measurements: &Measurements<'_>) -> Result<Self> {
        let column = measurements.column(&written.measurement)?;
        let bound = match (written.is, written.above, written.below) {
            (Some(value), None, None) => Bound::Is(value),
            (None, Some(value), None) => Bound::Above(value),
            (None, None, Some(value)) => Bound::Below(value),
            _ => {
                return Err(Error::bad_config(format!(
                    "the condition on '{}' needs exactly one of: is, above, below",
                    written.measurement
                )));
            }
        };
        Ok(Self { column, bound })
    }

    fn words(&self, measurements: &[String]) -> String {
        format!("{} {}", measurements[self.column], self.bound.words())
    }

    fn holds(&self, row: &[f32]) -> bool {
        self.bound.holds(f64::from(row[self.column]))
    }
}

impl Bound {
    /// Such as `above 0.5`.
    pub fn words(self) -> String {
        match self {
            Self::Is(value) => format!("is {value}"),
            Self::Above(value) => format!("above {value}"),
            Self::Below(value) => format!("below {value}"),
        }
    }

    /// Whether the number keeps to the bound.
    pub fn holds(self, value: f64) -> bool {
        // No f32 is 0.1: the nearest one is what was measured.
        let nearest = |bound: f64| f64::from(bound as f32);
        match self {
            Self::Is(wanted) => value as f32 == wanted as f32,
            Self::Above(bound) => value > nearest(bound),
            Self::Below(bound) => value < nearest(bound),
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn fold(text: &str) -> Fold {
        resolved(&toml::from_str(text).unwrap()).unwrap()
    }

    fn resolved(written: &FoldOf) -> Result<Fold> {
        let names = ["a".to_owned(), "b".to_owned()];
        Fold::resolve(written, &Measurements { names: &names, whose: "[measurements]" })
    }

    fn rows(values: &[[f32; 2]]) -> Rows {
        values.iter().map(|row| &row[..]).collect()
    }

    /// a falls and rises again; b is a switch.
    fn episode() -> Rows {
        rows(&[[3.0, 1.0], [0.5, 1.0], [1.0, 0.0], [4.0, 1.0], [2.0, 0.0]])
    }

    #[test]
    fn each_fold_gives_the_number_worked_out_by_hand() {
        for (kind, value) in [
            ("last_minus_first", -1.0),
            ("min", 0.5),
            ("max", 4.0),
            ("sum", 10.5),
            ("mean", 2.1),
            ("last", 2.0),
        ] {
            let text = format!("fold = '{kind}'\nof = 'a'\nunit = 'm'");
            assert_eq!(fold(&text).score(&episode()), value, "{kind}");
            assert_eq!(fold(&format!("{text}\nnegate = true")).score(&episode()), -value, "{kind} negated");
            assert_eq!(fold(&text).unit(), "m");
        }
    }

    #[test]
    fn several_measurements_are_added_up_in_each_row() {
        assert_eq!(fold("fold = 'max'\nof = ['a', 'b']").score(&episode()), 5.0);
    }

    #[test]
    fn when_counts_only_the_rows_at_which_the_condition_holds() {
        let when = |kind: &str, condition: &str| {
            fold(&format!(
                "fold = '{kind}'\nof = 'a'\notherwise = 9\nwhen = [{{ measurement = {condition} }}]"
            ))
            .score(&episode())
        };
        assert_eq!(when("sum", "'b', is = 1"), 7.5);
        assert_eq!(when("mean", "'b', is = 0"), 1.5);
        assert_eq!(when("last_minus_first", "'b', above = 0.5"), 1.0);
        assert_eq!(when("max", "'a', below = 3"), 2.0);
        assert_eq!(when("min", "'a', below = 0"), 9.0, "no row is counted");
        assert_eq!(when("sum", "'a', below = 0"), 9.0, "no row is counted");
    }

    #[test]
    fn a_number_is_what_is_written_as_exactly_as_it_is_measured() {
        let tenths = rows(&[[0.1, 1.0], [0.2, 1.0], [0.1, 0.0], [0.100_001, 0.0]]);
        let count = |bound: &str| {
            fold(&format!("fold = 'count'\nwhen = [{{ measurement = 'a', {bound} }}]")).score(&tenths)
        };
        assert_eq!((count("is = 0.1"), count("is = 0.2"), count("is = 0.3")), (2.0, 1.0, 0.0));
        assert_eq!((count("above = 0.1"), count("below = 0.1"), count("below = 0.2")), (2.0, 0.0, 3.0));
    }

    #[test]
    fn while_stops_for_good_at_the_first_row_at_which_the_condition_fails() {
        let text = "of = 'a'\notherwise = -7\nwhile = [{ measurement = 'b', is = 1 }]\nfold = ";
        assert_eq!(fold(&format!("{text}'sum'")).score(&episode()), 3.5);
        assert_eq!(fold(&format!("{text}'max'")).score(&episode()), 3.0);
        assert_eq!(fold(&format!("{text}'last'")).score(&rows(&[[1.0, 0.0], [2.0, 1.0]])), -7.0);
        let both = format!("{text}'sum'\nwhen = [{{ measurement = 'a', above = 1 }}]");
        assert_eq!(fold(&both).score(&episode()), 3.0);
    }

    #[test]
    fn a_count_is_of_the_rows_that_the_conditions_leave() {
        assert_eq!(fold("fold = 'count'").score(&episode()), 5.0);
        let when = "fold = 'count'\nwhen = [{ measurement = 'a', above = 0.9 }]";
        assert_eq!(fold(when).score(&episode()), 4.0);
        assert_eq!(
            fold(&format!("{when}\nwhile = [{{ measurement = 'b', is = 1 }}]")).score(&episode()),
            1.0
        );
        assert_eq!(fold("fold = 'count'\nwhen = [{ measurement = 'a', above = 9 }]").score(&episode()), 0.0);
    }

    #[test]
    fn a_bound_is_settled_only_where_more_rows_cannot_undo_it() {
        let settled = |text: &str, bound| {
            let fold = fold(text);
            let mut state = fold.start();
            assert!(!fold.is_settled_by(&state, bound), "nothing is settled before the first row");
            fold.push(&mut state, &[0.0, 0.0]);
            fold.is_settled_by(&state, bound)
        };
        assert!(settled("fold = 'min'\nof = 'a'", Bound::Below(1.0)));
        assert!(!settled("fold = 'min'\nof = 'a'", Bound::Above(1.0)));
        assert!(settled("fold = 'min'\nof = 'a'\nnegate = true", Bound::Above(-1.0)));
        assert!(settled("fold = 'max'\nof = 'a'", Bound::Above(1.0)));
        assert!(!settled("fold = 'last'\nof = 'a'", Bound::Below(1.0)));
        assert!(
            settled("fold = 'count'", Bound::Above(0.5)) && !settled("fold = 'count'", Bound::Below(9.0))
        );
    }

    #[test]
    fn what_is_wrong_with_a_fold_is_said_with_what_would_be_right() {
        for (text, wanted) in [
            ("fold = 'min'\nof = 'c'", "no measurement is called 'c'; [measurements] has: a, b"),
            ("fold = 'min'\nof = []", "at least one measurement"),
            ("fold = 'min'", "at least one measurement"),
            ("fold = 'count'\nof = 'a'", "takes no measurement"),
            ("fold = 'min'\nof = 'a'\nwhen = [{ measurement = 'b' }]", "exactly one of: is, above, below"),
            ("fold = 'min'\nof = 'a'\nwhen = [{ measurement = 'b', is = 1 }]", "`otherwise` is missing"),
        ] {
            let error = resolved(&toml::from_str(text).unwrap()).unwrap_err();
            assert!(error.to_string().contains(wanted), "{error}");
            assert!(error.is_bad_config());
        }
        let error = toml::from_str::<FoldOf>("fold = 'median'\nof = 'a'").unwrap_err().to_string();
        assert!(error.contains("expected one of `last_minus_first`, `min`"), "{error}");
    }
}
