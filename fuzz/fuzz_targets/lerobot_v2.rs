#![no_main]

use demosift::data::demonstration::episode::Format;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| demosift_fuzz::folder(bytes, Format::LeRobotV2, "lerobot_v2", "data/chunk-000/episode_000001.parquet"));
