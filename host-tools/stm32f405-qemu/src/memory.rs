//! Addresses of memory (RM0090 section 2.3).

use std::ops::Range;

/// SRAM1 and SRAM2 of the STM32F405. The DMA reaches them, and reads flash.
pub const SRAM: Range<u32> = 0x2000_0000..0x2002_0000;
/// Flash of the STM32F405, on the AHB. It is bank 1 of parts with 2 MiB.
pub const FLASH: Range<u32> = 0x0800_0000..0x0810_0000;
/// Flash that the firmware can write: all but sectors 0 and 1, where a program starts.
pub const WRITABLE: Range<u32> = 0x0800_8000..0x0810_0000;

/// The sector of flash that CR.SNB names, if there is one (tables 5 and 6). Bit 4 is the bank.
pub(crate) fn sector(snb: u32) -> Option<Range<u32>> {
    let (bank, number) = (snb >> 4, snb & 0xf);
    let (start, kib) = match number {
        0..4 => (16 * number, 16),
        4 => (64, 64),
        5..12 => (128 * (number - 4), 128),
        _ => return None,
    };
    let start = FLASH.start + bank * FLASH.len() as u32 + (start << 10);
    Some(start..start + (kib << 10))
}

/// Core-coupled memory. It is on the processor's bus only: the DMA does not reach it.
pub(crate) const CCM: Range<u32> = 0x1000_0000..0x1001_0000;

/// SRAM of the part that has most. QEMU 7.2 gives this machine all of it, 10.0 only [`SRAM`].
pub(crate) const MOST_SRAM: Range<u32> = 0x2000_0000..0x2003_0000;
/// APB1 and APB2.
pub(crate) const APB: Range<u32> = 0x4000_0000..0x4002_0000;
/// The peripheral region of the address space.
pub(crate) const PERIPHERALS: Range<u32> = 0x4000_0000..0x6000_0000;

/// Returns `true` if an address of the peripheral region is on no bus at all, so that silicon raises a bus
/// fault: above AHB1's and AHB2's last peripheral (table 1). An address between peripherals of one bus reads
/// as zero here, and is reported.
pub(crate) fn is_beyond_every_bus(address: u32) -> bool {
    matches!(address, 0x4008_0000..0x5000_0000 | 0x5006_0c00..0x6000_0000)
}

/// Returns `true` if these bytes lie in SRAM or CCM of some part.
pub(crate) fn is_ram(address: u32, bytes: usize) -> bool {
    within(&MOST_SRAM, address, bytes) || within(&CCM, address, bytes)
}

/// Returns `true` if these bytes lie in a region.
pub(crate) fn within(region: &Range<u32>, address: u32, bytes: usize) -> bool {
    region.contains(&address) && (region.end - address) as usize >= bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twelve_sectors_make_the_flash() {
        let sectors: Vec<_> = (0..12).map_while(sector).collect();
        assert_eq!((sectors[0].start, sectors[11].end), (FLASH.start, FLASH.end));
        assert!(sectors.windows(2).all(|pair| pair[0].end == pair[1].start));
        assert_eq!(sectors[2].start, WRITABLE.start);
        assert_eq!(sectors[10], 0x080c_0000..0x080e_0000);
        assert_eq!(sector(12), None);
        let second: Vec<_> = (16..28).map_while(sector).collect();
        assert_eq!((second[0].start, second[11].end), (FLASH.end, 0x0820_0000));
        assert_eq!(second[1], 0x0810_4000..0x0810_8000);
    }
}
