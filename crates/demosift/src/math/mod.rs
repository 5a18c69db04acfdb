//! Numbers without a meaning yet: rows, small networks, solvers, statistics and how far rankings agree.

pub mod agreement;
pub mod arithmetic;
pub mod nn;
pub mod rows;
pub mod smoothness;
pub mod solve;
pub mod statistics;
