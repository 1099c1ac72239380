//! libFuzzer on [`bead_fuzz::strikes`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| bead_fuzz::strikes::check(bytes));
