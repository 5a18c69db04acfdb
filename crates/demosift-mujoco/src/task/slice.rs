//! Some of the numbers of a part of an observation: `name[from:to]`, half open, counted from 0, as in Python.

use std::ops::Range;

use demosift::{Error, Result};

/// `[from:to]` behind a name; without an end it goes to the last number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Slice {
    from: usize,
    to: Option<usize>,
}

/// What a written name means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sliced<T> {
    pub(crate) of: T,
    pub(crate) slice: Slice,
}

impl Slice {
    /// All numbers.
    pub(crate) const WHOLE: Self = Self { from: 0, to: None };

    fn parse(inside: &str) -> Option<Self> {
        let (from, to) = inside.split_once(':')?;
        let end = |text: &str| text.trim().parse().ok();
        let from = if from.trim().is_empty() { 0 } else { end(from)? };
        let to = if to.trim().is_empty() { None } else { Some(end(to)?) };
        Some(Self { from, to })
    }

    /// Which of `width` numbers it takes.
    ///
    /// # Errors
    /// If it takes none, or some that do not exist.
    pub(crate) fn of(self, width: usize) -> Result<Range<usize>> {
        let range = self.from..self.to.unwrap_or(width);
        if range.is_empty() || range.end > width {
            return Err(Error::bad_config(format!(
                "there are {width} numbers, so a slice takes at least one of [0:{width}]"
            )));
        }
        Ok(range)
    }
}

/// Looks up a name that may have a slice behind it; a thing whose own name ends in brackets comes first.
///
/// # Errors
/// Those of `find`, or if what stands in the brackets is no slice.
pub(crate) fn sliced<T>(written: &str, find: impl Fn(&str) -> Result<T>) -> Result<Sliced<T>> {
    let error = match find(written) {
        Ok(of) => return Ok(Sliced { of, slice: Slice::WHOLE }),
        Err(error) => error,
    };
    let Some((name, inside)) = written.strip_suffix(']').and_then(|written| written.rsplit_once('[')) else {
        return Err(error);
    };
    let of = find(name)?;
    let slice = Slice::parse(inside).ok_or_else(|| {
        Error::bad_config(format!(
            "'{written}': a slice is [from:to], such as {name}[2:] or {name}[:3]; it counts from 0, and `to` is not in it"
        ))
    })?;
    Ok(Sliced { of, slice })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(written: &str) -> Result<Range<usize>> {
        let find = |name: &str| match name {
            "root" | "odd[1:]" => Ok(()),
            other => Err(Error::bad_config(format!("no {other}"))),
        };
        sliced(written, find)?.slice.of(7)
    }

    /// What Python's `list(range(7))[...]` is.
    #[test]
    fn a_slice_takes_what_it_takes_in_python() {
        for (written, wanted) in [
            ("root", 0..7),
            ("root[2:]", 2..7),
            ("root[:3]", 0..3),
            ("root[2:3]", 2..3),
            ("root[ 2 : 7 ]", 2..7),
            ("root[:]", 0..7),
            ("odd[1:]", 0..7),
            ("odd[1:][1:]", 1..7),
        ] {
            assert_eq!(numbers(written).expect(written), wanted, "{written}");
        }
    }

    #[test]
    fn what_is_no_slice_or_takes_nothing_is_refused() {
        let said = |written| numbers(written).expect_err(written).to_string();
        for written in ["root[2]", "root[-1:]", "root[a:b]", "root[1:2:3]", "root[]"] {
            assert!(
                said(written).contains("a slice is [from:to], such as root[2:] or root[:3]"),
                "{written}"
            );
        }
        for written in ["root[3:3]", "root[4:2]", "root[7:]", "root[2:8]"] {
            assert_eq!(said(written), "there are 7 numbers, so a slice takes at least one of [0:7]");
        }
        assert_eq!(said("foot[2:]"), "no foot");
        assert_eq!(said("root[2:"), "no root[2:");
    }
}
