//! Beads in physical quantities, in TOML, and the settings that are made of them.

use bead::recording::physical::Physical;
use bead_model::Settings;
use bead_model::settings::BLOCK_MAX;

use crate::text;

/// Reads the bytes as a bead's file.
///
/// # Panics
/// A bead that was accepted has settings that a bead would refuse, or is not read as it was written.
pub fn check(bytes: &[u8]) {
    let Some(text) = text::of(bytes) else { return };
    let (physical, settings) = match Physical::parse(text, "a.toml") {
        Ok(read) => read,
        Err(error) => return text::one_line(&error),
    };
    let mut block = [0; BLOCK_MAX];
    let length = settings.encode(&mut block).expect("a block fits");
    assert_eq!(Settings::decode(&block[..length]), Ok(settings));
    let written = physical.to_toml();
    let (again, same) = Physical::parse(&written, "b.toml").expect("what was written is a bead");
    assert_eq!((again, same), (physical, settings));
}
