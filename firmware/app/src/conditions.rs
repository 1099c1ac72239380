//! Supply and temperature of the die, measured between strikes.
//!
//! # Design
//! A separate converter does it ([`Device::convert`]), so that no scan is lost. Each block reads the
//! conversion that the block before started, so nothing waits for one. [`PAIRS`] conversions of the reference
//! voltage and of the temperature sensor, in turn, make a measurement, in 34 ms. The next one begins
//! [`EVERY`] blocks after its end. It pauses while a strike is measured, since the other converter shares
//! the supply, unless the last one is [`LATEST`] blocks old.

use bead_wire::{Conditions, Temperature, Voltage};

use crate::device::{Device, FactoryCodes, InternalChannel};

/// Conversions of each channel in a measurement. Their mean has a third of the noise of one.
const PAIRS: u32 = 8;
const CHANNELS: [InternalChannel; 2] = [InternalChannel::Reference, InternalChannel::Temperature];
/// Blocks from the end of a measurement to the start of the next: 100 ms.
const EVERY: u32 = 50;
/// Blocks without a measurement after which strikes no longer delay one: 8 s.
const LATEST: u32 = 4000;
/// Supply of the factory's measurements, V, and temperatures of the two points (DocID022152, temperature
/// sensor calibration values), °C.
const FACTORY_SUPPLY: f32 = 3.3;
const FACTORY_POINTS: [f32; 2] = [30.0, 110.0];

/// Measures supply and temperature.
pub(crate) struct ConditionsMeter {
    /// Sums of the codes of [`CHANNELS`].
    sums: [u32; 2],
    /// Conversions that are read. The measurement is complete at twice [`PAIRS`].
    read: u32,
    /// Blocks since the end of the last complete measurement, or [`LATEST`] before the first.
    age: u32,
    is_converting: bool,
}

impl ConditionsMeter {
    pub(crate) const fn new() -> Self {
        Self {
            sums: [0; 2],
            read: 0,
            age: LATEST,
            is_converting: false,
        }
    }

    /// Continues a measurement; called once a block. Returns the result in its last block, and that of the
    /// first pair if there was none for [`LATEST`] blocks. Also returns `None` if the codes are not those of
    /// a good part.
    pub(crate) fn take(&mut self, device: &impl Device, is_measuring: bool) -> Option<Conditions> {
        self.age = self.age.saturating_add(1);
        if self.age < EVERY || is_measuring && self.age < LATEST {
            return None;
        }
        if self.is_converting
            && let Some(code) = device.converted()
        {
            self.sums[self.read as usize % 2] += u32::from(code);
            self.read += 1;
        }
        let is_complete = self.read == 2 * PAIRS;
        let is_first_pair = self.age >= LATEST && self.read == 2;
        let found = (is_complete || is_first_pair)
            .then(|| conditions(&device.factory_codes(), self.sums, self.read / 2))
            .flatten();
        if is_complete {
            *self = Self {
                age: 0,
                ..Self::new()
            };
        } else {
            device.convert(CHANNELS[self.read as usize % 2]);
            self.is_converting = true;
        }
        found
    }
}

/// The conditions by the sums of this many codes of each channel. The reference voltage is constant, so its
/// code rises as the supply falls; the temperature sensor is compared at the supply of the factory.
fn conditions(factory: &FactoryCodes, sums: [u32; 2], count: u32) -> Option<Conditions> {
    let [reference, temperature] = sums.map(|sum| sum as f32 / count as f32);
    let ratio = f32::from(factory.reference) / reference;
    let supply = FACTORY_SUPPLY * ratio;
    let [low, high] = factory.temperatures.map(f32::from);
    let at = (temperature * ratio - low) / (high - low);
    let [cold, hot] = FACTORY_POINTS;
    // Rejects erased words and the codes of a converter that hangs.
    let is_sound = FactoryCodes::REFERENCE.contains(&factory.reference)
        && high - low >= FactoryCodes::LEAST_RISE
        && (1.5..4.0).contains(&supply);
    is_sound.then(|| Conditions {
        supply: Voltage::from_bits((supply * 4096.0 + 0.5) as u16),
        die_temperature: Temperature::from_bits(((cold + (hot - cold) * at) * 256.0) as i16),
    })
}
