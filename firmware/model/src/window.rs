//! The window of one strike: a pure function of the settings and of the codes in it.
//!
//! [`layout`](crate::layout) shows its parts. Replay feeds the recorded codes through the same [`Window`] and
//! gets the same bits.

use crate::layout::{BASELINE, PIECE};
use crate::observer::ObserverState;
use crate::quantity::{Acceleration, Energy, Force, Scan, SensedAcceleration};
use crate::reduced_chain::ReducedChainState;
use crate::sensor::{Loudness, SensorState};
use crate::settings::Settings;
use crate::shape::{Peaks, Shape, WindowRecord};
use fixed::types::I16F16;
use micromath::F32Ext;
use serde::{Deserialize, Serialize};

/// What was wrong with a strike; empty for a good one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Flags(u16);

impl Flags {
    /// The force was at a rail of the converter at the low gain: peak and estimate B are too low.
    pub const FORCE_RAILED: Self = Self(1 << 0);
    /// The acceleration was at a rail of the converter at the low gain: estimate A is too low.
    pub const ACCELERATION_RAILED: Self = Self(1 << 1);
    // Bit 2 said that estimate A had left its range. It cannot do so any more.
    /// A state of estimate B left half the range of its format.
    pub const CHAIN_RANGE: Self = Self(1 << 3);
    /// A and B differ by more than the settings allow, and no other flag says why: c, τ, M or a gain differs
    /// from the settings. A wrong k changes both alike.
    pub const ESTIMATES_DIFFER: Self = Self(1 << 4);
    /// The frequency or the decay of the intruder's ringing is outside the tolerance of the settings: its k,
    /// c or m differs from the settings.
    pub const INTRUDER_DRIFTED: Self = Self(1 << 5);
    /// The ratio of the two gains of a sensor is off by more than [`GAIN_TOLERANCE`], and noise does not
    /// explain it.
    pub const GAINS_DIFFER: Self = Self(1 << 6);

    /// Every flag with its name in reports.
    pub const NAMES: [(Self, &'static str); 6] = [
        (Self::FORCE_RAILED, "force_railed"),
        (Self::ACCELERATION_RAILED, "acceleration_railed"),
        (Self::CHAIN_RANGE, "chain_range"),
        (Self::ESTIMATES_DIFFER, "estimates_differ"),
        (Self::INTRUDER_DRIFTED, "intruder_drifted"),
        (Self::GAINS_DIFFER, "gains_differ"),
    ];

    /// From the bits of a strike frame. Bits that this version does not know are kept.
    pub const fn from_bits(bits: u16) -> Self {
        Self(bits)
    }

    /// The bits for a strike frame.
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// Whether all of `other` is set.
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Sets `other` if `condition`.
    fn set_if(&mut self, other: Self, condition: bool) {
        if condition {
            self.0 |= other.0;
        }
    }
}

/// What the bead reports of one strike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StrikeReport {
    /// Number of the strike since power-up, from 0.
    pub strike: u32,
    /// Sample index of the window's first sample.
    pub first_index: u64,
    /// Sample index at which the trigger fired.
    pub trigger_index: u64,
    /// Samples in the window.
    pub samples: u16,
    /// Highest force.
    pub peak_force: Force,
    /// Sample index of the highest force.
    pub peak_index: u64,
    /// Highest acceleration of the intruder.
    pub acceleration_max: Acceleration,
    /// Lowest acceleration of the intruder.
    pub acceleration_min: Acceleration,
    /// Estimate A: the absorbed energy measured by the intruder's acceleration, less the energy of the noise.
    pub absorbed_measured: Energy,
    /// Estimate B: the absorbed energy predicted from the force.
    pub absorbed_predicted: Energy,
    /// Energy of a solitary wave with this peak force.
    pub incident_energy: Energy,
    /// Estimate A over the incident energy; 0 without one.
    pub absorbed_fraction: I16F16,
    /// What noise would have added to estimate A; it was subtracted.
    pub noise_energy: Energy,
    /// Standard deviation of the force before the strike.
    pub force_noise: Force,
    /// Arrival, width and momentum of the pulse, and the ringing.
    pub shape: Shape,
    /// What was wrong.
    pub flags: Flags,
}

impl StrikeReport {
    /// How far the highest force stands above the noise before the strike, in dB, within 0.001 dB. `None`
    /// without noise, or if the force does not exceed it.
    pub fn signal_to_noise(&self) -> Option<f32> {
        let (peak, noise) = (self.peak_force, self.force_noise);
        let known = noise > Force::ZERO && peak > noise;
        known.then(|| decibels(peak.to_num::<f32>() / noise.to_num::<f32>()))
    }
}

/// `20 log₁₀` of a ratio of amplitudes above 1, by `micromath`.
fn decibels(ratio: f32) -> f32 {
    20.0 * F32Ext::log10(ratio)
}

/// Part by which the ratio of the two gains of a sensor may be off.
pub const GAIN_TOLERANCE: I16F16 = I16F16::lit("0.02");

/// The running window of a strike.
#[derive(Clone, Copy, Debug, Default)]
pub struct Window {
    strike: u32,
    first_index: u64,
    samples: u16,
    force: SensorState,
    acceleration: SensorState,
    observer: ObserverState,
    chain: ReducedChainState,
    /// Σ F² over `force_samples` samples before the strike.
    force_squares: u64,
    force_samples: u16,
    /// End of the last piece that counted for estimate A.
    ring_end: u16,
    /// Whether the wide codes of the newest piece had a part in the result.
    loud: bool,
    railed: Flags,
}

impl Window {
    /// Opens a window for strike number `strike` whose first sample has the index `first_index`.
    pub fn open(strike: u32, first_index: u64) -> Self {
        Self {
            strike,
            first_index,
            ..Self::default()
        }
    }

    /// Takes the next samples and writes their forces and accelerations into `record`. The result does not
    /// depend on how the samples are cut into calls. Never inlined, so that its instructions can be counted
    /// by its symbol.
    #[inline(never)]
    pub fn process(&mut self, settings: &Settings, mut scans: &[Scan], record: &mut WindowRecord) {
        while !scans.is_empty() {
            let room = PIECE - usize::from(self.samples) % PIECE;
            let (piece, rest) = scans.split_at(scans.len().min(room));
            scans = rest;
            if room == PIECE {
                self.loud = false;
            }
            if self.samples < BASELINE {
                for scan in piece {
                    self.force.settle(scan.force);
                    self.acceleration.settle(scan.acceleration);
                }
                self.loud = true;
            } else {
                self.measure(settings, piece, record);
            }
            self.samples += piece.len() as u16;
            if piece.len() == room {
                self.close_piece(settings);
            }
        }
    }

    /// Takes samples after the baseline, at most [`PIECE`].
    fn measure(&mut self, settings: &Settings, scans: &[Scan], record: &mut WindowRecord) {
        let mut forces = [Force::ZERO; PIECE];
        let forces = &mut forces[..scans.len()];
        let mut accelerations = [SensedAcceleration::ZERO; PIECE];
        let accelerations = &mut accelerations[..scans.len()];
        let codes = scans.iter().map(|scan| scan.force);
        let force = settings.force.process(&mut self.force, codes, forces);
        let codes = scans.iter().map(|scan| scan.acceleration);
        let acceleration = settings
            .acceleration
            .process(&mut self.acceleration, codes, accelerations);
        self.note(force, Flags::FORCE_RAILED);
        self.note(acceleration, Flags::ACCELERATION_RAILED);
        record.extend(forces, accelerations);
        let scale = &settings.scale;
        settings
            .observer
            .process(scale.observer, &mut self.observer, accelerations);
        if self.samples < settings.window.noise_end() {
            for force in &*forces {
                let force = u64::from(force.to_bits().unsigned_abs());
                self.force_squares = self.force_squares.saturating_add(force * force);
            }
            self.force_samples += forces.len() as u16;
            return;
        }
        settings
            .chain
            .process(scale, &settings.company, &mut self.chain, forces);
    }

    fn note(&mut self, loudness: Loudness, railed: Flags) {
        self.loud |= loudness.loud;
        self.railed.set_if(railed, loudness.railed);
    }

    /// A piece is complete.
    fn close_piece(&mut self, settings: &Settings) {
        let noise_end = settings.window.noise_end();
        if self.samples <= BASELINE {
            return;
        }
        if self.samples <= noise_end {
            self.observer.close_noise();
            if self.samples == noise_end {
                self.chain.gate_noise(self.force_squares, self.force_samples);
            }
        } else if self.observer.close_piece() {
            self.ring_end = self.samples;
        }
    }

    /// Samples taken so far.
    pub fn samples(&self) -> u16 {
        self.samples
    }

    /// Whether the wide codes of the newest piece, or of the two samples before it, had a part in the result.
    /// If not, the window is the same without them.
    pub fn is_loud(&self) -> bool {
        self.loud
    }

    /// Estimate A so far.
    pub fn absorbed_measured(&self, settings: &Settings) -> Energy {
        settings
            .observer
            .absorbed(settings.scale.measured, &self.observer)
    }

    /// Estimate B so far.
    pub fn absorbed_predicted(&self, settings: &Settings) -> Energy {
        settings.chain.absorbed(settings.scale.predicted, &self.chain)
    }

    /// The report of the window, made when its last sample has been taken.
    pub fn report(&self, settings: &Settings, record: &WindowRecord) -> StrikeReport {
        let [measured, predicted] = [
            self.absorbed_measured(settings),
            self.absorbed_predicted(settings),
        ];
        let noise_energy = settings.observer.noise(settings.scale.measured, &self.observer);
        let Peaks {
            force: peak_force,
            sample: peak_sample,
            acceleration,
        } = record.peaks();
        let incident_energy = incident_energy(settings.incident, peak_force);
        let shape = Shape {
            force_gains: self.force.gain_match(),
            acceleration_gains: self.acceleration.gain_match(),
            ..Shape::of(
                settings.sample_rate_hz,
                record,
                peak_sample,
                usize::from(self.ring_end),
                settings.observer.noise_square(&self.observer),
                settings.ringing.frequency,
            )
        };
        let mut flags = self.railed;
        flags.set_if(Flags::CHAIN_RANGE, self.chain.saturated());
        let drifted = settings.company.is_alone() && settings.ringing.is_other_than(&shape);
        flags.set_if(Flags::INTRUDER_DRIFTED, drifted);
        let gains = [shape.force_gains, shape.acceleration_gains];
        let gains_differ = gains.iter().flatten().any(|gains| gains.differ(GAIN_TOLERANCE));
        flags.set_if(Flags::GAINS_DIFFER, gains_differ);
        // Another flag explains a difference.
        let unexplained =
            flags == Flags::default() && differ([measured, predicted], settings.disagreement, noise_energy);
        flags.set_if(Flags::ESTIMATES_DIFFER, unexplained);
        StrikeReport {
            strike: self.strike,
            first_index: self.first_index,
            trigger_index: self.first_index + u64::from(settings.window.history) - 1,
            samples: self.samples,
            peak_force,
            peak_index: self.first_index + peak_sample as u64,
            acceleration_max: Acceleration::saturating_from_num(*acceleration.end()),
            acceleration_min: Acceleration::saturating_from_num(*acceleration.start()),
            absorbed_measured: measured,
            absorbed_predicted: predicted,
            incident_energy,
            absorbed_fraction: fraction(measured, incident_energy),
            noise_energy,
            force_noise: self.chain.gate() / 3,
            shape,
            flags,
        }
    }
}

/// One energy over another.
fn fraction(part: Energy, whole: Energy) -> I16F16 {
    match whole.to_bits() {
        ..=0 => I16F16::ZERO,
        whole => {
            let bits = (i128::from(part.to_bits()) << I16F16::FRAC_NBITS) / i128::from(whole);
            I16F16::from_bits(i32::try_from(bits).unwrap_or(i32::MAX))
        }
    }
}

/// Whether two energies differ by more than `part` of the greater and the energy of the noise.
fn differ([a, b]: [Energy; 2], part: I16F16, noise: Energy) -> bool {
    let apart = u128::from(
        a.to_bits()
            .abs_diff(b.to_bits())
            .saturating_sub(noise.to_bits().unsigned_abs()),
    );
    let greater = u128::from(a.max(b).to_bits().unsigned_abs());
    apart << I16F16::FRAC_NBITS > greater * u128::from(part.to_bits().unsigned_abs())
}

/// Energy of the solitary wave whose peak force is `peak`: `e F^{5/3}`, with `e` in nJ/N^{5/3}. Within 1e-5,
/// in f32, once a strike.
///
/// `micromath`'s power is off by up to 18 % over 0.1 to 1000 N. It starts two Newton steps for the cube root.
/// Every recorded strike has the bits of these steps, so another power function would end its replay.
pub fn incident_energy(coefficient: I16F16, peak: Force) -> Energy {
    if peak <= Force::ZERO {
        return Energy::ZERO;
    }
    let force = peak.to_num::<f32>();
    let mut root = F32Ext::powf(force, 1.0 / 3.0);
    for _ in 0..2 {
        root = (2.0 * root + force / (root * root)) / 3.0;
    }
    Energy::saturating_from_num(force * root * root * coefficient.to_num::<f32>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_contain_others_if_all_of_them_are_set() {
        let both = Flags::from_bits(Flags::FORCE_RAILED.bits() | Flags::GAINS_DIFFER.bits());
        for (flag, name) in Flags::NAMES {
            assert!(flag.contains(flag), "{name}");
            assert!(flag.contains(Flags::default()), "{name}");
            assert!(!Flags::default().contains(flag), "{name}");
            let is_one = flag == Flags::FORCE_RAILED || flag == Flags::GAINS_DIFFER;
            assert_eq!(both.contains(flag), is_one, "{name}");
            // One of two is not both.
            assert!(!flag.contains(both), "{name}");
        }
        assert!(both.contains(both));
    }

    #[test]
    fn a_flag_is_set_on_its_condition_and_others_stay() {
        let mut flags = Flags::FORCE_RAILED;
        flags.set_if(Flags::CHAIN_RANGE, false);
        assert_eq!(flags, Flags::FORCE_RAILED);
        for _ in 0..2 {
            flags.set_if(Flags::CHAIN_RANGE, true);
            assert_eq!(flags, Flags::from_bits(0b1001));
        }
    }

    #[test]
    fn energies_differ_when_they_are_further_apart_than_a_part_of_the_greater() {
        let part = I16F16::from_num(0.0625);
        let [whole, near, far] = [800.0, 750.0, 749.9].map(Energy::from_num);
        for (other, apart) in [(whole, false), (near, false), (far, true), (Energy::ZERO, true)] {
            assert_eq!(differ([whole, other], part, Energy::ZERO), apart, "{other}");
            assert_eq!(differ([other, whole], part, Energy::ZERO), apart, "{other}");
        }
        assert!(!differ([Energy::ZERO; 2], part, Energy::ZERO));
        assert!(!differ([whole, far], part, Energy::ONE));
    }

    #[test]
    fn a_fraction_of_no_energy_is_zero() {
        let [part, whole] = [250.0, 1000.0].map(Energy::from_num);
        assert_eq!(fraction(part, whole), I16F16::from_num(0.25));
        assert_eq!(fraction(part, Energy::ZERO), I16F16::ZERO);
        assert_eq!(fraction(Energy::MAX, Energy::DELTA), I16F16::MAX);
    }

    #[test]
    fn incident_energy_is_within_the_stated_error_of_the_power_law() {
        let mut worst = 0.0f64;
        let mut peak = 0.1;
        while peak < 1000.0 {
            let force = Force::from_num(peak);
            let exact = force.to_num::<f64>().powf(5.0 / 3.0);
            let got = incident_energy(I16F16::ONE, force).to_num::<f64>();
            worst = worst.max((got / exact - 1.0).abs());
            peak *= 1.01;
        }
        println!("worst relative error of the power 5/3: {worst:.2e}");
        assert!(worst < 1e-5, "{worst:e}");
    }

    #[test]
    fn the_signal_stands_above_the_noise_if_there_is_noise_and_it_is_higher() {
        let settings = crate::design::derive(
            &crate::design::Bead::paper(),
            &crate::design::FrontEnd::reference(),
            &crate::design::Capture::default(),
        );
        let nothing = Window::open(0, 0).report(&settings.unwrap(), &WindowRecord::new());
        let level = |peak: f64, noise: f64| {
            let [peak_force, force_noise] = [peak, noise].map(Force::from_num);
            StrikeReport {
                peak_force,
                force_noise,
                ..nothing
            }
            .signal_to_noise()
        };
        assert!((level(8.0, 0.008).unwrap() - 60.0).abs() < 0.02);
        assert!((level(1.0, 0.5).unwrap() - 6.02).abs() < 0.01);
        assert_eq!([level(8.0, 0.0), level(0.0, 0.0), level(-1.0, -2.0)], [None; 3]);
        assert_eq!([level(0.5, 0.5), level(0.5, 1.0)], [None; 2]);
    }

    #[test]
    fn decibels_are_within_their_stated_error() {
        let (mut worst, mut ratio) = (0.0_f64, 1.0_f32);
        while ratio < 1e9 {
            worst = worst.max((f64::from(decibels(ratio)) - 20.0 * f64::from(ratio).log10()).abs());
            ratio *= 1.003;
        }
        println!("worst error of the level: {worst:.2e} dB");
        assert!(worst < 1e-3, "{worst:e}");
    }
}
