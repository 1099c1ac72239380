//! Messages of `bead emulate` about images that fail.

use std::fs;
use std::path::Path;

use bead_bench::image::find_image;

use crate::program::{SCENARIO, TestFolder, said};

/// Numbers of the vectors of reset, HardFault and the DMA stream of the samples.
const RESET: usize = 1;
const HARD_FAULT: usize = 3;
const SAMPLES: usize = 16 + 56;

/// Copies the image to a path, with vectors that lead nowhere.
fn spoil(vectors: &[usize], path: &Path) {
    /// Start of the image behind its loader, and the type of a segment that is loaded.
    const FLASH: u32 = 0x0802_0000;
    const LOAD: u32 = 1;
    let mut image = fs::read(find_image(None).unwrap()).unwrap();
    let word = |at: usize| u32::from_le_bytes(image[at..at + 4].try_into().unwrap());
    let (headers, count) = (word(28) as usize, word(44) as usize & 0xffff);
    let mut headers = (0..count).map(|number| headers + 32 * number);
    let is_flash = |header: &usize| word(*header) == LOAD && word(header + 8) == FLASH;
    let table = word(headers.find(is_flash).unwrap() + 4) as usize;
    for vector in vectors {
        // The loader starts an image only if its start address is inside it. Erased flash at that address
        // is not an instruction.
        let nowhere = if *vector == RESET {
            0x0805_fff1
        } else {
            0xe000_0001_u32
        };
        image[table + 4 * vector..][..4].copy_from_slice(&nowhere.to_le_bytes());
    }
    fs::write(path, image).unwrap();
}

#[test]
fn how_an_image_failed_is_said_and_not_what_it_did_not_do_then() {
    for (vectors, status) in [([RESET, HARD_FAULT], 3), ([HARD_FAULT, SAMPLES], 1)] {
        let folder = TestFolder::new();
        spoil(&vectors, &folder.join("image"));
        let output = folder.run(&format!("emulate {SCENARIO} --bead 8 --firmware image"));
        let said = said(&output);
        assert_eq!(output.status.code(), Some(status), "{said}");
        let last = said.lines().last().unwrap_or_default();
        assert!(last.contains("the processor locked up"), "{said}");
    }
}
