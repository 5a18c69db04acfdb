//! Which demonstrations should your agent learn from?
//!
//! demosift answers by trying: it meta-learns a policy that imitates any demonstration of a noisy set within a few
//! updates, lets it imitate each one, and scores what comes out with the task's own heuristic.
//!
//! The method is that of "Learning from noisy demonstration sets via meta-learned suitability assessor"; sections,
//! equations and algorithms in this documentation are those of that paper.

pub mod demonstration;
pub mod environment;
pub mod error;
pub mod files;
pub mod heuristic;
pub mod observer;
pub mod rows;
pub mod seed;
pub mod trajectory;

pub use error::{Error, Result};
