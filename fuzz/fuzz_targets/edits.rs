#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| demosift_fuzz::edits(bytes));
