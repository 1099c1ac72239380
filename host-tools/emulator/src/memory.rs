//! Where memory lies (RM0090 section 2.3).

use std::ops::Range;

/// SRAM1 and SRAM2 (section 2.3). The DMA reaches them, and reads flash; CCM is on the processor's bus only.
pub const SRAM: Range<u32> = 0x2000_0000..0x2002_0000;
/// The flash on the AHB (section 2.3).
pub const FLASH: Range<u32> = 0x0800_0000..0x0810_0000;
/// What the firmware can write: sectors 10 and 11.
pub const WRITABLE: Range<u32> = 0x080c_0000..0x0810_0000;
/// Core-coupled memory.
pub(crate) const CCM: Range<u32> = 0x1000_0000..0x1001_0000;

/// Whether the log may lie there: SRAM or CCM. An address that the image has not set yet may be a register of ours.
pub(crate) fn is_ram(address: u32, bytes: usize) -> bool {
    let within = |ram: Range<u32>| {
        address
            .checked_sub(ram.start)
            .is_some_and(|offset| offset as usize + bytes <= ram.len())
    };
    within(SRAM) || within(CCM)
}
