//! How much each demonstration counts (§4.4): c_i, which Algorithm 3 calls w_i.

use serde::{Deserialize, Serialize};

use crate::data::demonstration::DemoId;

/// W: a weight above 0 for each demonstration of a set, `[n]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Weights(Vec<f64>);

impl Weights {
    /// All demonstrations count alike (Algorithm 3, line 1).
    pub fn ones(count: usize) -> Self {
        Self(vec![1.0; count])
    }

    /// These weights, in the order of the set.
    ///
    /// # Panics
    /// If one is not a finite number above 0: a bug of the caller.
    pub fn new(weights: Vec<f64>) -> Self {
        assert!(weights.iter().all(|weight| weight.is_finite() && *weight > 0.0), "weights are above 0");
        Self(weights)
    }

    /// c_i.
    ///
    /// # Panics
    /// If the id is not of this set: a bug of the caller.
    pub fn of(&self, demo: DemoId) -> f64 {
        self.0[demo.0]
    }

    /// All weights with their demonstrations, in the order of the set.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (DemoId, f64)> {
        self.0.iter().enumerate().map(|(index, weight)| (DemoId(index), *weight))
    }
}
