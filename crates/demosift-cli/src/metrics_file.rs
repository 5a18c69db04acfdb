//! `metrics.jsonl`: one line a measurement, appended as the run goes.
//!
//! A run that was killed measures again what came after its last checkpoint, and finds the same numbers.
//! A row that the file already holds is therefore not written twice.
//! The same rows stand in a file for TensorBoard.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use demosift::{Error, Result};
use serde_json::{Value, json};

use crate::appended::Appended;
use crate::event_file::EventFile;
use crate::writing::undisturbed;

/// Which measurement a row is: stage, part, iteration.
type Row = (String, String, u64);

#[derive(Debug)]
pub(crate) struct MetricsFile {
    path: PathBuf,
    file: Appended,
    held: BTreeSet<Row>,
    events: EventFile,
}

impl MetricsFile {
    /// Opens the file behind its last whole line; a line that was cut short by a kill is measured again.
    pub(crate) fn open(folder: &Path) -> Result<Self> {
        let path = folder.join("metrics.jsonl");
        let failed = |source: std::io::Error| Error::io("cannot open the metrics", &path, &source);
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(error) => return Err(failed(error)),
        };
        let whole = text.rfind('\n').map_or(0, |end| end + 1);
        let read = |line| row_of(line).ok_or_else(|| unreadable(line, &path));
        let rows = text[..whole].lines().map(read).collect::<Result<Vec<_>>>()?;
        let (held, rows): (_, Vec<Value>) = rows.into_iter().unzip();
        let file = Appended::after(&path, whole as u64, text.len() as u64, &[]).map_err(failed)?;
        let events = EventFile::open(folder, &rows)?;
        Ok(Self { path, file, held, events })
    }

    /// Appends a row, unless the file holds it.
    pub(crate) fn append(
        &mut self,
        stage: &str,
        part: &str,
        iteration: usize,
        numbers: &[(&str, f64)],
    ) -> Result<()> {
        if !self.held.insert((stage.to_owned(), part.to_owned(), iteration as u64)) {
            return Ok(());
        }
        let mut line =
            format!("{{\"stage\":{},\"part\":{},\"iteration\":{iteration}", json!(stage), json!(part));
        for (name, value) in numbers {
            // JSON knows no NaN; what was not measured becomes null.
            line += &format!(",{}:{}", json!(name), json!(value));
        }
        line += "}\n";
        // Read back, so that a row is the same event now and when the run goes on.
        let (_, row) = row_of(&line).expect("the line was made just now");
        undisturbed(|| {
            self.file
                .append(line.as_bytes())
                .map_err(|source| Error::io("cannot write the metrics", &self.path, &source))?;
            self.events.append(&row)
        })
    }
}

/// A line as which measurement it is, and as all that it says.
fn row_of(line: &str) -> Option<(Row, Value)> {
    let row: Value = serde_json::from_str(line).ok()?;
    let name = |key: &str| row[key].as_str().map(str::to_owned);
    Some(((name("stage")?, name("part")?, row["iteration"].as_u64()?), row))
}

fn unreadable(line: &str, path: &Path) -> Error {
    Error::bad_input(format!("a line of the metrics is not one of ours: {line}"))
        .at(path)
        .with_hint("delete the file; it is written again as far as the run goes on")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_doubled_and_a_torn_line_is_written_again() {
        let folder = std::env::temp_dir().join(format!("demosift-metrics-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let write = |iterations: std::ops::Range<usize>| {
            let mut file = MetricsFile::open(&folder).unwrap();
            for iteration in iterations {
                file.append("judge", "demonstration 0", iteration, &[("score", 0.5), ("success", f64::NAN)])
                    .unwrap();
            }
            std::fs::read_to_string(folder.join("metrics.jsonl")).unwrap()
        };
        let whole = write(0..4);
        assert_eq!(whole.lines().count(), 4);
        assert!(whole.contains("\"success\":null"), "{whole}");
        std::fs::write(folder.join("metrics.jsonl"), &whole[..whole.len() - 9]).unwrap();
        assert_eq!(write(2..4), whole);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
