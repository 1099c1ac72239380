//! The supply, which is also the reference of the ADC.
//!
//! # Design
//! The internal reference voltage tells the supply. Only ADC1 can convert it, and it has to be sampled for at
//! least 10 µs (DocID022152, embedded reference voltage). Between two scans there are 4.9 µs, so it cannot be
//! measured while scans are made without losing some. It is measured whenever acquisition starts. While
//! acquisition runs, the programmable voltage detector watches the supply; it needs no ADC (RM0090 section
//! 5.2.3).

use embassy_stm32::adc::{Adc, SampleTime, VrefInt};
use embassy_stm32::pac::PWR;
use embassy_stm32::peripherals;
use embassy_time::{Duration, block_for};

use crate::counters;

/// The detector's threshold, number 6 of PWR_CR.PLS: the supply is low below 2.93 V, and good again above
/// 3.03 V (DocID022152, table of the reset and power control block, typical values).
const THRESHOLD: u8 = 6;

/// Switches the detector on.
pub(crate) fn watch() {
    PWR.cr1().modify(|w| {
        w.set_pls(THRESHOLD);
        w.set_pvde(true);
    });
}

/// Whether the detector finds the supply low.
pub(crate) fn is_low() -> bool {
    PWR.csr1().read().pvdo()
}

/// Measures the supply with an ADC that is not scanning. Takes about 60 µs.
pub(crate) fn measure(adc: &mut Adc<'_, peripherals::ADC1>) {
    let mut reference = adc.enable_vrefint();
    block_for(Duration::from_micros(VrefInt::start_time_us().into()));
    // 22.9 µs at 21 MHz.
    let code = adc.blocking_read(&mut reference, SampleTime::CYCLES480);
    let supply_mv = match code {
        0 => 0,
        code => 3300 * u32::from(factory_reference()) / u32::from(code),
    };
    counters::update(|c| c.health.supply_mv = supply_mv.try_into().unwrap_or(u16::MAX));
}

/// The code of the internal reference voltage at a supply of 3.3 V and 30 °C, as the factory measured it
/// (DocID022152, internal reference voltage calibration values).
#[allow(
    unsafe_code,
    reason = "the factory's words are memory that no Rust object stands for"
)]
fn factory_reference() -> u16 {
    const VREFIN_CAL: *const u16 = core::ptr::without_provenance(0x1FFF_7A2A);
    // SAFETY: the address is that of a halfword of system memory, which is always readable and never changes.
    unsafe { VREFIN_CAL.read_volatile() }
}
