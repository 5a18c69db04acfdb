//! Smoothness by frequencies: the spectral arc length of the speed (Balasubramanian and others 2015), and the share of the power
//! spectral density that is fast. Both are in use to score demonstrations.
//!
//! What we simplify is what [`super::jerk()`] simplifies: nobody tells us which observations are positions, so the speed is that
//! of all observations that vary, each in units of its standard deviation over the set, and a time is a control step.
//! Length, noise of sensors and impacts that the task asks for all count.

use super::standard_observations;
use crate::basics::error::Result;
use crate::data::demonstration::DemonstrationSet;
use crate::math::rows::Rows;
use crate::math::smoothness;

/// Steps of which a spectrum says something.
const NEEDED: usize = 4;

/// Minus the arc length of the spectrum of its speed; nothing to say where a demonstration has fewer than 4 steps or stands still.
pub fn arc_length(set: &DemonstrationSet) -> Result<Option<Vec<f64>>> {
    let tables = standard_observations(set);
    let of = |table: &Rows| enough(table).then(|| smoothness::spectral_arc_length(&speeds(table))).flatten();
    Ok(tables.iter().map(of).collect())
}

/// Minus the share of its power at periods of less than eight steps; nothing to say where a demonstration has fewer than 4 steps
/// or stands still.
pub fn fast_power(set: &DemonstrationSet) -> Result<Option<Vec<f64>>> {
    let tables = standard_observations(set);
    Ok(tables
        .iter()
        .map(|table| if enough(table) { fast_share(table).map(|share| -share) } else { None })
        .collect())
}

fn enough(table: &Rows) -> bool {
    table.len() >= NEEDED && table.width() > 0
}

/// From step to step, the length of the difference of all columns.
fn speeds(table: &Rows) -> Vec<f64> {
    let speed = |step: usize| {
        let pairs = table.row(step).iter().zip(table.row(step + 1));
        pairs.map(|(one, next)| f64::from(next - one).powi(2)).sum::<f64>().sqrt()
    };
    (0..table.len() - 1).map(speed).collect()
}

fn fast_share(table: &Rows) -> Option<f64> {
    let column = |column: usize| table.iter().map(|row| f64::from(row[column])).collect::<Vec<_>>();
    let powers = (0..table.width()).map(|index| smoothness::fast_power(&column(index)));
    let (fast, all) = powers.fold((0.0, 0.0), |sum, power| (sum.0 + power.0, sum.1 + power.1));
    (all > 0.0).then_some(fast / all)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

    use super::*;
    use crate::data::demonstration::Demonstration;

    #[test]
    fn the_shaky_one_is_lower_by_both() {
        let of = |shake: f32| {
            let motion = |step: u8| {
                let step = f32::from(step);
                [(0.1 * step).sin() + shake * (2.5 * step).sin(), 3.0]
            };
            let observations = Rows::from_flat((0..64).flat_map(motion).collect(), 2).unwrap();
            Demonstration::new(observations, Rows::from_flat(vec![0.0; 64], 1).unwrap()).unwrap()
        };
        let set = DemonstrationSet::new(vec![of(0.0), of(0.1)]).unwrap();
        for found in [arc_length(&set), fast_power(&set)] {
            let found = found.unwrap().unwrap();
            assert!(found[1] < found[0] && found[0] < 0.0, "{found:?}");
        }
    }

    #[test]
    fn who_stands_still_has_no_spectrum() {
        let rows = |values: &[f32]| Rows::from_flat(values.to_vec(), 1).unwrap();
        let of = |values: &[f32]| Demonstration::new(rows(values), rows(&vec![0.0; values.len()])).unwrap();
        let set = DemonstrationSet::new(vec![of(&[1.0; 8]), of(&[1.0, 2.0, 3.0, 5.0])]).unwrap();
        assert_eq!((arc_length(&set).unwrap(), fast_power(&set).unwrap()), (None, None));
    }
}
