//! Numbers without a meaning yet: rows, small networks and solvers.

pub mod nn;
pub mod rows;
pub mod solve;
