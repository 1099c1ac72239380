//! Reset values and bits of every register of every modelled peripheral, against what ST describes.

use std::collections::BTreeSet;

use stm32f405_qemu::Run;
use stm32f405_qemu::machine::registers::{self, Register};
use stm32f405_qemu::machine::{Board, Machine};

/// Nothing is outside.
struct Nowhere;

impl Board for Nowhere {
    fn read_memory(&mut self, _address: u32, bytes: &mut [u8]) {
        bytes.fill(0);
    }
    fn write_memory(&mut self, _address: u32, _bytes: &[u8]) {}
    fn overwrite_flash(&mut self, _address: u32, _bytes: &[u8]) {}
    fn flash_changed(&mut self, _address: u32, _bytes: &[u8]) {}
    fn stall(&mut self, _stalled: bool) {}
    fn lose_memory(&mut self) {}
    fn set_interrupt(&mut self, _number: usize, _level: bool) {}
    fn sent(&mut self, _usart: usize, _data: u16, _at: u64) {}
    fn acquired(&mut self, _scans: u64) {}
    fn reset_wanted(&mut self) {}
}

const RCC: u32 = 0x4002_3800;
/// RCC's enable registers.
const ENABLES: [u32; 5] = [0x30, 0x34, 0x38, 0x40, 0x44];

/// A machine after reset with all clocks on; `reset` brings it back there.
struct ClockedChip(Machine);

impl ClockedChip {
    fn new() -> Self {
        let mut chip = Self(Machine::new(Run::new("")));
        chip.reset();
        chip
    }

    fn reset(&mut self) {
        self.0.reset(0, &mut Nowhere);
        for enable in ENABLES {
            self.write(RCC + enable, u32::MAX);
        }
    }

    fn read(&mut self, address: u32) -> u32 {
        self.0.read(address, 4, 0, &mut Nowhere)
    }

    /// Returns `true` if a model has a register there.
    fn answers(&self, address: u32) -> bool {
        let mut machine = self.0.clone();
        let unknown = |machine: &Machine| machine.outcome(0).unknown_registers.len();
        let before = unknown(&machine);
        machine.read(address, 4, 0, &mut Nowhere);
        unknown(&machine) == before
    }

    fn write(&mut self, address: u32, value: u32) {
        self.0.write(address, 4, value, 0, &mut Nowhere);
    }
}

/// Bits of registers where a model differs from the description, and why: by a section of RM0090 (rev. 21),
/// or since writing alone does not show what the bits do. `*` stands for anything but a `_`.
struct Exception {
    registers: &'static str,
    bits: u32,
    why: &'static str,
}

/// In the value after reset.
const RESETS: &[Exception] = &[
    Exception {
        registers: "GPIO*_IDR",
        bits: 1 << 15 | 1 << 13 | 1 << 4,
        why: "PA13, PA15 and PB4 are pulled up for a probe (sections 8.3.1 and 8.4.5: 0x0000 XXXX)",
    },
    Exception {
        registers: "TIM*_ARR",
        bits: u32::MAX,
        why: "0xffff or 0xffffffff, not 0 (sections 17.4.12, 18.4.12, 19.5.9, 20.4.8)",
    },
    Exception {
        registers: "PWR_CR",
        bits: 1 << 14,
        why: "VOS is 1, scale 1 (section 5.4.1)",
    },
    Exception {
        registers: "PWR_CSR",
        bits: 1 << 14,
        why: "VOSRDY: the regulator is ready at once here (section 5.4.2 has 0)",
    },
    Exception {
        registers: "RCC_CR",
        bits: 0xff00,
        why: "HSICAL is the factory's (section 7.3.1: 0x0000 XX83)",
    },
    Exception {
        registers: "RCC_*ENR",
        bits: u32::MAX,
        why: "this test has turned the clocks on",
    },
    Exception {
        registers: "RCC_CSR",
        bits: 1 << 28,
        why: "SFTRSTF: this test resets by software (section 7.3.21)",
    },
    Exception {
        registers: "FLASH_OPTCR",
        bits: u32::MAX,
        why: "the factory's option bytes, 0x0fffaaed (section 3.9.6)",
    },
    Exception {
        registers: "DBGMCU_IDCODE",
        bits: u32::MAX,
        why: "revision Z of DEV_ID 0x413 (section 38.6.1)",
    },
];

/// In the bits that keep what is written.
const BITS: &[Exception] = &[
    Exception {
        registers: "TIM*_SR",
        bits: u32::MAX,
        why: "flags: hardware sets them, a 0 clears (section 18.4.5)",
    },
    Exception {
        registers: "IWDG_PR",
        bits: 7,
        why: "locked until KR is 0x5555 (section 21.4.2)",
    },
    Exception {
        registers: "IWDG_RLR",
        bits: 0xfff,
        why: "locked until KR is 0x5555 (section 21.4.3)",
    },
    Exception {
        registers: "PWR_CR",
        bits: 0b1100,
        why: "CWUF and CSBF read as 0 (section 5.4.1)",
    },
    Exception {
        registers: "U*ART*_SR",
        bits: 0x360,
        why: "flags: hardware sets them, a 0 clears (section 30.6.1)",
    },
    Exception {
        registers: "U*ART*_DR",
        bits: 0x1ff,
        why: "two registers at one address (section 30.6.2)",
    },
    Exception {
        registers: "ADC*_SR",
        bits: 0x3f,
        why: "flags: hardware sets them, a 0 clears (section 13.13.1)",
    },
    Exception {
        registers: "ADC*_CR2",
        bits: 1 << 30,
        why: "SWSTART is cleared as soon as the conversion starts (section 13.13.3)",
    },
    Exception {
        registers: "GPIO*_LCKR",
        bits: 1 << 16,
        why: "LCKK reads 1 once the key was turned in three writes (section 8.4.8)",
    },
    Exception {
        registers: "EXTI_PR",
        bits: 0x007f_ffff,
        why: "a 1 clears (section 12.3.6)",
    },
    Exception {
        registers: "RCC_CR",
        bits: 1,
        why: "HSION: the clock in use cannot be stopped (section 7.3.1)",
    },
    Exception {
        registers: "RCC_CFGR",
        bits: 0b1100,
        why: "SWS is read-only (section 7.3.3)",
    },
    Exception {
        registers: "RCC_BDCR",
        bits: 0x0001_8305,
        why: "locked until PWR_CR.DBP is set (section 7.3.20)",
    },
    Exception {
        registers: "RCC_CSR",
        bits: 0xff00_0000,
        why: "reset flags are read-only, RMVF reads as 0 (section 7.3.21)",
    },
    Exception {
        registers: "FLASH_SR",
        bits: 0xf3,
        why: "flags: a 1 clears (section 3.9.4)",
    },
    Exception {
        registers: "FLASH_CR",
        bits: u32::MAX,
        why: "locked after reset (section 3.9.5)",
    },
    Exception {
        registers: "FLASH_OPTCR",
        bits: u32::MAX,
        why: "locked after reset (section 3.9.6)",
    },
    Exception {
        registers: "DBGMCU_CR",
        bits: 0x001f_0000,
        why: "bits 31:8 are reserved (section 38.16.3)",
    },
    Exception {
        registers: "DBGMCU_APB1_FZ",
        bits: 1 << 10,
        why: "DBG_RTC_STOP is missing in the description (section 38.16.4)",
    },
];

/// Registers that a modelled peripheral lacks. An access is reported.
const ABSENT: &[&str] = &["TIM*_DCR", "TIM*_DMAR", "TIM*_OR", "ADC*_JDR*", "ADC_CDR"];

/// Returns `true` if a name fits a pattern in which `*` stands for anything but a `_`.
fn fits(pattern: &str, name: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == name,
        Some((before, after)) => name.strip_prefix(before).is_some_and(|rest| {
            let ends = (0..=rest.len()).filter(|end| !rest[..*end].contains('_'));
            ends.into_iter().any(|end| fits(after, &rest[end..]))
        }),
    }
}

/// Returns the differences of a register that no exception explains, and marks the exceptions used.
fn unexplained(differences: u32, name: &str, exceptions: &[Exception], needed: &mut [bool]) -> u32 {
    let mut left = differences;
    for (exception, needed) in exceptions.iter().zip(needed) {
        if fits(exception.registers, name) {
            *needed |= differences & exception.bits != 0;
            left &= !exception.bits;
        }
    }
    left
}

fn all_needed(exceptions: &[Exception], needed: &[bool]) {
    for (exception, needed) in exceptions.iter().zip(needed) {
        assert!(
            needed,
            "no register needs this exception: {} {}",
            exception.registers, exception.why
        );
    }
}

/// Every register that a model has.
fn modelled(chip: &mut ClockedChip) -> Vec<Register> {
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
            wrong.push(format!(
                "{name} is {found:#x} after reset, not {:#x}",
                register.reset
            ));
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
    let lacks = |register: &Register| known.contains(register.peripheral) && !chip.answers(register.address);
    let lacking: Vec<_> = registers::all()
        .filter(lacks)
        .map(|register| register.to_string())
        .collect();
    let expected = |name: &String| ABSENT.iter().any(|pattern| fits(pattern, name));
    let (absent, forgotten): (Vec<_>, Vec<_>) = lacking.into_iter().partition(expected);
    assert_eq!(forgotten, [""; 0]);
    for pattern in ABSENT {
        assert!(
            absent.iter().any(|name| fits(pattern, name)),
            "{pattern} is not absent"
        );
    }
    // Most of the table of the part, so that this test looks at something.
    assert!(modelled(&mut chip).len() > 300);
}
