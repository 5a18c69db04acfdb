//! The rows of `metrics.jsonl` once more, for TensorBoard.
//!
//! The file is nothing but those rows written another way. When a run measures again it is made to hold them all, whatever
//! a kill left of it, so that nothing is missing and nothing doubled.

use std::fs::File;
use std::path::{Path, PathBuf};

use demosift::results::tensorboard;
use demosift::{Error, Result};
use serde_json::Value;

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
    pub(crate) fn open(folder: &Path, rows: &[Value]) -> Result<Self> {
        let path = folder.join(NAME);
        let (mut file, found) = open_to_grow(&path)?;
        let records = rows.iter().enumerate().flat_map(|(place, row)| record(place, row));
        let wanted: Vec<u8> = tensorboard::first_record().into_iter().chain(records).collect();
        let right = found.iter().zip(&wanted).take_while(|(found, wanted)| found == wanted).count();
        file.set_len(right as u64).map_err(|error| Error::io("cannot cut the events", &path, &error))?;
        grow(&mut file, &path, right as u64, &wanted[right..])?;
        Ok(Self { path, file, length: wanted.len() as u64, held: rows.len() })
    }

    /// Appends a row.
    pub(crate) fn append(&mut self, row: &Value) -> Result<()> {
        let record = record(self.held, row);
        grow(&mut self.file, &self.path, self.length, &record)?;
        self.length += record.len() as u64;
        self.held += 1;
        Ok(())
    }
}

fn record(place: usize, row: &Value) -> Vec<u8> {
    let word = |key: &str| row[key].as_str().unwrap_or_default();
    let numbers = row.as_object().into_iter().flatten();
    let numbers = numbers.filter_map(|(name, value)| Some((name.as_str(), value.as_f64()?)));
    let numbers = numbers.filter(|(name, _)| *name != "iteration");
    let iteration = row["iteration"].as_u64().unwrap_or_default();
    tensorboard::record(place, word("stage"), word("part"), iteration, numbers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn whatever_a_kill_left_becomes_the_file_of_all_rows() {
        let folder = std::env::temp_dir().join(format!("demosift-events-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let rows: Vec<Value> = (0..5)
            .map(|iteration| json!({ "stage": "judge", "part": "a", "iteration": iteration, "score": 0.1 }))
            .collect();
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
