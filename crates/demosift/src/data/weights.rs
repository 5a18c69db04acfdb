//! How much each demonstration counts (§4.4): c_i, which Algorithm 3 calls w_i.

use serde::{Deserialize, Serialize};

use crate::data::demonstration::{DemoId, DemonstrationSet};

/// W: a weight above 0 for each demonstration of a set, by its position in the file; 0 stands for what is not of the set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Weights(Vec<f64>);

impl Weights {
    /// All demonstrations count alike (Algorithm 3, line 1).
    pub fn ones(set: &DemonstrationSet) -> Self {
        Self(set.by_position(0.0, vec![1.0; set.len()]))
    }

    /// These weights of demonstrations that are all of a file.
    ///
    /// # Panics
    /// If one is not a finite number above 0: a bug of the caller.
    pub fn new(weights: Vec<f64>) -> Self {
        Self(vec![1.0; weights.len()]).with(&weights)
    }

    /// The same demonstrations with these weights, in the order of the set.
    ///
    /// # Panics
    /// If one is not a finite number above 0: a bug of the caller.
    #[must_use]
    pub fn with(&self, weights: &[f64]) -> Self {
        assert!(weights.iter().all(|weight| weight.is_finite() && *weight > 0.0), "weights are above 0");
        let mut all = vec![0.0; self.0.len()];
        self.iter().zip(weights).for_each(|((demo, _), weight)| all[demo.0] = *weight);
        Self(all)
    }

    /// c_i.
    ///
    /// # Panics
    /// If the id is not of this set: a bug of the caller.
    pub fn of(&self, demo: DemoId) -> f64 {
        self.0[demo.0]
    }

    /// c_i of a demonstration that need not be of this set.
    pub fn get(&self, demo: DemoId) -> Option<f64> {
        self.0.get(demo.0).copied()
    }

    /// All weights with their demonstrations, in the order of the set.
    pub fn iter(&self) -> impl Iterator<Item = (DemoId, f64)> {
        let all = self.0.iter().enumerate().map(|(index, weight)| (DemoId(index), *weight));
        all.filter(|(_, weight)| *weight > 0.0)
    }
}
