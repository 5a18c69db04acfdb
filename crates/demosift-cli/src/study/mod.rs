//! Studies: their files, their folders of cells, the experiments that come with demosift and their pages.

pub(crate) mod experiments;
pub(crate) mod in_short;
mod numbers;
pub(crate) mod reproduce_page;
pub(crate) mod study_cells;
pub(crate) mod study_file;
pub(crate) mod study_folder;
