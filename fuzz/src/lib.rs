//! What the targets share: bytes become the file that a reader reads.

use std::path::{Path, PathBuf};

use demosift::data::demonstration::episode::{Columns, Format};
use demosift::data::demonstration::open;

/// Reads the bytes as a file of this format.
pub fn file(bytes: &[u8], format: Format) {
    let path = scratch(format).join("file");
    std::fs::write(&path, bytes).expect("the temporary folder can be written");
    read(&path, format);
}

/// Reads a copy of a data set of the tests in which these are the bytes of one file.
pub fn folder(bytes: &[u8], format: Format, fixture: &str, replaced: &str) {
    let path = scratch(format).join(fixture);
    if !path.exists() {
        copy(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/demosift/tests/formats").join(fixture), &path);
    }
    std::fs::write(path.join(replaced), bytes).expect("the temporary folder can be written");
    read(&path, format);
}

fn read(path: &Path, format: Format) {
    if let Ok(source) = open::open(path, Some(format), &Columns::default()) {
        let _ = source.set();
    }
}

fn scratch(format: Format) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("demosift-fuzz-{}-{format}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("the temporary folder can be written");
    folder
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).expect("the temporary folder can be written");
    for entry in std::fs::read_dir(from).expect("the data sets of the tests are there").flatten() {
        if entry.path().is_dir() {
            copy(&entry.path(), &to.join(entry.file_name()));
        } else {
            std::fs::copy(entry.path(), to.join(entry.file_name())).expect("the temporary folder can be written");
        }
    }
}
