//! What demosift reads, each as a function of arbitrary bytes: it may return an error, and neither panic nor ask for much
//! memory.
//!
//! `cargo xtask fuzz` leads the bytes by what code they reach; the test of this package gives each target the files that are
//! kept for it.

mod results;
mod scratch;
mod sets;
mod tasks;

use demosift::data::demonstration::episode::Format;

/// One kind of file.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// How it is chosen, and the folder of `seeds` that holds what it begins from and what was found.
    pub name: &'static str,
    /// Reads the bytes.
    pub run: fn(&[u8]),
}

/// All of them.
pub const TARGETS: [Target; 22] = [
    Target { name: "detected", run: |bytes| sets::file(bytes, None) },
    Target { name: "robomimic", run: |bytes| sets::file(bytes, Some(Format::Robomimic)) },
    Target { name: "d4rl", run: |bytes| sets::file(bytes, Some(Format::D4rl)) },
    Target { name: "minari_hdf5", run: |bytes| sets::file(bytes, Some(Format::MinariHdf5)) },
    Target { name: "maniskill", run: |bytes| sets::file(bytes, Some(Format::ManiSkill)) },
    Target { name: "aloha", run: |bytes| sets::folder(bytes, Format::Aloha, "aloha", "episode_1.hdf5") },
    Target { name: "baselines_npz", run: |bytes| sets::file(bytes, Some(Format::BaselinesNpz)) },
    Target { name: "imitation_npz", run: |bytes| sets::file(bytes, Some(Format::ImitationNpz)) },
    Target { name: "stable_baselines_npz", run: |bytes| sets::file(bytes, Some(Format::StableBaselinesNpz)) },
    Target {
        name: "lerobot_v3",
        run: |bytes| {
            sets::folder(bytes, Format::LeRobotV3, "lerobot_v3", "data/chunk-000/file-000.parquet");
        },
    },
    Target {
        name: "lerobot_v2",
        run: |bytes| {
            sets::folder(bytes, Format::LeRobotV2, "lerobot_v2", "data/chunk-000/episode_000001.parquet");
        },
    },
    Target {
        name: "lerobot_info",
        run: |bytes| sets::folder(bytes, Format::LeRobotV3, "lerobot_v3", "meta/info.json"),
    },
    Target {
        name: "lerobot_episodes",
        run: |bytes| sets::folder(bytes, Format::LeRobotV2, "lerobot_v2", "meta/episodes.jsonl"),
    },
    Target {
        name: "minari_parquet",
        run: |bytes| {
            sets::folder(bytes, Format::MinariParquet, "minari_parquet", "data/1/part-0.parquet");
        },
    },
    Target {
        name: "minari_metadata",
        run: |bytes| sets::folder(bytes, Format::MinariParquet, "minari_parquet", "data/metadata.json"),
    },
    Target { name: "set_file", run: sets::set_file },
    Target { name: "edits", run: sets::edits },
    Target { name: "results", run: results::json },
    Target { name: "tensors", run: results::tensors },
    Target { name: "checkpoints", run: results::checkpoints },
    Target { name: "metrics", run: results::metrics },
    Target { name: "tasks", run: tasks::task_file },
];
