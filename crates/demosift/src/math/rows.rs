//! A table of numbers, one row a time step: the shape in which everything here is stored.

use std::sync::Arc;

use crate::basics::error::{Error, Result};

/// A row-major table of shape `[len, width]`.
///
/// A clone shares the numbers until one of both is changed: a large set is handed on many times and lies in memory once.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(from = "Plain", into = "Plain")]
pub struct Rows {
    values: Arc<Vec<f32>>,
    width: usize,
}

/// As it is written.
#[derive(serde::Serialize, serde::Deserialize)]
struct Plain {
    values: Vec<f32>,
    width: usize,
}

impl From<Plain> for Rows {
    fn from(Plain { values, width }: Plain) -> Self {
        Self { values: Arc::new(values), width }
    }
}

impl From<Rows> for Plain {
    fn from(Rows { values, width }: Rows) -> Self {
        Self { values: Arc::unwrap_or_clone(values), width }
    }
}

impl Rows {
    /// A table without rows that will hold rows of `width` numbers.
    pub fn with_capacity(width: usize, len: usize) -> Self {
        Self { values: Arc::new(Vec::with_capacity(width * len)), width }
    }

    /// The table over flat `values`; their number must be a multiple of `width`.
    pub fn from_flat(values: Vec<f32>, width: usize) -> Result<Self> {
        if width == 0 || !values.len().is_multiple_of(width) {
            return Err(Error::bad_input(format!("{} numbers do not make rows of {width}", values.len())));
        }
        Ok(Self { values: Arc::new(values), width })
    }

    /// Appends a row of `width` numbers.
    ///
    /// # Panics
    /// If the row has another width: a bug of the caller.
    pub fn push(&mut self, row: &[f32]) {
        assert_eq!(row.len(), self.width, "row width");
        Arc::make_mut(&mut self.values).extend_from_slice(row);
    }

    /// Appends all rows of a table of the same width.
    ///
    /// # Panics
    /// If the widths differ: a bug of the caller.
    pub fn append(&mut self, rows: &Rows) {
        assert_eq!(rows.width, self.width, "row width");
        Arc::make_mut(&mut self.values).extend_from_slice(&rows.values);
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.values.len().checked_div(self.width).unwrap_or(0)
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Numbers in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// One row.
    pub fn row(&self, index: usize) -> &[f32] {
        &self.values[index * self.width..(index + 1) * self.width]
    }

    /// The rows in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[f32]> {
        // A table without columns has no rows; chunks need a width of at least one.
        self.values.chunks_exact(self.width.max(1))
    }

    /// All numbers, row after row.
    pub fn flat(&self) -> &[f32] {
        &self.values
    }

    /// All numbers, row after row, to be changed in place.
    pub fn flat_mut(&mut self) -> &mut [f32] {
        Arc::make_mut(&mut self.values).as_mut_slice()
    }

    /// The first `len` rows.
    #[must_use]
    pub fn head(&self, len: usize) -> Self {
        Self { values: Arc::new(self.values[..len * self.width].to_vec()), width: self.width }
    }

    /// Position `(row, column)` of the first number that is not finite.
    pub fn first_not_finite(&self) -> Option<(usize, usize)> {
        let position = self.values.iter().position(|value| !value.is_finite())?;
        Some((position / self.width, position % self.width))
    }
}

impl<'a> FromIterator<&'a [f32]> for Rows {
    fn from_iter<I: IntoIterator<Item = &'a [f32]>>(rows: I) -> Self {
        let mut rows = rows.into_iter().peekable();
        let width = rows.peek().map_or(0, |row| row.len());
        let mut table = Self::with_capacity(width, rows.size_hint().0);
        rows.for_each(|row| table.push(row));
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clone_shares_the_numbers_until_it_is_changed() {
        let table = Rows::from_flat(vec![1.0, 2.0, 3.0, 4.0], 2).expect("whole rows");
        let mut other = table.clone();
        assert!(std::ptr::eq(table.flat(), other.flat()));
        other.push(&[5.0, 6.0]);
        other.flat_mut()[0] = 9.0;
        assert_eq!(table.flat(), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(other.flat(), [9.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    }

    #[test]
    fn a_table_is_written_as_numbers_and_width() {
        let table = Rows::from_flat(vec![1.0, 2.0, 3.0, 4.0], 2).expect("whole rows");
        let text = serde_json::to_string(&table).expect("plain data");
        assert_eq!(text, r#"{"values":[1.0,2.0,3.0,4.0],"width":2}"#);
        assert_eq!(serde_json::from_str::<Rows>(&text).expect("the same"), table);
    }
}
