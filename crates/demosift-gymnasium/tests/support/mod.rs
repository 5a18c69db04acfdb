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

/// The same interpreter with the stand-in for robosuite.
pub(crate) fn interpreter_with_stand_in() -> Option<PathBuf> {
    static INTERPRETER: OnceLock<Option<PathBuf>> = OnceLock::new();
    let find = || interpreter().and_then(|_| script("-robosuite", &[packages(), stand_in()]));
    INTERPRETER.get_or_init(find).clone()
}

/// The folder of the stand-in for robosuite, and what records episodes of it.
pub(crate) fn stand_in() -> PathBuf {
    environments().with_file_name("").join("../stand_in")
}

/// What finds the packages that `cargo xtask test` fetched; `None`, and why is said, if it did not.
pub(crate) fn interpreter() -> Option<PathBuf> {
    static INTERPRETER: OnceLock<Option<PathBuf>> = OnceLock::new();
    INTERPRETER.get_or_init(find).clone()
}

fn packages() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../.python")
}

/// An interpreter that finds what lies in these folders.
fn script(name: &str, folders: &[PathBuf]) -> Option<PathBuf> {
    let script = std::env::temp_dir().join(format!("demosift-python{name}-{}", std::process::id()));
    let folders: Vec<String> = folders.iter().map(|folder| folder.display().to_string()).collect();
    // One process, as with an interpreter itself.
    let text = format!(
        "#!/bin/sh\nexport PYTHONPATH='{}' PYTHONDONTWRITEBYTECODE=1\nexec python3 \"$@\"\n",
        folders.join(":")
    );
    fs::write(&script, text).unwrap();
    fs::set_permissions(&script, fs::Permissions::from_mode(0o755)).unwrap();
    Some(script)
}

fn find() -> Option<PathBuf> {
    let script = script("", &[packages()])?;
    let works = Command::new(&script).args(["-c", "import gymnasium, numpy"]).output();
    if works.is_ok_and(|output| output.status.success()) {
        return Some(script);
    }
    eprintln!("skipped: there is no gymnasium in {}; `cargo xtask test` fetches it", packages().display());
    None
}
