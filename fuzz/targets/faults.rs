//! libFuzzer on [`bead_fuzz::faults`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| bead_fuzz::faults::check(bytes));
