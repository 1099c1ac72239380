//! libFuzzer on [`bead_fuzz::requests`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| bead_fuzz::requests::check(bytes));
