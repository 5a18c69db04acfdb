//! The packages with which tests play policies (onnxruntime) and environments (Gymnasium). Without them these tests say that they
//! were skipped, so nothing here fails.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::rendering::succeeds;

/// A package as Python imports it and as it is installed.
struct Package {
    module: &'static str,
    version: &'static str,
    requirement: &'static str,
}

const PACKAGES: [Package; 3] = [
    Package { module: "onnxruntime", version: "1.31.0", requirement: "onnxruntime==1.31.0" },
    Package { module: "gymnasium", version: "1.4.0", requirement: "gymnasium[mujoco]==1.4.0" },
    // Not the newest, which Gymnasium would take; it need not be that of demosift.
    Package { module: "mujoco", version: "3.17.0", requirement: "mujoco==3.17.0" },
];

/// Puts the packages and what they need into the checkout's `.python`, or says that they are missing.
pub(crate) fn set_up(root: &Path) {
    let folder = root.join(".python");
    if works(&folder) {
        return;
    }
    let requirements = PACKAGES.map(|package| package.requirement);
    println!("Fetching {} ...", requirements.join(", "));
    let scratch = root.join(format!(".python-{}", std::process::id()));
    let fetched = succeeds(
        Command::new("python3")
            .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-input"])
            .args(["--only-binary=:all:", "--target"])
            .arg(&scratch)
            .args(requirements),
    );
    let installed = fetched && {
        // What is there is of other versions, or for another Python.
        let _ = fs::remove_dir_all(&folder);
        fs::rename(&scratch, &folder).is_ok() && works(&folder)
    };
    let _ = fs::remove_dir_all(&scratch);
    if !installed {
        println!(
            "Policies and environments are not played in Python: packages are missing. By hand: python3 -m pip install --target \
             {} {}",
            folder.display(),
            requirements.join(" ")
        );
    }
}

/// Whether this Python can use what is in the folder, and it is of the right versions.
fn works(folder: &Path) -> bool {
    let check = |package: &Package| {
        format!("import {0}; assert {0}.__version__ == '{1}'", package.module, package.version)
    };
    let check = PACKAGES.each_ref().map(check).join("; ");
    succeeds(
        Command::new("python3")
            .args(["-c", &check])
            .env("PYTHONPATH", folder)
            .env("PYTHONDONTWRITEBYTECODE", "1"),
    )
}
