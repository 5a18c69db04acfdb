//! Where policies play and how an episode is scored.

pub(crate) mod adapted_behaviors;
pub mod environment;
pub mod fold;
pub mod heuristic;
pub mod point_mass;
pub mod policy;
pub mod rollout;
pub mod trainer;
