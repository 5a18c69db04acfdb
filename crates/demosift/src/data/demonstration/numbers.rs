//! Numbers and spans of numbers as a user types them.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};

/// Numbers and spans of numbers, such as `0-9,12`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(into = "String", try_from = "String")]
pub struct Numbers(pub(super) Vec<(u64, u64)>);

impl Numbers {
    /// Whether a number is one of them.
    pub fn hold(&self, number: u64) -> bool {
        self.0.iter().any(|&(first, last)| (first..=last).contains(&number))
    }

    /// The greatest of them.
    pub(super) fn last(&self) -> Option<u64> {
        self.0.iter().map(|(_, last)| *last).max()
    }
}

impl FromIterator<u64> for Numbers {
    /// Ascending numbers; neighbors become a span.
    fn from_iter<I: IntoIterator<Item = u64>>(numbers: I) -> Self {
        let mut spans: Vec<(u64, u64)> = Vec::new();
        for number in numbers {
            match spans.last_mut() {
                Some((_, last)) if *last + 1 == number => *last = number,
                _ => spans.push((number, number)),
            }
        }
        Self(spans)
    }
}

impl FromStr for Numbers {
    type Err = Error;

    fn from_str(typed: &str) -> Result<Self> {
        let span = |part: &str| {
            let (first, last) = part.split_once('-').unwrap_or((part, part));
            let (first, last) = (first.trim().parse().ok()?, last.trim().parse().ok()?);
            (first <= last).then_some((first, last))
        };
        // A list as Python prints it is a list too.
        let bare = typed.trim().trim_start_matches('[').trim_end_matches(']');
        let spans: Option<Vec<(u64, u64)>> = bare.split(',').map(span).collect();
        spans.map(Self).ok_or_else(|| {
            Error::bad_input(format!(
                "'{typed}' is no list of numbers; wanted numbers and spans, such as 0-9,12"
            ))
        })
    }
}

impl fmt::Display for Numbers {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let span = |&(first, last): &(u64, u64)| {
            if first == last { first.to_string() } else { format!("{first}-{last}") }
        };
        out.pad(&self.0.iter().map(span).collect::<Vec<_>>().join(","))
    }
}

impl TryFrom<String> for Numbers {
    type Error = Error;

    fn try_from(written: String) -> Result<Self> {
        written.parse()
    }
}

impl From<Numbers> for String {
    fn from(numbers: Numbers) -> Self {
        numbers.to_string()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

    use super::*;

    #[test]
    fn numbers_and_spans_are_read_and_written() {
        let numbers: Numbers = "0-9, 12".parse().unwrap();
        assert_eq!(numbers.to_string(), "0-9,12");
        assert!(numbers.hold(9) && numbers.hold(12) && !numbers.hold(10));
        assert_eq!("[0,3,7]".parse::<Numbers>().unwrap().to_string(), "0,3,7");
        assert_eq!([0, 1, 2, 5].into_iter().collect::<Numbers>().to_string(), "0-2,5");
        for wrong in ["", "a", "3-1", "1,,2", "-1", "1-"] {
            let error = wrong.parse::<Numbers>().unwrap_err();
            assert!(error.to_string().contains("such as 0-9,12"), "{wrong}");
        }
    }
}
