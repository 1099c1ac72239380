//! Tests that QEMU does what the overlay relies on, so that a QEMU that differs causes a clear error instead
//! of a wrong result.

use super::qemu::{Qemu, SPARE_LINE};
use crate::chip::Chip;

/// Tests, before the first instruction, our registers as QEMU's memory and the processor see them, and the
/// added RAM. The reset that follows removes what this leaves behind.
pub(super) fn self_test(qemu: &Qemu, chip: Chip) -> Result<(), String> {
    const FLASH_ACR: u32 = 0x4002_3c00;
    const DWT_CTRL: u32 = 0xe000_1000;

    let word = |address: u32| {
        let mut bytes = [0; 4];
        qemu.read_memory(address, &mut bytes);
        u32::from_le_bytes(bytes)
    };
    let check = |what: &str, found: u32, expected: u32| {
        let differs = || format!("{what} is {found:#010x} instead of {expected:#010x}");
        (found == expected).then_some(()).ok_or_else(differs)
    };
    let flash = chip.flash_space();
    qemu.poke(flash.start, &vec![0xff; flash.len()]);
    check("a word of erased flash", word(flash.end - 4), u32::MAX)?;
    let at_0 = word((flash.end - flash.start) - 4);
    check("the same word seen at 0", at_0, u32::MAX)?;
    qemu.write_memory(FLASH_ACR, &5u32.to_le_bytes());
    check("FLASH_ACR after a write", word(FLASH_ACR), 5)?;
    qemu.write_memory(FLASH_ACR, &0u32.to_le_bytes());
    for ram in [chip.sram(), chip.ccm()]
        .into_iter()
        .filter(|ram| !ram.is_empty())
    {
        let last = ram.end - 4;
        for (address, value) in [(ram.start, 0x5a5a_a5a5u32), (last, 0x1234_5678), (ram.start, 0)] {
            qemu.write_memory(address, &value.to_le_bytes());
            check("a word of RAM after a write", word(address), value)?;
        }
    }
    let seen = qemu.processor_word(DWT_CTRL) & 0xf000_0000;
    check("DWT_CTRL seen by the processor", seen, 0x4000_0000)
}

/// Tests that an interrupt line that is raised is pending. The interrupt controller must have been reset
/// before.
pub(super) fn interrupt_test(qemu: &Qemu) -> Result<(), String> {
    /// Set-pending bits of interrupts 64 to 95.
    const NVIC_ISPR2: u32 = 0xe000_e208;
    const NVIC_ICPR2: u32 = 0xe000_e288;
    let pending = || (qemu.processor_word(NVIC_ISPR2) >> (SPARE_LINE - 64)) & 1 == 1;
    let before = pending();
    qemu.set_interrupt(SPARE_LINE, true);
    let raised = pending();
    qemu.set_interrupt(SPARE_LINE, false);
    // A pending interrupt stays pending until it is taken or cleared.
    qemu.write_nvic(NVIC_ICPR2, 1 << (SPARE_LINE - 64), 4);
    match (before, raised, pending()) {
        (false, true, false) => Ok(()),
        (_, _, cleared) => Err(format!(
            "an interrupt line is pending: {before} before it was raised, {raised} after that, {cleared} once cleared"
        )),
    }
}
