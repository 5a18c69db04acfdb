//! Which demonstrations should your agent learn from?
//!
//! demosift answers by trying: it meta-learns a policy that imitates any demonstration of a noisy set within a few
//! updates, lets it imitate each one, and scores what comes out with the task's own heuristic.
//!
//! The method is that of "Learning from noisy demonstration sets via meta-learned suitability assessor"; sections,
//! equations and algorithms in this documentation are those of that paper.

pub mod adapt;
pub mod advantage;
pub mod artifact;
pub mod demonstration;
pub mod demonstrator;
pub mod environment;
pub mod error;
pub mod experiment;
pub mod files;
pub mod gail;
pub mod heuristic;
pub mod imitate;
pub mod judge;
pub mod ledger;
pub mod meta_train;
pub mod metrics;
pub mod nn;
pub mod observation_filter;
pub mod observer;
pub mod point_mass;
pub mod policy;
pub mod preset;
pub mod rollout;
pub mod rows;
pub mod seed;
pub mod select;
pub mod solve;
pub mod trajectory;
pub mod trpo;

pub use error::{Error, Result};
