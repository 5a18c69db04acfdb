//! The browser in which tests look at the report. Without it they say that they were skipped, so nothing here fails.

use std::process::Command;

use crate::rendering::{apt, is_root, succeeds};

const PACKAGE: &str = "chromium";

/// Installs it where that needs no question, else says that it is missing.
pub(crate) fn set_up() {
    if !cfg!(target_os = "linux") || succeeds(Command::new(PACKAGE).arg("--version")) {
        return;
    }
    let installed = is_root() && succeeds(Command::new("apt-get").arg("--version")) && {
        println!("Installing {PACKAGE} to look at the report ...");
        succeeds(apt().args(["update", "--quiet"]))
            && succeeds(apt().args(["install", "--quiet", "--yes", "--no-install-recommends", PACKAGE]))
    };
    if !installed {
        println!(
            "The report is not looked at in a browser: {PACKAGE} is missing. On Debian: apt-get install {PACKAGE}"
        );
    }
}
