//! What is recorded: trajectories, and demonstrations in the formats of several tools.

pub mod demonstration;
pub mod likeness;
pub mod observation_filter;
pub mod trajectory;
pub mod weights;
