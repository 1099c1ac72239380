//! The part that the image runs on, by its device number (DBGMCU_IDCODE, RM0090 section 38.6.1).

use crate::cli::commands::prelude::*;

/// The device number of an STM32F405, and of F407, F415 and F417, which differ in what a bead does not use.
const PART: u16 = 0x413;

/// Returns the part's number, or a failure if it is another part's.
pub(crate) fn check(part: u16) -> Result<u16, Failure> {
    if part == PART {
        return Ok(part);
    }
    let name = match part {
        0x411 => " (an STM32F405 of revision A, or an STM32F2)",
        0x419 => " (STM32F42x or F43x)",
        0x421 => " (STM32F446, which has no core-coupled memory)",
        0x431 => " (STM32F411)",
        0x423 | 0x433 => " (STM32F401)",
        0x434 => " (STM32F469 or F479)",
        0x441 => " (STM32F412)",
        0x463 => " (STM32F413)",
        _ => "",
    };
    bail!(
        Input,
        "the part is {part:#x}{name}, not 0x413 (STM32F405): the image takes no samples there; nothing was flashed; \
         docs/hardware.md lists boards that will do"
    )
}
