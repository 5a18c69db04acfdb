//! From the numbers of a set to those of the task.

use crate::basics::counting::counted;
use crate::basics::error::{Error, Result};
use crate::math::rows::Rows;

/// How the numbers of a set become those of the task; by default they are those.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Conversion {
    pub(super) observations: Option<Affine>,
    pub(super) actions: Option<Affine>,
}

/// Each number of the task: one of the set, times a factor, plus a shift.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Affine(pub(super) Vec<Term>);

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Term {
    /// Its place in the set.
    pub(super) from: usize,
    pub(super) factor: f64,
    pub(super) shift: f64,
}

impl Conversion {
    /// Whether all numbers stay as they are.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Observations `[T, recorded]` as the task has them, `[T, obs]`.
    ///
    /// # Panics
    /// If the rows have another width than was said: a bug of the caller.
    pub fn observations(&self, recorded: &Rows) -> Rows {
        self.observations.as_ref().map_or_else(|| recorded.clone(), |affine| affine.apply(recorded))
    }

    /// Actions `[T, recorded]` as the task takes them, `[T, act]`.
    ///
    /// # Panics
    /// As [`Conversion::observations`].
    pub fn actions(&self, recorded: &Rows) -> Rows {
        self.actions.as_ref().map_or_else(|| recorded.clone(), |affine| affine.apply(recorded))
    }

    /// One action `[recorded]` as the task takes it, `[act]`, with all its bits.
    ///
    /// # Panics
    /// As [`Conversion::observations`].
    pub fn action(&self, recorded: &[f64]) -> Vec<f64> {
        let Some(Affine(terms)) = &self.actions else { return recorded.to_vec() };
        terms.iter().map(|term| term.factor * recorded[term.from] + term.shift).collect()
    }

    /// The same with actions in a unit in which −1 and 1 of the task are these bounds, `[act]`; an action of the set has
    /// `acted` numbers.
    ///
    /// # Errors
    /// `is_bad_input` if there are other bounds than numbers that the task takes.
    pub fn in_unit_of(self, bounds: &[[f64; 2]], acted: usize) -> Result<Self> {
        let as_they_are = || Affine((0..acted).map(|from| Term { from, factor: 1.0, shift: 0.0 }).collect());
        let Affine(mut terms) = self.actions.unwrap_or_else(as_they_are);
        if terms.len() != bounds.len() {
            return Err(Error::bad_input(format!(
                "an action of the set has {}, and the environment takes {}",
                counted(terms.len(), "number"),
                bounds.len()
            )));
        }
        for (term, [low, high]) in terms.iter_mut().zip(bounds) {
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
            *term = Term { factor: half * term.factor, shift: half * term.shift + middle, ..*term };
        }
        Ok(Self { actions: Some(Affine(terms)), ..self })
    }
}

impl Affine {
    fn apply(&self, recorded: &Rows) -> Rows {
        let mut made = Rows::with_capacity(self.0.len(), recorded.len());
        let mut row = vec![0.0; self.0.len()];
        for from in recorded.iter() {
            for (to, term) in row.iter_mut().zip(&self.0) {
                *to = (term.factor * f64::from(from[term.from]) + term.shift) as f32;
            }
            made.push(&row);
        }
        made
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

    use super::*;

    #[test]
    fn actions_of_a_policy_become_those_of_an_environment() {
        let taken = Conversion::default().in_unit_of(&[[-2.0, 2.0], [0.0, 10.0]], 2).unwrap();
        assert_eq!(taken.action(&[0.1, -1.0]), [0.2, 0.0], "in 64 bits");
        let rows = Rows::from_flat(vec![0.5, 0.5], 2).unwrap();
        assert_eq!(taken.actions(&rows).flat(), [1.0, 7.5]);
        assert_eq!(taken.observations(&rows).flat(), [0.5, 0.5]);
        let swapped = Affine([1, 0].map(|from| Term { from, factor: -1.0, shift: 0.0 }).to_vec());
        let swapped = Conversion { actions: Some(swapped), ..Conversion::default() };
        let taken = swapped.in_unit_of(&[[-2.0, 2.0], [0.0, 10.0]], 2).unwrap();
        assert_eq!(taken.action(&[1.0, 0.5]), [-1.0, 0.0]);
        let error = Conversion::default().in_unit_of(&[[-1.0, 1.0]], 2).unwrap_err();
        assert!(error.is_bad_input() && error.to_string().contains("2 numbers"), "{error}");
    }
}
