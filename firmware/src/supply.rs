//! The supply, which is also the reference of the ADC.
//!
//! # Design
//! The internal reference voltage tells the supply. Only ADC1 can convert it, and it has to be sampled for at
//! least 10 µs (DocID022152, embedded reference voltage). Between two scans there are 4.9 µs, so it cannot be
//! measured while scans are made without losing some. It is measured whenever acquisition starts. While
//! acquisition runs, the programmable voltage detector watches the supply; it needs no ADC (RM0090 section
//! 5.2.3).
//!
//! A supply that rises slowly passes through voltages at which the core runs and flash is read wrongly. So
//! nothing is done at first but [`wait`]. Flash is erased only after the supply has been good, and is not
//! written while it is low.

use cortex_m::peripheral::DWT;
use embassy_stm32::adc::{Adc, SampleTime, VrefInt};
use embassy_stm32::pac::{PWR, RCC};
use embassy_stm32::peripherals;
use embassy_time::{Duration, block_for};

use crate::clocks::INTERNAL_HZ;

/// The detector's threshold, number 6 of PWR_CR.PLS: the supply is low below 2.93 V, and good again above
/// 3.03 V (DocID022152, table of the reset and power control block, typical values).
const THRESHOLD: u8 = 6;

/// The supply must have been good for this long at start-up: 20 ms, in clocks of the internal oscillator.
const GOOD: u32 = INTERNAL_HZ / 50;
/// Longest wait for a good supply: 5 s.
const PATIENCE: u32 = 5 * INTERNAL_HZ;

/// Waits until the supply has been good for 20 ms, at most 5 s. Returns whether it has. Called on the
/// internal oscillator, first of all but for the watchdog.
pub(crate) fn wait() -> bool {
    RCC.apb1enr().modify(|w| w.set_pwren(true));
    watch();
    let start = DWT::cycle_count();
    let mut low = start;
    loop {
        let now = DWT::cycle_count();
        if is_low() {
            low = now;
        }
        if now.wrapping_sub(low) > GOOD {
            return true;
        }
        if now.wrapping_sub(start) > PATIENCE {
            return false;
        }
        cortex_m::asm::delay(INTERNAL_HZ / 1000);
    }
}

/// Switches the detector on. The set-up of the clocks switches it off.
pub(crate) fn watch() {
    PWR.cr1().modify(|w| {
        w.set_pls(THRESHOLD);
        w.set_pvde(true);
    });
}

/// Returns `true` if the detector finds the supply low.
pub(crate) fn is_low() -> bool {
    PWR.csr1().read().pvdo()
}

/// Measures the supply, mV, with an ADC that is not scanning; 0 if it gives no code. Takes about 70 µs.
pub(crate) fn measure(adc: &mut Adc<'_, peripherals::ADC1>) -> u16 {
    let mut reference = adc.enable_vrefint();
    // A tick is 10 µs, and of the last one only a part may be left.
    block_for(Duration::from_micros(VrefInt::start_time_us().into()) + Duration::from_ticks(1));
    // 22.9 µs at 21 MHz.
    let code = adc.blocking_read(&mut reference, SampleTime::CYCLES480);
    let supply_mv = match code {
        0 => 0,
        code => 3300 * u32::from(factory_reference()) / u32::from(code),
    };
    supply_mv.try_into().unwrap_or(u16::MAX)
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
