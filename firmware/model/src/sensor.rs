//! The two gains of a sensor, as one signal.
//!
//! # Design
//!
//! The *sensitive* channel gives the signal until it comes near a rail; there the *wide* channel takes over.
//! The codes alone decide which of the two a sample is taken from. The compensated value of a sample
//! ([`Channel`]) is made of three codes, and all three have to be away from the rails.
//!
//! **No step at the hand-over.** The channels are compared while both see the same signal and it moves. When
//! the wide channel takes over, their mean difference so far is subtracted from it: this is the error of the
//! wide channel's zero, a fraction of a code. The baseline counts as samples without a difference: as its 64
//! samples if its codes scatter, since they then determine the zero to an eighth of their scatter; as one
//! sample if all 64 codes are the same, since they then determine it to half a code only.
//!
//! **The gains.** The slope of the difference over the signal says how far the ratio of the two gains is from
//! the settings. It is reported with the strike ([`GainMatch`]) and not used: one strike knows it to about
//! one per cent, a calibration to a tenth of that.
//!
//! In a quiet piece, in which the sensitive channel stays near its zero, the wide channel is not looked at.
//! The second gain costs time only while a strike is loud, and only then does the host need the wide codes.

use crate::calibration::{Channel, ChannelState};
use crate::layout::{BASELINE, PIECE};
use crate::quantity::{AdcCode, Pair};
use bead_wire::{Fraction, GainMatch};
use core::ops::RangeInclusive;
use fixed::FixedI32;
use fixed::types::I16F16;
use fixed::types::extra::LeEqU32;
use serde::{Deserialize, Serialize};

/// Least distance from the rails of a sensitive code that is trusted. The amplifier reaches its rail before
/// the filter behind it does.
const MARGIN: u16 = 64;
/// A signal moves if it is more than this many sensitive codes away from its zero: a quarter of the range.
const MOVING: u16 = 1024;

/// Bits in the sums of [`GainOverlap`] of a signal that fills the sensitive range.
const OVERLAP_BITS: u32 = 20;

/// Calibration of a sensor's two channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Sensor<F: LeEqU32> {
    /// The channel of the high gain.
    pub sensitive: Channel<F>,
    /// The channel of the low gain.
    pub wide: Channel<F>,
}

/// State of a sensor in a window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SensorState {
    sensitive: ChannelState,
    wide: ChannelState,
    /// The first wide code of the baseline, and true if a later one was different.
    first: Option<AdcCode>,
    scatters: bool,
    /// Number of coming values that a code far from zero still affects.
    loud: u8,
    /// Number of coming values that a code near a rail still affects.
    hold: u8,
    /// Error of the wide channel's zero: it is subtracted from its values.
    offset: i32,
    overlap: GainOverlap,
}

/// Which channels measured some samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Loudness {
    /// The result depends on the wide codes.
    pub loud: bool,
    /// The wide channel was at a rail while it supplied the signal.
    pub railed: bool,
}

impl SensorState {
    /// Adds the codes of the quiet signal to the baselines.
    pub fn settle(&mut self, codes: Pair) {
        self.sensitive.settle(codes.sensitive());
        self.wide.settle(codes.wide());
        self.scatters |= *self.first.get_or_insert(codes.wide()) != codes.wide();
    }

    /// Match of the gains; `None` if the window does not determine it.
    pub fn gain_match(&self) -> Option<GainMatch> {
        self.overlap.gain_match()
    }
}

impl<F: LeEqU32> Sensor<F> {
    /// The values at the samples *before* those of the codes, at most [`PIECE`], relative to the baseline.
    #[inline(always)]
    pub fn process<V: LeEqU32>(
        &self,
        state: &mut SensorState,
        codes: impl DoubleEndedIterator<Item = Pair> + Clone,
        values: &mut [FixedI32<V>],
    ) -> Loudness {
        let sensitive = codes.clone().map(|pair| pair.sensitive());
        let wide = codes.clone().map(|pair| pair.wide());
        let zero = state.sensitive.zero();
        let low = zero.saturating_sub(MOVING).max(MARGIN);
        let high = (zero + MOVING).min(AdcCode::MAX.get() - MARGIN);
        let near_zero = i32::from(low)..=i32::from(high);
        // Negative if a code is beyond either end, without a branch for each code.
        let beyond = sensitive.clone().fold(0, |beyond, code| {
            let code = i32::from(code.get());
            beyond | (code - near_zero.start()) | (near_zero.end() - code)
        });
        let quiet = state.loud == 0 && beyond >= 0;
        self.sensitive.process(&mut state.sensitive, sensitive, values);
        if quiet {
            state.wide.skip(wide);
            return Loudness::default();
        }
        self.merge(state, near_zero, codes, wide, values)
    }

    /// Merges the wide channel into `values`, which are those of the sensitive one.
    fn merge<V: LeEqU32>(
        &self,
        state: &mut SensorState,
        near_zero: RangeInclusive<i32>,
        codes: impl Iterator<Item = Pair>,
        wide: impl Iterator<Item = AdcCode>,
        values: &mut [FixedI32<V>],
    ) -> Loudness {
        let mut wides = [FixedI32::<V>::ZERO; PIECE];
        let wides = &mut wides[..values.len()];
        self.wide.process(&mut state.wide, wide, wides);
        let code: FixedI32<V> = FixedI32::from_bits(self.sensitive.per_code.to_bits() >> (F::U32 - V::U32));
        let floor = code.to_bits().saturating_mul(MOVING.into());
        // The sensitive range is four times the floor.
        let shift = (floor.unsigned_abs() | 1)
            .ilog2()
            .saturating_sub(OVERLAP_BITS - 2);
        let mut loudness = Loudness {
            loud: true,
            railed: false,
        };
        for ((value, wide), codes) in values.iter_mut().zip(wides).zip(codes) {
            let believable = MARGIN..=AdcCode::MAX.get() - MARGIN;
            let code = codes.sensitive().get();
            // A code affects three values.
            if !near_zero.contains(&i32::from(code)) {
                state.loud = 3;
            }
            if !believable.contains(&code) {
                if state.hold == 0 {
                    let baseline = if state.scatters { BASELINE } else { 1 };
                    state.offset = state.overlap.mean_difference(baseline) << shift;
                }
                state.hold = 3;
            }
            let loud = state.loud > 0;
            state.loud = state.loud.saturating_sub(1);
            if state.hold > 0 {
                state.hold -= 1;
                loudness.railed |= codes.wide().is_railed();
                *value = FixedI32::from_bits(wide.to_bits().saturating_sub(state.offset));
            } else if loud && value.to_bits().abs() >= floor {
                let difference = wide.to_bits().saturating_sub(value.to_bits());
                state.overlap.add(value.to_bits() >> shift, difference >> shift);
            }
        }
        loudness
    }
}

/// Sums over the samples in which both channels see a signal that moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct GainOverlap {
    samples: i32,
    /// Σ of the signal, of the wide channel less the signal, and of their products.
    signal: i64,
    difference: i64,
    signal_signal: i64,
    signal_difference: i64,
    difference_difference: i64,
}

impl GainOverlap {
    #[inline(always)]
    fn add(&mut self, signal: i32, difference: i32) {
        // With the clamp the sums stay in range, even if the wide channel reads nonsense.
        let difference = difference.clamp(-(1 << 24), (1 << 24) - 1);
        let [s, d] = [signal, difference].map(i64::from);
        self.samples += 1;
        self.signal += s;
        self.difference += d;
        self.signal_signal += s * s;
        self.signal_difference += s * d;
        self.difference_difference += d * d;
    }

    /// Mean difference of the wide channel. The baseline counts as `baseline` samples of no difference.
    fn mean_difference(&self, baseline: u16) -> i32 {
        (self.difference / i64::from(self.samples + i32::from(baseline))) as i32
    }

    /// Slope of the difference over the signal, by least squares.
    fn gain_match(&self) -> Option<GainMatch> {
        if self.samples < 8 {
            return None;
        }
        let n = self.samples as f32;
        let [s, d, ss, sd, dd] = [
            self.signal,
            self.difference,
            self.signal_signal,
            self.signal_difference,
            self.difference_difference,
        ]
        .map(|sum| sum as f32 / n);
        let (variance, covariance) = (ss - s * s, sd - s * d);
        if variance <= 0.0 {
            return None;
        }
        let slope = covariance / variance;
        let rest = (dd - d * d - slope * covariance).max(0.0);
        Some(GainMatch {
            deviation: reported(slope),
            uncertainty: reported(libm::sqrtf(rest / (variance * (n - 2.0)))),
        })
    }
}

/// A part of the signal in the format of the result; saturates.
fn reported(part: f32) -> Fraction {
    Fraction::from_bits(I16F16::saturating_from_num(part).to_bits())
}

/// True if the two gains of a sensor deviate by more than `part` and by more than five standard deviations.
pub(crate) fn gains_differ(gains: GainMatch, part: I16F16) -> bool {
    let apart = gains.deviation.bits().unsigned_abs();
    apart > part.to_bits().unsigned_abs() && apart / 5 > gains.uncertainty.bits().unsigned_abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantity::SensedForce;
    use crate::window::GAIN_TOLERANCE;
    use fixed::types::I2F30;
    use fixed::types::extra::U30;

    /// 4 mN a code, 64 mN a code: 1 to 16. No poles.
    fn sensor() -> Sensor<U30> {
        let channel = |per_code| Channel {
            per_code,
            slope: I2F30::ZERO,
            curve: I2F30::ZERO,
        };
        Sensor {
            sensitive: channel(I2F30::from_num(1.0 / 256.0)),
            wide: channel(I2F30::from_num(1.0 / 16.0)),
        }
    }

    /// Codes of `force` (N): zeros at 128 and 100.3, the wide gain `more` times what the settings say.
    fn pair(force: f64, more: f64) -> Pair {
        let code = |value: f64| value.round().clamp(0.0, 4095.0) as u16;
        Pair::new(code(128.0 + force * 256.0), code(100.3 + force * 16.0 * more))
    }

    /// Feeds the codes of a baseline and those after it. Returns the values, the loudness of each piece, and
    /// the match of the gains.
    fn measured(
        sensor: &Sensor<U30>,
        quiet: impl Fn(u16) -> Pair,
        codes: &[Pair],
    ) -> (Vec<SensedForce>, Vec<Loudness>, Option<GainMatch>) {
        let mut state = SensorState::default();
        (0..BASELINE).for_each(|n| state.settle(quiet(n)));
        let mut values = vec![SensedForce::ZERO; codes.len()];
        let pieces = codes.chunks(PIECE).zip(values.chunks_mut(PIECE));
        let loudness = pieces
            .map(|(codes, values)| sensor.process(&mut state, codes.iter().copied(), values))
            .collect();
        (values, loudness, state.gain_match())
    }

    /// Match of the gains over these forces, of a wide gain `more` times what the settings say.
    fn matched(forces: &[f64], more: f64) -> Option<GainMatch> {
        let codes: Vec<Pair> = forces.iter().map(|&force| pair(force, more)).collect();
        measured(&sensor(), |_| pair(0.0, more), &codes).2
    }

    /// A pulse of `peak` N, 60 samples wide at its foot, after 40 of quiet.
    fn pulse(peak: f64) -> Vec<f64> {
        (0..160)
            .map(|n| {
                // Off the middle, so that no code comes twice.
                let phase = std::f64::consts::PI * (f64::from(n) - 39.7) / 60.0;
                let inside = (40..100).contains(&n);
                if inside { peak * phase.sin().powi(2) } else { 0.0 }
            })
            .collect()
    }

    #[test]
    fn beyond_it_there_is_no_step_though_the_wide_zero_is_off_by_a_third_of_a_code() {
        let forces = pulse(200.0);
        let codes: Vec<Pair> = forces.iter().map(|&force| pair(force, 1.0)).collect();
        let (values, loudness, _) = measured(&sensor(), |_| pair(0.0, 1.0), &codes);
        // A value is that of the sample before.
        let errors = values[1..].iter().zip(&forces);
        let errors = errors.map(|(value, force)| (value.to_num::<f64>() - force).abs());
        let worst = errors.fold(0.0, f64::max);
        // Half a wide code of rounding, and what is left of the third by the few samples of the overlap.
        assert!(worst < (0.5 + 0.25) / 16.0, "{worst}");
        assert!(worst > 0.5 / 256.0, "the wide channel is not used");
        assert!(!loudness[0].loud && loudness[1].loud && loudness.iter().all(|l| !l.railed));
    }

    #[test]
    fn gains_that_differ_are_told_by_how_much() {
        for more in [0.95, 1.0, 1.03] {
            let matched = matched(&pulse(14.0), more).unwrap();
            let (deviation, uncertainty) = (matched.deviation.ratio(), matched.uncertainty.ratio());
            let off = (deviation - (more - 1.0)).abs();
            assert!(off < 3.0 * uncertainty, "{matched:?}");
            assert!(uncertainty < 2e-3, "{matched:?}");
            assert_eq!(gains_differ(matched, GAIN_TOLERANCE), more != 1.0);
        }
        assert_eq!(matched(&pulse(1.0), 1.0), None);
    }

    #[test]
    fn gains_differ_beyond_a_part_and_beyond_five_standard_deviations_to_either_side() {
        const PART: i32 = 1311; // 2 %
        for (deviation, uncertainty, expected) in [
            // A deviation by exactly the part is allowed, however certain.
            (PART, 0, false),
            (PART + 1, 0, true),
            (5 * PART, PART, false),
            (5 * PART, PART - 1, true),
            (250 * PART, 50 * PART, false),
            (250 * PART, 50 * PART - 1, true),
            (i32::MAX, i32::MAX, false),
        ] {
            for deviation in [deviation, -deviation] {
                let gains = GainMatch {
                    deviation: Fraction::from_bits(deviation),
                    uncertainty: Fraction::from_bits(uncertainty),
                };
                assert_eq!(gains_differ(gains, GAIN_TOLERANCE), expected, "{gains:?}");
            }
        }
    }

    /// Offset of the wide channel when it takes over, in bits. It reads one code too many while the signal
    /// moves, in `overlap` samples. Its codes in the baseline are 100 plus those of `baseline` in turn. A
    /// sensitive code is 2^power/256 N, and a wide one 16 times as much.
    fn offset(overlap: usize, baseline: [i32; 2], power: u32) -> i32 {
        let mut sensor = sensor();
        for channel in [&mut sensor.sensitive, &mut sensor.wide] {
            channel.per_code <<= power;
        }
        let code = |codes: i32| codes as u16;
        let quiet = |n: u16| Pair::new(128, code(100 + baseline[usize::from(n % 2)]));
        // Of a signal in wide codes.
        let at = |signal: i32| Pair::new(code((128 + 16 * signal).min(4095)), code(100 + signal + 1));
        let codes = [vec![at(100); overlap], vec![at(2000); 2]].concat();
        let (values, ..) = measured(&sensor, quiet, &codes);
        (2001 << (12 + power)) - values[overlap + 1].to_bits()
    }

    #[test]
    fn the_wide_channel_takes_over_less_its_mean_difference_so_far_with_the_baseline() {
        for overlap in [2, 3, 9, 33, 80] {
            // A baseline that scatters counts as its 64 samples, and one of equal codes as one.
            for (baseline, counts) in [([0, 0], 1), ([-1, 1], 64)] {
                // The sums have 20 bits for a signal of the sensitive range, which is that of a code of
                // 1/256 N.
                for power in 0..=4 {
                    // A value is that of the sample before, so the first value belongs to a quiet sample.
                    let samples = overlap as i32 - 1;
                    let stated = (4096 * samples / (samples + counts)) << power;
                    let found = offset(overlap, baseline, power);
                    assert_eq!(found, stated, "{overlap}, {counts}, {power}");
                }
            }
        }
    }

    #[test]
    fn seven_samples_do_not_tell_the_gains_and_eight_do() {
        for (overlap, told) in [(8, false), (9, true)] {
            // The last value is that of the sample before the last.
            let forces: Vec<f64> = (0..overlap).map(|n| 6.0 + f64::from(n) / 8.0).collect();
            assert_eq!(matched(&forces, 1.0).is_some(), told, "{overlap}");
        }
    }

    #[test]
    fn a_difference_counts_with_24_bits_and_a_sign_at_most() {
        for (difference, counts) in [
            ((1 << 24) - 1, (1 << 24) - 1),
            (i32::MAX, (1 << 24) - 1),
            (-(1 << 24), -(1 << 24)),
            (i32::MIN, -(1 << 24)),
        ] {
            let mut overlap = GainOverlap::default();
            overlap.add(1, difference);
            assert_eq!(overlap.mean_difference(0), counts, "{difference}");
        }
    }

    /// True if a piece with these high-gain codes over this zero is loud.
    fn is_loud(zero: u16, codes: &[u16]) -> bool {
        let codes: Vec<Pair> = codes.iter().map(|&code| Pair::new(code, 2000)).collect();
        measured(&sensor(), |_| Pair::new(zero, 2000), &codes).1[0].loud
    }

    #[test]
    fn a_code_far_from_zero_or_at_a_rail_makes_a_piece_loud_whichever_others_there_are() {
        for (zero, code, loud) in [
            (128, 64, false),
            (128, 63, true),
            (128, 1152, false),
            (128, 1153, true),
            (2048, 1024, false),
            (2048, 1023, true),
            (3900, 2876, false),
            (3900, 2875, true),
            (3900, 4031, false),
            (3900, 4032, true),
        ] {
            assert_eq!(is_loud(zero, &[zero, code, zero]), loud, "{zero}, {code}");
        }
        for (high, low) in [(7, 8), (16, 16)] {
            let codes = [vec![3500; high], vec![700; low], vec![2048; PIECE - high - low]].concat();
            assert!(is_loud(2048, &codes), "{high} high, {low} low");
        }
    }
}
