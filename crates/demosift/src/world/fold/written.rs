//! A fold as it is written, before any name in it is looked up: as a table of a task file, or in a few words.

use std::str::FromStr;

use serde::Deserialize;

use crate::basics::error::{Error, Result};
use crate::basics::names::unknown;

/// How the counted rows become one number.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum FoldKind {
    /// The last counted value less the first.
    LastMinusFirst,
    /// The least counted value.
    Min,
    /// The greatest counted value.
    Max,
    /// All counted values, added up.
    Sum,
    /// Their mean.
    Mean,
    /// The last counted value.
    Last,
    /// How many rows are counted.
    Count,
}

/// The words of the folds. `any` is the greatest value of a measurement that is 0 or 1: whether it ever was 1.
const WORDS: [(&str, FoldKind); 8] = [
    ("sum", FoldKind::Sum),
    ("mean", FoldKind::Mean),
    ("last", FoldKind::Last),
    ("max", FoldKind::Max),
    ("min", FoldKind::Min),
    ("any", FoldKind::Max),
    ("last_minus_first", FoldKind::LastMinusFirst),
    ("count", FoldKind::Count),
];

/// What stands before a fold of which less is better.
const NEGATED: &str = "negated";

/// A number that sums up the measurements of an episode.
///
/// In TOML it is a table with the names of the fields as keys; `while` is the key of `as_long_as`.
/// In a few words it is a fold and the measurement that it is of, or several with `+` between them, and `negated` before it
/// where less is better.
///
/// ```
/// use demosift::world::fold::{FoldKind, FoldOf};
///
/// for words in ["sum reward", "any is_success", "last score", "max height", "negated min gap", "count"] {
///     let fold: FoldOf = words.parse()?;
///     assert_eq!(fold.negate, words.starts_with("negated"));
/// }
/// let error = "median reward".parse::<FoldOf>().unwrap_err();
/// assert!(error.to_string().contains("there are: sum, mean, last, max, min, any"), "{error}");
/// # Ok::<(), demosift::Error>(())
/// ```
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct FoldOf {
    /// Which number it is.
    pub fold: FoldKind,
    /// The measurements that are added up to the value of a row; none of a count.
    #[serde(default)]
    pub of: OneOrMore,
    /// Turns a number of which less is better into a score.
    #[serde(default)]
    pub negate: bool,
    /// Only the steps at which all of these hold are counted.
    #[serde(default)]
    pub when: Vec<ConditionOf>,
    /// Only the steps before the first one at which one of these fails are counted.
    #[serde(default, rename = "while")]
    pub as_long_as: Vec<ConditionOf>,
    /// The number, before `negate`, of an episode of which no step is counted.
    pub otherwise: Option<f64>,
    /// The unit of the number, for people; empty if it has none.
    #[serde(default)]
    pub unit: String,
}

/// One measurement, or several that are added up.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq)]
#[serde(untagged, expecting = "expected the name of a measurement, or a list of names to be added up")]
pub enum OneOrMore {
    /// The name of one.
    One(String),
    /// The names of several.
    More(Vec<String>),
}

impl OneOrMore {
    /// All names.
    pub fn names(&self) -> &[String] {
        match self {
            Self::One(name) => std::slice::from_ref(name),
            Self::More(names) => names,
        }
    }
}

impl Default for OneOrMore {
    fn default() -> Self {
        Self::More(Vec::new())
    }
}

/// A condition on one measurement: exactly one of `is`, `above`, `below`.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ConditionOf {
    /// Its name.
    pub measurement: String,
    /// What it has to be.
    pub is: Option<f64>,
    /// What it has to be more than.
    pub above: Option<f64>,
    /// What it has to be less than.
    pub below: Option<f64>,
}

impl FromStr for FoldOf {
    type Err = Error;

    fn from_str(words: &str) -> Result<Self> {
        let (first, rest) = first_word(words);
        let negate = first == NEGATED;
        let (fold, of) = if negate { first_word(rest) } else { (first, rest) };
        let read = in_words(fold, of).map_err(|error| {
            error.during(&format!("'{words}'")).with_hint(
                "write a fold and a measurement, such as \"sum reward\", \"max height\" or \"negated min gap\"",
            )
        });
        Ok(Self { negate, ..read? })
    }
}

/// The first word, and what stands behind it.
fn first_word(words: &str) -> (&str, &str) {
    let words = words.trim();
    let (first, rest) = words.split_once(char::is_whitespace).unwrap_or((words, ""));
    (first, rest.trim())
}

/// A fold by its word, of measurements with `+` between them.
fn in_words(fold: &str, of: &str) -> Result<FoldOf> {
    let words: Vec<&str> = WORDS.iter().map(|(word, _)| *word).collect();
    if fold.is_empty() {
        return Err(Error::bad_config(format!("a fold is missing; there are: {}", words.join(", "))));
    }
    let Some((_, kind)) = WORDS.iter().find(|(word, _)| *word == fold) else {
        return Err(Error::bad_config(unknown("fold", fold, &words)));
    };
    let of: Vec<String> = match of {
        "" => Vec::new(),
        of => of.split('+').map(|name| name.trim().to_owned()).collect(),
    };
    if of.iter().any(String::is_empty) {
        return Err(Error::bad_config("a measurement is missing beside the +"));
    }
    match (kind, &of[..]) {
        (FoldKind::Count, [_, ..]) => {
            return Err(Error::bad_config(
                "a count is of the steps of an episode, so it takes no measurement",
            ));
        }
        (FoldKind::Count, []) => {}
        (_, []) => return Err(Error::bad_config(format!("the measurement is missing that `{fold}` is of"))),
        _ => {}
    }
    let (when, as_long_as) = (Vec::new(), Vec::new());
    let (of, unit) = (OneOrMore::More(of), String::new());
    Ok(FoldOf { fold: *kind, of, negate: false, when, as_long_as, otherwise: None, unit })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_few_words_say_what_the_table_says() {
        for (words, table) in [
            ("sum reward", "fold = 'sum'\nof = ['reward']"),
            ("any is_success", "fold = 'max'\nof = ['is_success']"),
            ("last score", "fold = 'last'\nof = ['score']"),
            ("max height", "fold = 'max'\nof = ['height']"),
            ("min gap", "fold = 'min'\nof = ['gap']"),
            ("negated min gap", "fold = 'min'\nof = ['gap']\nnegate = true"),
            ("  negated   mean  a+b ", "fold = 'mean'\nof = ['a', 'b']\nnegate = true"),
            ("last_minus_first x", "fold = 'last_minus_first'\nof = ['x']"),
            ("count", "fold = 'count'"),
            ("negated count", "fold = 'count'\nnegate = true"),
            ("last negated", "fold = 'last'\nof = ['negated']"),
        ] {
            assert_eq!(words.parse::<FoldOf>().unwrap(), toml::from_str(table).unwrap(), "{words}");
        }
    }

    #[test]
    fn wrong_words_get_an_error_that_says_what_would_be_right() {
        let folds = "there are: sum, mean, last, max, min, any, last_minus_first, count";
        for (words, said) in [
            ("", format!("'': a fold is missing; {folds}")),
            ("negated", format!("'negated': a fold is missing; {folds}")),
            ("median gap", format!("'median gap': no fold is called 'median'; did you mean 'mean'? {folds}")),
            ("reward", format!("'reward': no fold is called 'reward'; {folds}")),
            ("sum", "'sum': the measurement is missing that `sum` is of".to_owned()),
            ("sum a +", "'sum a +': a measurement is missing beside the +".to_owned()),
            (
                "count steps",
                "'count steps': a count is of the steps of an episode, so it takes no measurement".to_owned(),
            ),
        ] {
            let error = words.parse::<FoldOf>().unwrap_err();
            assert_eq!(error.to_string(), said);
            assert!(error.is_bad_config() && error.hint().unwrap().contains("negated min gap"));
        }
    }
}
