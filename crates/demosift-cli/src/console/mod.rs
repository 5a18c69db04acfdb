//! The terminal: what is shown on it, and Ctrl-C.

pub(crate) mod interruption;
pub(crate) mod quoting;
pub(crate) mod terminal;
