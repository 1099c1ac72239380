//! Images that fail: what `bead emulate` says of them.

use std::fs;
use std::path::Path;

use bead_bench::image::find_image;

use crate::program::{bead, said};

const SCENARIO: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../docs/scenarios/paper-strike.toml"
);

/// The vectors of the reset, of HardFault, and of the stream by which samples come.
const RESET: usize = 1;
const HARD_FAULT: usize = 3;
const SAMPLES: usize = 16 + 56;

/// Leaves the image at a path, with vectors that lead nowhere.
fn spoil(vectors: &[usize], path: &Path) {
    /// Where flash begins, and the type of a segment that is loaded.
    const FLASH: u32 = 0x0800_0000;
    const LOAD: u32 = 1;
    let mut image = fs::read(find_image(None).unwrap()).unwrap();
    let word = |at: usize| u32::from_le_bytes(image[at..at + 4].try_into().unwrap());
    let (headers, count) = (word(28) as usize, word(44) as usize & 0xffff);
    let table = (0..count)
        .map(|number| headers + 32 * number)
        .find(|header| word(*header) == LOAD && word(header + 8) == FLASH)
        .map(|header| word(header + 4) as usize)
        .unwrap();
    for vector in vectors {
        image[table + 4 * vector..][..4].copy_from_slice(&0xe000_0001_u32.to_le_bytes());
    }
    fs::write(path, image).unwrap();
}

/// The status and the last line of a run whose image has vectors that lead nowhere.
fn emulated(vectors: &[usize]) -> (Option<i32>, String) {
    let folder = tempfile::tempdir().unwrap();
    spoil(vectors, &folder.path().join("image"));
    let arguments = ["emulate", SCENARIO, "--bead", "8", "--firmware", "image"];
    let output = bead(folder.path(), arguments);
    let said = said(&output);
    (
        output.status.code(),
        said.lines().last().unwrap_or_default().to_owned(),
    )
}

#[test]
fn how_an_image_failed_is_said_and_not_what_it_did_not_do_then() {
    let (status, said) = emulated(&[RESET, HARD_FAULT]);
    assert_eq!(status, Some(3), "{said}");
    assert!(said.contains("image: the processor locked up"), "{said}");

    let (status, said) = emulated(&[HARD_FAULT, SAMPLES]);
    assert_eq!(status, Some(1), "{said}");
    assert!(said.contains("the processor locked up"), "{said}");
}
