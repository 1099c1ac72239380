//! libFuzzer on [`bead_fuzz::limits`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| bead_fuzz::limits::check(bytes));
