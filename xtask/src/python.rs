//! The onnxruntime with which a test plays policies. Without it the test says that it was skipped, so nothing here fails.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::rendering::succeeds;

const VERSION: &str = "1.31.0";

/// Puts onnxruntime and what it needs into the checkout's `.python`, or says that it is missing.
pub(crate) fn set_up(root: &Path) {
    let folder = root.join(".python");
    if works(&folder) {
        return;
    }
    println!("Fetching onnxruntime {VERSION} ...");
    let scratch = root.join(format!(".python-{}", std::process::id()));
    let fetched = succeeds(
        Command::new("python3")
            .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-input"])
            .args(["--only-binary=:all:", "--target"])
            .arg(&scratch)
            .arg(format!("onnxruntime=={VERSION}")),
    );
    let installed = fetched && {
        // What is there is of another version, or for another Python.
        let _ = fs::remove_dir_all(&folder);
        fs::rename(&scratch, &folder).is_ok() && works(&folder)
    };
    let _ = fs::remove_dir_all(&scratch);
    if !installed {
        println!(
            "Policies are not played in onnxruntime: it is missing. By hand: python3 -m pip install --target {} onnxruntime=={VERSION}",
            folder.display()
        );
    }
}

/// Whether this Python can use what is in the folder, and it is the right version.
fn works(folder: &Path) -> bool {
    let check = format!("import onnxruntime; assert onnxruntime.__version__ == '{VERSION}'");
    succeeds(
        Command::new("python3")
            .args(["-c", &check])
            .env("PYTHONPATH", folder)
            .env("PYTHONDONTWRITEBYTECODE", "1"),
    )
}
