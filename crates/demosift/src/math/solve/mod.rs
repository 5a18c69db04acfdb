//! Solvers: conjugate gradient, backtracking line search, ridge regression.

pub mod conjugate_gradient;
pub mod line_search;
pub mod ridge;

pub use conjugate_gradient::conjugate_gradient;
pub use line_search::backtrack;
pub use ridge::ridge;
