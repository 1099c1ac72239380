//! Every register of the STM32F405 by name, as ST describes it.
//!
//! The table `registers.txt` is not hand-written. `examples/registers.rs` generates it from the crate
//! `stm32f4` of the project stm32-rs, which publishes ST's description with corrections. The overlay takes
//! names from it, and `tests/all/registers.rs` checks the models against it.

use std::fmt;
use std::ops::Range;

use crate::memory::PERIPHERALS;

/// One register.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedRegister {
    /// For example `TIM2`.
    pub peripheral: &'static str,
    /// For example `CR1`.
    pub name: &'static str,
    /// Address of the word.
    pub address: u32,
    /// Value after reset.
    pub reset: u32,
    /// Bits that can be read.
    pub readable: u32,
    /// Bits that can be written.
    pub writable: u32,
}

impl fmt::Display for NamedRegister {
    /// As in the reference manual: `TIM2_CR1`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}_{}", self.peripheral, self.name)
    }
}

const TABLE: &str = include_str!("registers.txt");

/// Largest address range of a peripheral of [`TABLE`], in bytes (section 2.3, table 1).
const SLOT: u32 = 0x400;

/// Regions that the table lacks: the factory's constants, the backup RAM, and units of the processor.
const OTHERS: [(Range<u32>, &str); 13] = [
    (0x1fff_0000..0x1fff_7800, "BOOTLOADER"),
    (0x1fff_7800..0x1fff_7a10, "OTP"),
    (0x1fff_7a10..0x1fff_7c00, "SIGNATURE"),
    (0x1fff_c000..0x1fff_c010, "OPTION_BYTES"),
    (0x4002_4000..0x4002_5000, "BKPSRAM"),
    (0xe000_0000..0xe000_1000, "ITM"),
    (0xe000_1000..0xe000_2000, "DWT"),
    (0xe000_2000..0xe000_3000, "FPB"),
    (0xe000_e010..0xe000_e020, "SysTick"),
    (0xe000_ed10..0xe000_ed14, "SCR"),
    (0xe000_edf0..0xe000_ee00, "DCB"),
    (0xe004_0000..0xe004_1000, "TPIU"),
    (0xe004_1000..0xe004_2000, "ETM"),
];

/// Registers of the processor's own units (ARMv7-M ARM, B3.3.2, C1.8.7, C1.7.6, C1.6.5).
const OF_CORE: [(u32, &str); 17] = [
    (0xe000_0e00, "ITM_TER"),
    (0xe000_0e40, "ITM_TPR"),
    (0xe000_0e80, "ITM_TCR"),
    (0xe000_1000, "DWT_CTRL"),
    (0xe000_1004, "DWT_CYCCNT"),
    (0xe000_2000, "FP_CTRL"),
    (0xe000_e010, "SysTick_CTRL"),
    (0xe000_e014, "SysTick_LOAD"),
    (0xe000_e018, "SysTick_VAL"),
    (0xe000_e01c, "SysTick_CALIB"),
    (0xe000_ed10, "SCR"),
    (0xe000_edf0, "DCB_DHCSR"),
    (0xe000_edf4, "DCB_DCRSR"),
    (0xe000_edf8, "DCB_DCRDR"),
    (0xe000_edfc, "DCB_DEMCR"),
    (0xe004_0004, "TPIU_CSPSR"),
    (0xe004_00f0, "TPIU_SPPR"),
];

/// A peripheral of [`TABLE`]: its name, its first address, and its kind, which has the registers.
type MappedBlock = (&'static str, u32, &'static str);

fn places() -> impl Iterator<Item = MappedBlock> {
    TABLE.lines().filter_map(|line| {
        let mut words = line.strip_prefix("at ")?.split(' ');
        let start = hex(words.next()?)?;
        Some((words.next()?, start, words.next()?))
    })
}

fn registers((peripheral, start, kind): MappedBlock) -> impl Iterator<Item = NamedRegister> {
    let mut lines = TABLE.lines();
    lines.find(|line| line.strip_prefix("block ") == Some(kind));
    let lines = lines.map_while(|line| line.strip_prefix("  "));
    lines.filter_map(move |line| {
        let mut words = line.split(' ');
        let address = start + hex(words.next()?)?;
        let name = words.next()?;
        let mut number = || hex(words.next()?);
        Some(NamedRegister {
            peripheral,
            name,
            address,
            reset: number()?,
            readable: number()?,
            writable: number()?,
        })
    })
}

fn hex(digits: &str) -> Option<u32> {
    u32::from_str_radix(digits, 16).ok()
}

/// All registers of all peripherals, modelled or not, in the order of their peripherals' addresses.
pub fn all() -> impl Iterator<Item = NamedRegister> {
    places().flat_map(registers)
}

/// Name of the register at an address: `SPI1_SR`, `SPI1+0x24` between the registers of a peripheral, or
/// `0x40007c00 (reserved)` where there is none.
pub fn name(address: u32) -> String {
    if let Some((_, name)) = OF_CORE.iter().find(|(at, _)| *at == address) {
        return (*name).into();
    }
    let other = OTHERS.iter().find(|(range, _)| range.contains(&address));
    let place = places().take_while(|(_, start, _)| *start <= address).last();
    let (peripheral, start) = match (other, place) {
        (Some((range, name)), _) => (*name, range.start),
        (None, Some((name, start, _))) if address - start < SLOT => (name, start),
        _ => return format!("{address:#010x} (reserved)"),
    };
    let named = place.and_then(|place| registers(place).find(|register| register.address == address));
    let unnamed = || format!("{peripheral}+{:#04x}", address - start);
    named.map_or_else(unnamed, |register| register.to_string())
}

/// Name of the register at an address in the peripheral region, `None` outside of it.
pub(crate) fn name_of(address: u32) -> Option<String> {
    let of_core = OTHERS.iter().any(|(range, _)| range.contains(&address));
    (of_core || PERIPHERALS.contains(&address)).then(|| name(address))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn peripherals_are_in_the_order_of_their_addresses() {
        assert!(places().map(|(_, start, _)| start).is_sorted());
    }

    #[test]
    fn every_line_of_the_table_is_understood() {
        let lines = TABLE.lines().filter(|line| line.starts_with("  ")).count();
        let kinds: BTreeSet<_> = places().map(|(_, _, kind)| kind).collect();
        let first_of_each = kinds
            .iter()
            .filter_map(|kind| places().find(|place| place.2 == *kind));
        assert_eq!(first_of_each.flat_map(registers).count(), lines);
        assert!(all().all(|register| register.address.is_multiple_of(4)));
    }

    #[test]
    fn a_register_is_named_as_in_the_manual_and_what_is_none_by_its_place() {
        assert_eq!(name(0x4001_3008), "SPI1_SR");
        assert_eq!(name(0x4001_3024), "SPI1+0x24");
        assert_eq!(name(0x4002_6488), "DMA2_S5CR");
        assert_eq!(name(0x4001_2304), "ADC_CCR");
        assert_eq!(name(0x4000_7404), "DAC_SWTRIGR");
        assert_eq!(name(0x5006_0804), "RNG_SR");
        assert_eq!(name(0x4002_4ffc), "BKPSRAM+0xffc");
        assert_eq!(name(0xe000_1004), "DWT_CYCCNT");
        assert_eq!(name(0xe000_e018), "SysTick_VAL");
        assert_eq!(name(0x4000_7c00), "0x40007c00 (reserved)");
        assert_eq!(name(0x4002_9400), "0x40029400 (reserved)");
    }
}
