//! The modelled peripherals: a row for each, with its model, its addresses and its connections.
//!
//! # Design
//!
//! The table is the memory map (RM0090 section 2.3, table 1), the clock gates (section 7.3) and the interrupt
//! lines (table 61) of what is modelled. Everything that treats all peripherals alike goes through it:
//! registers, resets, clocks, interrupts and notes. A new peripheral is a row here and a file that implements
//! [`Peripheral`].
//!
//! A row names a field of [`Units`], the struct that holds the models. Code that connects peripherals needs
//! their own types, and accesses these fields by name.

use std::ops::Range;
use std::sync::LazyLock;

use super::board::NMI;
use crate::peripherals::rcc::Bus::{self, Ahb1, Ahb2, Apb1, Apb2};
use crate::peripherals::{
    Notes, Peripheral,
    adc_common::Adcs,
    clock::{Apb, HSI_HZ, LSI_HZ},
    core,
    crc::Crc,
    dac::Dac,
    dbgmcu::Dbgmcu,
    dma::Dma,
    dwt::Dwt,
    exti::Exti,
    flash::FlashController,
    gpio::Gpio,
    i2c::I2c,
    iwdg::Iwdg,
    pwr::Pwr,
    rcc::Rcc,
    rng::Rng,
    rtc::Rtc,
    signature::Signature,
    spi::Spi,
    syscfg::Syscfg,
    systick::SysTick,
    tim::{Tim, TimerKind},
    usart::{Usart, UsartFeatures},
    wwdg::Wwdg,
};

/// The interrupt lines of DMA2's streams.
pub(super) const DMA2_LINES: [usize; 8] = [56, 57, 58, 59, 60, 68, 69, 70];

pub(super) struct PeripheralRow {
    pub(super) name: &'static str,
    pub(super) addresses: Range<u32>,
    pub(super) gate: Gate,
    /// Its lines at the interrupt controller, in the order of the model's outputs.
    pub(super) lines: &'static [usize],
    pub(super) model: fn(&Units) -> &dyn Peripheral,
    /// Requests of the firmware that the model does not carry out.
    pub(super) notes: fn(&Units) -> &Notes,
    pub(super) model_mut: fn(&mut Units) -> &mut dyn Peripheral,
}

/// Bits of a bus's enable and reset registers. Without them, the clock is always on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Gate {
    pub(super) bus: Bus,
    /// The clock is on if one of these is set.
    pub(super) enables: u32,
    pub(super) reset: u32,
}

/// A clock that is always on.
const ALWAYS: Gate = Gate {
    bus: Ahb1,
    enables: 0,
    reset: 0,
};

/// Gate of a peripheral that shares it with no other: the same bit in both registers.
const fn gate(bus: Bus, bit: u32) -> Gate {
    let (enables, reset) = (1 << bit, 1 << bit);
    Gate { bus, enables, reset }
}

/// Gate of a converter: each has its clock, and all share one reset. The common registers answer with any of
/// the clocks.
const fn converter(enables: u32) -> Gate {
    let (bus, reset) = (Apb2, 1 << 8);
    Gate { bus, enables, reset }
}

/// Declares [`Units`] and [`TABLE`]: for each field its type and its value after power-up, then a row for
/// each peripheral in it: name, addresses, clock gate, interrupt lines.
macro_rules! peripherals {
    (
        new($($argument:ident: $given:ty),*);
        $($field:ident: $model:ty = $new:expr => {
            $($(.$inner:ident)? $([$index:literal])? $name:literal, $addresses:expr, $gate:expr, $lines:expr;)+
        })+
    ) => {
        /// The models of all peripherals.
        #[derive(Debug, Clone)]
        pub(super) struct Units { $(pub(super) $field: $model,)+ }

        impl Units {
            /// The models after power-up.
            pub(super) fn new($($argument: $given),*) -> Self {
                Self { $($field: $new,)+ }
            }
        }

        /// In the order in which notes are reported.
        pub(super) static TABLE: &[PeripheralRow] = &[$($(
            PeripheralRow {
                name: $name,
                addresses: $addresses,
                gate: $gate,
                lines: $lines,
                model: |units| &units.$field$(.$inner)?$([$index])?,
                notes: |units| &units.$field$(.$inner)?$([$index])?.notes,
                model_mut: |units| &mut units.$field$(.$inner)?$([$index])?,
            },
        )+)+];
    };
}

const TIMERS: [TimerKind; 14] = [
    TimerKind::ADVANCED,
    TimerKind::GENERAL_32,
    TimerKind::GENERAL,
    TimerKind::GENERAL,
    TimerKind::GENERAL_32,
    TimerKind::BASIC,
    TimerKind::BASIC,
    TimerKind::ADVANCED,
    TimerKind::TWO_CHANNELS.on_apb2(),
    TimerKind::ONE_CHANNEL.on_apb2(),
    TimerKind::WITH_CRYSTAL.on_apb2(),
    TimerKind::TWO_CHANNELS,
    TimerKind::ONE_CHANNEL,
    TimerKind::ONE_CHANNEL,
];

const PORTS: [UsartFeatures; 6] = [
    UsartFeatures::USART,
    UsartFeatures::USART_ON_APB1,
    UsartFeatures::USART_ON_APB1,
    UsartFeatures::UART,
    UsartFeatures::UART,
    UsartFeatures::USART,
];

peripherals! {
    new(hse_hz: u32, dev_id: u16, uid: [u8; 12], seed: u64);
    tim: [Tim; 14] = TIMERS.map(|kind| Tim::new(kind, HSI_HZ)) => {
        [0] "TIM1", 0x4001_0000..0x4001_0400, gate(Apb2, 0), &[24, 25, 26, 27];
        [1] "TIM2", 0x4000_0000..0x4000_0400, gate(Apb1, 0), &[28];
        [2] "TIM3", 0x4000_0400..0x4000_0800, gate(Apb1, 1), &[29];
        [3] "TIM4", 0x4000_0800..0x4000_0c00, gate(Apb1, 2), &[30];
        [4] "TIM5", 0x4000_0c00..0x4000_1000, gate(Apb1, 3), &[50];
        [5] "TIM6", 0x4000_1000..0x4000_1400, gate(Apb1, 4), &[54];
        [6] "TIM7", 0x4000_1400..0x4000_1800, gate(Apb1, 5), &[55];
        [7] "TIM8", 0x4001_0400..0x4001_0800, gate(Apb2, 1), &[43, 44, 45, 46];
        [8] "TIM9", 0x4001_4000..0x4001_4400, gate(Apb2, 16), &[24];
        [9] "TIM10", 0x4001_4400..0x4001_4800, gate(Apb2, 17), &[25];
        [10] "TIM11", 0x4001_4800..0x4001_4c00, gate(Apb2, 18), &[26];
        [11] "TIM12", 0x4000_1800..0x4000_1c00, gate(Apb1, 6), &[43];
        [12] "TIM13", 0x4000_1c00..0x4000_2000, gate(Apb1, 7), &[44];
        [13] "TIM14", 0x4000_2000..0x4000_2400, gate(Apb1, 8), &[45];
    }
    dma: [Dma; 2] = [0, 1].map(Dma::new) => {
        [0] "DMA1", 0x4002_6000..0x4002_6400, gate(Ahb1, 21), &[11, 12, 13, 14, 15, 16, 17, 47];
        [1] "DMA2", 0x4002_6400..0x4002_6800, gate(Ahb1, 22), &DMA2_LINES;
    }
    adc: Adcs = Adcs::new(HSI_HZ) => {
        .converters[0] "ADC1", 0x4001_2000..0x4001_2100, converter(1 << 8), &[18];
        .converters[1] "ADC2", 0x4001_2100..0x4001_2200, converter(1 << 9), &[18];
        .converters[2] "ADC3", 0x4001_2200..0x4001_2300, converter(1 << 10), &[18];
        "ADC", 0x4001_2300..0x4001_2400, converter(0b111 << 8), &[];
    }
    dac: Dac = Dac::default() => { "DAC", 0x4000_7400..0x4000_7800, gate(Apb1, 29), &[54]; }
    // The whole page belongs to the unit.
    dwt: Dwt = Dwt::new(HSI_HZ) => { "DWT", 0xe000_1000..0xe000_2000, ALWAYS, &[]; }
    flash: FlashController = FlashController::new() => { "FLASH", 0x4002_3c00..0x4002_4000, ALWAYS, &[4]; }
    pwr: Pwr = Pwr::new() => { "PWR", 0x4000_7000..0x4000_7400, gate(Apb1, 28), &[]; }
    rcc: Rcc = Rcc::new(hse_hz) => { "RCC", 0x4002_3800..0x4002_3c00, ALWAYS, &[5, NMI]; }
    usart: [Usart; 6] = PORTS.map(|kind| Usart::new(kind, HSI_HZ)) => {
        [0] "USART1", 0x4001_1000..0x4001_1400, gate(Apb2, 4), &[37];
        [1] "USART2", 0x4000_4400..0x4000_4800, gate(Apb1, 17), &[38];
        [2] "USART3", 0x4000_4800..0x4000_4c00, gate(Apb1, 18), &[39];
        [3] "UART4", 0x4000_4c00..0x4000_5000, gate(Apb1, 19), &[52];
        [4] "UART5", 0x4000_5000..0x4000_5400, gate(Apb1, 20), &[53];
        [5] "USART6", 0x4001_1400..0x4001_1800, gate(Apb2, 5), &[71];
    }
    gpio: [Gpio; 9] = std::array::from_fn(Gpio::new) => {
        [0] "GPIOA", 0x4002_0000..0x4002_0400, gate(Ahb1, 0), &[];
        [1] "GPIOB", 0x4002_0400..0x4002_0800, gate(Ahb1, 1), &[];
        [2] "GPIOC", 0x4002_0800..0x4002_0c00, gate(Ahb1, 2), &[];
        [3] "GPIOD", 0x4002_0c00..0x4002_1000, gate(Ahb1, 3), &[];
        [4] "GPIOE", 0x4002_1000..0x4002_1400, gate(Ahb1, 4), &[];
        [5] "GPIOF", 0x4002_1400..0x4002_1800, gate(Ahb1, 5), &[];
        [6] "GPIOG", 0x4002_1800..0x4002_1c00, gate(Ahb1, 6), &[];
        [7] "GPIOH", 0x4002_1c00..0x4002_2000, gate(Ahb1, 7), &[];
        [8] "GPIOI", 0x4002_2000..0x4002_2400, gate(Ahb1, 8), &[];
    }
    exti: Exti = Exti::default() => { "EXTI", 0x4001_3c00..0x4001_4000, ALWAYS, &Exti::INTERRUPTS; }
    syscfg: Syscfg = Syscfg::default() => { "SYSCFG", 0x4001_3800..0x4001_3c00, gate(Apb2, 14), &[]; }
    iwdg: Iwdg = Iwdg::new(LSI_HZ) => { "IWDG", 0x4000_3000..0x4000_3400, ALWAYS, &[]; }
    i2c: [I2c; 3] = std::array::from_fn(|_| I2c::new(HSI_HZ)) => {
        [0] "I2C1", 0x4000_5400..0x4000_5800, gate(Apb1, 21), &[31, 32];
        [1] "I2C2", 0x4000_5800..0x4000_5c00, gate(Apb1, 22), &[33, 34];
        [2] "I2C3", 0x4000_5c00..0x4000_6000, gate(Apb1, 23), &[72, 73];
    }
    spi: [Spi; 3] = [Apb::Two, Apb::One, Apb::One].map(|apb| Spi::new(apb, HSI_HZ)) => {
        [0] "SPI1", 0x4001_3000..0x4001_3400, gate(Apb2, 12), &[35];
        [1] "SPI2", 0x4000_3800..0x4000_3c00, gate(Apb1, 14), &[36];
        [2] "SPI3", 0x4000_3c00..0x4000_4000, gate(Apb1, 15), &[51];
    }
    wwdg: Wwdg = Wwdg::new(HSI_HZ) => { "WWDG", 0x4000_2c00..0x4000_3000, gate(Apb1, 11), &[0]; }
    rtc: Rtc = Rtc::new() => { "RTC", 0x4000_2800..0x4000_2c00, ALWAYS, &[]; }
    crc: Crc = Crc::new() => { "CRC", 0x4002_3000..0x4002_3400, gate(Ahb1, 12), &[]; }
    rng: Rng = Rng::new(seed) => { "RNG", 0x5006_0800..0x5006_0c00, gate(Ahb2, 6), &[80]; }
    systick: SysTick = SysTick::new(HSI_HZ) => { "SysTick", 0xe000_e010..0xe000_e020, ALWAYS, &[]; }
    scr: core::Scr = core::Scr::default() => { "SCR", 0xe000_ed10..0xe000_ed14, ALWAYS, &[]; }
    debug: core::Debug = core::Debug::default() => { "DCB", 0xe000_edf0..0xe000_ee00, ALWAYS, &[]; }
    dbgmcu: Dbgmcu = Dbgmcu::new(dev_id) => { "DBGMCU", 0xe004_2000..0xe004_2400, ALWAYS, &[]; }
    signature: Signature = Signature { uid, ..Signature::default() } => { "SIGNATURE", 0x1fff_7a10..0x1fff_7c00, ALWAYS, &[]; }
}

/// Bytes of a page. A peripheral on APB, AHB1 or AHB2 has whole pages to itself.
const PAGE: u32 = 0x100;
/// Pages that peripherals on APB and AHB1 may have.
const PAGES: Range<u32> = 0x4000_0000..0x4008_0000;

/// The number of the row of the peripheral at an address.
pub(super) fn row_at(address: u32) -> Option<usize> {
    /// Numbers of rows by page. Every access asks for one.
    static ROWS: LazyLock<Vec<Option<u8>>> = LazyLock::new(|| {
        let row = |page| row_among_all(page).map(|row| row as u8);
        PAGES.step_by(PAGE as usize).map(row).collect()
    });
    if PAGES.contains(&address) {
        ROWS[((address - PAGES.start) / PAGE) as usize].map(usize::from)
    } else {
        row_among_all(address)
    }
}

fn row_among_all(address: u32) -> Option<usize> {
    TABLE.iter().position(|row| row.addresses.contains(&address))
}

/// Rows whose registers the firmware has written since power-up. No other row has an interrupt.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct WrittenRows(u128);

impl WrittenRows {
    pub(super) fn insert(&mut self, row: usize) {
        self.0 |= 1 << row;
    }

    pub(super) fn iter(self) -> impl Iterator<Item = &'static PeripheralRow> {
        let mut left = self.0;
        std::iter::from_fn(move || {
            let row = TABLE.get(left.trailing_zeros() as usize)?;
            left &= left - 1;
            Some(row)
        })
    }
}

/// The offset of an address in a peripheral.
pub(super) fn offset_in(row: &PeripheralRow, address: u32) -> u32 {
    address - row.addresses.start
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::registers::name;
    use super::*;
    use crate::chip::Chip;

    #[test]
    fn modelled_peripherals_answer_where_table_1_has_them() {
        for row in TABLE {
            let start = row.addresses.start;
            let last = row.addresses.end - 4;
            let found = row_at(last).map(|row| (TABLE[row].name, offset_in(&TABLE[row], last)));
            assert_eq!(found, Some((row.name, last - start)));
            assert!(name(start).starts_with(row.name), "{}", name(start));
            assert_eq!(row.gate.enables != 0, row.gate.reset != 0, "{}", row.name);
        }
        assert!(row_at(0x4000_6400).is_none(), "CAN1");
    }
    /// README lists the peripherals, of all parts, for which there is no row.
    #[test]
    fn peripherals_without_a_model_are_listed() {
        let readme = include_str!("../../README.md");
        let (_, list) = readme
            .split_once("no model knows is reported by its name: ")
            .unwrap();
        let (list, _) = list.split_once('.').unwrap();
        let listed: BTreeSet<&str> = list
            .split([',', ' ', '\n'])
            .filter(|word| !word.is_empty())
            .collect();
        let modelled = |name: &&str| {
            let by_another_name = ["DAC1", "UID"].contains(name) || name.ends_with("_COMMON");
            by_another_name || TABLE.iter().any(|row| row.name == *name)
        };
        let all = Chip::all().flat_map(|chip| chip.peripherals().iter().copied());
        let unmodelled: BTreeSet<&str> = all.filter(|name| !modelled(name)).collect();
        assert_eq!(listed, unmodelled);
    }

    /// Compares the rows with the clock gates and interrupts in ST's database.
    #[test]
    fn gates_and_interrupts_are_those_of_st() {
        let mut held = Vec::new();
        for line in include_str!("connections.txt").lines() {
            let words: Vec<&str> = line.split(' ').collect();
            let row = |name: &str| TABLE.iter().find(|row| row.name == name);
            match words[..] {
                [which @ ("enable" | "reset"), register, bit, name] => {
                    let Some(row) = row(name) else { continue };
                    let Gate { bus, enables, reset } = row.gate;
                    let bits = if which == "enable" { enables } else { reset };
                    assert_eq!(bits, 1 << bit.parse::<u32>().unwrap(), "{line}");
                    let bus = format!("{bus:?}").to_uppercase();
                    assert!(register.starts_with(&bus), "{line}");
                    held.push(name);
                }
                ["interrupt", number, name, _] => {
                    let Some(row) = row(name) else { continue };
                    assert!(row.lines.contains(&number.parse().unwrap()), "{line}");
                    held.push(name);
                }
                _ => {}
            }
        }
        let names = TABLE.iter().map(|row| row.name);
        let kinds = ["TIM", "ART", "I2C", "SPI", "RNG", "WWDG"];
        for row in names.filter(|name| kinds.iter().any(|kind| name.contains(kind))) {
            let lines = held.iter().filter(|name| **name == row).count();
            assert!(lines >= 3, "{row}: a gate, a reset and an interrupt");
        }
    }
}
