//! Tables of parquet in which some rows are not as most are: which those are, and why.

use std::collections::BTreeMap;

use crate::basics::counting::counted;
use crate::basics::error::{Error, Result};
use crate::math::rows::Rows;

/// How many numbers a row holds, and whether none of them is missing.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct Held {
    pub(super) numbers: usize,
    pub(super) whole: bool,
}

/// A table in which some rows are not as most are.
pub(super) struct Ragged {
    /// Those rows are not a number here.
    pub(super) rows: Rows,
    /// Why not, by the row.
    pub(super) faults: BTreeMap<usize, String>,
}

/// What parquet says of a number that is there, and of how many rows.
pub(super) struct Levels {
    pub(super) full: i16,
    pub(super) records: usize,
}

/// Adds how many numbers each of some rows holds.
pub(super) fn hold(
    held: &mut Vec<Held>,
    definitions: &[i16],
    repetitions: &[i16],
    Levels { full, records }: Levels,
) {
    if full == 0 {
        held.extend(std::iter::repeat_n(Held { numbers: 1, whole: true }, records));
        return;
    }
    for (at, &definition) in definitions.iter().enumerate() {
        if repetitions.get(at).is_none_or(|&level| level == 0) {
            held.push(Held { numbers: 0, whole: true });
        }
        let Some(last) = held.last_mut() else { continue };
        if definition == full { last.numbers += 1 } else { last.whole = false }
    }
}

/// Rows of the width that most have, where the others are not a number.
///
/// # Errors
/// `is_bad_input` if more than half of them are not of it.
pub(super) fn evened(values: &[f32], held: &[Held], name: &str) -> Result<Ragged> {
    let mut counts = BTreeMap::new();
    for one in held.iter().filter(|one| one.whole && one.numbers > 0) {
        *counts.entry(one.numbers).or_insert(0_usize) += 1;
    }
    let usual = counts.into_iter().max_by_key(|(_, count)| *count);
    // Otherwise a few rows could ask for any memory.
    let Some((width, _)) = usual.filter(|(_, count)| 2 * count >= held.len()) else {
        return Err(differing(name));
    };
    let (mut flat, mut faults, mut from) = (Vec::new(), BTreeMap::new(), 0);
    for (row, one) in held.iter().enumerate() {
        let numbers = values.get(from..from + one.numbers).ok_or_else(|| differing(name))?;
        from += one.numbers;
        if one.whole && one.numbers == width {
            flat.extend_from_slice(numbers);
            continue;
        }
        flat.extend(std::iter::repeat_n(f32::NAN, width));
        faults.insert(
            row,
            match one.whole {
                true => format!("'{name}' has {}, and {width} in most rows", counted(one.numbers, "number")),
                false => format!("'{name}' is empty or lacks a number"),
            },
        );
    }
    let rows = Rows::from_flat(flat, width).map_err(|error| error.during(name))?;
    Ok(Ragged { rows, faults })
}

pub(super) fn differing(name: &str) -> Error {
    Error::bad_input(format!("the rows of '{name}' differ in length; wanted as many numbers in each"))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

    use super::*;

    #[test]
    fn rows_are_told_by_their_levels() {
        // [1, 2], null, [3, null], [4, 5]
        let (definitions, repetitions) = ([3, 3, 0, 3, 2, 3, 3], [0, 1, 0, 0, 1, 0, 1]);
        let mut held = Vec::new();
        hold(&mut held, &definitions, &repetitions, Levels { full: 3, records: 4 });
        let told: Vec<(usize, bool)> = held.iter().map(|one| (one.numbers, one.whole)).collect();
        assert_eq!(told, [(2, true), (0, false), (1, false), (2, true)]);
        let Ragged { rows, faults } = evened(&[1.0, 2.0, 3.0, 4.0, 5.0], &held, "arm").unwrap();
        assert_eq!((rows.row(0), rows.row(3)), (&[1.0, 2.0][..], &[4.0, 5.0][..]));
        assert_eq!(faults.keys().collect::<Vec<_>>(), [&1, &2]);
        assert!(rows.row(1)[0].is_nan() && faults[&2].contains("'arm' is empty or lacks a number"));
    }

    #[test]
    fn where_most_rows_differ_nothing_is_read() {
        let held = [(2, true), (0, false), (0, false)].map(|(numbers, whole)| Held { numbers, whole });
        assert!(evened(&[1.0, 2.0], &held, "arm").is_err());
    }
}
