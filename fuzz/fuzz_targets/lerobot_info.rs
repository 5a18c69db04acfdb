#![no_main]

use demosift::data::demonstration::episode::Format;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| demosift_fuzz::folder(bytes, Format::LeRobotV3, "lerobot_v3", "meta/info.json"));
