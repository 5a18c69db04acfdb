//! A share of a run's work, for machines that do it side by side.

use std::fmt;
use std::str::FromStr;

/// Every n-th piece of work, counted in an order that all parts agree on.
///
/// ```
/// use demosift::basics::part::Part;
///
/// let second: Part = "2/3".parse()?;
/// assert!(second.takes(1) && second.takes(4) && !second.takes(2));
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    index: usize,
    of: usize,
}

impl Part {
    /// Whether the piece with this number is done by this part.
    pub fn takes(self, number: usize) -> bool {
        number % self.of == self.index
    }

    /// A name for files, such as `2-of-3`.
    pub fn name(self) -> String {
        format!("{}-of-{}", self.index + 1, self.of)
    }
}

impl fmt::Display for Part {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}/{}", self.index + 1, self.of)
    }
}

impl FromStr for Part {
    type Err = String;

    fn from_str(typed: &str) -> Result<Self, String> {
        let numbers = typed.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match numbers {
            Some((index, of)) if (1..=of).contains(&index) => Ok(Self { index: index - 1, of }),
            Some((_, of)) => Err(format!("the part must be from 1 to {of}, such as 1/{}", of.max(1))),
            None => Err("wanted which part of how many, such as 1/2".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_take_every_piece_once() {
        let parts: Vec<Part> = (1..=3).map(|index| format!("{index}/3").parse().expect("a part")).collect();
        for number in 0..20 {
            assert_eq!(parts.iter().filter(|part| part.takes(number)).count(), 1);
        }
        assert_eq!((parts[1].to_string(), parts[1].name()), ("2/3".to_owned(), "2-of-3".to_owned()));
    }

    #[test]
    fn what_is_no_part_is_told() {
        for typed in ["0/3", "4/3", "1/0", "1", "a/b", ""] {
            assert!(typed.parse::<Part>().is_err(), "{typed}");
        }
    }
}
