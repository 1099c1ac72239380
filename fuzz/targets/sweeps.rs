//! libFuzzer on [`bead_fuzz::sweeps`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| bead_fuzz::sweeps::check(bytes));
