//! The flash before the image: the loader, and the state in which it starts this image.

#![allow(unsafe_code, reason = "both have their own places in flash")]

use bead_update::swap::{SETTLED, WIDE};

const BYTES: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/loader.bin"));

/// The loader (`firmware/loader`), which starts first.
#[used]
// SAFETY: a section of bytes that nothing else is linked to; `memory.x` has it where the part starts.
#[unsafe(link_section = ".loader")]
static LOADER: [u8; BYTES.len()] = {
    let mut bytes = [0; BYTES.len()];
    bytes.copy_from_slice(BYTES);
    bytes
};

/// A probe that brings this image ends every update that was under way.
#[used]
// SAFETY: as for the loader.
#[unsafe(link_section = ".state")]
static STATE: [u8; WIDE] = SETTLED;
