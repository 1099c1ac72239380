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

#[cfg(test)]
mod tests {
    use super::*;

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
            assert_eq!(super::super::names::name(address), format!("{name}+0x00"));
        }
        assert_eq!(locate(0x4001_3000), None, "SPI1");
    }
}
