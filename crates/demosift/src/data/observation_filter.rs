//! The normalization through which policy, discriminator and baseline see observations.
//!
//! The demonstration passes through the same filter as the agent, and the filter is frozen while anything adapts:
//! otherwise the discriminator would tell the two apart by their scaling.

use serde::{Deserialize, Serialize};

use crate::math::rows::Rows;

/// No spread below this counts: constant columns must not be blown up.
const SMALLEST_STD: f64 = 1e-2;
/// Normalized observations are clipped to this many standard deviations.
pub(crate) const CLIP: f32 = 10.0;

/// Subtracts a mean, divides by a standard deviation, clips; fixed once made.
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
        let spread = |squared: &f64| (squared / self.count.max(1.0)).sqrt() as f32;
        ObservationFilter::new(
            self.mean.iter().map(|mean| *mean as f32).collect(),
            self.squared_deviation.iter().map(spread).collect(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filtered_rows_have_zero_mean_and_unit_spread_and_constants_stay_small() {
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
    }
}
