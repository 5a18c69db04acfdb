//! `cargo xtask fuzz`: each target of `fuzz/` for a minute, by the pinned compiler and without other tools.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::Failure;

/// Tells libFuzzer which code was reached, and makes a wrong sum a panic.
const FLAGS: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
                     -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
                     -Cdebug-assertions=on -Coverflow-checks=on --cfg fuzzing";

/// Named, so that scripts of builds, which run here, are not compiled with these flags.
const TARGET: &str = "x86_64-unknown-linux-gnu";

/// Each target with a file to begin from, below the tests of formats or of the targets.
const SEEDS: [(&str, &str); 12] = [
    ("robomimic", "crates/demosift/tests/formats/robomimic.hdf5"),
    ("d4rl", "data/free_throw_8/demonstrations.hdf5"),
    ("minari_hdf5", "crates/demosift/tests/formats/minari_hdf5/data/main_data.hdf5"),
    ("baselines_npz", "crates/demosift/tests/formats/baselines.npz"),
    ("imitation_npz", "crates/demosift/tests/formats/imitation.npz"),
    ("lerobot_v3", "crates/demosift/tests/formats/lerobot_v3/data/chunk-000/file-000.parquet"),
    ("lerobot_v2", "crates/demosift/tests/formats/lerobot_v2/data/chunk-000/episode_000001.parquet"),
    ("minari_parquet", "crates/demosift/tests/formats/minari_parquet/data/1/part-0.parquet"),
    ("lerobot_info", "crates/demosift/tests/formats/lerobot_v3/meta/info.json"),
    ("minari_metadata", "crates/demosift/tests/formats/minari_parquet/data/metadata.json"),
    ("results", "fuzz/seeds/ranking.json"),
    ("edits", "crates/demosift/tests/formats/robomimic.hdf5"),
];

/// Builds the targets and runs each for so many seconds, in a folder of its own below `target/fuzz`.
pub(crate) fn run(root: &Path, seconds: &str) -> Result<(), Failure> {
    let built = root.join("target/fuzz");
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let arguments = ["build", "--release", "--manifest-path", "fuzz/Cargo.toml", "--target", TARGET];
    done(
        Command::new(cargo)
            .args(arguments)
            .current_dir(root)
            .env("CARGO_TARGET_DIR", &built)
            .env("RUSTFLAGS", FLAGS),
    )?;
    for (target, seed) in SEEDS {
        let corpus = built.join("corpus").join(target);
        fs::create_dir_all(&corpus)
            .and_then(|()| fs::copy(root.join(seed), corpus.join("seed")))
            .map_err(|error| format!("cannot copy {seed}: {error}"))?;
        println!("\n{target}");
        let limits = ["-rss_limit_mb=1024", "-timeout=10", "-max_len=60000", "-print_final_stats=1"];
        let binary = built.join(TARGET).join("release").join(target);
        done(Command::new(binary).arg(&corpus).args(limits).arg(format!("-max_total_time={seconds}")))?;
    }
    Ok(())
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
