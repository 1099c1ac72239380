//! Checks of a run's inputs: pins, USARTs, devices, the image.

use std::collections::BTreeSet;
use std::ops::Range;

use super::error::RunError;
use super::image::Image;
use crate::chip::Chip;
use crate::device::{DevicePlace, Devices};
use crate::machine::{I2CS, SPIS, USARTS, pin};
use crate::memory::within;

pub(super) const TWELVE_BITS: &str = "codes of the 12-bit ADC are 0..=4095";

pub(super) fn check_pin(chip: Chip, name: &str) -> Result<(), RunError> {
    if pin(name).is_none() {
        return Err(RunError::Input(format!(
            "there is no pin {name:?}; pins are PA0 to PI15"
        )));
    }
    let missing = || {
        let what = format!("the {chip} has no pin {name}");
        RunError::Input(what + "; give another pin, or the part that has it (--chip, Run::chip)")
    };
    chip.has_pin(name).then_some(()).ok_or_else(missing)
}

/// Refuses an image that does not fit the part's memory.
pub(super) fn check_image(chip: Chip, image: &Image) -> Result<(), RunError> {
    let other = |why: String| Err(RunError::OtherPart(image.path.clone(), why));
    let (flash, sram, ccm) = (chip.flash(), chip.sram(), chip.ccm());
    let kib = |range: &Range<u32>| range.len() >> 10;
    let has = format!(
        "the {chip} has {} KiB of flash, {} KiB of SRAM and {} KiB of CCM",
        chip.flash_kib(),
        kib(&sram),
        kib(&ccm)
    );
    let next = "link it for this part, or name the part that it is for (--chip, Run::chip)";
    for (start, bytes) in &image.segments {
        let places = [(FLASH_SPACE, &flash), (CCM_SPACE, &ccm), (SRAM_SPACE, &sram)];
        let place = places.into_iter().find(|(space, _)| space.contains(start));
        if let Some((_, memory)) = place
            && !within(memory, *start, *bytes as usize)
        {
            let end = start.saturating_add(*bytes);
            return other(format!(
                "it occupies {start:#010x}..{end:#010x}, but {has}; {next}"
            ));
        }
    }
    match image.stack {
        // The stack grows down: it may begin where memory ends.
        Some(stack) if !chip.is_ram(stack.wrapping_sub(4), 4) => {
            other(format!("its stack begins at {stack:#010x}, but {has}; {next}"))
        }
        _ => Ok(()),
    }
}

/// Address ranges of flash, core-coupled memory and SRAM, on any part.
const FLASH_SPACE: Range<u32> = 0x0800_0000..0x1000_0000;
const CCM_SPACE: Range<u32> = 0x1000_0000..0x1fff_0000;
const SRAM_SPACE: Range<u32> = 0x2000_0000..0x4000_0000;

pub(super) fn check_usart(port: &str) -> Result<(), RunError> {
    let all = USARTS.join(", ");
    let unknown = || RunError::Input(format!("there is no USART {port:?}; give one of {all}"));
    USARTS.contains(&port).then_some(()).ok_or_else(unknown)
}

/// Refuses devices at places that the part does not have, and two at one address.
pub(super) fn check_devices(chip: Chip, devices: &Devices) -> Result<(), RunError> {
    let refused = |what: String| Err(RunError::Input(what));
    let mut taken = BTreeSet::new();
    for place in devices.places() {
        let (names, bus) = match place {
            DevicePlace::I2c { bus, address } => {
                // Section 3.1.12 of the I2C specification (UM10204): the other addresses are reserved.
                if !(0x08..0x78).contains(address) {
                    return refused(format!(
                        "a device at {bus} has the address {address:#04x}; give a 7-bit address, 0x08 to 0x77"
                    ));
                }
                if !taken.insert((bus, address)) {
                    return refused(format!("two devices at {bus} have the address {address:#04x}"));
                }
                (I2CS, bus)
            }
            DevicePlace::Spi { bus, select } => {
                check_pin(chip, select)?;
                (SPIS, bus)
            }
        };
        if !names.contains(&&**bus) {
            return refused(format!(
                "there is no bus {bus:?} for a device; give one of {}",
                names.join(", ")
            ));
        }
    }
    Ok(())
}
