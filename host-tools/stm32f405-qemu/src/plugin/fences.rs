//! Regions of the memory protection unit in which accesses may fault.

use std::ops::Range;

use super::qemu::Qemu;

/// Registers of the unit (ARMv7-M ARM, B3.5).
const MPU_CTRL: u32 = 0xe000_ed94;
const MPU_RNR: u32 = 0xe000_ed98;
const MPU_RBAR: u32 = 0xe000_ed9c;
const MPU_RASR: u32 = 0xe000_eda0;
const ENABLE: u64 = 1;
/// Outside the regions, privileged code has access as without the unit. Other code can execute only within a
/// region.
const PRIVDEFENA: u64 = 1 << 2;
/// Regions of a Cortex-M4.
const REGIONS: u64 = 8;

/// Addresses that the unit watches. `None` if it watches all.
pub(super) fn fences(qemu: &Qemu) -> Option<Vec<Range<u64>>> {
    let control = qemu.read_nvic(MPU_CTRL, 4);
    if control & ENABLE == 0 {
        return Some(Vec::new());
    }
    if control & PRIVDEFENA == 0 {
        return None;
    }
    let selected = qemu.read_nvic(MPU_RNR, 4);
    let region = |number| {
        qemu.write_nvic(MPU_RNR, number, 4);
        let attributes = qemu.read_nvic(MPU_RASR, 4);
        let size = 2 << (attributes >> 1 & 0x1f);
        let start = qemu.read_nvic(MPU_RBAR, 4) & !(size - 1);
        (attributes & 1 == 1).then_some(start..start + size)
    };
    let regions = (0..REGIONS).filter_map(region).collect();
    qemu.write_nvic(MPU_RNR, selected, 4);
    Some(regions)
}
