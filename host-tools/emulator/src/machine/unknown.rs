//! Registers that the firmware accesses and no model knows.

use std::collections::BTreeMap;

use crate::outcome::UnknownRegister;

/// The accesses to each of them, by its address and by whether the clock of its peripheral was off.
#[derive(Debug, Clone, Default)]
pub(super) struct UnknownRegisters(BTreeMap<(u32, bool), UnknownRegister>);

impl UnknownRegisters {
    pub(super) fn read(&mut self, address: u32, clock_off: bool) {
        self.register(address, clock_off).reads += 1;
    }

    pub(super) fn written(&mut self, address: u32, clock_off: bool, value: u32) {
        let register = self.register(address, clock_off);
        register.writes += 1;
        register.last_write = Some(value);
    }

    fn register(&mut self, address: u32, clock_off: bool) -> &mut UnknownRegister {
        self.0
            .entry((address, clock_off))
            .or_insert_with(|| UnknownRegister {
                name: name(address) + if clock_off { " (clock off)" } else { "" },
                address,
                reads: 0,
                writes: 0,
                last_write: None,
            })
    }

    /// In the order of their addresses.
    pub(super) fn list(&self) -> Vec<UnknownRegister> {
        self.0.values().cloned().collect()
    }
}

/// Every peripheral of the STM32F405 (table 1), modelled or not: from each address on, one every 0x400 bytes.
/// At a `-` the peripheral before goes on, or nothing is there.
const NAMES: [(u32, &str); 12] = [
    (0x1fff_7a10, "SIGNATURE"),
    (
        0x4000_0000,
        "TIM2 TIM3 TIM4 TIM5 TIM6 TIM7 TIM12 TIM13 TIM14 - RTC WWDG IWDG I2S2ext SPI2 SPI3 I2S3ext \
         USART2 USART3 UART4 UART5 I2C1 I2C2 I2C3 - CAN1 CAN2 - PWR DAC",
    ),
    (
        0x4001_0000,
        "TIM1 TIM8 - - USART1 USART6 - - ADC - - SDIO SPI1 - SYSCFG EXTI TIM9 TIM10 TIM11",
    ),
    (
        0x4002_0000,
        "GPIOA GPIOB GPIOC GPIOD GPIOE GPIOF GPIOG GPIOH GPIOI - - - CRC - RCC FLASH BKPSRAM",
    ),
    (0x4002_6000, "DMA1 DMA2"),
    (0x4002_8000, "ETH - - - - reserved"),
    (0x4004_0000, "OTG_HS"),
    (0x5000_0000, "OTG_FS"),
    (0x5005_0000, "DCMI"),
    (0x5006_0800, "RNG"),
    (0xe000_1000, "DWT"),
    (0xe004_2000, "DBGMCU"),
];

/// `SPI1+0x08` for 0x4001_3008.
pub(super) fn name(address: u32) -> String {
    let peripherals = NAMES.iter().flat_map(|(start, names)| {
        let starts = (*start..).step_by(0x400);
        starts.zip(names.split(' ')).filter(|(_, name)| *name != "-")
    });
    match peripherals.take_while(|(start, _)| *start <= address).last() {
        Some((start, name)) => format!("{name}+{:#04x}", address - start),
        None => format!("{address:#010x}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_in_the_order_of_their_addresses() {
        let ends = NAMES.map(|(start, names)| [start, start + 0x400 * names.split(' ').count() as u32]);
        assert!(ends.as_flattened().is_sorted());
    }

    #[test]
    fn a_register_is_named_by_its_peripheral_and_offset() {
        assert_eq!(name(0x4001_3008), "SPI1+0x08");
        assert_eq!(name(0x4002_6488), "DMA2+0x88");
        assert_eq!(name(0x4000_7404), "DAC+0x04");
        assert_eq!(name(0x4002_9400), "reserved+0x00");
        assert_eq!(name(0x5006_0804), "RNG+0x04");
        assert_eq!(name(0x1000_0000), "0x10000000");
    }
}
