//! libFuzzer on [`bead_fuzz::settings`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| bead_fuzz::settings::check(bytes));
