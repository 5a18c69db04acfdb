//! The normalization through which policy, discriminator and baseline see observations.
//!
//! The demonstration passes through the same filter as the agent, and the filter is frozen while anything adapts:
//! otherwise the discriminator would tell the two apart by their scaling.

use serde::{Deserialize, Serialize};

use crate::math::rows::Rows;

/// No spread below this counts: columns that hardly change must not be blown up.
const SMALLEST_STD: f64 = 1e-2;
/// A column that changes by less than this share of its size, or of 1, is constant ...
const CONSTANT: f64 = 1e-6;
/// ... and is divided by so much that nothing of it is left: nobody can learn from demonstrations what another value of it means,
/// and an agent that meets one would act on numbers far from all that it has seen.
const LEAVES_OUT: f32 = 1e9;
/// Normalized observations are clipped to this many standard deviations.
pub(crate) const CLIP: f32 = 10.0;

/// Subtracts a mean, divides by a standard deviation, clips; fixed once made. Columns that were constant are left out: 0, whatever
/// their value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ObservationFilter {
    mean: Vec<f32>,
    std: Vec<f32>,
}

impl ObservationFilter {
    /// Leaves observations of this size as they are, but for the clipping.
    pub fn identity(observation_size: usize) -> Self {
        Self { mean: vec![0.0; observation_size], std: vec![1.0; observation_size] }
    }

    /// Mean and spread per column, each `[obs]`; spreads are floored.
    pub fn new(mean: Vec<f32>, std: Vec<f32>) -> Self {
        Self { mean, std: std.into_iter().map(|std| std.max(SMALLEST_STD as f32)).collect() }
    }

    /// Numbers in an observation.
    pub fn observation_size(&self) -> usize {
        self.mean.len()
    }

    /// The mean that is subtracted, `[obs]`.
    pub fn mean(&self) -> &[f32] {
        &self.mean
    }

    /// The standard deviation that is divided by, `[obs]`.
    pub fn std(&self) -> &[f32] {
        &self.std
    }

    /// Normalizes one observation `[obs]` into `out`, `[obs]`.
    pub fn apply(&self, observation: &[f32], out: &mut [f32]) {
        for (((out, value), mean), std) in out.iter_mut().zip(observation).zip(&self.mean).zip(&self.std) {
            *out = ((value - mean) / std).clamp(-CLIP, CLIP);
        }
    }

    /// Normalizes the first `len` rows of a table `[.., obs]`.
    pub fn apply_rows(&self, rows: &Rows, len: usize) -> Rows {
        let mut filtered = rows.head(len);
        let width = self.observation_size();
        for row in filtered.flat_mut().chunks_exact_mut(width) {
            for ((value, mean), std) in row.iter_mut().zip(&self.mean).zip(&self.std) {
                *value = ((*value - mean) / std).clamp(-CLIP, CLIP);
            }
        }
        filtered
    }
}

/// Counts, means and squared deviations of columns, updated row by row (Welford's method).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Moments {
    count: f64,
    mean: Vec<f64>,
    squared_deviation: Vec<f64>,
}

impl Moments {
    /// Counts the rows of a table in.
    pub fn add(&mut self, rows: &Rows) {
        self.mean.resize(rows.width(), 0.0);
        self.squared_deviation.resize(rows.width(), 0.0);
        for row in rows.iter() {
            self.count += 1.0;
            for ((value, mean), squared) in row.iter().zip(&mut self.mean).zip(&mut self.squared_deviation) {
                let difference = f64::from(*value) - *mean;
                *mean += difference / self.count;
                *squared += difference * (f64::from(*value) - *mean);
            }
        }
    }

    /// The filter with these moments.
    pub fn filter(&self) -> ObservationFilter {
        let spread = |(squared, mean): (&f64, &f64)| {
            let spread = (squared / self.count.max(1.0)).sqrt();
            if spread <= CONSTANT * mean.abs().max(1.0) { LEAVES_OUT } else { spread as f32 }
        };
        ObservationFilter::new(
            self.mean.iter().map(|mean| *mean as f32).collect(),
            self.squared_deviation.iter().zip(&self.mean).map(spread).collect(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filtered_rows_have_zero_mean_and_unit_spread_and_constants_are_left_out() {
        let mut rows = Rows::with_capacity(2, 4);
        for value in [1.0, 3.0, 5.0, 7.0] {
            rows.push(&[value, 4.0]);
        }
        let mut moments = Moments::default();
        moments.add(&rows);
        let filtered = moments.filter().apply_rows(&rows, 4);
        let column: Vec<f32> = filtered.iter().map(|row| row[0]).collect();
        assert!((column.iter().sum::<f32>()).abs() < 1e-6);
        assert!((column.iter().map(|value| value * value).sum::<f32>() / 4.0 - 1.0).abs() < 1e-5);
        assert!(filtered.iter().all(|row| row[1] == 0.0));
        // An agent may meet what no demonstration has.
        let mut met = [0.0; 2];
        moments.filter().apply(&[5.0, -300.0], &mut met);
        assert!(met[0] > 0.1 && met[1].abs() < 1e-6, "{met:?}");
    }

    #[test]
    fn a_column_that_hardly_changes_is_not_blown_up() {
        let mut moments = Moments::default();
        moments.add(&Rows::from_flat(vec![0.3, 0.301, 0.299, 0.3], 1).expect("whole rows"));
        let mut met = [0.0];
        moments.filter().apply(&[0.31], &mut met);
        assert!((met[0] - 1.0).abs() < 1e-3, "a hundredth is one: {met:?}");
    }
}
