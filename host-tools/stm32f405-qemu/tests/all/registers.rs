//! Reset values and bits of every register of every modelled peripheral, against ST's description.

use std::collections::BTreeSet;

use stm32f405_qemu::Run;
use stm32f405_qemu::machine::Machine;
use stm32f405_qemu::machine::registers::{self, NamedRegister};

use super::machine::bench::{RCC, TestBoard};

/// RCC's enable registers.
const ENABLES: [u32; 5] = [0x30, 0x34, 0x38, 0x40, 0x44];

/// A machine after reset with all clocks on; `reset` restores that state.
struct ClockedChip(Machine, TestBoard);

impl ClockedChip {
    fn new() -> Self {
        let mut chip = Self(Machine::new(Run::new("")), TestBoard::new());
        chip.reset();
        chip
    }

    fn reset(&mut self) {
        self.0.reset(0, &mut self.1);
        for enable in ENABLES {
            self.write(RCC + enable, u32::MAX);
        }
    }

    fn read(&mut self, address: u32) -> u32 {
        self.0.read(address, 4, 0, &mut self.1)
    }

    /// Returns `true` if a model has a register at this address.
    fn answers(&self, address: u32) -> bool {
        let mut machine = self.0.clone();
        let unknown = |machine: &Machine| machine.outcome(0).unknown_registers.len();
        let before = unknown(&machine);
        machine.read(address, 4, 0, &mut TestBoard::default());
        unknown(&machine) == before
    }

    fn write(&mut self, address: u32, value: u32) {
        self.0.write(address, 4, value, 0, &mut self.1);
    }
}

/// Bits of registers where a model differs from the description. Each has its reason: a section of RM0090
/// (rev. 21), or that writes alone do not show their function. `*` matches anything but a `_`.
type Deviation = (&'static str, u32);

/// Deviations in the value after reset.
const RESETS: &[Deviation] = &[
    // PA13, PA15 and PB4 are pulled up for a probe (sections 8.3.1 and 8.4.5: 0x0000 XXXX).
    ("GPIO*_IDR", 1 << 15 | 1 << 13 | 1 << 4),
    // 0xffff or 0xffffffff, not 0 (sections 17.4.12, 18.4.12, 19.5.9, 20.4.8).
    ("TIM*_ARR", u32::MAX),
    // VOS is 1, scale 1 (section 5.4.1).
    ("PWR_CR", 1 << 14),
    // VOSRDY: the regulator is ready at once here (section 5.4.2 has 0).
    ("PWR_CSR", 1 << 14),
    // HSICAL is the factory's (section 7.3.1: 0x0000 XX83).
    ("RCC_CR", 0xff00),
    // This test has turned the clocks on.
    ("RCC_*ENR", u32::MAX),
    // SFTRSTF: this test resets by software (section 7.3.21).
    ("RCC_CSR", 1 << 28),
    // The factory's option bytes, 0x0fffaaed (section 3.9.6).
    ("FLASH_OPTCR", u32::MAX),
    // Counts down from PREDIV_S, which is 255 (section 26.6.11).
    ("RTC_SSR", 0xff),
    // 0 (section 26.6.15).
    ("RTC_TSDR", 0x2101),
    // Revision Z of DEV_ID 0x413 (section 38.6.1).
    ("DBGMCU_IDCODE", u32::MAX),
];

/// Deviations in the bits that keep a written value.
const BITS: &[Deviation] = &[
    // Flags: hardware sets them, a 0 clears (section 18.4.5).
    ("TIM*_SR", u32::MAX),
    // Locked until KR is 0x5555 (section 21.4.2).
    ("IWDG_PR", 7),
    // Locked until KR is 0x5555 (section 21.4.3).
    ("IWDG_RLR", 0xfff),
    // CWUF and CSBF read as 0 (section 5.4.1).
    ("PWR_CR", 0b1100),
    // Flags: hardware sets them, a 0 clears (section 30.6.1).
    ("U*ART*_SR", 0x360),
    // Two registers at one address (section 30.6.2).
    ("U*ART*_DR", 0x1ff),
    // Flags: hardware sets them, a 0 clears (section 13.13.1).
    ("ADC*_SR", 0x3f),
    // SWSTART is cleared as soon as the conversion starts (section 13.13.3).
    ("ADC*_CR2", 1 << 30),
    // LCKK reads 1 once the key was turned in three writes (section 8.4.8).
    ("GPIO*_LCKR", 1 << 16),
    // A 1 clears (section 12.3.6).
    ("EXTI_PR", 0x007f_ffff),
    // HSION: the clock in use cannot be stopped (section 7.3.1).
    ("RCC_CR", 1),
    // SWS is read-only (section 7.3.3).
    ("RCC_CFGR", 0b1100),
    // Locked until PWR_CR.DBP is set (section 7.3.20).
    ("RCC_BDCR", 0x0001_8305),
    // Reset flags are read-only, RMVF reads as 0 (section 7.3.21).
    ("RCC_CSR", 0xff00_0000),
    // Flags: a 1 clears (section 3.9.4).
    ("FLASH_SR", 0xf3),
    // Locked after reset (section 3.9.5).
    ("FLASH_CR", u32::MAX),
    // Locked after reset (section 3.9.6).
    ("FLASH_OPTCR", u32::MAX),
    // Flags: a 1 clears (section 14.5.14).
    ("DAC_SR", 1 << 29 | 1 << 13),
    // Bits 31:8 are reserved (section 38.16.3).
    ("DBGMCU_CR", 0x001f_0000),
    // A 0 clears (section 24.4.2).
    ("RNG_SR", 0x60),
    // Hardware sets EWIF, a 0 clears (section 22.6.3).
    ("WWDG_SR", 1),
    // The unit computes a checksum of the written words (section 4.4.1).
    ("CRC_DR", u32::MAX),
    // Locked until PWR_CR.DBP is set and the keys are in WPR (section 26.3.3).
    ("RTC_*", u32::MAX),
    // START, STOP: hardware clears them, at once with PE clear (section 27.6.1).
    ("I2C*_CR1", 0x300),
    // Flags: hardware sets them, a 0 clears (section 27.6.6).
    ("I2C*_SR1", 0xdf00),
    // Two registers at one address (section 27.6.5).
    ("I2C*_DR", 0xff),
    // Two registers at one address (section 28.5.4).
    ("SPI*_DR", 0xffff),
    // Hardware sets it, a 0 clears (section 28.5.3).
    ("SPI*_SR", 1 << 4),
    // DBG_RTC_STOP is missing in the description (section 38.16.4).
    ("DBGMCU_APB1_FZ", 1 << 10),
];

/// Registers that a modelled peripheral lacks. An access is reported.
const ABSENT: &[&str] = &[
    "TIM*_DCR",
    "TIM*_DMAR",
    "TIM2_OR",
    "TIM5_OR",
    "ADC*_JDR*",
    "ADC_CDR",
];

/// Returns `true` if a name matches a pattern, in which `*` matches anything but a `_`.
fn fits(pattern: &str, name: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == name,
        Some((before, after)) => name.strip_prefix(before).is_some_and(|rest| {
            let ends = (0..=rest.len()).filter(|end| !rest[..*end].contains('_'));
            ends.into_iter().any(|end| fits(after, &rest[end..]))
        }),
    }
}

/// Returns the differences of a register that no deviation explains, and marks the deviations used.
fn unexplained(differences: u32, name: &str, deviations: &[Deviation], needed: &mut [bool]) -> u32 {
    let mut left = differences;
    for ((registers, bits), needed) in deviations.iter().zip(needed) {
        if fits(registers, name) {
            *needed |= differences & bits != 0;
            left &= !bits;
        }
    }
    left
}

fn all_needed(deviations: &[Deviation], needed: &[bool]) {
    for (deviation, needed) in deviations.iter().zip(needed) {
        assert!(needed, "no register needs this deviation: {deviation:?}");
    }
}

/// Every register that a model has.
fn modelled(chip: &mut ClockedChip) -> Vec<NamedRegister> {
    registers::all()
        .filter(|register| chip.answers(register.address))
        .collect()
}

#[test]
fn every_register_has_the_value_after_reset_that_st_describes() {
    let mut chip = ClockedChip::new();
    let mut needed = [false; RESETS.len()];
    let mut wrong = Vec::new();
    for register in modelled(&mut chip) {
        chip.reset();
        let found = chip.read(register.address);
        let name = register.to_string();
        if unexplained(found ^ register.reset, &name, RESETS, &mut needed) != 0 {
            let expected = register.reset;
            wrong.push(format!("{name} is {found:#x} after reset, not {expected:#x}"));
        }
    }
    assert_eq!(wrong, [""; 0]);
    all_needed(RESETS, &needed);
}

#[test]
fn every_register_keeps_the_bits_that_st_describes_and_no_other() {
    let mut chip = ClockedChip::new();
    let mut needed = [false; BITS.len()];
    let mut wrong = Vec::new();
    for register in modelled(&mut chip) {
        let address = register.address;
        let mut kept = 0;
        for bit in 0..32 {
            chip.reset();
            let reset = chip.read(address);
            chip.write(address, reset ^ 1 << bit);
            kept |= (chip.read(address) ^ reset) & 1 << bit;
        }
        let described = register.readable & register.writable;
        let name = register.to_string();
        if unexplained(kept ^ described, &name, BITS, &mut needed) != 0 {
            wrong.push(format!("{name} keeps {kept:#010x}, not {described:#010x}"));
        }
    }
    assert_eq!(wrong, [""; 0]);
    all_needed(BITS, &needed);
}

#[test]
fn a_modelled_peripheral_has_every_register_but_those_that_are_reported() {
    let mut chip = ClockedChip::new();
    let known: BTreeSet<_> = modelled(&mut chip)
        .iter()
        .map(|register| register.peripheral)
        .collect();
    let lacks =
        |register: &NamedRegister| known.contains(register.peripheral) && !chip.answers(register.address);
    let lacking: Vec<_> = registers::all()
        .filter(lacks)
        .map(|register| register.to_string())
        .collect();
    let expected = |name: &String| ABSENT.iter().any(|pattern| fits(pattern, name));
    let (absent, forgotten): (Vec<_>, Vec<_>) = lacking.into_iter().partition(expected);
    assert_eq!(forgotten, [""; 0]);
    for pattern in ABSENT {
        let is_absent = absent.iter().any(|name| fits(pattern, name));
        assert!(is_absent, "{pattern}");
    }
    // Most registers of the table, so that this test cannot pass without checking any.
    assert!(modelled(&mut chip).len() > 300);
}
