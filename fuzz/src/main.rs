//! libFuzzer's entry: the target that the environment variable `DEMOSIFT_FUZZ` names.
#![no_main]

use std::sync::LazyLock;

use demosift_fuzz::{TARGETS, Target};

static CHOSEN: LazyLock<&Target> = LazyLock::new(|| {
    let name = std::env::var("DEMOSIFT_FUZZ").unwrap_or_default();
    let known: Vec<&str> = TARGETS.iter().map(|target| target.name).collect();
    let found = TARGETS.iter().find(|target| target.name == name);
    found.unwrap_or_else(|| panic!("DEMOSIFT_FUZZ is '{name}'; there are: {}", known.join(", ")))
});

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| (CHOSEN.run)(bytes));
