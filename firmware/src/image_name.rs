//! The image's name in flash, right behind its vectors, where `bead flash` reads it: also from an image that
//! it does not know and that may not run.

/// Mark, version, commit and board (`build.rs`).
const NAME: &str = env!("BEAD_IMAGE_NAME");

#[allow(unsafe_code, reason = "a section of its own has a place of its own")]
#[used]
#[unsafe(link_section = ".image_name")]
static IMAGE_NAME: [u8; NAME.len()] = *NAME.as_bytes().first_chunk().expect("it is as long as itself");
