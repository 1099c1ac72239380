//! The noise that the settings explain. A bead whose quiet before a strike is louder was not at rest.

use crate::correction::Correction;
use crate::layout::{BASELINE, WindowSettings};
use crate::quantity::{SensedAcceleration, SensedForce};
use crate::shape::WindowRecord;
use serde::Serialize;

/// Ratio of the mean square of a quiet signal to that of its known noise above which it counts as louder. The
/// mean of 32 samples of noise scatters by a quarter of itself, so noise alone gets there once in 10^13
/// strikes.
const LOUDER: f64 = 4.0;
/// Mean square of the converter's rounding and of its own noise, half a code rms, in codes.
const CONVERTER: f64 = 1.0 / 12.0 + 0.25;
/// Samples over which the noise goes through the observer: more than the noise of any window has.
const SETTLED: usize = 256;

/// Greatest mean squares of signals at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Quiet {
    /// Of the force, N².
    force: f32,
    /// Of the acceleration, (m/s²)².
    acceleration: f32,
    /// Of the difference that estimate A squares, in bits of a [`SensedAcceleration`].
    pub(crate) observer: u64,
}

/// Noise of a sensor at the high gain.
pub(crate) struct CodeNoise {
    /// Quantity per code.
    pub(crate) per_code: f64,
    /// Noise before the converter, rms.
    pub(crate) noise: f64,
    /// Correction for the filter.
    pub(crate) correction: Correction,
}

impl CodeNoise {
    /// Greatest mean square of a code at rest, in the square of the quantity.
    fn square(&self) -> f64 {
        LOUDER * (self.noise * self.noise + CONVERTER * self.per_code * self.per_code)
    }

    /// Weights of a code in three values.
    fn weights(&self) -> [f64; 3] {
        let Correction { slope, curve } = self.correction;
        [curve + slope, 1.0 - 2.0 * curve, curve - slope]
    }
}

impl Quiet {
    /// Limits for these sensors, with the weights β₀ and β₁ of the observer.
    #[inline(never)]
    pub(crate) fn new(force: &CodeNoise, acceleration: &CodeNoise, [start, end]: [f64; 2]) -> Self {
        let gain = |noise: &CodeNoise| noise.weights().iter().map(|weight| weight * weight).sum::<f64>();
        let (mut held, mut left, mut passed) = (0.0, 0.0, 0.0);
        let weights = acceleration.weights();
        for n in 0..SETTLED {
            let value = weights.get(n).copied().unwrap_or(0.0);
            held += start * left + end * (value - held);
            left = value - held;
            passed += left * left;
        }
        let unit = f64::from(1_u32 << SensedAcceleration::FRAC_NBITS);
        Self {
            force: (force.square() * gain(force)) as f32,
            acceleration: (acceleration.square() * gain(acceleration)) as f32,
            // A cast saturates.
            observer: (acceleration.square() * passed * unit * unit) as u64,
        }
    }

    /// True if force or acceleration were louder than their noise before the strike.
    pub(crate) fn is_exceeded(&self, window: &WindowSettings, record: &WindowRecord) -> bool {
        const FORCE: f32 = 1.0 / (1_u32 << SensedForce::FRAC_NBITS) as f32;
        const ACCELERATION: f32 = 1.0 / (1_u32 << SensedAcceleration::FRAC_NBITS) as f32;
        let (mut samples, mut squares) = (0.0_f32, [0.0_f32; 2]);
        let noise = usize::from(BASELINE)..usize::from(window.noise_end());
        for (force, acceleration) in record.samples().take(noise.end).skip(noise.start) {
            let values = [
                FORCE * force.to_bits() as f32,
                ACCELERATION * acceleration.to_bits() as f32,
            ];
            for (square, value) in squares.iter_mut().zip(values) {
                *square += value * value;
            }
            samples += 1.0;
        }
        let [force, acceleration] = squares;
        force > self.force * samples || acceleration > self.acceleration * samples
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{Bead, Capture, FrontEnd, derive};

    #[test]
    fn either_sensor_is_louder_from_twice_its_noise_on() {
        let settings = derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default()).unwrap();
        let front_end = FrontEnd::reference();
        // The pole at 40 kHz weighs a code and its neighbours with 1, 0.199 and -0.199: 1.039 in rms.
        let rms = |noise: f64, per_code: f64| 1.039 * f64::hypot(noise, per_code * libm::sqrt(1.0 / 3.0));
        let force = rms(front_end.force.noise, front_end.force.per_code);
        let acceleration = rms(front_end.acceleration.noise, front_end.acceleration.per_code);
        for (times, louder) in [([1.99, 1.99], false), ([2.02, 0.0], true), ([0.0, 2.02], true)] {
            let mut record = WindowRecord::new();
            record.clear();
            let sign = |n: u32| if n.is_multiple_of(2) { 1.0 } else { -1.0 };
            for n in 0..100 {
                let force = SensedForce::from_num(sign(n) * times[0] * force);
                let acceleration = SensedAcceleration::from_num(sign(n / 2) * times[1] * acceleration);
                record.extend(&[force], &[acceleration]);
            }
            assert_eq!(
                settings.quiet.is_exceeded(&settings.window, &record),
                louder,
                "{times:?}"
            );
        }
    }
}
