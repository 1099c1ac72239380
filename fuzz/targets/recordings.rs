//! libFuzzer on [`bead_fuzz::recordings`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| bead_fuzz::recordings::check(bytes));
