#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| btf_runtime_fuzz::round_trip(bytes));
