//! What an episode looks like: pixels, sheets and clips of them, and the shapes from which others draw it.

pub mod film;
pub mod picture;
pub mod render;
pub mod scene;
