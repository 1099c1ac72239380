//! Where memory lies (RM0090 section 2.3).

use std::ops::Range;

/// SRAM1 and SRAM2. The DMA reaches them, and reads flash.
pub const SRAM: Range<u32> = 0x2000_0000..0x2002_0000;
/// Flash, on the AHB.
pub const FLASH: Range<u32> = 0x0800_0000..0x0810_0000;
/// The part of flash that the firmware can write: sectors 10 and 11.
pub const WRITABLE: Range<u32> = 0x080c_0000..0x0810_0000;
/// Core-coupled memory. It is on the processor's bus only: the DMA does not reach it.
pub(crate) const CCM: Range<u32> = 0x1000_0000..0x1001_0000;

/// Whether these bytes lie in SRAM or CCM.
pub(crate) fn is_ram(address: u32, bytes: usize) -> bool {
    let within = |ram: Range<u32>| {
        address
            .checked_sub(ram.start)
            .is_some_and(|offset| offset as usize + bytes <= ram.len())
    };
    within(SRAM) || within(CCM)
}
