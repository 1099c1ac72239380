//! Who answers at which address: the memory map (RM0090 section 2.3) and the clock gates (section 7.3).

use crate::peripherals::rcc::Bus;
use crate::peripherals::signature;

/// A modelled peripheral.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unit {
    /// TIM2 is 0.
    Tim(usize),
    Iwdg,
    Pwr,
    Usart1,
    Adc,
    Syscfg,
    Exti,
    /// Port A is 0.
    Gpio(usize),
    Rcc,
    Flash,
    /// DMA1 is 0.
    Dma(usize),
    Signature,
    Dwt,
    Dbgmcu,
}

/// The peripheral at an address, and the offset in it.
pub(super) fn locate(address: u32) -> Option<(Unit, u32)> {
    let offset = address & 0x3ff;
    let unit = match address & !0x3ff {
        base @ 0x4000_0000..=0x4000_0c00 => Unit::Tim((base as usize - 0x4000_0000) / 0x400),
        0x4000_3000 => Unit::Iwdg,
        0x4000_7000 => Unit::Pwr,
        0x4001_1000 => Unit::Usart1,
        0x4001_2000 => Unit::Adc,
        0x4001_3800 => Unit::Syscfg,
        0x4001_3c00 => Unit::Exti,
        base @ 0x4002_0000..=0x4002_2000 => Unit::Gpio((base as usize - 0x4002_0000) / 0x400),
        0x4002_3800 => Unit::Rcc,
        0x4002_3c00 => Unit::Flash,
        0x4002_6000 => Unit::Dma(0),
        0x4002_6400 => Unit::Dma(1),
        0xe004_2000 => Unit::Dbgmcu,
        // Its own offsets, since it does not start at a multiple of 0x400.
        0x1fff_7800 if address >= signature::START => {
            return Some((Unit::Signature, address - signature::START));
        }
        // The whole page belongs to the unit.
        0xe000_1000..=0xe000_1c00 => return Some((Unit::Dwt, address & 0xfff)),
        _ => return None,
    };
    Some((unit, offset))
}

/// Which bit of RCC's enable and reset registers belongs to a unit.
pub(super) fn gate(unit: Unit) -> Option<(Bus, u32)> {
    match unit {
        Unit::Tim(n) => Some((Bus::Apb1, n as u32)),
        Unit::Pwr => Some((Bus::Apb1, 28)),
        Unit::Usart1 => Some((Bus::Apb2, 4)),
        Unit::Adc => Some((Bus::Apb2, 8)),
        Unit::Syscfg => Some((Bus::Apb2, 14)),
        Unit::Gpio(n) => Some((Bus::Ahb1, n as u32)),
        Unit::Dma(n) => Some((Bus::Ahb1, 21 + n as u32)),
        _ => None,
    }
}

/// The timer (TIM2 is 0) and the channel (0 is the first) that a pin belongs to as an alternate function: port, number
/// and function as in DocID022152 table 9, for the packages that have ports A to D.
pub(super) fn timer_input(port: usize, pin: usize, function: u32) -> Option<(usize, usize)> {
    const A: usize = 0;
    const B: usize = 1;
    const C: usize = 2;
    const D: usize = 3;
    Some(match (function, port, pin) {
        (1, A, 0 | 5 | 15) => (0, 0),
        (1, A, 1) | (1, B, 3) => (0, 1),
        (1, A, 2) | (1, B, 10) => (0, 2),
        (1, A, 3) | (1, B, 11) => (0, 3),
        (2, A, 6) | (2, B, 4) | (2, C, 6) => (1, 0),
        (2, A, 7) | (2, B, 5) | (2, C, 7) => (1, 1),
        (2, B, 0) | (2, C, 8) => (1, 2),
        (2, B, 1) | (2, C, 9) => (1, 3),
        (2, B, 6..=9) => (2, pin - 6),
        (2, D, 12..=15) => (2, pin - 12),
        (2, A, 0..=3) => (3, pin),
        _ => return None,
    })
}

/// Units that RCC can reset.
pub(super) const GATED: [Unit; 19] = [
    Unit::Tim(0),
    Unit::Tim(1),
    Unit::Tim(2),
    Unit::Tim(3),
    Unit::Pwr,
    Unit::Usart1,
    Unit::Adc,
    Unit::Syscfg,
    Unit::Gpio(0),
    Unit::Gpio(1),
    Unit::Gpio(2),
    Unit::Gpio(3),
    Unit::Gpio(4),
    Unit::Gpio(5),
    Unit::Gpio(6),
    Unit::Gpio(7),
    Unit::Gpio(8),
    Unit::Dma(0),
    Unit::Dma(1),
];

/// Start and name of every peripheral of the STM32F405 (table 1), modelled or not, in order.
const NAMES: [(u32, &str); 63] = [
    (0x1fff_7a10, "SIGNATURE"),
    (0x4000_0000, "TIM2"),
    (0x4000_0400, "TIM3"),
    (0x4000_0800, "TIM4"),
    (0x4000_0c00, "TIM5"),
    (0x4000_1000, "TIM6"),
    (0x4000_1400, "TIM7"),
    (0x4000_1800, "TIM12"),
    (0x4000_1c00, "TIM13"),
    (0x4000_2000, "TIM14"),
    (0x4000_2800, "RTC"),
    (0x4000_2c00, "WWDG"),
    (0x4000_3000, "IWDG"),
    (0x4000_3400, "I2S2ext"),
    (0x4000_3800, "SPI2"),
    (0x4000_3c00, "SPI3"),
    (0x4000_4000, "I2S3ext"),
    (0x4000_4400, "USART2"),
    (0x4000_4800, "USART3"),
    (0x4000_4c00, "UART4"),
    (0x4000_5000, "UART5"),
    (0x4000_5400, "I2C1"),
    (0x4000_5800, "I2C2"),
    (0x4000_5c00, "I2C3"),
    (0x4000_6400, "CAN1"),
    (0x4000_6800, "CAN2"),
    (0x4000_7000, "PWR"),
    (0x4000_7400, "DAC"),
    (0x4001_0000, "TIM1"),
    (0x4001_0400, "TIM8"),
    (0x4001_1000, "USART1"),
    (0x4001_1400, "USART6"),
    (0x4001_2000, "ADC"),
    (0x4001_2c00, "SDIO"),
    (0x4001_3000, "SPI1"),
    (0x4001_3800, "SYSCFG"),
    (0x4001_3c00, "EXTI"),
    (0x4001_4000, "TIM9"),
    (0x4001_4400, "TIM10"),
    (0x4001_4800, "TIM11"),
    (0x4002_0000, "GPIOA"),
    (0x4002_0400, "GPIOB"),
    (0x4002_0800, "GPIOC"),
    (0x4002_0c00, "GPIOD"),
    (0x4002_1000, "GPIOE"),
    (0x4002_1400, "GPIOF"),
    (0x4002_1800, "GPIOG"),
    (0x4002_1c00, "GPIOH"),
    (0x4002_2000, "GPIOI"),
    (0x4002_3000, "CRC"),
    (0x4002_3800, "RCC"),
    (0x4002_3c00, "FLASH"),
    (0x4002_4000, "BKPSRAM"),
    (0x4002_6000, "DMA1"),
    (0x4002_6400, "DMA2"),
    (0x4002_8000, "ETH"),
    (0x4002_9400, "reserved"),
    (0x4004_0000, "OTG_HS"),
    (0x5000_0000, "OTG_FS"),
    (0x5005_0000, "DCMI"),
    (0x5006_0800, "RNG"),
    (0xe000_1000, "DWT"),
    (0xe004_2000, "DBGMCU"),
];

/// `SPI1+0x08` for 0x4001_3008.
pub(super) fn name(address: u32) -> String {
    match NAMES.iter().rev().find(|(start, _)| *start <= address) {
        Some((start, name)) => format!("{name}+{:#04x}", address - start),
        None => format!("{address:#010x}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_in_the_order_of_their_addresses() {
        assert!(NAMES.is_sorted_by_key(|(start, _)| start));
    }

    #[test]
    fn a_register_is_named_by_its_peripheral_and_offset() {
        assert_eq!(name(0x4001_3008), "SPI1+0x08");
        assert_eq!(name(0x4002_6488), "DMA2+0x88");
        assert_eq!(name(0x1000_0000), "0x10000000");
    }

    #[test]
    fn modelled_peripherals_answer_where_table_1_has_them() {
        for (address, unit, name) in [
            (0x4000_0400, Unit::Tim(1), "TIM3"),
            (0x4000_0c00, Unit::Tim(3), "TIM5"),
            (0x4001_2000, Unit::Adc, "ADC"),
            (0x4002_0800, Unit::Gpio(2), "GPIOC"),
            (0x4002_6400, Unit::Dma(1), "DMA2"),
            (0x1fff_7a10, Unit::Signature, "SIGNATURE"),
        ] {
            assert_eq!(locate(address + 0x10), Some((unit, 0x10)), "{name}");
            assert!(NAMES.contains(&(address, name)));
        }
        assert_eq!(locate(0x4001_3000), None, "SPI1");
    }
}
