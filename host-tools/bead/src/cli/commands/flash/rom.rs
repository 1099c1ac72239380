//! `bead flash --rom`: the image over the serial line, with the loader that ST has put into the part.
//!
//! # Design
//! The loader cannot undo anything, so safety rests on the order of the work: part and image are checked
//! before anything is erased; the sectors are erased upwards, and written downwards. The first block has
//! the vectors that the core starts from. It is erased first and written last, so that a part whose line
//! was cut starts nothing rather than half an image, and waits for the loader again.
//!
//! At the end the loader is told to start four instructions in RAM, which reset the part. An image that the
//! loader starts itself would meet the clocks and the peripherals that the loader has set up.

use crate::cli::commands::flash::arguments::Arguments;
use crate::cli::commands::flash::image::{BLOCK, FlashImage, ImageName, sector};
use crate::cli::commands::flash::part::check;
use crate::cli::commands::flash::report::FlashReport;
use crate::cli::commands::prelude::*;
use bead_line::port::Address;
use bead_line::rom_loader::RomLoader;

/// Fastest rate of the loader, bits a second.
const FASTEST: u32 = 115_200;
/// Address in RAM of the code that resets the part: well beyond the first 12 KiB, which the loader needs
/// (AN2606).
const RAM: u32 = 0x2001_0000;

/// Stack pointer, start, and: `ldr r0, =0x05fa0004`, `ldr r1, =0xe000ed0c`, `str r0, [r1]`, `b .`. The two
/// words behind are AIRCR with SYSRESETREQ, and its address.
const RESET: [u32; 6] = [
    RAM + 0x1000,
    RAM + 8 + 1,
    0x4902_4801,
    0xe7fe_6008,
    0x05fa_0004,
    0xe000_ed0c,
];

/// The state of a part whose flashing was interrupted.
const HALF: &str = "the image in flash is incomplete, and the part does not start; run the same command again, with BOOT0 at 3.3 V";

/// Rate of the loader's port: up to 115 200 bits a second, which is taken if none is given.
fn rate(baud: Option<u32>) -> Result<u32, Failure> {
    match baud.unwrap_or(FASTEST) {
        rate @ 1200..=FASTEST => Ok(rate),
        rate => bail!(
            Input,
            "--baud {rate}: the part's own loader takes 1200 to {FASTEST}"
        ),
    }
}

/// Flashes an image by the loader at a port.
///
/// # Errors
/// [`Failure`]: no loader, another part, a locked one, or the line fails.
pub(crate) fn run(arguments: &Arguments, port: &Address, image: &FlashImage) -> Result<FlashReport, Failure> {
    let mut loader = RomLoader::open(port, rate(arguments.baud)?)?;
    let part = check(loader.part()?)?;
    let before = ImageName::read(|address, bytes| {
        let mut blocks = (address..).step_by(BLOCK).zip(bytes.chunks_mut(BLOCK));
        Ok(blocks.try_for_each(|(address, block)| loader.read(address, block))?)
    })?;
    image.may_replace(before.as_ref(), arguments.board.as_deref())?;
    let sectors = image.sectors();
    let steps = sectors.len() + 2 * image.blocks.len();
    let bar = output::progress(steps as u64);
    bar.set_message(format!("flashing {}", image.name));
    interrupt::resumable(HALF.to_owned());
    for number in &sectors {
        loader.erase(*number, sector(*number).start)?;
        bar.inc(1);
    }
    for (address, block) in image.blocks.iter().rev() {
        loader.write(*address, block)?;
        bar.inc(1);
    }
    for (address, block) in &image.blocks {
        let mut there = [0; BLOCK];
        loader.read(*address, &mut there)?;
        if there != *block {
            bail!(
                Device,
                "flash and image differ at {address:#010x} after flashing: run the same command again; if they still \
                 differ, a sector is protected from writing, flash is worn, or the supply is low"
            );
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    loader.write(RAM, &RESET.map(u32::to_le_bytes).concat())?;
    loader.go(RAM)?;
    note!("the part was reset; if BOOT0 is still at 3.3 V, connect it to ground and reset the board");
    Ok(FlashReport {
        part,
        brown_out_level: None,
        read_protection: 0,
        before,
        after: image.name.clone(),
        sectors,
        bytes: image.length(),
    })
}
