#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| modelmill_fuzz_targets::targets::mesh(data));
