//! The window of one strike: a pure function of the settings and of the codes in it.
//!
//! Its first [`BASELINE`] samples are quiet and give the channels' zeros; from there on both estimates run.
//! Replay feeds the recorded codes through the same [`Window`] and gets the same bits.

use crate::calibration::{BASELINE, ChannelState};
use crate::observer::ObserverState;
use crate::quantity::{Acceleration, Energy, Force, Scan, SensedAcceleration};
use crate::reduced_chain::ReducedChainState;
use crate::settings::Settings;
use fixed::types::I16F16;
use micromath::F32Ext;
use serde::{Deserialize, Serialize};

/// What was not right about a strike; empty for a good one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Flags(u16);

impl Flags {
    /// The force stood at a rail of the converter: peak and estimate B are too low.
    pub const FORCE_RAILED: Self = Self(1 << 0);
    /// The acceleration stood at a rail of the converter: estimate A is too low.
    pub const ACCELERATION_RAILED: Self = Self(1 << 1);
    // Bit 2 said that estimate A had left its range, which it no longer can.
    /// A state of estimate B left half the range of its format.
    pub const CHAIN_RANGE: Self = Self(1 << 3);
    /// A and B differ by more than the settings allow, and no other flag says why: c, τ, M or a gain is not what the
    /// settings say. A wrong k moves both alike.
    pub const ESTIMATES_DIFFER: Self = Self(1 << 4);

    /// Every flag with the name that reports show.
    pub const NAMES: [(Self, &'static str); 4] = [
        (Self::FORCE_RAILED, "force_railed"),
        (Self::ACCELERATION_RAILED, "acceleration_railed"),
        (Self::CHAIN_RANGE, "chain_range"),
        (Self::ESTIMATES_DIFFER, "estimates_differ"),
    ];

    /// From the bits of a strike frame; bits unknown to this version are kept.
    pub const fn from_bits(bits: u16) -> Self {
        Self(bits)
    }

    /// As the bits of a strike frame.
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

/// What the bead says of one strike.
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
    /// Estimate A: the absorbed energy measured by the intruder's acceleration.
    pub absorbed_measured: Energy,
    /// Estimate B: the absorbed energy predicted from the force.
    pub absorbed_predicted: Energy,
    /// Energy of a solitary wave with this peak force.
    pub incident_energy: Energy,
    /// What was not right.
    pub flags: Flags,
}

/// The running window of a strike.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    strike: u32,
    first_index: u64,
    samples: u16,
    force: ChannelState,
    acceleration: ChannelState,
    observer: ObserverState,
    chain: ReducedChainState,
    peak_force: Force,
    peak_sample: u16,
    acceleration_max: SensedAcceleration,
    acceleration_min: SensedAcceleration,
    railed: Flags,
}

/// Samples that the estimators take at a time, at most: what the sums of squares count on.
pub const PIECE: usize = 32;

impl Window {
    /// Opens a window for strike number `strike` whose first sample has the index `first_index`.
    pub fn open(strike: u32, first_index: u64) -> Self {
        Self {
            strike,
            first_index,
            samples: 0,
            force: ChannelState::default(),
            acceleration: ChannelState::default(),
            observer: ObserverState::default(),
            chain: ReducedChainState::default(),
            peak_force: Force::ZERO,
            peak_sample: 0,
            acceleration_max: SensedAcceleration::ZERO,
            acceleration_min: SensedAcceleration::ZERO,
            railed: Flags::default(),
        }
    }

    /// Takes the next samples. The result does not depend on how they are cut into calls. Never inlined, so that
    /// its instructions can be counted by its symbol.
    #[inline(never)]
    pub fn process(&mut self, settings: &Settings, scans: &[Scan]) {
        for scan in scans {
            self.railed.set_if(Flags::FORCE_RAILED, scan.force.is_railed());
            self.railed
                .set_if(Flags::ACCELERATION_RAILED, scan.acceleration.is_railed());
        }
        let quiet = usize::from(BASELINE.saturating_sub(self.samples)).min(scans.len());
        let (quiet, strike) = scans.split_at(quiet);
        for scan in quiet {
            self.force.settle(scan.force);
            self.acceleration.settle(scan.acceleration);
        }
        self.samples += quiet.len() as u16;
        for piece in strike.chunks(PIECE) {
            self.measure(settings, piece);
            self.samples += piece.len() as u16;
        }
    }

    /// Takes samples after the baseline, at most [`PIECE`].
    fn measure(&mut self, settings: &Settings, scans: &[Scan]) {
        let mut forces = [Force::ZERO; PIECE];
        let forces = &mut forces[..scans.len()];
        let mut accelerations = [SensedAcceleration::ZERO; PIECE];
        let accelerations = &mut accelerations[..scans.len()];
        settings
            .force
            .process(&mut self.force, scans.iter().map(|scan| scan.force), forces);
        settings.acceleration.process(
            &mut self.acceleration,
            scans.iter().map(|scan| scan.acceleration),
            accelerations,
        );
        settings.observer.process(&mut self.observer, accelerations);
        settings.chain.process(&mut self.chain, forces);
        // The compensated value is that of the sample before.
        for (sample, &force) in (self.samples - 1..).zip(&*forces) {
            if force > self.peak_force {
                self.peak_force = force;
                self.peak_sample = sample;
            }
        }
        for &acceleration in &*accelerations {
            self.acceleration_max = self.acceleration_max.max(acceleration);
            self.acceleration_min = self.acceleration_min.min(acceleration);
        }
    }

    /// Samples taken so far.
    pub fn samples(&self) -> u16 {
        self.samples
    }

    /// Estimate A so far.
    pub fn absorbed_measured(&self, settings: &Settings) -> Energy {
        settings.observer.absorbed(&self.observer)
    }

    /// Estimate B so far.
    pub fn absorbed_predicted(&self, settings: &Settings) -> Energy {
        settings.chain.absorbed(&self.chain)
    }

    /// What the window says; asked for when its last sample is in.
    pub fn report(&self, settings: &Settings) -> StrikeReport {
        let mut flags = self.railed;
        flags.set_if(Flags::CHAIN_RANGE, self.chain.saturated());
        let estimates = [
            self.absorbed_measured(settings),
            self.absorbed_predicted(settings),
        ];
        // What is wrong already explains a difference.
        let unexplained = flags == Flags::default() && differ(estimates, settings.disagreement);
        flags.set_if(Flags::ESTIMATES_DIFFER, unexplained);
        StrikeReport {
            strike: self.strike,
            first_index: self.first_index,
            trigger_index: self.first_index + u64::from(settings.window.history) - 1,
            samples: self.samples,
            peak_force: self.peak_force,
            peak_index: self.first_index + u64::from(self.peak_sample),
            acceleration_max: Acceleration::saturating_from_num(self.acceleration_max),
            acceleration_min: Acceleration::saturating_from_num(self.acceleration_min),
            absorbed_measured: self.absorbed_measured(settings),
            absorbed_predicted: self.absorbed_predicted(settings),
            incident_energy: incident_energy(settings.incident, self.peak_force),
            flags,
        }
    }
}

/// Whether two energies are further apart than this part of the greater.
fn differ([a, b]: [Energy; 2], part: I16F16) -> bool {
    let apart = u128::from(a.to_bits().abs_diff(b.to_bits()));
    let greater = u128::from(a.max(b).to_bits().unsigned_abs());
    apart << I16F16::FRAC_NBITS > greater * u128::from(part.to_bits().unsigned_abs())
}

/// Energy of the solitary wave whose peak force is `peak`: `e F^{5/3}`, with `e` in nJ/N^{5/3}.
///
/// Once a strike, so in f32. `micromath`'s power function is off by up to 18 % over 0.1 to 1000 N; as the start
/// of two Newton steps for the cube root it gives `F^{5/3}` within 1e-5.
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
    fn energies_differ_when_they_are_further_apart_than_a_part_of_the_greater() {
        let part = I16F16::from_num(0.0625);
        let [whole, near, far] = [800.0, 750.0, 749.9].map(Energy::from_num);
        for (other, apart) in [(whole, false), (near, false), (far, true), (Energy::ZERO, true)] {
            assert_eq!(differ([whole, other], part), apart, "{other}");
            assert_eq!(differ([other, whole], part), apart, "{other}");
        }
        assert!(!differ([Energy::ZERO; 2], part));
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
}
