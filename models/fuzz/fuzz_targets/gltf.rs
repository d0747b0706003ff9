#![no_main]

use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};

fuzz_target!(|bytes: &[u8]| btf_models_fuzz::gltf(bytes));
fuzz_mutator!(|data: &mut [u8], size: usize, most: usize, seed: u32| {
    btf_models_fuzz::mutate_in_place(data, size, most, seed, fuzzer_mutate)
});
