//! The supply, which is also the reference of the ADC.
//!
//! # Design
//! The supply is derived from the internal reference voltage. This voltage and the temperature sensor have to
//! be sampled for at least 10 µs (DocID022152, embedded reference voltage), and between two scans there are
//! 4.9 µs. An injected conversion would delay scans or cost them. But only ADC1 can convert the two (RM0090
//! section 13.10), and ADC3 makes the scans, so no scan is lost. `bead_app` decides when they are converted.
//! The programmable voltage detector watches the supply between; it needs no ADC (RM0090 section 5.2.3).
//!
//! A supply that rises slowly passes through voltages at which the core runs but reads flash wrongly. So a
//! start does little before [`wait`]. Flash is erased only after the supply has been good, and is not
//! written while it is low.

use core::mem;

use bead_app::{FactoryCodes, InternalChannel};
use cortex_m::peripheral::DWT;
use embassy_stm32::adc::{Adc, SampleTime};
use embassy_stm32::pac::{ADC1, PWR, RCC};
use embassy_stm32::{Peri, peripherals};

use crate::clocks::INTERNAL_HZ;

/// ADC1's channels of the reference voltage and of the temperature sensor (RM0090 sections 13.10 and 13.11).
const VREFINT: usize = 17;
const TEMPERATURE: usize = 16;

/// The detector's threshold, number 6 of PWR_CR.PLS: the supply is low below 2.93 V, and good again above
/// 3.03 V (DocID022152, table of the reset and power control block, typical values).
const THRESHOLD: u8 = 6;

/// The supply must have been good for this long at start-up: 20 ms, in clocks of the internal oscillator.
const GOOD: u32 = INTERNAL_HZ / 50;
/// Longest wait for a good supply: 5 s.
const PATIENCE: u32 = 5 * INTERNAL_HZ;

/// Waits until the supply has been good for 20 ms, at most 5 s. Returns `true` if it has been. Called on the
/// internal oscillator, after the start of the watchdog and before the peripherals are set up.
pub(crate) fn wait() -> bool {
    RCC.apb1enr().modify(|w| w.set_pwren(true));
    // A peripheral can be written two clocks after its own was turned on (ES0182, delay after RCC peripheral
    // clock enabling). Reading this back takes as long.
    let _ = RCC.apb1enr().read();
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

/// Switches ADC1 on, with the reference voltage and the temperature sensor. Both are ready after 10 µs, and
/// the first conversion comes milliseconds later.
pub(crate) fn begin(adc: Peri<'static, peripherals::ADC1>) {
    let adc = Adc::new(adc);
    adc.enable_vrefint();
    for channel in [VREFINT, TEMPERATURE] {
        ADC1.smpr1()
            .modify(|w| w.set_smp(channel - 10, SampleTime::CYCLES480));
    }
    // Dropping it would switch the converter off.
    mem::forget(adc);
}

/// Starts a conversion: 480 + 12 clocks, 23.4 µs.
pub(crate) fn convert(channel: InternalChannel) {
    let number = match channel {
        InternalChannel::Reference => VREFINT,
        InternalChannel::Temperature => TEMPERATURE,
    };
    ADC1.sqr3().write(|w| w.set_sq(0, number as u8));
    ADC1.sr().write(|_| {});
    ADC1.cr2().modify(|w| w.set_swstart(true));
}

/// The code of the conversion that was started, if it is over.
pub(crate) fn converted() -> Option<u16> {
    ADC1.sr().read().eoc().then(|| ADC1.dr().read().data())
}

/// The factory's words (DocID022152, calibration values of the reference voltage and the temperature sensor).
#[allow(
    unsafe_code,
    reason = "the factory's words are memory that no Rust object stands for"
)]
pub(crate) fn factory_codes() -> FactoryCodes {
    const WORDS: [usize; 3] = [0x1FFF_7A2A, 0x1FFF_7A2C, 0x1FFF_7A2E];
    let [reference, cold, hot] = WORDS.map(|word| {
        // SAFETY: these are halfwords of system memory, which is always readable and never changes.
        unsafe { core::ptr::without_provenance::<u16>(word).read_volatile() }
    });
    FactoryCodes {
        reference,
        temperatures: [cold, hot],
    }
}
