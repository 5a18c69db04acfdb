//! `metrics.jsonl`: one line a measurement, appended as the run goes.
//!
//! A run that was killed measures again what came after its last checkpoint, and finds the same numbers.
//! A row that the file already holds is therefore not written twice.
//! The same rows stand in a file for TensorBoard.
//!
//! `measured.json` says how much of the file there was at the last checkpoint, and its checksum: nothing before it may be
//! missing or another. What came after nobody vouches for, so a run that goes on cuts it off and measures it again.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use demosift::basics::{files, seal};
use demosift::results::metrics::{self, Measured, Row};
use demosift::{Error, Result};

use crate::files::event_file::EventFile;
use crate::files::writing::{grow, open_to_grow, undisturbed};

const NAME: &str = "metrics.jsonl";
/// What vouches for the measurements of a folder.
pub(crate) const MEASURED: &str = "measured.json";

/// The measurements of a run folder, which is touched when the first is written.
#[derive(Debug)]
pub(crate) struct MetricsFile {
    folder: PathBuf,
    opened: Option<Opened>,
}

#[derive(Debug)]
struct Opened {
    path: PathBuf,
    file: File,
    /// All that the file holds.
    text: Vec<u8>,
    held: BTreeSet<Row>,
    events: EventFile,
    /// Bytes of the file that `measured.json` vouches for.
    vouched: usize,
}

impl MetricsFile {
    /// The measurements of a folder; those that are there must be those that were written.
    pub(crate) fn of(folder: &Path) -> Result<Self> {
        let measured = measured(folder)?;
        let path = folder.join(NAME);
        let text = match files::read(&path) {
            Err(_) if !path.exists() => Vec::new(),
            read => read?,
        };
        check(&measured, &text).map_err(|error| error.at(&path))?;
        Ok(Self { folder: folder.to_owned(), opened: None })
    }

    /// Appends a row, unless the file holds it.
    pub(crate) fn append(
        &mut self,
        stage: &str,
        part: &str,
        iteration: usize,
        numbers: &[(&str, f64)],
    ) -> Result<()> {
        let opened = match &mut self.opened {
            Some(opened) => opened,
            none => none.insert(undisturbed(|| Opened::at(&self.folder))?),
        };
        let row = Row { stage: stage.to_owned(), part: part.to_owned(), iteration: iteration as u64 };
        opened.append(row, numbers)
    }

    /// Makes sure that nothing of what was measured so far can get lost from here on.
    pub(crate) fn settle(&mut self) -> Result<()> {
        let Some(opened) = self.opened.as_mut().filter(|opened| opened.vouched != opened.text.len()) else {
            return Ok(());
        };
        let now = Measured::of(&opened.text);
        let synced = opened.file.sync_data().map_err(|error| files::cannot_write(&opened.path, &error));
        undisturbed(|| {
            synced.and_then(|()| files::write_atomically(&self.folder.join(MEASURED), &seal::to_json(&now)))
        })?;
        opened.vouched = now.bytes;
        Ok(())
    }
}

impl Opened {
    /// Opens the file behind what is vouched for, or, where somebody has deleted `measured.json`, behind its last whole line.
    fn at(folder: &Path) -> Result<Self> {
        let path = folder.join(NAME);
        let mut measured = measured(folder)?;
        let (file, mut text) = open_to_grow(&path)?;
        check(&measured, &text).map_err(|error| error.at(&path))?;
        if measured.is_none() && text.is_empty() {
            let nothing = measured.insert(Measured::of(&text));
            files::write_atomically(&folder.join(MEASURED), &seal::to_json(nothing))?;
        }
        let kept = measured.as_ref().map_or_else(|| metrics::whole_lines(&text), |measured| measured.bytes);
        text.truncate(kept);
        let rows = metrics::read(&text).map_err(|error| error.at(&path).with_hint(unreadable()))?;
        file.set_len(kept as u64).map_err(|error| Error::io("cannot cut the metrics", &path, &error))?;
        let events = EventFile::open(folder, &rows)?;
        let held = rows.into_iter().map(|line| line.row).collect();
        Ok(Self { path, file, text, held, events, vouched: measured.map_or(0, |measured| measured.bytes) })
    }

    fn append(&mut self, row: Row, numbers: &[(&str, f64)]) -> Result<()> {
        if self.held.contains(&row) {
            return Ok(());
        }
        let line = metrics::line(&row, numbers);
        // Read back, so that a row is the same event now and when the run goes on.
        let event = metrics::read_line(&line).expect("the line was made just now");
        undisturbed(|| {
            let length = self.text.len() as u64;
            grow(&mut self.file, &self.path, length, line.as_bytes())?;
            self.events.append(&event).inspect_err(|_| {
                // As if it had not been measured: the events are made again from what stands here.
                let _ = self.file.set_len(length);
            })
        })?;
        self.text.extend(line.as_bytes());
        self.held.insert(row);
        Ok(())
    }
}

/// What the last checkpoint vouches for; runs have none before their first.
fn measured(folder: &Path) -> Result<Option<Measured>> {
    let path = folder.join(MEASURED);
    let bytes = match std::fs::symlink_metadata(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        _ => files::read(&path)?,
    };
    let damaged = |error: Error| {
        Error::bad_input(error.message())
            .at(&path)
            .with_hint("delete it; the measurements are then taken as they are")
    };
    let json = seal::of_json(&bytes, MEASURED).map_err(damaged)?;
    let unread = |error| Error::bad_input(format!("this is no {MEASURED}: {error}")).at(&path);
    serde_json::from_slice(&json).map(Some).map_err(unread)
}

/// Whether a text begins with all that was vouched for.
fn check(measured: &Option<Measured>, text: &[u8]) -> Result<()> {
    let Some(measured) = measured.as_ref().filter(|measured| !measured.vouches_for(text)) else {
        return Ok(());
    };
    Err(Error::bad_input(format!(
        "measurements are missing or are not as they were written: of {} bytes there are {}",
        measured.bytes,
        text.len()
    ))
    .with_hint(format!(
        "take the file from a copy; or delete it and {MEASURED}: these measurements are lost then, and no result is"
    )))
}

fn unreadable() -> String {
    format!("delete the file and {MEASURED}; it is written again as far as the run goes on")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scratch(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("demosift-metrics-{}-{name}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    fn append(file: &mut MetricsFile, iterations: std::ops::Range<usize>) {
        for iteration in iterations {
            file.append("judge", "demonstration 0", iteration, &[("score", 0.5), ("success", f64::NAN)])
                .unwrap();
        }
    }

    #[test]
    fn nothing_is_doubled_and_what_nobody_vouches_for_is_written_again() {
        let folder = scratch("torn");
        let write = |iterations: std::ops::Range<usize>| {
            append(&mut MetricsFile::of(&folder).unwrap(), iterations);
            std::fs::read_to_string(folder.join(NAME)).unwrap()
        };
        let whole = write(0..4);
        assert_eq!(whole.lines().count(), 4);
        assert!(whole.contains("\"success\":null"), "{whole}");
        std::fs::write(folder.join(NAME), &whole[..whole.len() - 9]).unwrap();
        assert_eq!(write(0..4), whole);
        std::fs::write(folder.join(NAME), whole.replace("0.5", "0.7")).unwrap();
        assert_eq!(write(0..4), whole, "changed where nobody could tell");
        let mut file = MetricsFile::of(&folder).unwrap();
        append(&mut file, 0..2);
        file.settle().unwrap();
        append(&mut file, 2..4);
        drop(file);
        std::fs::write(folder.join(NAME), whole.replacen("0.5", "0.7", 4).replacen("0.7", "0.5", 2)).unwrap();
        assert_eq!(write(1..4), whole);
        // Taken as they are, without what vouches for them.
        std::fs::remove_file(folder.join(MEASURED)).unwrap();
        assert_eq!(write(2..4), whole);
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn nothing_is_touched_before_something_is_measured() {
        let folder = scratch("untouched");
        MetricsFile::of(&folder).unwrap().settle().unwrap();
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 0);
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn what_a_checkpoint_vouches_for_is_missed_and_what_came_after_is_not() {
        let folder = scratch("vouched");
        let mut file = MetricsFile::of(&folder).unwrap();
        append(&mut file, 0..3);
        file.settle().unwrap();
        append(&mut file, 3..5);
        drop(file);
        let whole = std::fs::read(folder.join(NAME)).unwrap();
        let vouched = 3 * whole.len() / 5;
        for length in 0..whole.len() {
            std::fs::write(folder.join(NAME), &whole[..length]).unwrap();
            assert_eq!(MetricsFile::of(&folder).is_ok(), length >= vouched, "{length} of {vouched}");
        }
        let mut changed = whole.clone();
        changed[vouched / 2] ^= 1;
        std::fs::write(folder.join(NAME), &changed).unwrap();
        let error = MetricsFile::of(&folder).unwrap_err();
        assert!(error.to_string().ends_with("metrics.jsonl") && error.hint().is_some(), "{error}");
        std::fs::remove_file(folder.join(NAME)).unwrap();
        assert!(MetricsFile::of(&folder).is_err());
        // The way out that the hint names.
        std::fs::remove_file(folder.join(MEASURED)).unwrap();
        let mut file = MetricsFile::of(&folder).unwrap();
        append(&mut file, 0..5);
        assert_eq!(std::fs::read(folder.join(NAME)).unwrap(), whole);
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn nothing_is_written_through_a_link() {
        let folder = scratch("link");
        let victim = folder.join("victim");
        std::fs::write(&victim, "mine").unwrap();
        for name in [NAME, "events.out.tfevents.demosift"] {
            std::os::unix::fs::symlink(&victim, folder.join(name)).unwrap();
            let written = MetricsFile::of(&folder).and_then(|mut file| file.append("judge", "", 0, &[]));
            let error = written.unwrap_err();
            assert!(error.is_bad_input() && error.to_string().contains("wanted a plain file"), "{error}");
            assert_eq!(std::fs::read(&victim).unwrap(), b"mine");
            std::fs::remove_file(folder.join(name)).unwrap();
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }

    /// A file that may not grow stands for a full disk.
    #[test]
    fn a_row_that_was_not_written_is_written_by_the_next_try() {
        let folder = scratch("full");
        let mut file = MetricsFile::of(&folder).unwrap();
        append(&mut file, 0..2);
        let whole = std::fs::read(folder.join(NAME)).unwrap();
        let opened = file.opened.as_mut().unwrap();
        let good = std::mem::replace(&mut opened.file, File::open("/dev/null").unwrap());
        assert!(file.append("judge", "", 2, &[]).unwrap_err().is_io());
        assert_eq!(std::fs::read(folder.join(NAME)).unwrap(), whole);
        file.opened.as_mut().unwrap().file = good;
        append(&mut file, 2..3);
        assert_eq!(std::fs::read_to_string(folder.join(NAME)).unwrap().lines().count(), 3);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
