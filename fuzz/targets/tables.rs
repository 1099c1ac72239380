//! libFuzzer on [`bead_fuzz::tables`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| bead_fuzz::tables::check(bytes));
