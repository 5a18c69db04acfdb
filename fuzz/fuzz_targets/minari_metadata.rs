#![no_main]

use demosift::data::demonstration::episode::Format;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| demosift_fuzz::folder(bytes, Format::MinariParquet, "minari_parquet", "data/metadata.json"));
