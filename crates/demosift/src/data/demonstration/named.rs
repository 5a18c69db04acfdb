//! How columns are named: parts of them (`observations[0:35]`), what a list of names looks like in an error, and which option
//! names the right ones.

use crate::basics::error::{Error, Result};
use crate::math::rows::Rows;

/// Names that are listed before the rest is only counted.
const MOST_LISTED: usize = 10;

/// What the reader of JSON says, without words that only a programmer knows.
pub(super) fn json_in_words(said: &serde_json::Error) -> String {
    let mut words = said.to_string();
    for (theirs, ours) in [
        ("expected usize", "expected a whole number of at least 0"),
        ("expected u64", "expected a whole number of at least 0"),
        ("expected i64", "expected a whole number"),
        ("expected f64", "expected a number"),
        ("floating point", "number"),
        ("sequence", "list"),
        ("expected a map", "expected names with values"),
        ("expected value", "expected a number, a text, a list or names with values"),
    ] {
        words = words.replace(theirs, ours);
    }
    words
}

/// The names, of many only the first ten, `and 90 more`.
pub(super) fn listed<T: ToString>(names: impl IntoIterator<Item = T>) -> String {
    shortened(names.into_iter().map(|name| name.to_string()).collect(), ", ")
}

/// The same with other words between the names.
pub(super) fn shortened(mut names: Vec<String>, between: &str) -> String {
    let rest = names.len().saturating_sub(MOST_LISTED);
    // One more name is no longer than the words that would stand for it.
    if rest < 2 {
        return if names.is_empty() { "nothing".to_owned() } else { names.join(between) };
    }
    names.truncate(MOST_LISTED);
    format!("{}{between}and {rest} more", names.join(between))
}

/// The option that names the columns of a set, with those of its names that look right.
pub(super) fn option_for<'a>(names: impl IntoIterator<Item = &'a str> + Clone) -> String {
    let guess = |words: &[&str]| {
        let fits = |name: &&str| {
            let lower = name.to_lowercase();
            !lower.contains("image")
                && !lower.starts_with("next")
                && words.iter().any(|word| lower.contains(word))
        };
        let mut found = words.iter().filter_map(|word| {
            names.clone().into_iter().find(|name| fits(name) && name.to_lowercase().contains(word))
        });
        let Some(name) = found.next() else { return "NAME".to_owned() };
        // What one column is split into is wanted together: observation.state.joints and observation.state.velocities.
        let Some((whole, _)) = name.rsplit_once('.') else { return name.trim_end_matches('/').to_owned() };
        let is_part = |part: &&str| fits(part) && part.rsplit_once('.').is_some_and(|(of, _)| of == whole);
        names.clone().into_iter().filter(is_part).collect::<Vec<_>>().join(",")
    };
    format!(
        "name the columns: --observation-columns {} --action-columns {}",
        guess(&["state", "obs", "qpos"]),
        guess(&["action", "act", "acs"])
    )
}

/// A column's name, and which of its numbers are meant where that is only a part.
pub(super) struct Named<'a> {
    pub(super) column: &'a str,
    typed: &'a str,
    part: Option<(usize, Option<usize>)>,
}

impl<'a> Named<'a> {
    /// Reads `name`, `name[3]`, `name[0:35]`, `name[4:]` or `name[:7]`; any other brackets belong to the name.
    pub(super) fn new(typed: &'a str) -> Self {
        let inner = typed.strip_suffix(']').and_then(|rest| rest.rsplit_once('['));
        let part = inner.and_then(|(column, part)| {
            let (first, end) = match part.split_once(':') {
                Some((first, end)) => (
                    if first.is_empty() { 0 } else { first.parse().ok()? },
                    if end.is_empty() { None } else { Some(end.parse().ok()?) },
                ),
                None => {
                    let one: usize = part.parse().ok()?;
                    (one, Some(one.checked_add(1)?))
                }
            };
            Some((column, (first, end)))
        });
        match part {
            Some((column, part)) => Self { column, typed, part: Some(part) },
            None => Self { column: typed, typed, part: None },
        }
    }

    /// All of a column, whatever brackets its name has.
    pub(super) fn new_whole(column: &'a str) -> Self {
        Self { column, typed: column, part: None }
    }

    /// Which of its numbers are meant: the first, and the one after the last, if not to the end; `None` for all.
    pub(super) fn part(&self) -> Option<(usize, Option<usize>)> {
        self.part
    }

    /// The named numbers of each row of the column.
    ///
    /// # Errors
    /// `is_bad_input` if the column does not have them.
    pub(super) fn part_of(&self, whole: Rows) -> Result<Rows> {
        let Some((first, end)) = self.part else { return Ok(whole) };
        let width = whole.width();
        let end = end.unwrap_or(width);
        if first >= end || end > width {
            // A table without rows may not know its width.
            if whole.is_empty() {
                return Ok(whole);
            }
            return Err(Error::bad_input(format!(
                "'{}' is no part of '{}', which has {width} numbers a step; wanted a first number below the end, as in {}[0:{width}]",
                self.typed, self.column, self.column
            )));
        }
        if whole.is_empty() {
            return Ok(Rows::with_capacity(end - first, 0));
        }
        Ok(whole.iter().map(|row| &row[first..end]).collect())
    }
}

/// A floating-point number of two bytes, as IEEE 754 has it.
pub(super) fn half(bits: u16) -> f32 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f32::from(bits & 0x3ff) / 1024.0);
    sign * match exponent {
        0 => fraction * 2.0_f32.powi(-14),
        31 if fraction == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        _ => (1.0 + fraction) * 2.0_f32.powi(exponent - 15),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

    use super::*;

    #[test]
    fn parts_of_a_column_are_cut_out() {
        let table = || Rows::from_flat((0..8_u8).map(f32::from).collect(), 4).unwrap();
        for (typed, wanted) in [
            ("a[1:3]", vec![1.0, 2.0, 5.0, 6.0]),
            ("a[2]", vec![2.0, 6.0]),
            ("a[3:]", vec![3.0, 7.0]),
            ("a[:1]", vec![0.0, 4.0]),
        ] {
            let named = Named::new(typed);
            assert_eq!((named.column, named.part_of(table()).unwrap().flat()), ("a", &wanted[..]), "{typed}");
        }
        for typed in ["a[3:5]", "a[4]", "a[2:2]", "a[3:1]"] {
            let error = Named::new(typed).part_of(table()).unwrap_err().to_string();
            assert!(error.contains("4 numbers a step") && error.contains("a[0:4]"), "{typed}: {error}");
        }
        for name in ["a", "a[x]", "a[]b", "a[-1]", "[0:1"] {
            assert_eq!(Named::new(name).column, name);
        }
    }

    #[test]
    fn long_lists_end_after_ten_names() {
        assert_eq!(listed(0..3), "0, 1, 2");
        assert_eq!(listed(0..100), "0, 1, 2, 3, 4, 5, 6, 7, 8, 9, and 90 more");
        assert_eq!(listed(Vec::<String>::new()), "nothing");
    }

    #[test]
    fn the_option_names_what_looks_right() {
        let hint = option_for(["timestamp", "image.state", "actions", "state"]);
        assert_eq!(hint, "name the columns: --observation-columns state --action-columns actions");
        assert!(option_for(["a"]).ends_with("--observation-columns NAME --action-columns NAME"));
    }

    /// Examples of IEEE 754-2008, binary16.
    #[test]
    fn halves_are_the_numbers_that_the_standard_says() {
        let pairs = [
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0x0001, 5.960_464_5e-8),
            (0x3555, 0.333_251_95),
        ];
        for (bits, wanted) in pairs {
            assert_eq!(half(bits), wanted, "{bits:x}");
        }
        assert!(half(0x7c00).is_infinite() && half(0x7e00).is_nan());
    }
}
