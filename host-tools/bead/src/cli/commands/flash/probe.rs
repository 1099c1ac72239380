//! `bead flash --probe`: part, option bytes, image, comparison, version before and after.

use std::fmt;

use crate::cli::commands::flash::arguments::Arguments;
use crate::cli::commands::flash::image::{FlashImage, ImageName};
use crate::cli::commands::flash::part::check;
use crate::cli::commands::flash::probe_rs::ProbeRs;
use crate::cli::commands::flash::report::FlashReport;
use crate::cli::commands::prelude::*;

/// DBGMCU_IDCODE (RM0090 section 38.6.1).
const DBGMCU_IDCODE: u32 = 0xe004_2000;
/// FLASH_OPTKEYR with its two keys, and FLASH_OPTCR (RM0090 sections 3.6.2, 3.9.3 and 3.9.7).
const FLASH_OPTKEYR: u32 = 0x4002_3c08;
const OPTION_KEYS: [u32; 2] = [0x0819_2a3b, 0x4c5d_6e7f];
const FLASH_OPTCR: u32 = 0x4002_3c14;

/// Option bytes, as the register FLASH_OPTCR holds them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct OptionBytes(u32);

impl OptionBytes {
    const START: u32 = 1 << 1;
    /// OPTLOCK, OPTSTRT and BOR_LEV.
    const LOW: u32 = 0b1111;
    /// Bits that are always 0 in this part.
    const RESERVED: u32 = 0xf000_0010;

    /// Level of the brown-out reset: 3 is the highest, 0 is off. The field counts downwards.
    fn brown_out_level(self) -> u8 {
        3 - (self.0 >> 2 & 3) as u8
    }

    /// Level of read protection.
    fn read_protection(self) -> u8 {
        match self.0 >> 8 & 0xff {
            0xaa => 0,
            0xcc => 2,
            _ => 1,
        }
    }

    /// True if a sector cannot be erased or written.
    fn is_write_protected(self, sector: u8) -> bool {
        self.0 >> (16 + sector) & 1 == 0
    }

    /// These option bytes with brown-out level 3 (BOR_LEV 0) and neither lock nor start.
    fn with_brown_out_reset(self) -> Self {
        Self(self.0 & !Self::LOW)
    }
}

impl fmt::Display for OptionBytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:#010x}", self.0)
    }
}

/// Flashes an image through a probe. `None` if this was a dry run.
///
/// # Errors
/// [`Failure`]: no program, no probe, no part, a part that cannot be flashed, or it failed.
pub(crate) fn run(arguments: &Arguments, image: &FlashImage) -> Result<Option<FlashReport>, Failure> {
    let (serial, under_reset) = (arguments.serial.as_deref(), arguments.under_reset);
    let probe = if arguments.dry_run {
        ProbeRs::dry(serial, under_reset)
    } else {
        ProbeRs::find(serial, under_reset)?
    };
    let part = probe
        .read(DBGMCU_IDCODE, 1)?
        .map(|words| check((words[0] & 0xfff) as u16))
        .transpose()?;
    let mut options = read_options(&probe)?;
    if let Some(options) = options {
        check_options(options, image)?;
    }
    let read = |address, bytes: &mut [u8]| read_flash(&probe, address, bytes);
    let before = ImageName::read(read)?;
    image.may_replace(before.as_ref(), arguments.board.as_deref())?;
    if arguments.brownout && options.is_none_or(|options| options.brown_out_level() != 3) {
        options = set_brown_out_reset(&probe, options)?;
    }
    let bar = output::spinner(format!("flashing {}", image.name));
    interrupt::resumable("the image in flash may be incomplete; run the same command again".to_owned());
    probe.flash(&image.path)?;
    bar.finish_and_clear();
    let after = ImageName::read_at(image.start, read)?;
    probe.reset()?;
    let (Some(part), Some(options)) = (part, options) else {
        return Ok(None);
    };
    if after.as_ref() != Some(&image.name) {
        bail!(
            Device,
            "flash was written and compared, but does not contain the name of the image, {}; flash it again",
            image.name
        );
    }
    Ok(Some(FlashReport {
        part,
        brown_out_level: Some(options.brown_out_level()),
        read_protection: options.read_protection(),
        before,
        after: image.name.clone(),
        sectors: image.sectors(),
        bytes: image.length(),
    }))
}

fn read_options(probe: &ProbeRs) -> Result<Option<OptionBytes>, Failure> {
    Ok(probe.read(FLASH_OPTCR, 1)?.map(|words| OptionBytes(words[0])))
}

/// Refuses a part that cannot be read or written.
fn check_options(options: OptionBytes, image: &FlashImage) -> Result<(), Failure> {
    if options.0 & OptionBytes::RESERVED != 0 {
        bail!(
            Device,
            "the part's option bytes read as {options}, which is impossible: something is wrong between probe and part; \
             nothing was flashed; shorter wires, or PROBE_RS_SPEED=1000, may help"
        );
    }
    if options.read_protection() != 0 {
        bail!(
            Input,
            "the part is locked (read protection level {}): no probe can read or write its flash; nothing was flashed; \
             `STM32_Programmer_CLI -c port=SWD -rdu` unlocks it, but erases all of it, with settings and strikes",
            options.read_protection()
        );
    }
    match image
        .sectors()
        .into_iter()
        .find(|number| options.is_write_protected(*number))
    {
        Some(number) => bail!(
            Input,
            "sector {number} of the part's flash is write-protected, and the image covers it; nothing was flashed; \
             `STM32_Programmer_CLI -c port=SWD -ob nWRP{number}=1` removes the protection"
        ),
        None => Ok(()),
    }
}

/// Reads bytes of flash.
fn read_flash(probe: &ProbeRs, address: u32, bytes: &mut [u8]) -> Result<(), Failure> {
    let words = probe.read(address, bytes.len() / 4)?.unwrap_or_default();
    for (bytes, word) in bytes.chunks_mut(4).zip(words) {
        bytes.copy_from_slice(&word.to_le_bytes());
    }
    Ok(())
}

/// Sets the brown-out level to 3, and nothing else; returns what the part then has.
fn set_brown_out_reset(probe: &ProbeRs, found: Option<OptionBytes>) -> Result<Option<OptionBytes>, Failure> {
    // A wrong bit may lock the part for ever, so the option bytes have to read the same twice. A dry run
    // uses those of a new part.
    let again = read_options(probe)?;
    if again != found {
        bail!(
            Device,
            "two reads of the part's option bytes differ: something is wrong between probe and part; nothing was \
             changed; shorter wires, or PROBE_RS_SPEED=1000, may help"
        );
    }
    if again.is_none() {
        output::print_line(
            "# for the option bytes of a new part; on other parts, too, only the level changes:",
        )?;
    }
    let wanted = again.unwrap_or(OptionBytes(0x0fff_aaed)).with_brown_out_reset();
    for key in OPTION_KEYS {
        probe.write(FLASH_OPTKEYR, key)?;
    }
    probe.write(FLASH_OPTCR, wanted.0)?;
    probe.write(FLASH_OPTCR, wanted.0 | OptionBytes::START)?;
    match read_options(probe)? {
        Some(options) if options.with_brown_out_reset() != wanted || options.brown_out_level() != 3 => bail!(
            Device,
            "the part did not take brown-out level 3: its option bytes are {options}; the image was not flashed; \
             `STM32_Programmer_CLI -c port=SWD -ob BOR_LEV=0` sets the level; then leave --brownout out"
        ),
        other => Ok(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn option_bytes_of_a_new_part_are_read_and_only_the_brown_out_level_changes() {
        let new = OptionBytes(0x0fff_aaed);
        assert_eq!((new.brown_out_level(), new.read_protection()), (0, 0));
        assert!((0..12).all(|sector| !new.is_write_protected(sector)));
        let set = new.with_brown_out_reset();
        assert_eq!(
            (set.0, set.brown_out_level(), set.read_protection()),
            (0x0fff_aae0, 3, 0)
        );
        assert_eq!(OptionBytes(0x0fff_55ed).read_protection(), 1);
        assert!(OptionBytes(0x0ffe_aaed).is_write_protected(0));
    }
}
