//! From the numbers of a set to those of the task.

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
