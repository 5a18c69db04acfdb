//! Scores of the recorded data alone, as others give them: columns beside ours that never enter the ranking.
//!
//! Tools that clean demonstration sets look at the data and try nothing. Each scorer here is one such opinion, a pure
//! function from a set to one number a demonstration, higher being better by its authors' lights, whatever the task
//! says. They read observations and actions and nothing else.
//!
//! A published audit of such scorers found most of them to be reading the length of an episode; so the length is one of
//! the columns, and where the others agree with it, that is what they read.

mod action_range;
mod cloning_loss;
mod jerk;
mod length;
mod mutual_information;
mod spectral;

use serde::{Deserialize, Serialize};

use crate::basics::error::Result;
use crate::data::demonstration::DemonstrationSet;
use crate::math::agreement;
use crate::math::rows::Rows;
use crate::stages::select::Ranking;

pub use action_range::action_range;
pub use cloning_loss::cloning_loss;
pub use jerk::jerk;
pub use length::length;
pub use mutual_information::mutual_information;
pub use spectral::{arc_length, fast_power};

/// The opinions on a set.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DataOnly {
    /// One a scorer that has something to say about this set.
    pub columns: Vec<Column>,
}

/// What one scorer says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Column {
    /// The scorer, in a word or two.
    pub name: String,
    /// What the number is.
    pub meaning: String,
    /// One per demonstration, in the order of the set; higher is better by the scorer's lights.
    pub scores: Vec<f64>,
}

impl Column {
    /// Spearman's rank correlation with the gains of a ranking; `None` where one of both finds all alike.
    pub fn agreement(&self, ranking: &Ranking) -> Option<f64> {
        let gains: Vec<f64> = ranking.entries.iter().map(|entry| entry.gain).collect();
        Some(agreement::spearman(&gains, &ranking.ordered(&self.scores)))
            .filter(|agreement| agreement.is_finite())
    }
}

/// A scorer: `None` where it has nothing to say about a set.
type Scorer = fn(&DemonstrationSet) -> Result<Option<Vec<f64>>>;

/// Every scorer with its name and what its number is.
const SCORERS: [(&str, &str, Scorer); 7] = [
    ("length", "minus the number of steps: who is good at it is done sooner", length),
    ("jerk", "minus the root mean square of the third differences of the observations", jerk),
    ("action range", "share of the set's range of actions that it uses", action_range),
    (
        "mutual information",
        "its pairs' contribution to the mutual information of state and action, in nats",
        mutual_information,
    ),
    (
        "cloning loss",
        "minus the squared error of a policy cloned from the other demonstrations",
        cloning_loss,
    ),
    (
        "arc length",
        "minus the arc length of the spectrum of its speed: smooth motions have few frequencies",
        arc_length,
    ),
    (
        "fast power",
        "minus the share of its power spectral density at periods of less than eight steps",
        fast_power,
    ),
];

/// All that the scorers say about a set; one that has nothing to say is left out.
pub fn data_only(set: &DemonstrationSet) -> Result<DataOnly> {
    let mut columns = Vec::new();
    for (name, meaning, scorer) in SCORERS {
        if let Some(scores) = scorer(set)? {
            columns.push(Column { name: name.to_owned(), meaning: meaning.to_owned(), scores });
        }
    }
    Ok(DataOnly { columns })
}

/// The spread below which a column counts as constant, beside the size of its numbers.
const SMALLEST_SPREAD: f64 = 1e-6;

/// Tables of several demonstrations with each column at mean 0 and standard deviation 1 over all of them; constant columns
/// are left out, so that a column of the result is a real one and units do not count.
fn standardized(tables: &[&Rows]) -> Vec<Rows> {
    let width = tables.first().map_or(0, |table| table.width());
    let count = tables.iter().map(|table| table.len()).sum::<usize>() as f64;
    let mean_of = |number: &dyn Fn(f64, usize) -> f64| -> Vec<f64> {
        let mut sums = vec![0.0; width];
        for row in tables.iter().flat_map(|table| table.iter()) {
            let values = row.iter().enumerate().map(|(column, &value)| number(f64::from(value), column));
            sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        }
        sums.into_iter().map(|sum| sum / count).collect()
    };
    let means = mean_of(&|value, _| value);
    let variances = mean_of(&|value, column| (value - means[column]).powi(2));
    let varies = |column: &usize| variances[*column].sqrt() > SMALLEST_SPREAD * means[*column].abs().max(1.0);
    let columns: Vec<usize> = (0..width).filter(varies).collect();
    let standardize = |table: &&Rows| {
        let mut standard = Rows::with_capacity(columns.len(), table.len());
        for row in table.iter() {
            let of = |&column: &usize| {
                ((f64::from(row[column]) - means[column]) / variances[column].sqrt()) as f32
            };
            standard.push(&columns.iter().map(of).collect::<Vec<f32>>());
        }
        standard
    };
    tables.iter().map(standardize).collect()
}

/// The set's observations, standardized, a table each demonstration.
fn standard_observations(set: &DemonstrationSet) -> Vec<Rows> {
    standardized(&set.iter().map(|(_, demonstration)| demonstration.observations()).collect::<Vec<_>>())
}

/// Whether any number of the observations varies over the set.
pub(crate) fn observations_vary(set: &DemonstrationSet) -> bool {
    standard_observations(set).iter().any(|table| table.width() > 0)
}

/// The set's actions, standardized, a table each demonstration.
fn standard_actions(set: &DemonstrationSet) -> Vec<Rows> {
    standardized(&set.iter().map(|(_, demonstration)| demonstration.actions()).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basics::seed::Seed;
    use crate::data::demonstration::{DemoId, Demonstration};
    use crate::world::point_mass::planted_set;

    #[test]
    fn every_scorer_has_a_finite_number_for_every_demonstration_wherever_it_stands() {
        let set = planted_set(&[0.0, 90.0, 180.0, 20.0], Seed::new(1)).unwrap();
        let found = data_only(&set).unwrap();
        assert_eq!(found.columns.len(), SCORERS.len());
        let order = [2, 0, 3, 1];
        let moved: Vec<Demonstration> = order.iter().map(|id| set.get(DemoId(*id)).clone()).collect();
        let again = data_only(&DemonstrationSet::new(moved).unwrap()).unwrap();
        for (here, there) in found.columns.iter().zip(&again.columns) {
            assert_eq!(here.scores.len(), 4);
            for (place, id) in order.iter().enumerate() {
                let (here, there) = (here.scores[*id], there.scores[place]);
                assert!(
                    here.is_finite() && (here - there).abs() < 1e-4 * here.abs().max(1.0),
                    "{here} {there}"
                );
            }
        }
    }

    #[test]
    fn standard_columns_have_mean_0_and_spread_1_and_constant_ones_are_gone() {
        let tables = [
            Rows::from_flat(vec![1.0, 7.0, 0.0, 3.0, 7.0, 0.0], 3).unwrap(),
            Rows::from_flat(vec![5.0, 7.0, 4.0], 3).unwrap(),
        ];
        let standard = standardized(&tables.iter().collect::<Vec<_>>());
        assert_eq!(standard.iter().map(Rows::width).collect::<Vec<_>>(), [2, 2]);
        let spread = (8.0_f32 / 3.0).sqrt();
        assert!((standard[0].row(0)[0] + 2.0 / spread).abs() < 1e-6);
        let all: Vec<f32> = standard.iter().flat_map(|table| table.iter().map(|row| row[1])).collect();
        assert!(all.iter().sum::<f32>().abs() < 1e-6);
        assert!((all.iter().map(|value| value * value).sum::<f32>() / 3.0 - 1.0).abs() < 1e-6);
    }
}
