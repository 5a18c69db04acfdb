//! What the commands do after the set-up, one cargo call a step.

use crate::Failure;
use std::path::Path;
use std::process::Command;

/// The main job on the demonstrations of the repository; the output folder follows.
const DEMO: [&str; 8] =
    ["sift", "data/free_throw_8", "--task", "free_throw", "--preset", "quick", "--out", DEMO_OUT];
const DEMO_OUT: &str = "runs/demo";

const TEST: [&[&str]; 3] = [
    &["fmt", "--all", "--check"],
    &["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"],
    &["test", "--workspace"],
];

const BENCH: [&[&str]; 3] = [
    &["bench", "--package", "demosift", "--bench", "learner"],
    &["bench", "--package", "demosift-mujoco", "--bench", "playing"],
    &["bench", "--package", "demosift-mujoco", "--bench", "meta_update"],
];

/// Format, lints, tests and doctests.
pub(crate) fn test(root: &Path) -> Result<(), Failure> {
    TEST.iter().try_for_each(|arguments| cargo(root, arguments))
}

/// Builds for speed and runs [`DEMO`].
pub(crate) fn demo(root: &Path) -> Result<(), Failure> {
    let out = free_folder(root);
    let job = DEMO.map(|argument| if argument == DEMO_OUT { out.as_str() } else { argument });
    cargo(root, &["build", "--release"])?;
    cargo(root, &[&["run", "--release", "--quiet", "--bin", "demosift", "--"], &job[..]].concat())
}

/// Writes the schemas of `docs/schema`, which a test compares with the types otherwise.
pub(crate) fn schema(root: &Path) -> Result<(), Failure> {
    cargo_with(root, &["test", "--workspace", "--lib", "schema_tests"], &[("DEMOSIFT_WRITE_SCHEMAS", "1")])
}

/// The ratios of `docs/results`.
pub(crate) fn bench(root: &Path) -> Result<(), Failure> {
    BENCH.iter().try_for_each(|arguments| cargo(root, arguments))
}

/// Builds the command and tries to make it lose or misuse something, which `xtask/torture/torture.py` describes.
pub(crate) fn torture(root: &Path, options: &[&str]) -> Result<(), Failure> {
    cargo(root, &["build", "--package", "demosift-cli"])?;
    let script = ["xtask/torture/torture.py", "target/debug/demosift"];
    let status = Command::new("python3")
        .args(script)
        .args(options)
        .current_dir(root)
        .status()
        .map_err(|error| format!("cannot run python3: {error}"))?;
    match status.success() {
        true => Ok(()),
        false => Err(Failure { message: "error: the torture found failures".to_owned(), code: 1 }),
    }
}

/// The first of `runs/demo`, `runs/demo-2`, `runs/demo-3` … that does not exist: no run is written over.
fn free_folder(root: &Path) -> String {
    std::iter::once(DEMO_OUT.to_owned())
        .chain((2..).map(|number| format!("{DEMO_OUT}-{number}")))
        .find(|folder| !root.join(folder).exists())
        .expect("the numbers do not end")
}

/// Runs cargo in the checkout, where everybody sees it.
pub(crate) fn cargo(root: &Path, arguments: &[&str]) -> Result<(), Failure> {
    cargo_with(root, arguments, &[])
}

/// The same with environment variables.
fn cargo_with(root: &Path, arguments: &[&str], variables: &[(&str, &str)]) -> Result<(), Failure> {
    // The cargo that runs xtask, so that both use one toolchain.
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let shown = format!("cargo {}", arguments.join(" "));
    println!("\n$ {shown}");
    let status = Command::new(cargo)
        .args(arguments)
        .envs(variables.iter().copied())
        .current_dir(root)
        .status()
        .map_err(|error| format!("cannot run cargo: {error}"))?;
    if status.success() {
        return Ok(());
    }
    // A process that was killed by a signal has no code.
    let code = status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1);
    Err(Failure { message: format!("error: `{shown}` failed"), code })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_demo_never_writes_over_a_run() {
        let root = std::env::temp_dir().join(format!("xtask-demo-{}", std::process::id()));
        assert_eq!(free_folder(&root), "runs/demo");
        std::fs::create_dir_all(root.join("runs/demo")).unwrap();
        assert_eq!(free_folder(&root), "runs/demo-2");
        std::fs::create_dir_all(root.join("runs/demo-2")).unwrap();
        assert_eq!(free_folder(&root), "runs/demo-3");
        std::fs::remove_dir_all(&root).unwrap();
    }
}
