//! A study with all its cells as one compact file, a cell a line: what a result page is made from.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use serde_json::{Number, Value};

use super::pools::PoolSummary;
use super::{Adaptation, Cell, Curve, Draws, Fingerprint, Finished, Found, Study, Work};
use crate::basics::error::{Error, Result};

/// Changes when a reader of before could no longer read the file.
const VERSION: u32 = 3;
/// The first version that this one reads.
const OLDEST: u32 = 2;
/// Points of a curve at most, where a figure shows it.
const POINTS: usize = 25;
/// Digits of a number that count.
const DIGITS: usize = 6;

/// All that a study found.
#[derive(Clone, Debug, PartialEq)]
pub struct Compact {
    /// The version of demosift that made the cells.
    pub demosift: String,
    /// What was planned.
    pub study: Study,
    /// What is to be said besides, such as which sets were not there.
    pub notes: Vec<String>,
    /// What was found.
    pub finished: Finished,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    version: u32,
    demosift: String,
    study: Study,
    notes: Vec<String>,
    /// What cells were made with, each once; a cell has the place of its own here.
    made_with: Vec<Fingerprint>,
    cells: Vec<Numbered>,
    /// For other readers; found again from the cells by this one.
    pools: Vec<Value>,
}

/// A cell, with what it was made with by its place in `made_with`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbered {
    work: Work,
    found: Found,
    of: usize,
}

/// The bytes of the file, numbers rounded to six digits.
pub fn write(compact: &Compact, pools: &[PoolSummary]) -> Vec<u8> {
    let Compact { demosift, study, notes, finished } = compact;
    let made_with: BTreeSet<&Fingerprint> = finished.cells().map(|cell| &cell.fingerprint).collect();
    let made_with: Vec<&Fingerprint> = made_with.into_iter().collect();
    let numbered = |cell: &Cell| Numbered {
        work: cell.work.clone(),
        found: thinned(study, cell.found.clone()),
        of: made_with.binary_search(&&cell.fingerprint).expect("all of them are there"),
    };
    let lines = |values: Vec<Value>| {
        let lines: Vec<String> = values.into_iter().map(|value| rounded(value).to_string()).collect();
        if lines.is_empty() { "[]".to_owned() } else { format!("[\n{}\n]", lines.join(",\n")) }
    };
    let head = [
        format!("\"version\":{VERSION}"),
        format!("\"demosift\":{}", json(demosift)),
        format!("\"study\":{}", json(study)),
        format!("\"notes\":{}", json(notes)),
        format!("\"made_with\":{}", lines(made_with.iter().map(value).collect())),
        format!("\"cells\":{}", lines(finished.cells().map(|cell| value(&numbered(cell))).collect())),
        format!("\"pools\":{}", lines(pools.iter().map(|pool| without_curves(value(pool))).collect())),
    ];
    format!("{{\n{}\n}}\n", head.join(",\n")).into_bytes()
}

fn value(of: &impl Serialize) -> Value {
    serde_json::to_value(of).expect("plain data is JSON")
}

fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("plain data is JSON")
}

/// What was written.
///
/// # Errors
/// `is_bad_input` if it is no such file.
pub fn read(bytes: &[u8]) -> Result<Compact> {
    #[derive(Deserialize)]
    struct Versioned {
        version: u32,
    }
    let wrong =
        |error: serde_json::Error| Error::bad_input(format!("this is not the file of a study: {error}"));
    let Versioned { version } = serde_json::from_slice(bytes).map_err(wrong)?;
    if !(OLDEST..=VERSION).contains(&version) {
        return Err(Error::bad_input(format!(
            "this file of a study has format version {version}; this demosift reads versions {OLDEST} to {VERSION}"
        )));
    }
    let File { demosift, study, notes, made_with, cells, .. } =
        serde_json::from_slice(bytes).map_err(wrong)?;
    study.check()?;
    let cell = |Numbered { work, found, of }: Numbered| match made_with.get(of) {
        Some(fingerprint) => Ok(Cell { work, found, fingerprint: fingerprint.clone() }),
        None => Err(Error::bad_input(format!(
            "this is not the file of a study: the cell {} was made with entry {of} of {} in made_with",
            work.name(),
            made_with.len()
        ))),
    };
    let finished = cells.into_iter().map(cell).collect::<Result<Finished>>()?;
    Ok(Compact { demosift, study, notes, finished })
}

/// The same with as much of its curves as figures of the study show: they would be most of the file.
fn thinned(study: &Study, found: Found) -> Found {
    match found {
        Found::Training(mut training) => {
            training.curve = match study.drawn.shows(Draws::TopK) {
                true => thin(&training.curve),
                false => Curve::default(),
            };
            Found::Training(training)
        }
        Found::Judging(mut judging) => {
            judging.adaptation =
                judging.adaptation.filter(|_| study.drawn.shows(Draws::Adaptation)).map(thin_adaptation);
            Found::Judging(judging)
        }
        other => other,
    }
}

fn thin(curve: &Curve) -> Curve {
    let kept = places(curve.score.len());
    Curve {
        updates: picked(&curve.updates, &kept),
        environment_steps: picked(&curve.environment_steps, &kept),
        score: picked(&curve.score, &kept),
        success: picked(&curve.success, &kept),
    }
}

fn thin_adaptation(adaptation: Adaptation) -> Adaptation {
    let kept = places(adaptation.updates.len());
    Adaptation {
        updates: picked(&adaptation.updates, &kept),
        score: adaptation.score.iter().map(|score| picked(score, &kept)).collect(),
    }
}

/// Which of so many points stay: the first, the last, and evenly between them.
fn places(count: usize) -> Vec<usize> {
    match count {
        0..=POINTS => (0..count).collect(),
        _ => (0..POINTS).map(|place| place * (count - 1) / (POINTS - 1)).collect(),
    }
}

/// Of a list that may be shorter, such as that of successes nobody knows.
fn picked<T: Copy>(all: &[T], places: &[usize]) -> Vec<T> {
    places.iter().filter_map(|place| all.get(*place).copied()).collect()
}

/// The same without the curves of trainings.
fn without_curves(value: Value) -> Value {
    match value {
        Value::Array(values) => values.into_iter().map(without_curves).collect(),
        Value::Object(fields) => {
            let kept = fields.into_iter().filter(|(key, _)| key != "curve");
            Value::Object(kept.map(|(key, value)| (key, without_curves(value))).collect())
        }
        other => other,
    }
}

/// The same with as many digits as count.
fn rounded(value: Value) -> Value {
    match value {
        Value::Number(number) if number.is_f64() => {
            let exact = number.as_f64().unwrap_or_default();
            let short = format!("{exact:.*e}", DIGITS - 1).parse().ok();
            short.and_then(Number::from_f64).map_or(Value::Number(number), Value::Number)
        }
        Value::Array(values) => values.into_iter().map(rounded).collect(),
        Value::Object(fields) => {
            Value::Object(fields.into_iter().map(|(key, value)| (key, rounded(value))).collect())
        }
        other => other,
    }
}
