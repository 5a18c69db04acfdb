//! The adapted behaviors distance (§5.2, Table 1): how far from a demonstration the agent is that imitates it.
//!
//! The paper: 1/T Σ_i ‖s'_{i,t} − ŝ_{i,t}‖ + ‖a'_{i,t} − â_{i,t}‖, with v_i's pairs (ŝ_i, â_i) and those (s'_i, a'_i) of
//! the agent adapted to v_i; Table 1 has its mean over the set, the lower the better.
//!
//! What this leaves open, and what we take:
//!
//! | open | here |
//! |---|---|
//! | the sum runs over i and the terms have t | it runs over time, as 1/T says, and over both norms |
//! | which of the agent's pairs belongs to which of the demonstration's | those of the same time step; nothing is warped or matched |
//! | what if the lengths differ | the steps that both have; an agent that falls early is measured while it stands |
//! | how many of the agent's episodes | any number, and the mean over them |
//! | whether the agent acts by its mean or samples | the caller's choice; Algorithm 2 samples |
//! | whether actions beyond the range count as drawn or as executed | as drawn: an agent that overshoots does not do what was shown |
//! | the units of the states | raw, as recorded: a distance is comparable within a task, and a column with large numbers rules |

use crate::basics::error::{Error, Result};
use crate::data::demonstration::Demonstration;
use crate::data::trajectory::Trajectory;
use crate::math::rows::Rows;

/// The distance between a demonstration and the episodes of the agent adapted to it.
///
/// Observations `[T, obs]`, actions `[T, act]`, in their own units.
///
/// # Errors
/// Bad input if there is no episode, or if sizes differ.
pub(crate) fn distance(demonstration: &Demonstration, played: &[Trajectory]) -> Result<f64> {
    if played.is_empty() {
        return Err(Error::bad_input(
            "the adapted behaviors distance needs at least one episode of the agent",
        ));
    }
    let mut sum = 0.0;
    for trajectory in played {
        sum += distance_of_one(demonstration, trajectory)?;
    }
    Ok(sum / played.len() as f64)
}

fn distance_of_one(demonstration: &Demonstration, played: &Trajectory) -> Result<f64> {
    let wanted = (demonstration.observations().width(), demonstration.actions().width());
    let found = (played.observations().width(), played.actions().width());
    if found != wanted {
        return Err(Error::bad_input(format!(
            "the demonstration has {} observations and {} actions a step, but the agent's episode has {} and {}",
            wanted.0, wanted.1, found.0, found.1
        )));
    }
    let steps = demonstration.steps().min(played.steps());
    let sum: f64 = (0..steps)
        .map(|step| {
            norm(demonstration.observations(), played.observations(), step)
                + norm(demonstration.actions(), played.actions(), step)
        })
        .sum();
    Ok(sum / steps as f64)
}

/// Euclidean distance of two rows.
fn norm(left: &Rows, right: &Rows, step: usize) -> f64 {
    let squared = left.row(step).iter().zip(right.row(step)).map(|(a, b)| f64::from(a - b).powi(2));
    squared.sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::trajectory::{Ended, Parts};

    fn rows(values: &[f32], width: usize) -> Rows {
        Rows::from_flat(values.to_vec(), width).expect("whole rows")
    }

    fn played(observations: &[f32], actions: &[f32]) -> Trajectory {
        let steps = actions.len();
        Trajectory::new(Parts {
            observations: rows(observations, 2),
            actions: rows(actions, 1),
            measurements: rows(&vec![0.0; steps + 1], 1),
            task_rewards: vec![0.0; steps],
            ended: Ended::Horizon,
        })
        .expect("a whole trajectory")
    }

    /// By hand: states 5 and 0 apart, actions 1 and 2 apart, over two steps.
    #[test]
    fn table_1_distance_is_the_mean_over_time_of_both_norms() {
        let demonstration =
            Demonstration::new(rows(&[0.0, 0.0, 1.0, 1.0], 2), rows(&[0.5, -1.0], 1)).unwrap();
        let one = played(&[3.0, 4.0, 1.0, 1.0, 9.0, 9.0], &[-0.5, 1.0]);
        assert_eq!(distance(&demonstration, std::slice::from_ref(&one)).unwrap(), 4.0);
        // The same behavior is 0 away, and two episodes count their mean.
        let same = played(&[0.0, 0.0, 1.0, 1.0, 7.0, 7.0], &[0.5, -1.0]);
        assert_eq!(distance(&demonstration, &[one, same]).unwrap(), 2.0);
        // An episode that ends early is compared as far as it goes.
        let short = played(&[3.0, 4.0, 0.0, 0.0], &[-0.5]);
        assert_eq!(distance(&demonstration, &[short]).unwrap(), 6.0);
    }

    #[test]
    fn no_episode_or_another_size_is_told() {
        let demonstration = Demonstration::new(rows(&[0.0], 1), rows(&[0.5], 1)).unwrap();
        assert!(distance(&demonstration, &[]).unwrap_err().is_bad_input());
        let other = played(&[0.0; 4], &[0.0]);
        let error = distance(&demonstration, &[other]).unwrap_err();
        assert!(error.to_string().contains("has 1 observations and 1 actions a step"), "{error}");
    }
}
