//! Places of the images in flash.

use core::ops::Range;

/// Parts of flash, as offsets from its start.
#[derive(Clone, Debug)]
pub struct Layout {
    /// The state: whether another image is to be tried, and how far the swap is.
    pub state: Range<u32>,
    /// The image that runs.
    pub active: Range<u32>,
    /// The image that an update brings, or the one before. It is one page longer.
    pub spare: Range<u32>,
}

impl Layout {
    /// The regions STATE, FLASH and SPARE of `memory.x`.
    pub const BEAD: Self = Self {
        state: 0x0_8000..0x0_c000,
        active: 0x2_0000..0x6_0000,
        spare: 0x6_0000..0xc_0000,
    };

    /// Longest image, bytes.
    pub const fn capacity(&self) -> u32 {
        self.active.end - self.active.start
    }
}

/// Bytes that are swapped at a time: a sector of the active image.
pub const PAGE: usize = 128 * 1024;

/// Address of the first byte of flash.
pub const FLASH: u32 = 0x0800_0000;

#[cfg(test)]
mod tests {
    use std::string::ToString;

    use super::*;

    #[test]
    fn the_linker_divides_flash_in_the_same_way() {
        let script = include_str!("../../../memory.x");
        let Layout { state, active, spare } = Layout::BEAD;
        for (name, range) in [("STATE", state), ("FLASH", active), ("SPARE", spare)] {
            let line = script
                .lines()
                .find(|line| line.trim_start().starts_with(name) && line.contains(" : "));
            let origin = std::format!(" {:#010X},", FLASH + range.start).replace("0X", "0x");
            let length = std::format!("LENGTH = {}K", range.len() / 1024);
            let line = line.unwrap().to_string();
            assert!(
                line.contains(&origin) && line.ends_with(&length),
                "{line}: {origin} {length}"
            );
        }
    }
}
