//! Demonstrations as other tools store them; `formats/` holds what these tests read.

mod reading;
mod refusing;
mod writing;

use std::fs;
use std::path::{Path, PathBuf};

use demosift::Error;
use demosift::data::demonstration::episode::{Columns, Format, Source};
use demosift::data::demonstration::open;

const LENGTHS: [usize; 3] = [4, 3, 5];

/// Each file or folder of `formats/`, with the columns that make an observation and the final observations it keeps.
const FIXTURES: [(&str, Format, &[&str], bool); 13] = [
    ("lerobot_v3", Format::LeRobotV3, &["observation.state"], false),
    ("lerobot_v2", Format::LeRobotV2, &["observation.state"], false),
    ("minari_hdf5", Format::MinariHdf5, &["observations"], true),
    ("minari_parquet", Format::MinariParquet, &["observations"], true),
    ("minari_parquet_dict", Format::MinariParquet, &["observations/position", "observations/velocity"], true),
    ("robomimic.hdf5", Format::Robomimic, &["obs/joint", "obs/wrist"], true),
    ("imitation.npz", Format::ImitationNpz, &["obs"], true),
    ("baselines.npz", Format::BaselinesNpz, &["obs"], false),
    ("stable_baselines.npz", Format::StableBaselinesNpz, &["obs"], false),
    ("maniskill.h5", Format::ManiSkill, &["obs"], true),
    ("aloha", Format::Aloha, &["observations/qpos"], false),
    ("lerobot_v3_zstd", Format::LeRobotV3, &["observation.state"], false),
    ("lerobot_v2_zstd", Format::LeRobotV2, &["observation.state"], false),
];

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/formats").join(name)
}

/// A folder that goes away with the test.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("demosift-formats-{}-{name}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }

    /// A copy of a fixture.
    fn copy(&self, name: &str) -> PathBuf {
        let to = self.0.join(name);
        copy(&fixture(name), &to);
        to
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn copy(from: &Path, to: &Path) {
    if !from.is_dir() {
        fs::copy(from, to).unwrap();
        return;
    }
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        copy(&entry.path(), &to.join(entry.file_name()));
    }
}

fn read(path: &Path) -> demosift::Result<Source> {
    open::open(path, None, &Columns::default())
}

/// Number `column` of the observation before step `step` of an episode, as `make.py` has it.
fn observation(episode: usize, step: usize, column: usize) -> f32 {
    (episode as f64 + 0.1 * step as f64 + column as f64).sin() as f32
}

fn action(episode: usize, step: usize, column: usize) -> f32 {
    ((episode as f64 + 0.1 * step as f64 + column as f64).cos() / 2.0) as f32
}

#[track_caller]
fn assert_close(found: f32, wanted: f32) {
    assert!((found - wanted).abs() < 1e-6, "{found} is not {wanted}");
}

fn columns(observations: &[&str], actions: &[&str]) -> Columns {
    let owned = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
    Columns { observations: owned(observations), actions: owned(actions) }
}

#[track_caller]
fn assert_says(error: &Error, wanted: &[&str]) {
    assert!(error.is_bad_input(), "{error}");
    let message = format!("{error} / {}", error.hint().unwrap_or_default());
    for part in wanted {
        assert!(message.contains(part), "'{message}' does not say '{part}'");
    }
}
