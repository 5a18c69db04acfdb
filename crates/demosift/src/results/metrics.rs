//! The rows of `metrics.jsonl`: one line of JSON a measurement, in the order in which they were taken.
//!
//! A run that was killed measures again what came after its last checkpoint. So a file may end in a line that was cut, while
//! all that a checkpoint vouches for must be there as it was written.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::basics::error::{Error, Result};
use crate::basics::files;
use crate::results::tensorboard;

/// Which measurement a row is.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Row {
    /// Of which stage.
    pub stage: String,
    /// Of which part of it, such as a demonstration; empty where a stage has one only.
    pub part: String,
    /// After how many updates.
    pub iteration: u64,
}

/// A line that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Which measurement it is.
    pub row: Row,
    /// All that it says.
    pub whole: Value,
}

/// How much of a file there was at the last checkpoint.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Measured {
    /// How many bytes.
    pub bytes: usize,
    /// Their SHA-256.
    pub metrics_sha256: String,
}

impl Measured {
    /// All of a text.
    pub fn of(text: &[u8]) -> Self {
        Self { bytes: text.len(), metrics_sha256: files::sha256_of(text) }
    }

    /// Whether a text begins with all that this vouches for.
    pub fn vouches_for(&self, text: &[u8]) -> bool {
        text.get(..self.bytes).is_some_and(|before| files::sha256_of(before) == self.metrics_sha256)
    }
}

/// A measurement as its line.
pub fn line(row: &Row, numbers: &[(&str, f64)]) -> String {
    let Row { stage, part, iteration } = row;
    let mut line = format!("{{\"stage\":{},\"part\":{},\"iteration\":{iteration}", json!(stage), json!(part));
    for (name, value) in numbers {
        // JSON knows no NaN; what was not measured becomes null.
        line += &format!(",{}:{}", json!(name), json!(value));
    }
    line + "}\n"
}

/// A line without its end, if it is one of ours.
pub fn read_line(line: &str) -> Option<Line> {
    let whole: Value = serde_json::from_str(line).ok()?;
    let name = |key: &str| whole[key].as_str().map(str::to_owned);
    let row = Row { stage: name("stage")?, part: name("part")?, iteration: whole["iteration"].as_u64()? };
    Some(Line { row, whole })
}

/// How many bytes of a text are whole lines.
pub fn whole_lines(text: &[u8]) -> usize {
    text.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1)
}

/// The rows of a text of whole lines.
///
/// # Errors
/// `is_bad_input`, with the first line that is not one of ours.
pub fn read(text: &[u8]) -> Result<Vec<Line>> {
    let text = String::from_utf8_lossy(text);
    let foreign = |line| Error::bad_input(format!("a line of the metrics is not one of ours: {line}"));
    text.lines().map(|line| read_line(line).ok_or_else(|| foreign(line))).collect()
}

/// A line as a record of TensorBoard, behind `place` others.
pub fn event(place: usize, line: &Line) -> Vec<u8> {
    let numbers = line.whole.as_object().into_iter().flatten();
    let numbers = numbers.filter_map(|(name, value)| Some((name.as_str(), value.as_f64()?)));
    let numbers = numbers.filter(|(name, _)| *name != "iteration");
    let Row { stage, part, iteration } = &line.row;
    tensorboard::record(place, stage, part, *iteration, numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_comes_back_and_what_was_not_measured_is_null() {
        let row = Row { stage: "judge".to_owned(), part: "a \"b\"".to_owned(), iteration: u64::MAX };
        let written = line(&row, &[("score", 0.5), ("success", f64::NAN)]);
        assert!(written.contains("\"success\":null") && written.ends_with("}\n"), "{written}");
        let [back] = &read(written.as_bytes()).expect("ours")[..] else { panic!("one line") };
        assert_eq!(back.row, row);
        assert_eq!(whole_lines(&[written.as_bytes(), b"{\"sta"].concat()), written.len());
        assert_eq!(whole_lines(b"{\"sta"), 0);
    }

    #[test]
    fn lines_that_are_not_ours_are_told() {
        for foreign in [
            "[]",
            "",
            "{",
            "{\"stage\":1,\"part\":\"\",\"iteration\":0}",
            "{\"stage\":\"a\",\"part\":\"\",\"iteration\":-1}",
        ] {
            let error = read(format!("{foreign}\n").as_bytes()).expect_err(foreign);
            assert!(error.to_string().ends_with(foreign), "{error}");
        }
    }
}
