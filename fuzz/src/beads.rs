//! Beads in physical quantities, in TOML, and the settings that are made of them.

use bead_model::Settings;
use bead_model::settings::BLOCK_MAX;
use bead_recording::physical::{parse, to_toml};

use crate::text;

/// Reads the bytes as a bead's file.
///
/// # Panics
/// A bead that was accepted has settings that a bead would refuse, or is not read as it was written.
pub fn check(bytes: &[u8]) {
    let Some(settings) = text::read(bytes, |text| parse(text, "a.toml")) else {
        return;
    };
    let mut block = [0; BLOCK_MAX];
    let length = settings.encode(&mut block).expect("a block fits");
    assert_eq!(Settings::decode(&block[..length]), Ok(settings));
    let written = to_toml(settings.description());
    assert_eq!(parse(&written, "b.toml"), Ok(settings), "{written}");
}
