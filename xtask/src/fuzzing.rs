//! `cargo xtask fuzz`: each target of `fuzz/` for a minute, by the pinned compiler and without other tools.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::Failure;

/// Tells libFuzzer which code was reached, and makes a wrong sum a panic.
const FLAGS: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
                     -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
                     -Cdebug-assertions=on -Coverflow-checks=on --cfg fuzzing";

/// Named, so that scripts of builds, which run here, are not compiled with these flags.
const TARGET: &str = "x86_64-unknown-linux-gnu";

/// Of memory in MB and time in seconds for one input, and of an input in bytes.
const LIMITS: [&str; 4] = ["-rss_limit_mb=1024", "-timeout=10", "-max_len=60000", "-print_final_stats=1"];

/// Which targets, and for how long each.
struct Asked {
    seconds: String,
    targets: Vec<String>,
}

/// Builds the targets and runs those that are asked for, all if none is, in a folder below `target/fuzz`.
pub(crate) fn run(root: &Path, options: &[&str]) -> Result<(), Failure> {
    let Asked { seconds, targets } = asked(root, options)?;
    let built = root.join("target/fuzz");
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let package =
        ["build", "--release", "--package", "demosift-fuzz", "--features", "fuzzing", "--bin", "fuzz"];
    done(
        Command::new(cargo)
            .args(package)
            .args(["--target", TARGET])
            .current_dir(root)
            .env("CARGO_TARGET_DIR", &built)
            .env("RUSTFLAGS", FLAGS),
    )?;
    for target in targets {
        let corpus = corpus(root, &built, &target)
            .map_err(|error| format!("cannot copy the seeds of {target}: {error}"))?;
        println!("\n{target}");
        // What is found lies in the folder of the target, beside its corpus.
        let binary = built.join(TARGET).join("release/fuzz");
        let limits = LIMITS.map(str::to_owned).into_iter().chain([format!("-max_total_time={seconds}")]);
        done(
            Command::new(binary)
                .arg("corpus")
                .args(limits)
                .current_dir(&corpus)
                .env("DEMOSIFT_FUZZ", &target),
        )?;
    }
    Ok(())
}

/// `[--seconds N] [TARGET …]`; a target is a folder of `fuzz/seeds`.
fn asked(root: &Path, options: &[&str]) -> Result<Asked, Failure> {
    let known = targets(root).map_err(|error| format!("cannot list fuzz/seeds: {error}"))?;
    let (seconds, named) = match options {
        ["--seconds", seconds, named @ ..] => (*seconds, named),
        named => ("60", named),
    };
    if let Some(unknown) = named.iter().find(|name| !known.iter().any(|known| known == *name)) {
        let message = format!("error: there is no target '{unknown}'; there are: {}", known.join(", "));
        return Err(Failure { message, code: 2 });
    }
    if seconds.parse::<u32>().is_err() {
        return Err(Failure {
            message: format!("error: --seconds {seconds}: wanted a whole number"),
            code: 2,
        });
    }
    let targets = if named.is_empty() { known } else { named.iter().map(ToString::to_string).collect() };
    Ok(Asked { seconds: seconds.to_owned(), targets })
}

fn targets(root: &Path) -> std::io::Result<Vec<String>> {
    let folders = fs::read_dir(root.join("fuzz/seeds"))?;
    let mut names = folders
        .map(|folder| Ok(folder?.file_name().to_string_lossy().into_owned()))
        .collect::<std::io::Result<Vec<String>>>()?;
    names.sort();
    Ok(names)
}

/// The folder of a target, with what it begins from in `corpus`, beside what earlier runs have put there.
fn corpus(root: &Path, built: &Path, target: &str) -> std::io::Result<PathBuf> {
    let folder = built.join("found").join(target);
    let corpus = folder.join("corpus");
    fs::create_dir_all(&corpus)?;
    for seed in fs::read_dir(root.join("fuzz/seeds").join(target))? {
        let seed = seed?;
        fs::copy(seed.path(), corpus.join(seed.file_name()))?;
    }
    Ok(folder)
}

fn done(command: &mut Command) -> Result<(), Failure> {
    let shown = format!("{command:?}");
    let status = command.status().map_err(|error| format!("cannot run {shown}: {error}"))?;
    if status.success() {
        Ok(())
    } else {
        Err(Failure { message: format!("error: {shown} failed"), code: 1 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_are_chosen_by_name() {
        let root = crate::checkout();
        let all = asked(&root, &[]).ok().expect("all");
        assert!(all.seconds == "60" && all.targets.len() > 20, "{:?}", all.targets);
        let two = asked(&root, &["--seconds", "5", "tasks", "d4rl"]).ok().expect("two");
        assert_eq!((two.seconds.as_str(), two.targets), ("5", vec!["tasks".to_owned(), "d4rl".to_owned()]));
        for (wrong, said) in
            [(&["nothing"][..], "there are: aloha, "), (&["--seconds", "soon"], "whole number")]
        {
            let failure = asked(&root, wrong).err().expect("wrong");
            assert!(failure.code == 2 && failure.message.contains(said), "{}", failure.message);
        }
    }
}
