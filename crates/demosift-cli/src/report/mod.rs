//! The report as a page: what is on it, and how it is put into one file.

pub(crate) mod page;
pub(crate) mod replay;
