//! The shape of a strike: arrival, width and momentum of the pulse, and how the intruder rang after it.
//!
//! # Design
//!
//! The shape is computed once a strike, from the forces and accelerations of its window. Per sample, these
//! are only stored. Bead and host compute the same: the result is a function of settings and codes alone.
//!
//! **Arrival** is the top of the parabola that fits the force best over a quarter of its width to either
//! side. The highest sample alone would tell it to one sample, and with noise to several. **Width** is
//! measured at half the height, with straight lines between the samples there. **Ringing**: a free
//! oscillation obeys
//!
//! ```text
//! a[n] = 2 e^(-βT) cos(ωT) a[n-1] - e^(-2βT) a[n-2]
//! ```
//!
//! whatever its amplitude and phase (Prony). Both coefficients are fitted by least squares to means of a few
//! samples: neighbours then differ by more than noise. The fit starts when the wave has left the bead behind
//! the host, and ends with the last piece of the window that has more than noise.

use crate::layout::{BASELINE, WINDOW_MAX};
use crate::quantity::{SensedAcceleration, SensedForce};
use bead_wire::{Decay, Frequency, Impulse, Samples, Shape};
use core::ops::RangeInclusive;
use fixed::types::{I16F16, U16F16};
use serde::{Deserialize, Serialize};

/// A rate, 1/s.
pub type Fine = U16F16;

/// Samples that a record has room for: the longest window.
const RECORD_MAX: usize = WINDOW_MAX as usize;

/// Least rate of the means that the ringing is fitted to, Hz: for oscillations of about 0.2 to 5 kHz.
const RING_RATE_HZ: u32 = 12_500;
/// Least number of means in a period of the ringing.
const RING_MEANS_A_PERIOD: f32 = 2.5;
/// Time from the highest force to the free ringing, in widths of the pulse, which has then left the contact
/// behind the host.
const FREE_AFTER: f32 = 2.25;
/// Greatest part of the ringing's power that the fit may leave. The decay is then about 10 % off.
const RING_REST: f32 = 2e-3;
/// Least number of means for a fit.
const RING_MEANS: u32 = 12;
/// Least ratio of the power of the ringing to the power of its noise. Noise then changes the decay by about 3
/// %.
const RING_SIGNAL: f32 = 1000.0;

/// The shape of a window, without its number and gains. A value that the window does not determine is 0.
/// `peak` is the sample with the highest force, `ring_end` the one at which the ringing is over; `noise` is
/// the mean square of the noise in the ringing, (m/s²)²; `expected` is the approximate frequency of the
/// ringing, Hz.
///
/// Never inlined, so that its instructions can be counted by its symbol.
#[inline(never)]
pub(crate) fn shape(
    sample_rate_hz: u32,
    record: &WindowRecord,
    peak: usize,
    ring_end: usize,
    noise: f32,
    expected: Fine,
) -> Shape {
    let mut shape = Shape::default();
    let forces = &record.forces[..record.length];
    shape.impulse = Impulse::from_bits(forces.iter().map(|force| i64::from(force.to_bits())).sum());
    let Some(width) = width(forces, peak) else {
        return shape;
    };
    let arrival = summit(forces, peak, (0.25 * width) as usize);
    shape.width = Samples::from_bits(fine(width));
    shape.arrival = Samples::from_bits(fine(arrival));

    let free = (arrival + FREE_AFTER * width) as usize;
    let ring = record.accelerations[..record.length.min(ring_end)]
        .get(free..)
        .and_then(|free| ringing(free, sample_rate_hz, noise, expected.to_num()));
    if let Some((frequency, decay)) = ring {
        shape.ring_frequency = Frequency::from_bits(fine(frequency));
        shape.ring_decay = Decay::from_bits(fine(decay));
    }
    shape
}

/// Bits of a number with 16 bits behind the binary point; saturates.
fn fine(number: f32) -> u32 {
    U16F16::saturating_from_num(number).to_bits()
}

/// Ringing of the intruder of a good bead, and its tolerances.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ringing {
    /// Frequency of the free ringing, Hz.
    pub frequency: Fine,
    /// Part by which the frequency may be off.
    pub frequency_tolerance: I16F16,
    /// Decay of its amplitude, 1/s.
    pub decay: Fine,
    /// Part by which the decay may be off.
    pub decay_tolerance: I16F16,
}

impl Ringing {
    /// Returns `true` if a strike rang outside the tolerances.
    pub fn is_other_than(&self, shape: &Shape) -> bool {
        let off = |found: u32, expected: Fine, tolerance: I16F16| {
            let apart = u64::from(found.abs_diff(expected.to_bits()));
            apart << I16F16::FRAC_NBITS
                > u64::from(expected.to_bits()) * u64::from(tolerance.to_bits().unsigned_abs())
        };
        let (frequency, decay) = (shape.ring_frequency.bits(), shape.ring_decay.bits());
        frequency > 0
            && (off(frequency, self.frequency, self.frequency_tolerance)
                || off(decay, self.decay, self.decay_tolerance))
    }
}

/// The extremes of a window.
pub(crate) struct WindowPeaks {
    /// The highest force; 0 if no force was positive.
    pub(crate) force: SensedForce,
    /// The first sample with the highest force.
    pub(crate) sample: usize,
    /// From the lowest acceleration to the highest.
    pub(crate) acceleration: RangeInclusive<SensedAcceleration>,
}

/// Force and acceleration of the samples of a window. It is too large for a stack.
#[derive(Clone)]
pub struct WindowRecord {
    length: usize,
    forces: [SensedForce; RECORD_MAX],
    accelerations: [SensedAcceleration; RECORD_MAX],
}

impl Default for WindowRecord {
    fn default() -> Self {
        Self::new()
    }
}

impl WindowRecord {
    /// An empty record.
    pub const fn new() -> Self {
        Self {
            length: 0,
            forces: [SensedForce::ZERO; RECORD_MAX],
            accelerations: [SensedAcceleration::ZERO; RECORD_MAX],
        }
    }

    /// Begins a new window, with zeros over its baseline. The last sample of the baseline comes with the
    /// first sample after it.
    pub fn clear(&mut self) {
        self.length = usize::from(BASELINE) - 1;
        self.forces[..self.length].fill(SensedForce::ZERO);
        self.accelerations[..self.length].fill(SensedAcceleration::ZERO);
    }

    /// Adds the next samples. Samples beyond the longest window are dropped; the settings allow none.
    pub(crate) fn extend(&mut self, forces: &[SensedForce], accelerations: &[SensedAcceleration]) {
        let end = (self.length + forces.len()).min(RECORD_MAX);
        let count = end - self.length;
        self.forces[self.length..end].copy_from_slice(&forces[..count]);
        self.accelerations[self.length..end].copy_from_slice(&accelerations[..count]);
        self.length = end;
    }

    /// The forces of the samples so far.
    pub(crate) fn forces(&self) -> &[SensedForce] {
        &self.forces[..self.length]
    }

    /// The accelerations of the samples so far.
    pub(crate) fn accelerations(&self) -> &[SensedAcceleration] {
        &self.accelerations[..self.length]
    }

    pub(crate) fn peaks(&self) -> WindowPeaks {
        let (mut force, mut sample) = (SensedForce::ZERO, 0);
        let [mut low, mut high] = [SensedAcceleration::ZERO; 2];
        for (at, (pushes, acceleration)) in self.samples().enumerate() {
            if pushes > force {
                (force, sample) = (pushes, at);
            }
            low = low.min(acceleration);
            high = high.max(acceleration);
        }
        WindowPeaks {
            force,
            sample,
            acceleration: low..=high,
        }
    }

    /// Force and acceleration of the samples so far. A sample is known one sample later, so the last
    /// one is missing.
    pub fn samples(&self) -> impl Iterator<Item = (SensedForce, SensedAcceleration)> + '_ {
        let (forces, accelerations) = (&self.forces[..self.length], &self.accelerations[..self.length]);
        forces.iter().copied().zip(accelerations.iter().copied())
    }
}

/// Full width at half the height of the pulse around `peak`, samples. `None` if it does not fall to half on
/// both sides.
fn width(forces: &[SensedForce], peak: usize) -> Option<f32> {
    let half = forces.get(peak)?.to_bits() / 2;
    let rise = (1..=peak)
        .rev()
        .find(|&after| forces[after - 1].to_bits() < half)?;
    let fall = (peak + 1..forces.len()).find(|&after| forces[after].to_bits() < half)?;
    let crossing = |after: usize| {
        let (from, to) = (forces[after - 1].to_bits(), forces[after].to_bits());
        (after - 1) as f32 + (half - from) as f32 / (to - from) as f32
    };
    Some(crossing(fall) - crossing(rise))
}

/// Top of the parabola that fits the forces best over `reach` samples to either side of `peak`, samples.
fn summit(forces: &[SensedForce], peak: usize, reach: usize) -> f32 {
    let reach = reach.clamp(1, 64).min(peak).min(forces.len() - 1 - peak);
    let (mut sum, mut first, mut second) = (0_i64, 0_i64, 0_i64);
    for (x, &force) in (-(reach as i64)..).zip(&forces[peak - reach..=peak + reach]) {
        let force = i64::from(force.to_bits());
        sum += force;
        first += x * force;
        second += x * x * force;
    }
    let reach = reach as i64;
    let count = 2 * reach + 1;
    let squares = reach * (reach + 1) * count / 3;
    let fourths = squares * (3 * reach * reach + 3 * reach - 1) / 5;
    // F = c + b x + a x² over x = -reach ..= reach, whose odd sums vanish: the top is at -b/2a.
    let a = (count * second - squares * sum) as f32 / (count * fourths - squares * squares) as f32;
    let b = first as f32 / squares as f32;
    let offset = -0.5 * b / a;
    if a < 0.0 && offset.abs() <= reach as f32 {
        peak as f32 + offset
    } else {
        peak as f32
    }
}

/// Frequency (Hz) and decay (1/s) of a free oscillation; `noise` is the mean square of its noise, (m/s²)²;
/// `expected` is its approximate frequency, Hz. `None` if the samples do not oscillate, or not strongly
/// enough.
fn ringing(
    accelerations: &[SensedAcceleration],
    sample_rate_hz: u32,
    noise: f32,
    expected: f32,
) -> Option<(f32, f32)> {
    let fast = sample_rate_hz as f32 / (RING_MEANS_A_PERIOD * expected);
    let together = (sample_rate_hz / RING_RATE_HZ).min(fast as u32).max(1);
    let period = together as f32 / sample_rate_hz as f32;
    let mut last = [0.0_f32; 2];
    let mut means = 0_u32;
    // Σ of products: a₁a₁, a₁a₂, a₂a₂, a₀a₁, a₀a₂, a₀a₀, with a₀ the latest mean.
    let mut products = [0.0_f32; 6];
    for some in accelerations.chunks_exact(together as usize) {
        let sum: i64 = some.iter().map(|a| i64::from(a.to_bits())).sum();
        let mean = sum as f32 / (together << SensedAcceleration::FRAC_NBITS) as f32;
        let [one, two] = last;
        if means >= 2 {
            for (product, value) in products.iter_mut().zip([
                one * one,
                one * two,
                two * two,
                mean * one,
                mean * two,
                mean * mean,
            ]) {
                *product += value;
            }
        }
        last = [mean, one];
        means += 1;
    }
    let [r11, r12, r22, r01, r02, r00] = products;
    let determinant = r11 * r22 - r12 * r12;
    let loud = r11 > RING_SIGNAL * noise / together as f32 * (means.saturating_sub(2)) as f32;
    if means < RING_MEANS || determinant <= 0.0 || !loud {
        return None;
    }
    // a₀ = p a₁ - q a₂ with q = e^(-2βT), p = 2 √q cos ωT.
    let p = (r01 * r22 - r02 * r12) / determinant;
    let q = (r01 * r12 - r02 * r11) / determinant;
    // The power that the fit leaves. If it is large, another wave came or the bead is not free.
    let rest = r00 - p * r01 + q * r02;
    if rest > RING_REST * r00 {
        return None;
    }
    let cosine = 0.5 * p / libm::sqrtf(q.max(0.0));
    if !(q > 0.0 && q < 1.0 && cosine.abs() < 1.0) {
        return None;
    }
    let frequency = libm::acosf(cosine) / (core::f32::consts::TAU * period);
    Some((frequency, -0.5 * libm::logf(q) / period))
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE: u32 = 100_000;

    fn sampled(samples: i32, value: impl Fn(f64) -> f64) -> Vec<SensedAcceleration> {
        (0..samples)
            .map(|n| SensedAcceleration::from_num(value(f64::from(n))))
            .collect()
    }

    fn rung(frequency: f64, decay: f64, samples: i32) -> Vec<SensedAcceleration> {
        sampled(samples, |n| {
            let t = n / f64::from(RATE);
            80.0 * (-decay * t).exp() * (core::f64::consts::TAU * frequency * t + 0.4).cos()
        })
    }

    fn forces(bits: &[i32]) -> Vec<SensedForce> {
        bits.iter().map(|bits| SensedForce::from_bits(*bits)).collect()
    }

    #[test]
    fn frequency_and_decay_of_a_free_oscillation_come_out_whatever_they_are() {
        for (frequency, decay) in [
            (1684.7, 1748.5),
            (800.0, 300.0),
            (300.0, 900.0),
            (4000.0, 100.0),
            (9000.0, 2000.0),
        ] {
            let (f, b) = ringing(&rung(frequency, decay, 400), RATE, 0.0, frequency as f32).unwrap();
            let (f, b) = (f64::from(f), f64::from(b));
            assert!((f / frequency - 1.0).abs() < 2e-4, "{f} for {frequency} Hz");
            let most = 1e-3 * core::f64::consts::TAU * frequency;
            assert!((b - decay).abs() < most, "{b} for {decay} /s");
        }
    }

    #[test]
    fn what_does_not_oscillate_or_is_too_short_has_no_frequency() {
        let falling = |height: f64, time: f64| move |n: f64| height * (-n / time).exp();
        let creep = |n: f64| falling(8000.0, 20.0)(n) - falling(8000.0, 60.0)(n);
        for (what, samples, noise, found) in [
            ("rest", sampled(400, |_| 0.0), 0.0, false),
            // Twelve means of eight samples are enough.
            ("too short", rung(1700.0, 1700.0, 8 * 11 + 7), 0.0, false),
            ("long enough", rung(1700.0, 1700.0, 8 * 12), 0.0, true),
            ("a decay", sampled(400, falling(80.0, 50.0)), 0.0, false),
            ("noise", rung(1700.0, 300.0, 400), 100.0, false),
            ("growth, which is not free", rung(1700.0, -300.0, 400), 0.0, false),
            ("a creep back", sampled(400, creep), 0.0, false),
        ] {
            assert_eq!(ringing(&samples, RATE, noise, 1700.0).is_some(), found, "{what}");
        }
    }

    #[test]
    fn the_top_of_a_parabola_between_samples_is_found() {
        let parabola: Vec<SensedForce> = (0..200)
            .map(|n| SensedForce::from_num(6.0 - 0.01 * (f64::from(n) - 97.3).powi(2)))
            .collect();
        // Near an end the fit uses the samples that there are.
        for forces in [&parabola[..], &parabola[..100]] {
            let top = summit(forces, 97, 9);
            assert!((top - 97.3).abs() < 1e-3, "{top}");
        }
        // Where no parabola has its top within the samples, the result is the highest sample.
        for bits in [[99, 50, 50, 100, 50, 50, 60], [0, 0, 0, 100, 99, 99, 99], [1; 7]] {
            assert_eq!(summit(&forces(&bits.map(|force| force << 16)), 3, 3), 3.0);
        }
    }

    #[test]
    fn the_width_goes_to_where_the_force_falls_below_half_on_both_sides_between_samples() {
        for (bits, peak, samples) in [
            (&[0, 0, 1000, 0, 0][..], 2, Some(1.0)),
            // Shoulders at just half the height belong to it.
            (&[0, 500, 500, 1000, 500, 500, 500, 0], 3, Some(5.0)),
            (&[0, 200, 400, 1000, 700, 400, 100], 3, Some(2.5)),
            (&[700, 800, 1000, 500, 0], 2, None),
            (&[0, 500, 1000, 800, 700], 2, None),
        ] {
            let width = width(&forces(bits), peak).map(|width| (width * 1e4).round() / 1e4);
            assert_eq!(width, samples, "{bits:?}");
        }
    }

    #[test]
    fn the_first_of_the_highest_forces_is_the_peak_and_the_extremes_include_zero() {
        for (pushes, accelerations, peak, [low, high]) in [
            (&[0, 3, 7, 2, 7, 1][..], &[0, 5, -9, 8, 2, 0][..], (7, 2), [-9, 8]),
            (&[-1; 3], &[1; 3], (0, 0), [0, 1]),
        ] {
            let mut record = WindowRecord::new();
            let accelerations: Vec<_> = accelerations
                .iter()
                .map(|a| SensedAcceleration::from_num(*a))
                .collect();
            record.extend(&forces(pushes), &accelerations);
            let peaks = record.peaks();
            assert_eq!((peaks.force.to_bits(), peaks.sample), peak);
            let [low, high] = [low, high].map(SensedAcceleration::from_num);
            assert_eq!(peaks.acceleration, low..=high);
        }
    }

    #[test]
    fn a_window_of_nothing_has_no_shape() {
        let mut record = WindowRecord::new();
        assert_eq!(shape(RATE, &record, 0, 0, 0.0, Fine::ZERO), Shape::default());
        record.clear();
        for _ in 0..50 {
            record.extend(&[SensedForce::ZERO; 32], &[SensedAcceleration::ZERO; 32]);
            assert_eq!(shape(RATE, &record, 0, 5000, 0.0, Fine::ZERO), Shape::default());
        }
        assert_eq!(record.samples().count(), RECORD_MAX);
    }

    #[test]
    fn a_ringing_further_off_than_allowed_is_told_and_one_unheard_is_not() {
        let ringing = Ringing {
            frequency: Fine::from_num(1600),
            frequency_tolerance: I16F16::from_num(0.25),
            decay: Fine::from_num(2000),
            decay_tolerance: I16F16::from_num(0.5),
        };
        for (frequency, decay, other) in [
            (1600.0, 2000.0, false),
            (0.0, 0.0, false),
            // The tolerance itself is allowed.
            (2000.0, 2000.0, false),
            (2000.01, 2000.0, true),
            (1200.0, 2000.0, false),
            (1199.99, 2000.0, true),
            (1600.0, 3000.0, false),
            (1600.0, 3000.01, true),
            (1600.0, 1000.0, false),
            (1600.0, 999.99, true),
        ] {
            let shape = Shape {
                ring_frequency: Frequency::from_bits(Fine::from_num(frequency).to_bits()),
                ring_decay: Decay::from_bits(Fine::from_num(decay).to_bits()),
                ..Shape::default()
            };
            assert_eq!(ringing.is_other_than(&shape), other, "{frequency} Hz, {decay} /s");
        }
    }
}
