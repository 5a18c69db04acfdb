//! What every other band may use: errors, random numbers, progress, and how results are kept.

pub mod counting;
pub(crate) mod error;
pub mod files;
pub mod ledger;
pub mod names;
pub mod observer;
pub mod part;
pub mod rounding;
pub mod seal;
pub mod seed;
