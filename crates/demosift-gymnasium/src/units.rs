//! Actions in the environment's own unit, and in that of a policy, for which −1 and 1 are the ends of what is possible.

use demosift::Result;
use demosift::data::demonstration::{Demonstration, DemonstrationSet};
use demosift::math::rows::Rows;

/// The affine map between the two, one number of an action each.
///
/// ```
/// use demosift_gymnasium::units::Units;
///
/// let units = Units::new(&[[-2.0, 2.0], [0.0, 5.0]]);
/// let mut own = [0.0; 2];
/// units.to_own(&[0.5, -3.0], &mut own);
/// assert_eq!(own, [1.0, 0.0], "the second is clipped");
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Units {
    bounds: Vec<[f64; 2]>,
}

impl Units {
    /// From the bounds of each number of an action, which are finite and differ.
    pub fn new(bounds: &[[f64; 2]]) -> Self {
        Self { bounds: bounds.to_vec() }
    }

    /// Bounds of each number in the environment's own unit.
    pub fn bounds(&self) -> &[[f64; 2]] {
        &self.bounds
    }

    /// An action of a policy `[act]`, clipped to [−1, 1], in the environment's own unit.
    pub fn to_own(&self, action: &[f32], own: &mut [f64]) {
        for ((own, action), [low, high]) in own.iter_mut().zip(action).zip(&self.bounds) {
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
            *own = (middle + half * f64::from(action.clamp(-1.0, 1.0))).clamp(*low, *high);
        }
    }

    /// Actions of a policy `[T, act]` as they are recorded: clipped, in the environment's own unit.
    ///
    /// # Errors
    /// None that a caller could cause: the size of an action is that of the bounds.
    pub fn own_rows(&self, actions: &Rows) -> Result<Rows> {
        let mut own = vec![0.0; self.bounds.len()];
        let mut numbers = Vec::with_capacity(actions.flat().len());
        for action in actions.iter() {
            self.to_own(action, &mut own);
            numbers.extend(own.iter().map(|number| *number as f32));
        }
        Rows::from_flat(numbers, self.bounds.len())
    }

    /// Recorded actions `[T, act]` as a policy would act; what lies beyond the bounds lies beyond [−1, 1].
    ///
    /// # Errors
    /// None that a caller could cause: the size of an action is that of the bounds.
    pub fn of_policy(&self, own: &Rows) -> Result<Rows> {
        let scaled = own.iter().flat_map(|row| {
            row.iter().zip(&self.bounds).map(|(own, [low, high])| {
                let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
                ((f64::from(*own) - middle) / half) as f32
            })
        });
        Rows::from_flat(scaled.collect(), self.bounds.len())
    }

    /// A set that was recorded in the environment's own unit, with actions as a policy would act.
    ///
    /// A set whose actions have another size is returned as it is, for whoever says that it does not fit.
    ///
    /// # Errors
    /// `is_bad_input` if a number is not finite.
    pub fn set_of_policy(&self, set: &DemonstrationSet) -> Result<DemonstrationSet> {
        if set.action_size() != self.bounds.len() {
            return Ok(set.clone());
        }
        let demonstrations = set.iter().map(|(_, demonstration)| {
            Demonstration::new(demonstration.observations().clone(), self.of_policy(demonstration.actions())?)
        });
        DemonstrationSet::chosen(set.ids(), demonstrations.collect::<Result<_>>()?)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn both_ways_are_inverse_and_bounds_of_one_change_no_bit() {
        let units = Units::new(&[[-0.4, 0.4], [0.0, 5.0], [-1.0, 1.0]]);
        let recorded = Rows::from_flat(vec![0.4, 0.0, 1e-10, -0.1, 2.5, 0.7], 3).unwrap();
        let scaled = units.of_policy(&recorded).unwrap();
        assert_eq!(scaled.row(0), [1.0, -1.0, 1e-10]);
        assert_eq!(scaled.row(1), [-0.25, 0.0, 0.7]);
        let mut own = [0.0; 3];
        units.to_own(scaled.row(1), &mut own);
        let wanted = [-0.1, 2.5, f64::from(0.7f32)];
        assert!(own.iter().zip(wanted).all(|(own, wanted)| (own - wanted).abs() < 1e-7), "{own:?}");
        assert_eq!(own[2], f64::from(0.7f32));
        assert_eq!(units.of_policy(&units.own_rows(&scaled).unwrap()).unwrap(), scaled);
    }

    #[test]
    fn a_set_of_another_size_is_left_to_whoever_says_so() {
        let rows = |width| Rows::from_flat(vec![0.5; 2 * width], width).unwrap();
        let set = DemonstrationSet::new(vec![Demonstration::new(rows(3), rows(2)).unwrap(); 2]).unwrap();
        assert_eq!(Units::new(&[[-2.0, 2.0]]).set_of_policy(&set).unwrap(), set);
        let scaled = Units::new(&[[-2.0, 2.0], [0.0, 1.0]]).set_of_policy(&set).unwrap();
        assert_eq!(scaled.iter().next().unwrap().1.actions().row(0), [0.25, 0.0]);
    }
}
