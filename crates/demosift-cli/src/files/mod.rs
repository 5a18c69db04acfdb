//! How the files of a run are written: whole, alone, and beside what was measured.

pub(crate) mod event_file;
pub(crate) mod lock;
pub(crate) mod metrics_file;
pub(crate) mod picture_folder;
pub(crate) mod writing;
