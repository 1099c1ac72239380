//! libFuzzer on [`bead_fuzz::beads`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| bead_fuzz::beads::check(bytes));
