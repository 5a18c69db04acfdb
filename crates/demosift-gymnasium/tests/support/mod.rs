//! A Python that has Gymnasium, if there is one; the tests of the command use this too.

#![allow(dead_code, reason = "each test file compiles this for itself and uses what it needs")]
#![allow(clippy::unwrap_used, clippy::print_stderr, reason = "a failed unwrap is a failed test")]

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The point mass and faulty variants of it.
pub(crate) fn environments() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../demosift-gymnasium/tests/environments/point.py")
}

/// What finds the packages that `cargo xtask test` fetched; `None`, and why is said, if it did not.
pub(crate) fn interpreter() -> Option<PathBuf> {
    static INTERPRETER: OnceLock<Option<PathBuf>> = OnceLock::new();
    INTERPRETER.get_or_init(find).clone()
}

fn find() -> Option<PathBuf> {
    let packages = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../.python");
    let script = std::env::temp_dir().join(format!("demosift-python-{}", std::process::id()));
    // One process, as with an interpreter itself.
    let text = format!(
        "#!/bin/sh\nexport PYTHONPATH='{}' PYTHONDONTWRITEBYTECODE=1\nexec python3 \"$@\"\n",
        packages.display()
    );
    fs::write(&script, text).unwrap();
    fs::set_permissions(&script, fs::Permissions::from_mode(0o755)).unwrap();
    let works = Command::new(&script).args(["-c", "import gymnasium, numpy"]).output();
    if works.is_ok_and(|output| output.status.success()) {
        return Some(script);
    }
    eprintln!("skipped: there is no gymnasium in {}; `cargo xtask test` fetches it", packages.display());
    None
}
