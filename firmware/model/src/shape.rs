//! The shape of a strike, beyond its energies: when the pulse came, how wide it was, what momentum it brought, and how the
//! intruder rang when it had passed.
//!
//! # Design
//!
//! Worked out once a strike from the codes of its window, by the host as by the bead: nothing is added to the work per
//! sample but to keep the codes, and the result is a function of settings and codes alone.
//!
//! **Arrival** is the top of the parabola that fits the force best over a quarter of its width to either side: a highest
//! sample alone would be known to a sample, and with noise to several. **Width** is between straight lines through the
//! samples on either side of half the height. **Ringing**: a free oscillation obeys
//!
//! ```text
//! a[n] = 2 e^(-βT) cos(ωT) a[n-1] - e^(-2βT) a[n-2]
//! ```
//!
//! whatever its amplitude and phase (Prony); both coefficients are fitted by least squares to means of some samples, a rate
//! at which neighbours differ by more than noise. It starts when the wave has left the bead behind the host.

use crate::calibration::{BASELINE, Channel, ChannelState};
use crate::quantity::{AdcCode, Scan};
use crate::settings::Settings;
use crate::window::PIECE;
use fixed::FixedI32;
use fixed::types::extra::{LeEqU32, U12, U16};
use fixed::types::{I48F16, U16F16};

/// A time in samples, or a rate in 1/s.
pub type Fine = U16F16;
/// A momentum, N·samples.
pub type Impulse = I48F16;

/// Most scans that a shape is taken from.
pub const SCANS_MAX: usize = 1024;

/// Rate of the means that the ringing is fitted to, Hz: for oscillations of some 0.2 to 5 kHz.
const RING_RATE_HZ: u32 = 12_500;
/// From the highest force to where the ringing is free, in widths of the pulse: it has left the contact behind the host.
const FREE_AFTER: f32 = 2.25;
/// Fewest means that a ringing is read from.
const RING_MEANS: u32 = 12;

/// What the codes of one window say. What cannot be told is zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Shape {
    /// Time of the highest force, samples after the window's first.
    pub arrival: Fine,
    /// Full width of the pulse of force at half its height, samples.
    pub width: Fine,
    /// Momentum that came in through the contact over the window, ∫ F dt.
    pub impulse: Impulse,
    /// Frequency of the free ringing, ω/2π, Hz.
    pub ring_frequency: Fine,
    /// Its decay β, 1/s: the amplitude falls as e^(-βt).
    pub ring_decay: Fine,
}

impl Shape {
    /// The shape of the window with these scans, its first first; those beyond [`SCANS_MAX`] do not count. Takes 4 KiB
    /// of stack, which a bead does not have to spare: see [`Record`].
    pub fn of(settings: &Settings, scans: &[Scan]) -> Self {
        Self::worked_out(settings, scans, &mut [0; SCANS_MAX])
    }

    /// As [`Shape::of`], with room to work in; what it holds does not matter.
    fn worked_out(settings: &Settings, scans: &[Scan], values: &mut [i32; SCANS_MAX]) -> Self {
        let mut shape = Self::default();
        let force = |scan: &Scan| scan.force;
        let forces = calibrated::<_, U16>(&settings.force, scans, force, values);
        shape.impulse = Impulse::from_bits(forces.iter().map(|&force| i64::from(force)).sum());
        let Some(peak) = (0..forces.len()).rev().max_by_key(|&sample| forces[sample]) else {
            return shape;
        };
        let Some(width) = width(forces, peak) else {
            return shape;
        };
        let arrival = summit(forces, peak, (0.25 * width) as usize);
        shape.width = Fine::saturating_from_num(width);
        shape.arrival = Fine::saturating_from_num(arrival);

        let acceleration = |scan: &Scan| scan.acceleration;
        let accelerations = calibrated::<_, U12>(&settings.acceleration, scans, acceleration, values);
        let free = (arrival + FREE_AFTER * width) as usize;
        let ring = accelerations
            .get(free..)
            .and_then(|free| ringing(free, settings.sample_rate_hz));
        if let Some((frequency, decay)) = ring {
            shape.ring_frequency = Fine::saturating_from_num(frequency);
            shape.ring_decay = Fine::saturating_from_num(decay);
        }
        shape
    }
}

/// The scans of a window while it is measured, and room to work out its shape: both too large for a stack.
#[derive(Clone)]
pub struct Record {
    scans: heapless::Vec<Scan, SCANS_MAX>,
    /// Whether more came than there is room for.
    overfull: bool,
    values: [i32; SCANS_MAX],
}

impl Default for Record {
    fn default() -> Self {
        Self::new()
    }
}

impl Record {
    /// Of nothing yet.
    pub const fn new() -> Self {
        Self {
            scans: heapless::Vec::new(),
            overfull: false,
            values: [0; SCANS_MAX],
        }
    }

    /// A new window begins.
    pub fn clear(&mut self) {
        self.scans.clear();
        self.overfull = false;
    }

    /// Takes the window's next scans.
    pub fn extend(&mut self, scans: &[Scan]) {
        self.overfull |= self.scans.extend_from_slice(scans).is_err();
    }

    /// The shape of the window; none of one longer than [`SCANS_MAX`].
    ///
    /// Never inlined into its caller, so that its instructions can be counted by its symbol.
    #[inline(never)]
    pub fn shape(&mut self, settings: &Settings) -> Option<Shape> {
        (!self.overfull).then(|| Shape::worked_out(settings, &self.scans, &mut self.values))
    }
}

/// Bits of the quantity of a channel at every sample of a window but its last, `V` fraction bits; 0 for the baseline.
fn calibrated<'a, F: LeEqU32, V: LeEqU32>(
    channel: &Channel<F>,
    scans: &[Scan],
    code: impl Fn(&Scan) -> AdcCode,
    values: &'a mut [i32; SCANS_MAX],
) -> &'a [i32] {
    let scans = &scans[..scans.len().min(SCANS_MAX)];
    let (quiet, strike) = scans.split_at(scans.len().min(usize::from(BASELINE)));
    let mut state = ChannelState::default();
    quiet.iter().for_each(|scan| state.settle(code(scan)));
    values[..quiet.len()].fill(0);
    // The compensated value is that of the sample before.
    let mut at = quiet.len().saturating_sub(1);
    for piece in strike.chunks(PIECE) {
        let mut some = [FixedI32::<V>::ZERO; PIECE];
        channel.process(&mut state, piece.iter().map(&code), &mut some[..piece.len()]);
        for value in &some[..piece.len()] {
            values[at] = value.to_bits();
            at += 1;
        }
    }
    &values[..at]
}

/// Full width at half the height of the pulse around `peak`, samples; none if it does not fall to half on both sides.
fn width(forces: &[i32], peak: usize) -> Option<f32> {
    let half = forces[peak] / 2;
    let rise = (1..=peak).rev().find(|&after| forces[after - 1] < half)?;
    let fall = (peak + 1..forces.len()).find(|&after| forces[after] < half)?;
    let crossing = |after: usize| {
        let (from, to) = (forces[after - 1], forces[after]);
        (after - 1) as f32 + (half - from) as f32 / (to - from) as f32
    };
    Some(crossing(fall) - crossing(rise))
}

/// Where the parabola is highest that fits the forces best over `reach` samples to either side of `peak`.
fn summit(forces: &[i32], peak: usize, reach: usize) -> f32 {
    let reach = reach.clamp(1, 64).min(peak).min(forces.len() - 1 - peak);
    let (mut sum, mut first, mut second) = (0_i64, 0_i64, 0_i64);
    for (x, &force) in (-(reach as i64)..).zip(&forces[peak - reach..=peak + reach]) {
        let force = i64::from(force);
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

/// Frequency (Hz) and decay (1/s) of a free oscillation; none of what does not oscillate.
fn ringing(accelerations: &[i32], sample_rate_hz: u32) -> Option<(f32, f32)> {
    let together = (sample_rate_hz / RING_RATE_HZ).max(1);
    let period = together as f32 / sample_rate_hz as f32;
    let mut last = [0.0_f32; 2];
    let mut means = 0_u32;
    // Σ of products: a₁a₁, a₁a₂, a₂a₂, a₀a₁, a₀a₂, with a₀ the latest mean.
    let mut products = [0.0_f32; 5];
    for some in accelerations.chunks_exact(together as usize) {
        // A common factor does not matter: this one keeps the products far from the ends of f32's range.
        let mean = some.iter().map(|&a| i64::from(a)).sum::<i64>() as f32 / (1 << 12) as f32;
        let [one, two] = last;
        if means >= 2 {
            for (product, value) in
                products
                    .iter_mut()
                    .zip([one * one, one * two, two * two, mean * one, mean * two])
            {
                *product += value;
            }
        }
        last = [mean, one];
        means += 1;
    }
    let [r11, r12, r22, r01, r02] = products;
    let determinant = r11 * r22 - r12 * r12;
    if means < RING_MEANS || determinant <= 0.0 {
        return None;
    }
    // a₀ = p a₁ - q a₂ with q = e^(-2βT), p = 2 √q cos ωT.
    let p = (r01 * r22 - r02 * r12) / determinant;
    let q = (r01 * r12 - r02 * r11) / determinant;
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

    fn rung(frequency: f64, decay: f64, samples: usize) -> Vec<i32> {
        (0..samples)
            .map(|n| {
                let t = n as f64 / 100e3;
                let value = 80.0 * (-decay * t).exp() * (core::f64::consts::TAU * frequency * t + 0.4).cos();
                (value * 4096.0) as i32
            })
            .collect()
    }

    #[test]
    fn frequency_and_decay_of_a_free_oscillation_come_out_whatever_they_are() {
        for (frequency, decay) in [(1684.7, 1748.5), (800.0, 300.0), (300.0, 900.0), (4000.0, 100.0)] {
            let (f, b) = ringing(&rung(frequency, decay, 400), 100_000).unwrap();
            let (f, b) = (f64::from(f), f64::from(b));
            assert!((f / frequency - 1.0).abs() < 2e-4, "{f} for {frequency} Hz");
            assert!(
                (b - decay).abs() < 1e-3 * core::f64::consts::TAU * frequency,
                "{b} for {decay} /s"
            );
        }
    }

    #[test]
    fn what_does_not_oscillate_or_is_too_short_has_no_frequency() {
        assert_eq!(ringing(&[0; 400], 100_000), None);
        assert_eq!(ringing(&rung(1700.0, 1700.0, 8 * 11 + 7), 100_000), None);
        let decays: Vec<i32> = (0..400)
            .map(|n| (3e5 * (-f64::from(n) / 50.0).exp()) as i32)
            .collect();
        assert_eq!(ringing(&decays, 100_000), None);
    }

    #[test]
    fn the_top_of_a_parabola_between_samples_is_found() {
        let forces: Vec<i32> = (0..200)
            .map(|n| {
                let x = f64::from(n) - 97.3;
                ((6.0 - 0.01 * x * x) * 65536.0) as i32
            })
            .collect();
        let top = summit(&forces, 97, 9);
        assert!((top - 97.3).abs() < 1e-3, "{top}");
        // Near an end it makes do with what there is.
        let top = summit(&forces[..100], 97, 9);
        assert!((top - 97.3).abs() < 1e-3, "{top}");
    }

    #[test]
    fn half_heights_are_crossed_between_samples_and_a_pulse_cut_off_has_no_width() {
        let triangle: Vec<i32> = (0..100)
            .map(|n: i32| 1000 - 100 * (n - 50).abs().min(10))
            .collect();
        let wide = width(&triangle, 50).unwrap();
        assert!((wide - 10.0).abs() < 1e-6, "{wide}");
        assert_eq!(width(&triangle[..53], 50), None);
        assert_eq!(width(&triangle[47..], 3), None);
    }

    #[test]
    fn a_window_of_nothing_has_no_shape() {
        let settings = crate::design::derive(
            &crate::design::Bead::paper(),
            &crate::design::FrontEnd::reference(),
            &crate::design::Capture::default(),
        )
        .unwrap();
        for length in [0, 1, 63, 64, 65, 640, 5000] {
            let scans = vec![Scan::ZERO; length];
            assert_eq!(Shape::of(&settings, &scans), Shape::default(), "{length}");
            let mut record = Record::new();
            record.extend(&scans);
            let shape = (length <= SCANS_MAX).then(Shape::default);
            assert_eq!(record.shape(&settings), shape, "{length}");
        }
    }
}
