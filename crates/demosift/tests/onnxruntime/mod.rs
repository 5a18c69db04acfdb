//! Plays policies in onnxruntime, if there is one; the tests of the command use this too.

use std::path::{Path, PathBuf};
use std::process::Command;

/// The folder into which `cargo xtask test` puts onnxruntime; `None`, and why is said, if it did not.
pub(crate) fn packages() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../.python");
    let is_there = folder.join("onnxruntime").is_dir();
    if !is_there {
        eprintln!("skipped: there is no onnxruntime in {}; `cargo xtask test` fetches it", folder.display());
    }
    is_there.then_some(folder)
}

/// What onnxruntime makes of the observations: actions and controls, row after row.
pub(crate) fn played(packages: &Path, name: &str, model: &[u8], observations: &[f32]) -> [Vec<f32>; 2] {
    let folder = std::env::temp_dir().join(format!("demosift-onnx-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = |name: &str| folder.join(name);
    std::fs::write(file("policy.onnx"), model).unwrap();
    let bytes: Vec<u8> = observations.iter().flat_map(|value| value.to_le_bytes()).collect();
    std::fs::write(file("observations"), bytes).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../demosift/tests/references/play_onnx.py");
    let output = Command::new("python3")
        .arg(script)
        .args(["policy.onnx", "observations", "actions", "controls"].map(file))
        .env("PYTHONPATH", packages)
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |name: &str| {
        let bytes = std::fs::read(file(name)).unwrap();
        bytes.chunks_exact(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect()
    };
    let outputs = ["actions", "controls"].map(read);
    std::fs::remove_dir_all(&folder).unwrap();
    outputs
}
