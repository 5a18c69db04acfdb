//! Each target reads what it begins from and what was found once, which stays mended.

use std::fs;
use std::path::{Path, PathBuf};

use demosift_fuzz::TARGETS;

fn seeds() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("seeds")
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let found = fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut entries: Vec<PathBuf> =
        found.map(|entry| entry.expect("a folder of the repository").path()).collect();
    entries.sort();
    entries
}

#[test]
fn every_kept_file_is_read_or_refused() {
    for target in TARGETS {
        let files = entries(&seeds().join(target.name));
        assert!(!files.is_empty(), "{} begins from nothing", target.name);
        for file in files {
            let bytes = fs::read(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
            let end = std::thread::spawn(move || (target.run)(&bytes)).join();
            assert!(end.is_ok(), "{} panics on {}", target.name, file.display());
        }
    }
}

/// `cargo xtask fuzz` takes the names from the folders.
#[test]
fn every_folder_of_seeds_is_of_a_target() {
    let folders = entries(&seeds());
    let names: Vec<&str> = folders.iter().filter_map(|folder| folder.file_name()?.to_str()).collect();
    let mut targets: Vec<&str> = TARGETS.iter().map(|target| target.name).collect();
    targets.sort_unstable();
    assert_eq!(names, targets);
}
