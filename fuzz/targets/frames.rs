//! libFuzzer on [`bead_fuzz::frames`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| bead_fuzz::frames::check(bytes));
