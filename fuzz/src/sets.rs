//! Demonstration sets, what lies beside them, and edits of a user's file.

use std::path::Path;

use demosift::data::demonstration::episode::{Columns, Format};
use demosift::data::demonstration::set_file::SetFile;
use demosift::data::demonstration::{inspection, lerobot, minari, open, robomimic, timing};

use crate::scratch;

/// Reads the bytes as a file of this format, or of the one that they look like.
pub(crate) fn file(bytes: &[u8], format: Option<Format>) {
    let path = scratch::folder(format.map_or("any", Format::name)).join("file");
    scratch::write(&path, bytes);
    read(&path, format);
}

/// Reads a copy of a data set of the tests in which these are the bytes of one file.
pub(crate) fn folder(bytes: &[u8], format: Format, fixture: &str, replaced: &str) {
    let path = scratch::folder(&replaced.replace('/', "_")).join(fixture);
    if !path.exists() {
        let formats = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/demosift/tests/formats");
        scratch::copy(&formats.join(fixture), &path);
    }
    scratch::write(&path.join(replaced), bytes);
    read(&path, Some(format));
}

/// All that commands ask of a set.
fn read(path: &Path, format: Option<Format>) {
    let Ok(source) = open::open(path, format, &Columns::default()) else { return };
    let _ = open::columns(path, &source);
    let _ = (inspection::inspect(&source), timing::timing(&source));
    let _ = (source.set(), open::read_states(path, Some(source.format)));
    match source.format {
        Format::LeRobotV3 | Format::LeRobotV2 => drop(lerobot::description(path, &source)),
        Format::MinariHdf5 | Format::MinariParquet => drop(minari::seeds(path, &source, usize::MAX)),
        _ => (),
    }
}

/// Reads the bytes as a `set.toml`.
pub(crate) fn set_file(bytes: &[u8]) {
    let path = scratch::folder("set_file").join("set.toml");
    scratch::write(&path, bytes);
    let _ = SetFile::read(&path);
}

/// Adds a filter key to the bytes as a file of robomimic, and writes a subset of them as one of Minari.
pub(crate) fn edits(bytes: &[u8]) {
    let folder = scratch::folder("edits");
    let path = folder.join("edited.hdf5");
    scratch::write(&path, bytes);
    let _ = robomimic::add_filter_key(&path, "kept", &["demo_0".to_owned(), "demo_1".to_owned()]);
    scratch::write(&path, bytes);
    let subset = folder.join("subset");
    let _ = std::fs::remove_dir_all(&subset);
    let _ = minari::write_subset(&subset, &path, &["0".to_owned()], "fuzz/subset-v0");
}
