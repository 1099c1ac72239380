//! Timing of the converter: ADC3 of the STM32F405 converts the four channels of a scan one after the other.

/// Clock of the converter, Hz: APB2 at 84 MHz through the prescaler of 4 (RM0090, ADC_CCR.ADCPRE).
pub const ADC_CLOCK_HZ: u32 = 21_000_000;
/// Clocks during which a channel's sample capacitor follows its input (RM0090, ADC_SMPR2: code 001).
pub const SAMPLE_CYCLES: u32 = 15;
/// Clocks of a 12-bit successive approximation (RM0090, ADC_CR1.RES: 12 bits, 12 cycles).
pub const CONVERSION_CYCLES: u32 = 12;
/// Time from one conversion of a scan to the next, s: 1.29 µs.
pub const CONVERSION: f64 = (SAMPLE_CYCLES + CONVERSION_CYCLES) as f64 / ADC_CLOCK_HZ as f64;
