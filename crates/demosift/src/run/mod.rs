//! The whole flow as one function, what it will cost, its presets, and studies of how well it judges.

pub mod experiment;
pub mod forecast;
pub mod preset;
pub mod study;
