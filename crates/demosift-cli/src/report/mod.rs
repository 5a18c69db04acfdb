//! Pages: the report of a run and the look at a set; what is on them, and how each is put into one file.

pub(crate) mod looks;
pub(crate) mod page;
pub(crate) mod replay;
