//! The steps of a run, each a free function from values to values.

pub mod demonstrator;
pub mod imitate;
pub mod judge;
pub mod meta_train;
pub mod method;
pub mod pre_train;
pub mod referee;
pub mod select;
pub mod subset_selection;
