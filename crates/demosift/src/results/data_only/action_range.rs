//! Action range use: an arm that idles shows nothing.
//!
//! No paper stands behind it; it is the plain check by which curators find idle or stuck recordings, and so the more of
//! the range is used the higher the score. A demonstrator that flails uses all of it too.

use crate::basics::error::Result;
use crate::data::demonstration::{Demonstration, DemonstrationSet};
use crate::math::statistics::mean_of;

/// The range of each action in the demonstration by its range in the set, the mean over the actions that vary, from 0
/// to 1; nothing to say where none varies.
pub fn action_range(set: &DemonstrationSet) -> Result<Option<Vec<f64>>> {
    let of_set = set.iter().map(|(_, demonstration)| extremes(demonstration)).reduce(|left, right| {
        left.iter().zip(&right).map(|(left, right)| (left.0.min(right.0), left.1.max(right.1))).collect()
    });
    let of_set = of_set.unwrap_or_default();
    let varies: Vec<usize> =
        (0..of_set.len()).filter(|&column| of_set[column].1 > of_set[column].0).collect();
    if varies.is_empty() {
        return Ok(None);
    }
    let used = |demonstration: &Demonstration| {
        let own = extremes(demonstration);
        let share = |&column: &usize| (own[column].1 - own[column].0) / (of_set[column].1 - of_set[column].0);
        mean_of(varies.iter().map(share))
    };
    Ok(Some(set.iter().map(|(_, demonstration)| used(demonstration)).collect()))
}

/// The least and the greatest of each action.
fn extremes(demonstration: &Demonstration) -> Vec<(f64, f64)> {
    let actions = demonstration.actions();
    let column = |column: usize| {
        let values = actions.iter().map(|row| f64::from(row[column]));
        values
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
    };
    (0..actions.width()).map(column).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rows::Rows;

    fn set(actions: &[&[f32]]) -> DemonstrationSet {
        let of = |actions: &&[f32]| {
            let actions = Rows::from_flat(actions.to_vec(), 2).unwrap();
            let observations = Rows::from_flat(vec![0.0; actions.len()], 1).unwrap();
            Demonstration::new(observations, actions).unwrap()
        };
        DemonstrationSet::new(actions.iter().map(of).collect()).unwrap()
    }

    #[test]
    fn the_share_of_the_range_is_that_by_hand() {
        // The first action runs from −1 to 1 in the set; the second never moves, and does not count.
        let found = action_range(&set(&[&[-1.0, 0.5, 1.0, 0.5], &[0.0, 0.5, 0.5, 0.5], &[0.2, 0.5]]));
        assert_eq!(found.unwrap().unwrap(), [1.0, 0.25, 0.0]);
    }

    #[test]
    fn actions_that_never_vary_say_nothing() {
        assert_eq!(action_range(&set(&[&[0.1, 0.2], &[0.1, 0.2, 0.1, 0.2]])).unwrap(), None);
    }
}
