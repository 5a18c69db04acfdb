//! Puts the command where a shell finds it, with a MuJoCo of its own, so that the checkout may go away.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::{Failure, USAGE, mujoco, steps};

/// Where the library lies below the folder that holds `bin`; `crates/demosift-cli/build.rs` writes this place into the command.
const LIBRARY_FOLDER: &str = "lib/demosift";

/// What was typed behind `install`.
#[derive(Debug, Default, PartialEq)]
struct Wanted {
    /// The folder that gets `bin` and `lib`.
    root: Option<PathBuf>,
    /// Built in a moment, and slow when it runs.
    debug: bool,
}

/// Installs the command. MuJoCo must be set up.
pub(crate) fn install(checkout: &Path, arguments: &[&str]) -> Result<(), Failure> {
    let wanted = wanted(arguments).ok_or_else(|| Failure { message: USAGE.to_owned(), code: 2 })?;
    let root = match wanted.root {
        Some(root) => root,
        None => cargos_folder(|variable| std::env::var_os(variable))
            .ok_or_else(|| "HOME is not set, so the folder must be given: --root DIR".to_owned())?,
    };
    // Cargo runs in the checkout, and a path that was typed is meant from where it was typed.
    let root = std::path::absolute(&root).map_err(|error| format!("{}: {error}", root.display()))?;
    let shown = root
        .to_str()
        .ok_or_else(|| format!("{} is not UTF-8; give another folder: --root DIR", root.display()))?;
    // The library first, so that there is never a command that cannot start.
    let library = root.join(LIBRARY_FOLDER);
    mujoco::copy_to(&library, checkout)?;
    let mut cargo = vec!["install", "--path", "crates/demosift-cli", "--locked", "--force", "--root", shown];
    if wanted.debug {
        cargo.push("--debug");
    }
    steps::cargo(checkout, &cargo)?;
    let command = root.join("bin").join("demosift");
    println!("\n{} is in {}", version_of(&command)?, command.display());
    println!("Its MuJoCo is in {}; this checkout is no longer needed for it.", library.display());
    println!("To remove both: cargo uninstall --root {shown} demosift-cli && rm -r {}", library.display());
    Ok(())
}

fn wanted(arguments: &[&str]) -> Option<Wanted> {
    let mut wanted = Wanted::default();
    let mut rest = arguments.iter();
    while let Some(argument) = rest.next() {
        match *argument {
            "--root" => wanted.root = Some(PathBuf::from(rest.next()?)),
            "--debug" => wanted.debug = true,
            other => wanted.root = Some(PathBuf::from(other.strip_prefix("--root=")?)),
        }
    }
    Some(wanted)
}

/// Where `cargo install` puts programs, as cargo finds it out itself.
fn cargos_folder(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    let set = |name| variable(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    set("CARGO_INSTALL_ROOT").or_else(|| set("CARGO_HOME")).or_else(|| Some(set("HOME")?.join(".cargo")))
}

/// What the command says of itself where nothing of the checkout's environment is left: that it starts.
fn version_of(command: &Path) -> Result<String, String> {
    let output = Command::new(command)
        .arg("--version")
        .env_clear()
        .output()
        .map_err(|error| format!("cannot run {}: {error}", command.display()))?;
    if !output.status.success() {
        let complaint = String::from_utf8_lossy(&output.stderr);
        return Err(format!("{} was installed but does not start: {}", command.display(), complaint.trim()));
    }
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;

    #[test]
    fn the_folder_may_be_given_in_both_ways() {
        let in_there = |debug| Some(Wanted { root: Some(PathBuf::from("there")), debug });
        assert_eq!(wanted(&[]), Some(Wanted::default()));
        assert_eq!(wanted(&["--root", "there"]), in_there(false));
        assert_eq!(wanted(&["--debug", "--root=there"]), in_there(true));
        for mistake in [["--root"].as_slice(), &["there"], &["--prefix", "there"]] {
            assert_eq!(wanted(mistake), None, "{mistake:?}");
        }
    }

    /// The command itself does not say where it looks, and beside a checkout it would find that of the checkout.
    #[test]
    fn the_command_looks_where_the_library_is_put() {
        let script = std::fs::read_to_string(crate::checkout().join("crates/demosift-cli/build.rs")).unwrap();
        assert!(script.contains(&format!("-rpath,$ORIGIN/../{LIBRARY_FOLDER}\"")), "{script}");
    }

    /// The order of the Cargo book, "cargo install", under "--root dir".
    #[test]
    fn without_it_the_folder_is_that_of_cargo_install() {
        let folder = |variables: &[(&str, &str)]| {
            cargos_folder(|wanted| {
                let found = variables.iter().find(|(name, _)| *name == wanted);
                found.map(|(_, value)| OsString::from(value))
            })
        };
        let (root, home) = (("CARGO_INSTALL_ROOT", "/root"), ("CARGO_HOME", "/cargo"));
        assert_eq!(folder(&[("HOME", "/home/me"), home, root]), Some(PathBuf::from("/root")));
        assert_eq!(folder(&[("HOME", "/home/me"), home, ("CARGO_INSTALL_ROOT", "")]), Some("/cargo".into()));
        assert_eq!(folder(&[("HOME", "/home/me")]), Some(PathBuf::from("/home/me/.cargo")));
        assert_eq!(folder(&[]), None);
    }
}
