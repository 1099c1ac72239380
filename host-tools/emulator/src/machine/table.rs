//! The modelled peripherals: one row for each says what it is, where it lies and how it is connected.
//!
//! # Design
//!
//! The table is the memory map (RM0090 section 2.3, table 1), the clock gates (section 7.3) and the interrupt
//! lines (table 61) of what is modelled. Everything that treats all peripherals alike goes through it:
//! registers, resets, clocks, interrupts and notes. A new peripheral is a row here and a file that implements
//! [`Peripheral`].
//!
//! A row names a place in [`Units`], the struct that holds the models. What connects one peripheral to
//! another needs their own types, and finds them there by name.

use std::ops::Range;

use super::board::NMI;

use crate::peripherals::rcc::Bus::{self, Ahb1, Apb1, Apb2};
use crate::peripherals::{
    Peripheral, adc::Adc, clock::HSI_HZ, dbgmcu::Dbgmcu, dma::Dma, dwt::Dwt, exti::Exti, flash::Flash,
    gpio::Gpio, iwdg::Iwdg, pwr::Pwr, rcc::Rcc, signature::Signature, syscfg::Syscfg, tim::Tim, usart::Usart,
};

/// The interrupt lines of DMA2's streams.
pub(super) const DMA2_LINES: [usize; 8] = [56, 57, 58, 59, 60, 68, 69, 70];

/// One peripheral.
pub(super) struct Row {
    pub(super) name: &'static str,
    addresses: Range<u32>,
    /// Its bit in RCC's enable and reset registers. Without one, its clock is always on.
    pub(super) gate: Option<(Bus, u32)>,
    /// Its lines at the interrupt controller, in the order of the model's outputs.
    pub(super) lines: &'static [usize],
    /// Its model.
    pub(super) model: fn(&Units) -> &dyn Peripheral,
    pub(super) model_mut: fn(&mut Units) -> &mut dyn Peripheral,
}

/// Declares [`Units`] and [`TABLE`]: for each field its type and its value after power-up, then a row for
/// each peripheral in it: name, addresses, clock gate, interrupt lines.
macro_rules! peripherals {
    (
        new($($argument:ident: $given:ty),*);
        $($field:ident: $model:ty = $new:expr => {
            $($([$index:literal])? $name:literal, $addresses:expr, $gate:expr, $lines:expr;)+
        })+
    ) => {
        /// The models of all peripherals.
        #[derive(Debug, Clone)]
        pub(super) struct Units { $(pub(super) $field: $model,)+ }

        impl Units {
            /// After power-up.
            pub(super) fn new($($argument: $given),*) -> Self {
                Self { $($field: $new,)+ }
            }
        }

        /// In the order in which notes are reported.
        pub(super) static TABLE: &[Row] = &[$($(
            Row {
                name: $name,
                addresses: $addresses,
                gate: $gate,
                lines: $lines,
                model: |units| &units.$field$([$index])?,
                model_mut: |units| &mut units.$field$([$index])?,
            },
        )+)+];
    };
}

peripherals! {
    new(hse_hz: u32, uid: [u8; 12]);
    tim: [Tim; 4] = [32, 16, 16, 32].map(|bits| Tim::new(bits, HSI_HZ)) => {
        [0] "TIM2", 0x4000_0000..0x4000_0400, Some((Apb1, 0)), &[28];
        [1] "TIM3", 0x4000_0400..0x4000_0800, Some((Apb1, 1)), &[29];
        [2] "TIM4", 0x4000_0800..0x4000_0c00, Some((Apb1, 2)), &[30];
        [3] "TIM5", 0x4000_0c00..0x4000_1000, Some((Apb1, 3)), &[50];
    }
    dma: [Dma; 2] = [Dma::default(), Dma::default()] => {
        [0] "DMA1", 0x4002_6000..0x4002_6400, Some((Ahb1, 21)), &[11, 12, 13, 14, 15, 16, 17, 47];
        [1] "DMA2", 0x4002_6400..0x4002_6800, Some((Ahb1, 22)), &DMA2_LINES;
    }
    adc: Adc = Adc::new(HSI_HZ) => { "ADC1", 0x4001_2000..0x4001_2400, Some((Apb2, 8)), &[18]; }
    // The whole page belongs to the unit.
    dwt: Dwt = Dwt::new(HSI_HZ) => { "DWT", 0xe000_1000..0xe000_2000, None, &[]; }
    flash: Flash = Flash::new() => { "FLASH", 0x4002_3c00..0x4002_4000, None, &[4]; }
    pwr: Pwr = Pwr::default() => { "PWR", 0x4000_7000..0x4000_7400, Some((Apb1, 28)), &[]; }
    rcc: Rcc = Rcc::new(hse_hz) => { "RCC", 0x4002_3800..0x4002_3c00, None, &[5, NMI]; }
    usart1: Usart = Usart::new(HSI_HZ) => { "USART1", 0x4001_1000..0x4001_1400, Some((Apb2, 4)), &[37]; }
    gpio: [Gpio; 9] = std::array::from_fn(Gpio::new) => {
        [0] "GPIOA", 0x4002_0000..0x4002_0400, Some((Ahb1, 0)), &[];
        [1] "GPIOB", 0x4002_0400..0x4002_0800, Some((Ahb1, 1)), &[];
        [2] "GPIOC", 0x4002_0800..0x4002_0c00, Some((Ahb1, 2)), &[];
        [3] "GPIOD", 0x4002_0c00..0x4002_1000, Some((Ahb1, 3)), &[];
        [4] "GPIOE", 0x4002_1000..0x4002_1400, Some((Ahb1, 4)), &[];
        [5] "GPIOF", 0x4002_1400..0x4002_1800, Some((Ahb1, 5)), &[];
        [6] "GPIOG", 0x4002_1800..0x4002_1c00, Some((Ahb1, 6)), &[];
        [7] "GPIOH", 0x4002_1c00..0x4002_2000, Some((Ahb1, 7)), &[];
        [8] "GPIOI", 0x4002_2000..0x4002_2400, Some((Ahb1, 8)), &[];
    }
    exti: Exti = Exti::default() => { "EXTI", 0x4001_3c00..0x4001_4000, None, &[6, 7, 8, 9, 10, 23, 40]; }
    syscfg: Syscfg = Syscfg::default() => { "SYSCFG", 0x4001_3800..0x4001_3c00, Some((Apb2, 14)), &[]; }
    iwdg: Iwdg = Iwdg::default() => { "IWDG", 0x4000_3000..0x4000_3400, None, &[]; }
    dbgmcu: Dbgmcu = Dbgmcu::default() => { "DBGMCU", 0xe004_2000..0xe004_2400, None, &[]; }
    signature: Signature = Signature { uid } => { "SIGNATURE", 0x1fff_7a10..0x1fff_7c00, None, &[]; }
}

/// The peripheral at an address, and the offset in it.
pub(super) fn locate(address: u32) -> Option<(&'static Row, u32)> {
    let row = TABLE.iter().find(|row| row.addresses.contains(&address))?;
    Some((row, address - row.addresses.start))
}

#[cfg(test)]
mod tests {
    use super::super::registers::name;
    use super::*;

    #[test]
    fn modelled_peripherals_answer_where_table_1_has_them() {
        for row in TABLE {
            let start = row.addresses.start;
            let found = locate(start + 0x10).map(|(row, offset)| (row.name, offset));
            assert_eq!(found, Some((row.name, 0x10)));
            assert!(name(start).starts_with(row.name), "{}", name(start));
        }
        assert!(locate(0x4001_3000).is_none(), "SPI1");
    }
}
