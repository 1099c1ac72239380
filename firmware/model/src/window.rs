//! The window of one strike: a pure function of the settings and of the codes in it.
//!
//! [`layout`](crate::layout) shows its parts. Replay feeds the recorded codes through the same [`Window`] and
//! gets the same bits.

use crate::layout::{BASELINE, PIECE};
use crate::observer::ObserverState;
use crate::quantity::{Scan, SensedAcceleration, SensedForce};
use crate::reduced_chain::ReducedChainState;
use crate::sensor::{Loudness, SensorState, gains_differ};
use crate::settings::Settings;
use crate::shape::{WindowPeaks, WindowRecord, shape};
use crate::waveform::WaveformState;
use bead_wire::{Acceleration, Energy, Force, Fraction, LeftEnergy, Shape, Strike, StrikeFlags};
use fixed::types::{I2F30, I16F16, I40F24};
use micromath::F32Ext;

/// Part by which the ratio of the two gains of a sensor may be off.
pub const GAIN_TOLERANCE: I16F16 = I16F16::lit("0.02");

/// Flags that explain why the wave forms differ although the bead is as its settings say.
const EXPLAIN: StrikeFlags = StrikeFlags::FORCE_RAILED
    .with(StrikeFlags::ANOTHER_WAVE)
    .with(StrikeFlags::CHAIN_RANGE)
    .with(StrikeFlags::GAINS_DIFFER)
    .with(StrikeFlags::SENSOR_END)
    .with(StrikeFlags::NOT_AT_REST);

/// Eighths of the highest force below which a wave has fallen, so that another may follow; and the limit for
/// two waves within the width of one.
const FALLEN: i32 = 4;
const FALLEN_OF_DOUBLE: i32 = 5;

/// Inverse of the part of an energy above which the energy left is flagged: 0.5 %.
const RINGING: i128 = 200;

/// Standard uncertainties of A - B beyond which A and B count as different. Chance alone takes 3 of 1000 good
/// beads there.
pub const COVERAGE: i32 = 3;

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
    waveform: WaveformState,
    /// Σ F² over `force_samples` samples before the strike.
    force_squares: u64,
    force_samples: u16,
    /// End of the last piece that counted for estimate A.
    ring_end: u16,
    /// True if the result depends on the wide codes of the newest piece.
    loud: bool,
    railed: StrikeFlags,
    /// Number of coming pieces that an acceleration at a rail still affects.
    unknown: u8,
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
        let mut forces = [SensedForce::ZERO; PIECE];
        let forces = &mut forces[..scans.len()];
        let mut accelerations = [SensedAcceleration::ZERO; PIECE];
        let accelerations = &mut accelerations[..scans.len()];
        let codes = scans.iter().map(|scan| scan.force);
        let force = settings.force.process(&mut self.force, codes, forces);
        let codes = scans.iter().map(|scan| scan.acceleration);
        let acceleration = settings
            .acceleration
            .process(&mut self.acceleration, codes, accelerations);
        self.note(force, StrikeFlags::FORCE_RAILED);
        self.note(acceleration, StrikeFlags::ACCELERATION_RAILED);
        if acceleration.railed {
            // A code also affects the next values, which may belong to the next piece.
            self.unknown = 2;
        }
        record.extend(forces, accelerations);
        let mut predicted = [0; PIECE];
        let predicted = &mut predicted[..scans.len()];
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
        } else {
            settings
                .chain
                .process(scale, &settings.company, &mut self.chain, forces, predicted);
        }
        settings
            .waveform
            .process(&mut self.waveform, accelerations, predicted);
    }

    fn note(&mut self, loudness: Loudness, railed: StrikeFlags) {
        self.loud |= loudness.loud;
        self.railed = self.railed.with_if(loudness.railed, railed);
    }

    /// Closes a piece.
    fn close_piece(&mut self, settings: &Settings) {
        let noise_end = settings.window.noise_end();
        if self.samples <= BASELINE {
            return;
        }
        if self.samples <= noise_end {
            self.observer.close_noise(settings.quiet.observer);
            self.waveform.close_noise();
            if self.samples == noise_end {
                self.chain.gate_noise(self.force_squares, self.force_samples);
            }
            return;
        }
        if self.observer.close_piece() {
            self.ring_end = self.samples;
        }
        let force_known = self.railed.without(StrikeFlags::FORCE_RAILED) == self.railed;
        self.waveform
            .close_piece(force_known && self.unknown == 0, self.chain.echoes());
        self.unknown = self.unknown.saturating_sub(1);
    }

    /// Samples taken so far.
    pub fn samples(&self) -> u16 {
        self.samples
    }

    /// Returns `true` if the result depends on the wide codes of the newest piece or of the two samples
    /// before it.
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

    /// The energy that the intruder holds at the end of the window. In estimate A it is 0 once the ringing is
    /// below the noise.
    fn left(&self, settings: &Settings, record: &WindowRecord) -> Option<LeftEnergy> {
        let last = self.samples / PIECE as u16 * PIECE as u16;
        let rings = self.ring_end > 0 && self.ring_end == last;
        settings
            .ring_down
            .left(rings, record.accelerations(), &self.chain)
    }

    /// The result of the window and its shape, once its last sample has been taken. Flags of
    /// [`StrikeFlags::OF_THE_BEAD`] are not set: they do not follow from the window.
    pub fn report(&self, settings: &Settings, record: &WindowRecord) -> (Strike, Shape) {
        let left = self.left(settings, record);
        let parts = left.map_or([Energy::default(); 2], |left| [left.measured, left.predicted]);
        let [measured, predicted] = [
            sum(self.absorbed_measured(settings), parts[0]),
            sum(self.absorbed_predicted(settings), parts[1]),
        ];
        let ringing_left = [(parts[0], measured), (parts[1], predicted)]
            .into_iter()
            .any(|(part, whole)| i128::from(part.bits()) * RINGING > i128::from(whole.bits()));
        let noise_energy = settings.observer.noise(settings.scale.measured, &self.observer);
        let peaks = record.peaks();
        let WindowPeaks {
            force: peak_force,
            sample: peak_sample,
            ref acceleration,
        } = peaks;
        let incident_energy = incident_energy(settings.incident, peak_force);
        let force_noise = self.part_of_noise(settings, peak_force);
        let shape = Shape {
            strike: self.strike,
            first_index: self.first_index,
            force_gains: self.force.gain_match(),
            acceleration_gains: self.acceleration.gain_match(),
            waveform: settings.waveform.result(&self.waveform, force_noise),
            left,
            ..shape(
                settings.sample_rate_hz,
                record,
                peak_sample,
                usize::from(self.ring_end),
                settings.observer.noise_square(&self.observer),
                settings.ringing.frequency,
            )
        };
        let uncertainty = settings.uncertainty.as_ref().and_then(|terms| {
            let noise = settings.observer.noise_square(&self.observer);
            terms.of(&shape, [measured, predicted], noise, self.force_noise())
        });
        let shape = Shape { uncertainty, ..shape };
        let found = self.found(settings, record, &peaks, &shape);
        let energies = [measured, predicted];
        let flags = found
            .with(self.judged(settings, record, peaks.force, &shape, energies, found))
            .with_if(ringing_left, StrikeFlags::RINGING_LEFT);
        let strike = Strike {
            strike: self.strike,
            first_index: self.first_index,
            trigger_index: self.first_index + u64::from(settings.window.history) - 1,
            samples: self.samples,
            peak_force: Force::from_bits(peak_force.to_bits()),
            peak_index: self.first_index + peak_sample as u64,
            acceleration_max: reported(*acceleration.end()),
            acceleration_min: reported(*acceleration.start()),
            absorbed_measured: measured,
            absorbed_predicted: predicted,
            incident_energy,
            absorbed_fraction: fraction(measured, incident_energy),
            noise_energy,
            force_noise: self.force_noise(),
            flags,
        };
        (strike, shape)
    }

    /// Flags that follow from the record alone, whatever the model says.
    fn found(
        &self,
        settings: &Settings,
        record: &WindowRecord,
        peaks: &WindowPeaks,
        shape: &Shape,
    ) -> StrikeFlags {
        let is_cut = self.samples < settings.window.length;
        let WindowPeaks {
            force, acceleration, ..
        } = peaks;
        let swing = (*acceleration.end()).max(acceleration.start().saturating_neg());
        let at_end = *force >= settings.force_end || swing >= settings.acceleration_end;
        let gains_differ = [shape.force_gains, shape.acceleration_gains]
            .into_iter()
            .flatten()
            .any(|gains| gains_differ(gains, GAIN_TOLERANCE));
        self.railed
            .with_if(self.chain.saturated(), StrikeFlags::CHAIN_RANGE)
            .with_if(at_end, StrikeFlags::SENSOR_END)
            .with_if(gains_differ, StrikeFlags::GAINS_DIFFER)
            .with_if(
                settings.quiet.is_exceeded(&settings.window, record),
                StrikeFlags::NOT_AT_REST,
            )
            .with_if(
                is_cut || another_wave(settings, record.forces(), *force, FALLEN),
                StrikeFlags::ANOTHER_WAVE,
            )
            .with_if(is_cut, StrikeFlags::WINDOW_CUT)
    }

    /// Flags of a bead that deviates from its model, unless the flags in `found` explain the deviation.
    fn judged(
        &self,
        settings: &Settings,
        record: &WindowRecord,
        peak: SensedForce,
        shape: &Shape,
        energies: [Energy; 2],
        found: StrikeFlags,
    ) -> StrikeFlags {
        let width = shape.width.samples() as f32;
        // The uncertainty of the difference includes that of the noise.
        let (part, noise) = match shape.uncertainty {
            Some(known) => (
                I16F16::from_bits(known.difference.bits().saturating_mul(COVERAGE)),
                Energy::default(),
            ),
            None => (
                settings.disagreement,
                settings.observer.noise(settings.scale.measured, &self.observer),
            ),
        };
        let is_apart = differ(energies, part, noise);
        let explained = match &settings.uncertainty {
            Some(terms) if shape.uncertainty.is_some() && !is_apart => terms.of_waveform(energies),
            _ => 0.0,
        };
        let is_unexplained = found.without(EXPLAIN) == found;
        let differs = |waveform| settings.waveform.differs(waveform, width, explained);
        let model_differs = is_unexplained && shape.waveform.is_some_and(differs);
        // In a row of heavy intruders one wave looks like two close ones, but the wave forms agree.
        let is_double = model_differs && another_wave(settings, record.forces(), peak, FALLEN_OF_DOUBLE);
        let later = || {
            let whole = settings
                .waveform
                .whole(&self.waveform, self.part_of_noise(settings, peak));
            whole.is_some_and(|whole| settings.waveform.differs_later(whole, width, explained))
        };
        let drifted = settings.company.is_alone() && settings.ringing.is_other_than(shape);
        let flags = StrikeFlags::NONE
            .with_if(drifted, StrikeFlags::INTRUDER_DRIFTED)
            .with_if(model_differs, StrikeFlags::MODEL_DIFFERS)
            .with_if(is_double, StrikeFlags::ANOTHER_WAVE)
            .with_if(
                is_unexplained && !model_differs && later(),
                StrikeFlags::WAVE_TRAIN,
            );
        // Another flag explains a difference. Energy left at the end does not: both estimates include it.
        let is_unexplained = found.with(flags) == StrikeFlags::NONE;
        flags.with_if(is_unexplained && is_apart, StrikeFlags::ESTIMATES_DIFFER)
    }

    /// Noise of the force over its `peak`. The noise that the settings state counts even where no code
    /// scatters.
    fn part_of_noise(&self, settings: &Settings, peak: SensedForce) -> f32 {
        let noise = self.chain.gate().max(settings.chain.gate).to_num::<f32>() / 3.0;
        noise / peak.to_num::<f32>().max(f32::MIN_POSITIVE)
    }

    /// Rms noise of the force in the quiet.
    fn force_noise(&self) -> Force {
        Force::from_bits((self.chain.gate() / 3).to_bits())
    }
}

/// True if the forces of a window have more waves than the one that it was opened for.
///
/// After a quiet of `lookback` samples, a wave counts if it is an eighth as high as the highest before: it
/// brings 3 % of its energy. Before such a quiet, a heavy striker sends a train of waves, each lower than the
/// one before. There a wave counts only if it is about as high, and the force fell to `fallen` eighths in
/// between.
///
/// Never inlined, so that its instructions can be counted by its symbol.
#[inline(never)]
fn another_wave(settings: &Settings, forces: &[SensedForce], peak: SensedForce, fallen: i32) -> bool {
    let lookback = usize::from(settings.window.lookback);
    let per_code = settings.force.sensitive.per_code;
    let threshold = (i64::from(per_code.to_bits()) * i64::from(settings.window.threshold))
        >> (I2F30::FRAC_NBITS - SensedForce::FRAC_NBITS);
    let threshold = threshold as i32;
    // A rise far below the peak is a precursor of a wave, not a wave of its own.
    let floor = threshold.max(peak.to_bits() / 8);
    let (mut highest, mut quiet) = (0, 0_usize);
    let [mut again, mut anew] = [i32::MAX; 2];
    let later = forces.get(lookback..).unwrap_or_default();
    for (now, before) in later.iter().zip(forces) {
        let (now, before) = (now.to_bits(), before.to_bits());
        let rise = now.saturating_sub(before);
        if now >= again || rise >= anew {
            return true;
        }
        quiet = if rise >= threshold { 0 } else { quiet + 1 };
        highest = highest.max(now);
        if quiet == lookback && highest >= floor {
            anew = threshold.max(highest / 8);
        }
        if again == i32::MAX && now < highest / 8 * fallen && highest >= floor && now < highest - threshold {
            again = highest / 8 * 7;
        }
    }
    false
}

/// Sum of two energies; saturates.
fn sum(one: Energy, other: Energy) -> Energy {
    Energy::from_bits(one.bits().saturating_add(other.bits()))
}

/// An acceleration in the format of the result; saturates.
fn reported(acceleration: SensedAcceleration) -> Acceleration {
    Acceleration::from_bits(I16F16::saturating_from_num(acceleration).to_bits())
}

/// One energy over another.
fn fraction(part: Energy, whole: Energy) -> Fraction {
    match whole.bits() {
        ..=0 => Fraction::default(),
        whole => {
            let bits = (i128::from(part.bits()) << Fraction::UNIT.fraction_bits) / i128::from(whole);
            Fraction::from_bits(i32::try_from(bits).unwrap_or(i32::MAX))
        }
    }
}

/// Returns `true` if two energies differ by more than `part` of the greater plus the energy of the noise.
fn differ([a, b]: [Energy; 2], part: I16F16, noise: Energy) -> bool {
    let apart = u128::from(
        a.bits()
            .abs_diff(b.bits())
            .saturating_sub(noise.bits().unsigned_abs()),
    );
    let greater = u128::from(a.max(b).bits().unsigned_abs());
    apart << I16F16::FRAC_NBITS > greater * u128::from(part.to_bits().unsigned_abs())
}

/// Energy of the solitary wave whose peak force is `peak`: `e F^{5/3}`, with `e` in nJ/N^{5/3}. Within 1e-5,
/// in f32, once a strike.
///
/// `micromath`'s power is off by up to 18 % over 0.1 to 1000 N. It is the start of two Newton steps for the
/// cube root. Recorded strikes contain the bits of these steps, so another power function would break their
/// replay.
pub fn incident_energy(coefficient: I16F16, peak: SensedForce) -> Energy {
    if peak <= SensedForce::ZERO {
        return Energy::default();
    }
    let force = peak.to_num::<f32>();
    let mut root = F32Ext::powf(force, 1.0 / 3.0);
    for _ in 0..2 {
        root = (2.0 * root + force / (root * root)) / 3.0;
    }
    let energy = I40F24::saturating_from_num(force * root * root * coefficient.to_num::<f32>());
    Energy::from_bits(energy.to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nanojoules(energy: f64) -> Energy {
        Energy::from_bits(I40F24::from_num(energy).to_bits())
    }

    #[test]
    fn energies_differ_when_they_are_further_apart_than_a_part_of_the_greater() {
        let part = I16F16::from_num(0.0625);
        let [whole, near, far] = [800.0, 750.0, 749.9].map(nanojoules);
        let none = Energy::default();
        for (other, apart) in [(whole, false), (near, false), (far, true), (none, true)] {
            assert_eq!(differ([whole, other], part, none), apart, "{other:?}");
            assert_eq!(differ([other, whole], part, none), apart, "{other:?}");
        }
        assert!(!differ([none; 2], part, none));
        assert!(!differ([whole, far], part, nanojoules(1.0)));
    }

    #[test]
    fn a_fraction_of_no_energy_is_zero() {
        let [part, whole] = [250.0, 1000.0].map(nanojoules);
        assert_eq!(fraction(part, whole).ratio(), 0.25);
        assert_eq!(fraction(part, Energy::default()), Fraction::default());
        let greatest = fraction(Energy::from_bits(i64::MAX), Energy::from_bits(1));
        assert_eq!(greatest, Fraction::from_bits(i32::MAX));
    }

    #[test]
    fn incident_energy_is_within_the_stated_error_of_the_power_law() {
        let mut worst = 0.0f64;
        let mut peak = 0.1;
        while peak < 1000.0 {
            let force = SensedForce::from_num(peak);
            let exact = force.to_num::<f64>().powf(5.0 / 3.0);
            let got = incident_energy(I16F16::ONE, force).joules() * 1e9;
            worst = worst.max((got / exact - 1.0).abs());
            peak *= 1.01;
        }
        println!("worst relative error of the power 5/3: {worst:.2e}");
        assert!(worst < 1e-5, "{worst:e}");
    }
}
