//! Solvers: conjugate gradient, backtracking line search, ridge regression.

mod conjugate_gradient;
mod line_search;
mod ridge;

pub use conjugate_gradient::conjugate_gradient;
pub use line_search::backtrack;
pub use ridge::ridge;
pub(crate) use ridge::{NormalEquations, ridge_columns};
