//! What the recording alone says of each episode: how smooth it is, whether it stands still, jumps, ends elsewhere than the
//! others, or is another one again.
//!
//! It says nothing of what an agent learns from it; a smooth demonstration may teach the wrong thing.

use serde::Serialize;

use crate::data::demonstration::DemoId;
use crate::data::demonstration::choice;
use crate::data::demonstration::episode::{Episode, Source};
use crate::math::rows::Rows;
use crate::math::{smoothness, statistics};

/// A step shorter than this share of the set's median step is standing still.
const STILL: f64 = 0.01;
/// An outlier is this many deviations from the median, as Iglewicz and Hoaglin 1993 have it; a deviation is 1.4826 times the median
/// absolute one, as for a normal distribution.
const FAR: f64 = 3.5;
const DEVIATION: f64 = 1.4826;
/// The least deviation, as a share of the median, so that equals do not make outliers of each other.
const LEAST_DEVIATION: f64 = 0.05;
/// Of fewer episodes nobody can say which is the odd one.
const FEWEST: usize = 5;

/// What is seen of one episode; what nobody can tell is `None`.
///
/// Observations are taken in units of their standard deviation over the set, those that never vary left out.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Look {
    /// Its position in the file.
    pub demonstration: usize,
    /// What the file calls it.
    pub label: String,
    /// T.
    pub steps: usize,
    /// The median over its steps of the size of the third differences.
    pub jerk: Option<f64>,
    /// The 95th percentile of the same.
    pub jerk_95: Option<f64>,
    /// Spectral arc length of its speed; nearer to 0 is smoother.
    pub arc_length: Option<f64>,
    /// Share of its power spectral density at periods of less than eight steps.
    pub fast_power: Option<f64>,
    /// Share of its steps that are shorter than a hundredth of the set's median step.
    pub still: Option<f64>,
    /// Its longest step, in median steps of the set.
    pub jump: Option<f64>,
    /// Share of its actions' numbers outside [−1, 1].
    pub outside: f64,
    /// How far its last observation is from the median one of the set.
    pub end_distance: Option<f64>,
    /// The first episode with the same observations and actions.
    pub duplicate_of: Option<String>,
    /// What is odd about it, in words.
    pub odd: Vec<String>,
    /// How far it is from the set's median by what is oddest, in deviations; 0 where nothing is an outlier.
    pub oddness: f64,
}

/// Every episode, the oddest first.
pub fn looks(source: &Source) -> Vec<Look> {
    let faults = choice::faults(&source.episodes);
    let judged = || source.episodes.iter().zip(&faults);
    let sound: Vec<&Episode> =
        judged().filter(|(_, fault)| fault.is_none()).map(|(episode, _)| episode).collect();
    let scale = Scale::of(&sound);
    let mut looks: Vec<Look> = Vec::with_capacity(source.episodes.len());
    for ((episode, fault), &DemoId(demonstration)) in judged().zip(&source.ids) {
        let label = episode.label.clone();
        let plain = Look { demonstration, label, steps: episode.actions.len(), ..Look::default() };
        looks.push(match fault {
            Some(fault) => Look { odd: vec![fault.clone()], oddness: f64::MAX, ..plain },
            None => scale.look(episode, plain),
        });
    }
    mark_duplicates(source, &mut looks);
    mark_outliers(&mut looks);
    looks.sort_by(|one, other| {
        other.oddness.total_cmp(&one.oddness).then(one.demonstration.cmp(&other.demonstration))
    });
    looks
}

/// In what units a set is looked at.
struct Scale {
    /// Columns that vary, with mean and standard deviation.
    columns: Vec<(usize, f64, f64)>,
    median_step: f64,
    median_end: Vec<f64>,
}

impl Scale {
    fn of(episodes: &[&Episode]) -> Self {
        let width = episodes.first().map_or(0, |episode| episode.observations.width());
        let mut columns = Vec::new();
        for column in 0..width {
            let rows = episodes.iter().flat_map(|episode| episode.observations.iter());
            let values: Vec<f64> = rows.map(|row| f64::from(row[column])).collect();
            let (mean, deviation) = statistics::mean_and_deviation(values.iter().copied());
            if deviation > 1e-6 * mean.abs().max(1.0) {
                columns.push((column, mean, deviation));
            }
        }
        let mut scale = Self { columns, median_step: 0.0, median_end: Vec::new() };
        let steps =
            episodes.iter().flat_map(|episode| differences(&scale.standard(&episode.observations), 1));
        let moving: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
        let ends: Vec<Vec<f64>> = episodes.iter().filter_map(|episode| scale.end(episode)).collect();
        let end = |place: usize| median(ends.iter().map(|end| end[place]).collect()).unwrap_or(0.0);
        let median_end = (0..scale.columns.len()).map(end).collect();
        scale.median_step = median(moving).unwrap_or(0.0);
        scale.median_end = median_end;
        scale
    }

    /// The columns that vary, in their units.
    fn standard(&self, rows: &Rows) -> Vec<Vec<f64>> {
        let of = |row: &[f32]| {
            self.columns
                .iter()
                .map(|&(column, mean, deviation)| (f64::from(row[column]) - mean) / deviation)
                .collect()
        };
        rows.iter().map(of).collect()
    }

    fn end(&self, episode: &Episode) -> Option<Vec<f64>> {
        let rows = &episode.observations;
        self.standard(&rows.iter().last().into_iter().collect()).pop()
    }

    fn look(&self, episode: &Episode, plain: Look) -> Look {
        let rows = self.standard(&episode.observations);
        let (steps, jerks) = (differences(&rows, 1), differences(&rows, 3));
        let columns = 0..self.columns.len();
        let powers = columns
            .map(|column| smoothness::fast_power(&rows.iter().map(|row| row[column]).collect::<Vec<_>>()));
        let (fast, all) = powers.fold((0.0, 0.0), |sum, power| (sum.0 + power.0, sum.1 + power.1));
        let longest = steps.iter().copied().fold(0.0, f64::max);
        let still = steps.iter().filter(|step| **step <= STILL * self.median_step).count();
        let actions = episode.actions.flat();
        let outside = actions.iter().filter(|action| action.abs() > 1.0).count();
        let moves = self.median_step > 0.0 && !steps.is_empty();
        Look {
            arc_length: smoothness::spectral_arc_length(&steps),
            fast_power: (all > 0.0 && rows.len() > 3).then_some(fast / all),
            still: moves.then(|| still as f64 / steps.len() as f64),
            jump: moves.then(|| longest / self.median_step),
            outside: outside as f64 / actions.len().max(1) as f64,
            end_distance: self.end(episode).map(|end| distance(&end, &self.median_end)),
            jerk: quantile(jerks.clone(), 0.5),
            jerk_95: quantile(jerks, 0.95),
            ..plain
        }
    }
}

/// The sizes of the first or third differences of rows: the root of the mean square over columns.
fn differences(rows: &[Vec<f64>], order: usize) -> Vec<f64> {
    let of = |window: &[Vec<f64>]| {
        let width = window[0].len();
        let square = |column: usize| match order {
            1 => (window[1][column] - window[0][column]).powi(2),
            _ => {
                let [a, b, c, d] = [0, 1, 2, 3].map(|at: usize| window[at][column]);
                (d - 3.0 * c + 3.0 * b - a).powi(2)
            }
        };
        ((0..width).map(square).sum::<f64>() / width.max(1) as f64).sqrt()
    };
    rows.windows(order + 1).map(of).collect()
}

fn distance(one: &[f64], other: &[f64]) -> f64 {
    let squares: f64 = one.iter().zip(other).map(|(one, other)| (one - other).powi(2)).sum();
    (squares / one.len().max(1) as f64).sqrt()
}

fn median(values: Vec<f64>) -> Option<f64> {
    quantile(values, 0.5)
}

fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    (!values.is_empty()).then(|| statistics::quantile(&values, share))
}

fn mark_duplicates(source: &Source, looks: &mut [Look]) {
    let mut order: Vec<usize> = (0..source.episodes.len()).filter(|&index| looks[index].steps > 0).collect();
    let bits = |index: usize| {
        let Episode { observations, actions, .. } = &source.episodes[index];
        observations.flat().iter().chain(actions.flat()).map(|value| value.to_bits())
    };
    order.sort_by(|&one, &other| bits(one).cmp(bits(other)).then(one.cmp(&other)));
    let mut first = None;
    for index in order {
        match first {
            Some(before) if bits(before).eq(bits(index)) => {
                let label = source.episodes[before].label.clone();
                looks[index].odd.push(format!("the same as {label}"));
                looks[index].duplicate_of = Some(label);
                looks[index].oddness = looks[index].oddness.max(1e9);
            }
            _ => first = Some(index),
        }
    }
}

/// What of a look is held against the set, what a large value is, and what a small one is where that is odd too.
type Told = (fn(&Look) -> Option<f64>, &'static str, Option<&'static str>);

fn mark_outliers(looks: &mut [Look]) {
    let told: [Told; 8] = [
        (|look| Some(look.steps as f64), "long", Some("short")),
        (|look| look.jerk, "jerky", None),
        (|look| look.jerk_95, "jerky in places", None),
        (|look| look.arc_length.map(|length| -length), "many movements in one", None),
        (|look| look.fast_power, "shaky", None),
        (|look| look.still, "stands still", None),
        (|look| look.jump, "jumps", None),
        (|look| look.end_distance, "ends elsewhere", None),
    ];
    for (number, high, low) in told {
        let sound = |look: &&Look| look.oddness < f64::MAX;
        let values: Vec<f64> = looks.iter().filter(sound).filter_map(number).collect();
        if values.len() < FEWEST {
            continue;
        }
        let Some(middle) = median(values.clone()) else { continue };
        let spread = median(values.iter().map(|value| (value - middle).abs()).collect()).unwrap_or(0.0);
        let deviation = (DEVIATION * spread).max(LEAST_DEVIATION * middle.abs()).max(1e-3);
        for look in looks.iter_mut().filter(|look| look.oddness < f64::MAX) {
            let Some(value) = number(look) else { continue };
            let off = (value - middle) / deviation;
            let word = if off > FAR { Some(high) } else { low.filter(|_| off < -FAR) };
            if let Some(word) = word {
                look.odd.push(word.to_owned());
                look.oddness = look.oddness.max(off.abs());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

    use super::*;
    use crate::data::demonstration::episode::{Columns, Format};

    fn set(motions: &[&dyn Fn(usize) -> f32]) -> Source {
        let episode = |(index, motion): (usize, &&dyn Fn(usize) -> f32)| {
            let observations = (0..60).flat_map(|step| [motion(step), 7.0]).collect();
            let observations = Rows::from_flat(observations, 2).unwrap();
            Episode::new(index.to_string(), observations, Rows::from_flat(vec![0.5; 60], 1).unwrap(), None)
        };
        Source::new(Format::D4rl, Columns::default(), motions.iter().enumerate().map(episode).collect())
    }

    #[test]
    fn what_is_planted_is_found_and_stands_first() {
        let reach = |size: f32| move |step: usize| size * (1.0 - (step as f32 / 19.0).cos());
        let smooth: Vec<_> = [1.0, 1.01, 0.99, 1.02, 0.98, 1.03].map(reach).to_vec();
        let shaky = |step: usize| smooth[0](step) + if step.is_multiple_of(2) { 0.1 } else { -0.1 };
        let jumps = |step: usize| smooth[1](step) + if step == 30 { 1.5 } else { 0.0 };
        let waits = |step: usize| smooth[2](step.saturating_sub(30));
        let mut motions: Vec<&dyn Fn(usize) -> f32> = smooth.iter().map(|motion| motion as _).collect();
        motions.extend([&shaky as &dyn Fn(usize) -> f32, &jumps, &waits, &smooth[3]]);
        let found = looks(&set(&motions));
        let of = |label: &str| found.iter().find(|look| look.label == label).unwrap();
        for (label, word) in
            [("6", "shaky"), ("6", "jerky"), ("7", "jumps"), ("8", "stands still"), ("8", "ends elsewhere")]
        {
            assert!(of(label).odd.iter().any(|odd| odd == word), "{label}: {:?} lacks {word}", of(label).odd);
        }
        assert_eq!(of("9").duplicate_of.as_deref(), Some("3"));
        for label in ["0", "1", "2", "3", "4", "5"] {
            assert!(of(label).odd.is_empty(), "{label}: {:?}", of(label).odd);
        }
        assert!(
            found[..4].iter().all(|look| !look.odd.is_empty())
                && found[4..].iter().all(|look| look.odd.is_empty())
        );
    }

    #[test]
    fn what_nobody_can_learn_from_is_no_measure_for_the_others() {
        let reach = |step: usize| step as f32;
        let mut source = set(&[&reach, &reach]);
        source.episodes[1].observations = Rows::from_flat(vec![f32::NAN; 120], 2).unwrap();
        let found = looks(&source);
        assert_eq!((found[0].demonstration, found[0].jerk), (1, None));
        assert!(found[0].odd[0].contains("NaN") && found[1].jerk.is_some_and(|jerk| jerk < 1e-9));
    }
}
