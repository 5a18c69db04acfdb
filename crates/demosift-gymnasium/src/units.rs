//! Actions in the environment's own unit, and in that of a policy, for which −1 and 1 are the ends of what is possible.

use demosift::Result;
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

    /// An action in the environment's own unit `[act]` as one of a policy: the inverse of [`to_own`](Units::to_own), clipped
    /// to [−1, 1].
    pub fn of_policy(&self, own: &[f64], action: &mut [f32]) {
        for ((action, own), [low, high]) in action.iter_mut().zip(own).zip(&self.bounds) {
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
            *action = ((own - middle) / half).clamp(-1.0, 1.0) as f32;
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
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use demosift::data::demonstration::set_file::{self, Ranges, SetFile, Unit};

    use super::*;

    /// Recorded actions are read as controls of a `set.toml` are, so these two must be inverse.
    #[test]
    fn what_is_recorded_is_read_back_as_the_policy_acted() {
        let bounds = [[-0.4, 0.4], [0.0, 5.0], [-1.0, 1.0]];
        let mut as_controls = SetFile::default();
        as_controls.actions.units = Some(set_file::Units::All(Unit::Controls));
        let ranges = Ranges { controls: &bounds, observations: &[] };
        let conversion = as_controls.conversion(0, 3, ranges).unwrap();

        let acted = Rows::from_flat(vec![1.0, -1.0, 1e-10, -0.25, 0.0, 0.7], 3).unwrap();
        let recorded = Units::new(&bounds).own_rows(&acted).unwrap();
        assert_eq!((recorded.row(0), recorded.row(1)), (&[0.4, 0.0, 1e-10][..], &[-0.1, 2.5, 0.7][..]));
        let read = conversion.actions(&recorded);
        assert!(
            read.flat().iter().zip(acted.flat()).all(|(read, acted)| (read - acted).abs() < 1e-6),
            "{read:?}"
        );
    }
}
