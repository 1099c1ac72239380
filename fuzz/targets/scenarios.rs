//! libFuzzer on [`bead_fuzz::scenarios`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| bead_fuzz::scenarios::check(bytes));
