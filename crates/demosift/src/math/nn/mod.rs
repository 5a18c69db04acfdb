//! Small networks on flat parameter vectors: forward, derivatives backward (vjp) and forward (jvp), and what they need.
//!
//! These are our own because they are many times faster at our sizes than the libraries: a control step is 25 µs of
//! physics, so a learner must not cost milliseconds of bookkeeping.
//! Everything is one thread; demonstrations and trajectories are what runs in parallel.
//! Loops over elements are compiled for several instruction sets and the best one is chosen at run time.

pub(crate) mod adam;
#[cfg(test)]
pub(crate) mod check;
pub(crate) mod elementwise;
pub mod gaussian;
pub(crate) mod lstm;
pub(crate) mod mlp;
pub(crate) mod product;
pub(crate) mod real;

pub use adam::Adam;
pub use elementwise::{sigmoid_in_place, softplus_in_place};
pub use lstm::{Lstm, LstmLayout, LstmTape};
pub use mlp::{LayerLayout, Mlp, Tape};
pub use real::Real;
