//! What a data set says of the brightness of its pictures, by which LeRobot normalizes them; demosift looks into no video.
//!
//! | | where |
//! |---|---|
//! | v3.0, v2.0 | `meta/stats.json`, over all frames |
//! | v2.1 | `meta/episodes_stats.jsonl`, a line an episode, which are taken together here as LeRobot's own converter does |

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use serde::Deserialize;
use serde_json::{Value, json};

use crate::basics::files;

/// What is said of each camera.
#[derive(Default)]
pub(super) struct CameraStatistics {
    of_all: Value,
    of_episodes: Vec<BTreeMap<String, Value>>,
}

/// A line of `meta/episodes_stats.jsonl`.
#[derive(Deserialize)]
struct Line {
    episode_index: i64,
    stats: BTreeMap<String, Value>,
}

impl CameraStatistics {
    /// Reads what is there about these episodes.
    pub(super) fn read(set: &Path, episodes: &BTreeSet<i64>) -> Self {
        let whole = files::read(&set.join("meta/stats.json")).ok();
        let lines =
            files::read_text(&set.join("meta/episodes_stats.jsonl"), "the statistics of the episodes");
        Self {
            of_all: whole.and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default(),
            of_episodes: lines.map(|lines| of_lines(&lines, episodes)).unwrap_or_default(),
        }
    }

    /// What is said of a camera.
    pub(super) fn of(&self, camera: &str) -> Option<Value> {
        let together = || taken_together(self.of_episodes.iter().filter_map(|stats| stats.get(camera)));
        self.of_all.get(camera).cloned().or_else(together)
    }
}

fn of_lines(lines: &str, episodes: &BTreeSet<i64>) -> Vec<BTreeMap<String, Value>> {
    let lines = lines.lines().filter_map(|line| serde_json::from_str::<Line>(line).ok());
    lines.filter(|line| episodes.contains(&line.episode_index)).map(|line| line.stats).collect()
}

/// The spread of the frames of one episode, or of several.
struct Spread {
    count: f64,
    min: Vec<f64>,
    max: Vec<f64>,
    mean: Vec<f64>,
    /// Σ (x − mean)².
    squares: Vec<f64>,
}

impl Spread {
    fn of(said: &Value) -> Option<Self> {
        let [min, max, mean, std] = ["min", "max", "mean", "std"].map(|name| flat(said.get(name)?));
        let (min, max, mean, std) = (min?, max?, mean?, std?);
        let count = flat(said.get("count")?)?.first().copied().filter(|count| *count > 0.0)?;
        let is_alike = [&min, &max, &std].iter().all(|numbers| numbers.len() == mean.len());
        let squares = std.iter().map(|std| count * std * std).collect();
        is_alike.then_some(Self { count, min, max, mean, squares })
    }

    /// Both together: the variance is the mean of the variances and the variance of the means.
    fn and(self, other: &Self) -> Option<Self> {
        if other.mean.len() != self.mean.len() {
            return None;
        }
        let count = self.count + other.count;
        let both = |one: &[f64], two: &[f64], together: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
            one.iter().zip(two).map(|(one, two)| together(*one, *two)).collect()
        };
        let apart = both(&self.mean, &other.mean, &|one, two| two - one);
        let between = self.count * other.count / count;
        let within = both(&self.squares, &other.squares, &|one, two| one + two);
        Some(Self {
            count,
            min: both(&self.min, &other.min, &f64::min),
            max: both(&self.max, &other.max, &f64::max),
            mean: both(&self.mean, &apart, &|mean, apart| mean + apart * other.count / count),
            squares: both(&within, &apart, &|within, apart| within + apart * apart * between),
        })
    }
}

/// The statistics of all frames from those of each episode; `None` where one says too little, or has another shape.
fn taken_together<'a>(episodes: impl Iterator<Item = &'a Value> + Clone) -> Option<Value> {
    let shape = episodes.clone().next()?.get("mean")?;
    let mut spreads = episodes.map(Spread::of);
    let first = spreads.next()??;
    let Spread { count, min, max, mean, squares } =
        spreads.try_fold(first, |together, one| together.and(&one?))?;
    let std: Vec<f64> = squares.iter().map(|squares| (squares / count).sqrt()).collect();
    let shaped = |numbers: &[f64]| shaped(shape, &mut numbers.iter());
    Some(json!({
        "min": shaped(&min),
        "max": shaped(&max),
        "mean": shaped(&mean),
        "std": shaped(&std),
        "count": [count as u64],
    }))
}

/// All numbers of an array, whatever its shape; `None` if it holds something else.
fn flat(array: &Value) -> Option<Vec<f64>> {
    match array {
        Value::Array(entries) => {
            let entries: Option<Vec<Vec<f64>>> = entries.iter().map(flat).collect();
            entries.map(|entries| entries.concat())
        }
        other => other.as_f64().map(|number| vec![number]),
    }
}

/// Numbers in the shape of an array of as many.
fn shaped<'a>(array: &Value, numbers: &mut impl Iterator<Item = &'a f64>) -> Value {
    match array {
        Value::Array(entries) => entries.iter().map(|entry| shaped(entry, numbers)).collect(),
        _ => numbers.next().map_or(Value::Null, |number| json!(number)),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

    use super::*;

    /// What LeRobot says of frames of one color channel, in its shape `[channels, 1, 1]`.
    fn said(frames: &[f64]) -> Value {
        let count = frames.len() as f64;
        let mean = frames.iter().sum::<f64>() / count;
        let variance = frames.iter().map(|frame| (frame - mean) * (frame - mean)).sum::<f64>() / count;
        let least = frames.iter().copied().fold(f64::INFINITY, f64::min);
        let most = frames.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let shaped = |number: f64| json!([[[number]]]);
        json!({
            "min": shaped(least), "max": shaped(most), "mean": shaped(mean), "std": shaped(variance.sqrt()),
            "count": [frames.len()],
        })
    }

    #[test]
    fn episodes_taken_together_are_all_frames() {
        let episodes = [&[0.1, 0.5, 0.3][..], &[0.9], &[0.2, 0.25, 0.75, 0.4, 0.0]];
        let each = episodes.map(said);
        let (found, wanted) = (taken_together(each.iter()).unwrap(), said(&episodes.concat()));
        assert_eq!(
            (&found["count"], &found["min"], &found["max"]),
            (&wanted["count"], &wanted["min"], &wanted["max"])
        );
        for name in ["mean", "std"] {
            let number = |of: &Value| of[name][0][0][0].as_f64().unwrap();
            assert!((number(&found) - number(&wanted)).abs() < 1e-12, "{name}: {found}, wanted {wanted}");
        }
        assert_eq!(taken_together(each[..1].iter()).unwrap()["mean"], each[0]["mean"]);
    }

    #[test]
    fn what_says_too_little_says_nothing() {
        let mut other = said(&[0.5]);
        other["mean"] = json!([[[0.5]], [[0.5]]]);
        let without = json!({ "min": [0.0], "max": [1.0], "mean": [0.5], "count": [2] });
        for wrong in [other, without, json!(null)] {
            assert_eq!(taken_together([&said(&[0.5]), &wrong].into_iter()), None, "{wrong}");
        }
        assert_eq!(taken_together([].into_iter()), None);
    }
}
