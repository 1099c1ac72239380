//! Registers that the firmware touches and no model knows.

use std::collections::BTreeMap;

use crate::outcome::UnknownRegister;

/// How each of them was touched, by address and by whether only the clock of its peripheral was off.
#[derive(Debug, Clone, Default)]
pub(super) struct UnknownRegisters(BTreeMap<(u32, bool), Accesses>);

#[derive(Debug, Clone, Copy, Default)]
struct Accesses {
    reads: u64,
    writes: u64,
    last_write: Option<u32>,
}

impl UnknownRegisters {
    pub(super) fn read(&mut self, address: u32, clock_off: bool) {
        self.0.entry((address, clock_off)).or_default().reads += 1;
    }

    pub(super) fn written(&mut self, address: u32, clock_off: bool, value: u32) {
        let accesses = self.0.entry((address, clock_off)).or_default();
        accesses.writes += 1;
        accesses.last_write = Some(value);
    }

    /// In the order of their addresses.
    pub(super) fn list(&self) -> Vec<UnknownRegister> {
        let named = |((address, clock_off), accesses): (&(u32, bool), &Accesses)| UnknownRegister {
            name: name(*address) + if *clock_off { " (clock off)" } else { "" },
            address: *address,
            reads: accesses.reads,
            writes: accesses.writes,
            last_write: accesses.last_write,
        };
        self.0.iter().map(named).collect()
    }
}

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
}
