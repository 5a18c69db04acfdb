//! The rows of `metrics.jsonl` once more, for TensorBoard.
//!
//! The file is nothing but those rows written another way. When a run measures again it is made to hold them all, whatever
//! a kill left of it, so that nothing is missing and nothing doubled.

use std::fs::File;
use std::path::{Path, PathBuf};

use demosift::results::metrics::{self, Line};
use demosift::results::tensorboard;
use demosift::{Error, Result};

use crate::files::writing::{grow, open_to_grow};

/// TensorBoard looks for `tfevents` in the name.
const NAME: &str = "events.out.tfevents.demosift";

#[derive(Debug)]
pub(crate) struct EventFile {
    path: PathBuf,
    file: File,
    /// Bytes in the file.
    length: u64,
    /// Measurements in the file.
    held: usize,
}

impl EventFile {
    /// Opens the file of a run folder and makes it hold the rows; what is right of it stays untouched, since a TensorBoard
    /// may be reading it.
    pub(crate) fn open(folder: &Path, rows: &[Line]) -> Result<Self> {
        let path = folder.join(NAME);
        let (mut file, found) = open_to_grow(&path)?;
        let records = rows.iter().enumerate().flat_map(|(place, row)| metrics::event(place, row));
        let wanted: Vec<u8> = tensorboard::first_record().into_iter().chain(records).collect();
        let right = found.iter().zip(&wanted).take_while(|(found, wanted)| found == wanted).count();
        file.set_len(right as u64).map_err(|error| Error::io("cannot cut the events", &path, &error))?;
        grow(&mut file, &path, right as u64, &wanted[right..])?;
        Ok(Self { path, file, length: wanted.len() as u64, held: rows.len() })
    }

    /// Appends a row.
    pub(crate) fn append(&mut self, row: &Line) -> Result<()> {
        let record = metrics::event(self.held, row);
        grow(&mut self.file, &self.path, self.length, &record)?;
        self.length += record.len() as u64;
        self.held += 1;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use demosift::results::metrics::Row;

    #[test]
    fn whatever_a_kill_left_becomes_the_file_of_all_rows() {
        let folder = std::env::temp_dir().join(format!("demosift-events-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let line = |iteration| {
            let row = Row { stage: "judge".to_owned(), part: "a".to_owned(), iteration };
            metrics::read_line(&metrics::line(&row, &[("score", 0.1)])).unwrap()
        };
        let rows: Vec<Line> = (0..5).map(line).collect();
        let mut file = EventFile::open(&folder, &[]).unwrap();
        rows.iter().for_each(|row| file.append(row).unwrap());
        let whole = std::fs::read(folder.join(NAME)).unwrap();
        let left = |bytes: &[u8]| {
            std::fs::write(folder.join(NAME), bytes).unwrap();
            let mut file = EventFile::open(&folder, &rows[..3]).unwrap();
            rows[3..].iter().for_each(|row| file.append(row).unwrap());
            std::fs::read(folder.join(NAME)).unwrap()
        };
        for length in 0..=whole.len() {
            assert_eq!(left(&whole[..length]), whole, "cut to {length} bytes");
        }
        assert_eq!(left(&[&whole[..], &whole].concat()), whole, "a row that the metrics do not hold");
        assert_eq!(left(b"something else, and longer than what was there before"), whole);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
