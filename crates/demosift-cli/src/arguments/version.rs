//! Which demosift this is, and which MuJoCo it found.

use std::sync::LazyLock;

static SHOWN: LazyLock<String> =
    LazyLock::new(|| format!("{} (MuJoCo {})", env!("CARGO_PKG_VERSION"), demosift_mujoco::mujoco_version()));

/// What `demosift --version` says behind the name.
pub(crate) fn shown() -> &'static str {
    &SHOWN
}
