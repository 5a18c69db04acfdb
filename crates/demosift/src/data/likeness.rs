//! Whether a demonstration is like those that a prior was trained on (not in the paper).
//!
//! A demonstration is summed up by the means and spreads of its observations, behind the prior's filter, and of its actions.
//! It is *unlike* the others if it is farther from its nearest among them than any of them is from its own nearest.
//! Of n that are alike, another one is so by chance in one case of n + 1.

use serde::{Deserialize, Serialize};

use crate::data::demonstration::{Demonstration, DemonstrationSet, Extent};
use crate::data::observation_filter::ObservationFilter;
use crate::math::rows::Rows;
use crate::math::statistics;

/// What is known of the demonstrations that a prior was trained on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct TrainedOn {
    /// A summary of each, `[n][2 (obs + act)]`.
    summaries: Vec<Vec<f64>>,
    /// Steps of the longest.
    longest: usize,
}

/// How far a demonstration is from what a prior was trained on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Likeness {
    /// To the nearest of them: the root of the mean square over the numbers of a summary.
    pub distance: f64,
    /// The largest that one of them has to its own nearest.
    pub usual: f64,
}

impl Likeness {
    /// Whether it is farther away than any of them.
    pub fn is_unlike(&self) -> bool {
        self.distance > self.usual
    }
}

impl TrainedOn {
    /// Sums up a set behind a filter.
    pub fn of(set: &DemonstrationSet, filter: &ObservationFilter) -> Self {
        let summaries = set.iter().map(|(_, demonstration)| summary(demonstration, filter)).collect();
        Self { summaries, longest: set.extent().longest }
    }

    /// How large that set was.
    pub fn extent(&self) -> Extent {
        Extent { demonstrations: self.summaries.len(), longest: self.longest }
    }

    /// How like these another demonstration is, behind the same filter.
    pub fn likeness(&self, demonstration: &Demonstration, filter: &ObservationFilter) -> Likeness {
        let nearest = |of: &[f64], but: Option<usize>| {
            let others = self.summaries.iter().enumerate().filter(|(place, _)| Some(*place) != but);
            others.map(|(_, other)| distance(of, other)).fold(f64::INFINITY, f64::min)
        };
        let own = self.summaries.iter().enumerate().map(|(place, of)| nearest(of, Some(place)));
        Likeness { distance: nearest(&summary(demonstration, filter), None), usual: own.fold(0.0, f64::max) }
    }
}

/// Means and standard deviations of filtered observations and of actions, as they act.
fn summary(demonstration: &Demonstration, filter: &ObservationFilter) -> Vec<f64> {
    let observations = filter.apply_rows(demonstration.observations(), demonstration.steps());
    let moments = |rows: &Rows, clip: f32| {
        let column = |index: usize| -> Vec<f64> {
            rows.iter().map(|row| f64::from(row[index].clamp(-clip, clip))).collect()
        };
        let all = (0..rows.width()).map(|index| statistics::mean_and_deviation(column(index).into_iter()));
        all.flat_map(|(mean, deviation)| [mean, deviation]).collect::<Vec<_>>()
    };
    let mut summary = moments(&observations, f32::MAX);
    summary.extend(moments(demonstration.actions(), 1.0));
    summary
}

fn distance(one: &[f64], other: &[f64]) -> f64 {
    let squares = one.iter().zip(other).map(|(one, other)| (one - other).powi(2));
    statistics::mean_of(squares).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten steps around a place, with a drift.
    fn around(place: f32, drift: f32) -> Demonstration {
        let mut observations = Rows::with_capacity(2, 10);
        let mut actions = Rows::with_capacity(1, 10);
        for step in 0..10 {
            observations.push(&[place + drift * step as f32, place]);
            actions.push(&[drift]);
        }
        Demonstration::new(observations, actions).expect("finite")
    }

    #[test]
    fn what_lies_among_them_is_like_them_and_what_lies_beyond_is_not() {
        let set = DemonstrationSet::new([0.0, 0.1, 0.2, 0.4].map(|place| around(place, 0.1)).to_vec())
            .expect("they fit");
        let filter = ObservationFilter::identity(2);
        let trained_on = TrainedOn::of(&set, &filter);
        let like = |place, drift| trained_on.likeness(&around(place, drift), &filter);
        assert!(!like(0.3, 0.1).is_unlike());
        assert!(like(0.9, 0.1).is_unlike());
        assert!(like(0.2, -0.5).is_unlike(), "the same place, and other actions");
        assert_eq!(like(0.1, 0.1).distance, 0.0);
        // Means 0.2 away in both observations, of six numbers.
        assert!((like(0.1, 0.1).usual - (2.0 * 0.2_f64.powi(2) / 6.0).sqrt()).abs() < 1e-6);
    }
}
