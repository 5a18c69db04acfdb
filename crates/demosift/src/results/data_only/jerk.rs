//! Jerk: practiced motion is smooth.
//!
//! Flash and Hogan 1985 ("The coordination of arm movements") found that practiced movements nearly minimize the squared
//! third derivative of position; cleaning tools score jerky episodes lower.
//!
//! What we simplify: nobody tells us which observations are positions, so the third difference is taken of every
//! observation that varies, each in units of its standard deviation over the set, and per control step rather than per
//! second; of a velocity it is one derivative further. Impacts that the task asks for count as jerk too.

use super::standard_observations;
use crate::basics::error::Result;
use crate::data::demonstration::DemonstrationSet;
use crate::math::rows::Rows;

/// Observations that a third difference needs.
const NEEDED: usize = 4;

/// Minus the root mean square of the third differences of the standardized observations; nothing to say where a
/// demonstration has fewer than 4 steps or no observation varies.
pub fn jerk(set: &DemonstrationSet) -> Result<Option<Vec<f64>>> {
    let tables = standard_observations(set);
    Ok(tables
        .iter()
        .map(|table| (table.len() >= NEEDED && table.width() > 0).then(|| -root_mean_square(table)))
        .collect())
}

/// Over all steps and columns, of x_{t+3} − 3 x_{t+2} + 3 x_{t+1} − x_t.
fn root_mean_square(table: &Rows) -> f64 {
    let squared = |step: usize| -> f64 {
        let column = |column: usize| {
            let at = |ahead: usize| f64::from(table.row(step + ahead)[column]);
            (at(3) - 3.0 * at(2) + 3.0 * at(1) - at(0)).powi(2)
        };
        (0..table.width()).map(column).sum()
    };
    let steps = table.len() + 1 - NEEDED;
    ((0..steps).map(squared).sum::<f64>() / (steps * table.width()) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::demonstration::Demonstration;

    fn set(motions: &[fn(f32) -> f32]) -> DemonstrationSet {
        let of = |motion: &fn(f32) -> f32| {
            let observations: Vec<f32> = (0..12).flat_map(|step| [motion(step as f32), 3.0]).collect();
            let actions = Rows::from_flat(vec![0.0; 12], 1).unwrap();
            Demonstration::new(Rows::from_flat(observations, 2).unwrap(), actions).unwrap()
        };
        DemonstrationSet::new(motions.iter().map(of).collect()).unwrap()
    }

    #[test]
    fn a_parabola_has_none_and_a_cubic_six_times_its_factor() {
        let table = Rows::from_flat((0..9).map(|step| 0.5 * (step * step) as f32).collect(), 1).unwrap();
        assert_eq!(root_mean_square(&table), 0.0);
        let table =
            Rows::from_flat((0..9).map(|step| 0.5 * (step * step * step) as f32).collect(), 1).unwrap();
        assert_eq!(root_mean_square(&table), 3.0);
    }

    #[test]
    fn the_shaky_one_is_lower_and_units_do_not_count() {
        let smooth = |step: f32| (0.3 * step).sin();
        let shaky = |step: f32| (0.3 * step).sin() + if step % 2.0 == 0.0 { 0.1 } else { -0.1 };
        let found = jerk(&set(&[smooth, shaky])).unwrap().unwrap();
        assert!(found[1] < 3.0 * found[0] && found[0] < 0.0, "{found:?}");
        let large = jerk(&set(&[
            |step| 1000.0 * (0.3 * step).sin(),
            |step| 1000.0 * (0.3 * step).sin() + if step % 2.0 == 0.0 { 100.0 } else { -100.0 },
        ]));
        let large = large.unwrap().unwrap();
        assert!(found.iter().zip(&large).all(|(a, b)| (a - b).abs() < 1e-4), "{found:?} {large:?}");
    }

    #[test]
    fn three_steps_say_nothing() {
        let rows = |values: &[f32]| Rows::from_flat(values.to_vec(), 1).unwrap();
        let of = |values: &[f32]| Demonstration::new(rows(values), rows(values)).unwrap();
        let set = DemonstrationSet::new(vec![of(&[1.0, 2.0, 3.0]), of(&[1.0, 2.0, 3.0, 5.0, 4.0])]).unwrap();
        assert_eq!(jerk(&set).unwrap(), None);
    }
}
