//! What the targets share: bytes become the file that a reader reads.

use std::path::{Path, PathBuf};

use demosift::Result;
use demosift::basics::ledger::Ledger;
use demosift::basics::seal;
use demosift::data::demonstration::episode::{Columns, Format};
use demosift::data::demonstration::{minari, open, robomimic};
use demosift::learning::adapt::MetaPrior;
use demosift::results::artifact::{self, Artifact as _};
use demosift::results::data_only::DataOnly;
use demosift::results::panel::Panel;
use demosift::results::uncertainty::Uncertainty;
use demosift::stages::demonstrator::Stage;
use demosift::stages::imitate::{ImitationState, LearningCurve};
use demosift::stages::judge::{Judged, JudgingState};
use demosift::stages::meta_train::MetaState;
use demosift::stages::referee::Verdict;
use demosift::stages::select::{Ranking, Subset};
use demosift::stages::subset_selection::Weighing;
use serde_json::Value;

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

/// Recalls every result and checkpoint from a run folder that holds these bytes under its name: as they are, and sealed, as
/// somebody would who knows the form of a file.
pub fn results(bytes: &[u8]) {
    recall_all(bytes);
    // What is sealed has fields.
    if let Ok(Value::Object(fields)) = serde_json::from_slice(bytes)
        && !fields.is_empty()
    {
        recall_all(&seal::to_json(&fields));
    }
    let mut checkpoint = [&artifact::FORMAT_VERSION.to_le_bytes()[..], &seal::OPEN, bytes].concat();
    seal::seal(&mut checkpoint, 4);
    recall_all(&checkpoint);
}

fn recall_all(bytes: &[u8]) {
    let all = All(bytes);
    let _ = Ranking::recall(&all, "").map(|ranking| ranking.map(|ranking| ranking.entries.len()));
    let _ = (Uncertainty::recall(&all, ""), Subset::recall(&all, ""), DataOnly::recall(&all, ""));
    let _ = (Weighing::recall(&all, ""), Panel::recall(&all, ""), Verdict::recall(&all, ""));
    let _ = (Judged::recall(&all, "paper"), MetaPrior::recall(&all, ""), LearningCurve::recall(&all, "all"));
    let _ = (Vec::<Stage>::recall(&all, ""), artifact::read_policy(bytes, "policy"));
    let _ = artifact::read_checkpoint::<(u64, MetaState)>(bytes, "checkpoint");
    let _ = artifact::read_checkpoint::<(u64, JudgingState)>(bytes, "checkpoint");
    let _ = artifact::read_checkpoint::<(u64, ImitationState)>(bytes, "checkpoint");
}

/// A run folder in which every file is the same.
struct All<'a>(&'a [u8]);

impl Ledger for All<'_> {
    fn recall(&self, _: &str) -> Result<Option<Vec<u8>>> {
        Ok(Some(self.0.to_vec()))
    }

    fn store(&mut self, _: &str, _: &[u8]) -> Result<()> {
        Ok(())
    }

    fn forget(&mut self, _: &str) -> Result<()> {
        Ok(())
    }
}

/// Adds a filter key to the bytes as a file of robomimic, and writes a subset of them as one of Minari.
pub fn edits(bytes: &[u8]) {
    let folder = scratch(Format::Robomimic);
    let path = folder.join("edited.hdf5");
    std::fs::write(&path, bytes).expect("the temporary folder can be written");
    let _ = robomimic::add_filter_key(&path, "kept", &["0".to_owned(), "1".to_owned()]);
    let subset = folder.join("subset");
    let _ = std::fs::remove_dir_all(&subset);
    let _ = minari::write_subset(&subset, &path, &["0".to_owned()], "fuzz/subset-v0");
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
