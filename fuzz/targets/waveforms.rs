//! libFuzzer on [`bead_fuzz::waveforms`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| bead_fuzz::waveforms::check(bytes));
