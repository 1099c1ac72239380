//! A strike as its bead measured it, compared with the record of another instrument.
//!
//! # Design
//! The two share no clock and perhaps no calibration. For force and for acceleration, the delay is that of
//! the greatest cross-correlation, refined between samples by the correlation; the gain follows by least
//! squares. All other values compare the aligned records at the bead's samples.

use serde::Serialize;

use crate::front_end::SCAN_SKEW;
use crate::given::{GivenEstimates, physics};
use crate::signal::{StrikeSignals, least};
use bead_instrument::{Trace, Waveform};
use bead_recording::strikes::RecordedStrike;

/// Reach of the pulse that is searched for, on either side of the strike's peak, in samples.
const PULSE: usize = 60;
/// The longest record that is searched, s.
const LONGEST: f64 = 100.0;
/// The part of a strike's energy that the other record must cover.
const COVERED: f64 = 0.9;

/// A value by both instruments.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct BothSides {
    /// By the bead.
    pub bead: f64,
    /// By the other instrument, as its file has it.
    pub reference: f64,
}

impl BothSides {
    /// The bead's, relative to the reference.
    pub fn off(&self) -> f64 {
        self.bead / self.reference - 1.0
    }
}

/// One quantity of a strike by both instruments, SI units.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct AlignedQuantity {
    /// Pearson's coefficient of the two, with the delay taken out.
    pub correlation: f64,
    /// The bead's values as a multiple of the reference's.
    pub gain: f64,
    /// Time since the bead's trigger, less the time in the reference's file, s.
    pub delay: f64,
    /// Time of the top of the strongest pulse, s: since the bead's trigger, and in the reference's file.
    pub arrival: BothSides,
    /// Delay of the top of the bead's pulse, beyond `delay`, s.
    pub arrival_off: f64,
    /// Height of that top.
    pub peak: BothSides,
    /// ∫ of the square over time.
    pub energy: BothSides,
    /// Root mean square of bead less gain times reference.
    pub residual_rms: f64,
    /// `residual_rms` as a part of the bead's peak.
    pub residual_part: f64,
    /// Samples of the bead that the reference reaches over.
    pub samples: usize,
    /// The points of a picture.
    #[serde(skip)]
    pub points: Vec<AlignedPoint>,
}

/// Both sides at one sample of the bead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlignedPoint {
    /// Since the trigger, s.
    pub time: f64,
    /// By the bead.
    pub bead: f64,
    /// Gain times the reference.
    pub reference: f64,
}

/// An estimate by the bead, in f64 from the bead's samples, and in f64 from the reference, J.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Absorbed {
    /// By the bead.
    pub bead: f64,
    /// In f64 from the same samples.
    pub f64_samples: f64,
    /// In f64 from the reference, as its file has it; none where it lacks the quantity.
    pub reference: Option<f64>,
}

/// A strike against the record of another instrument.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct AgainstReference {
    /// Force, N; none if the reference has none.
    pub force: Option<AlignedQuantity>,
    /// Acceleration of the intruder, m/s²; none if the reference has none.
    pub acceleration: Option<AlignedQuantity>,
    /// Estimate A.
    pub absorbed_measured: Absorbed,
    /// Estimate B.
    pub absorbed_predicted: Absorbed,
}

/// Compares a strike with a reference.
///
/// # Errors
/// Samples or settings of the strike are missing, or the reference does not hold it: one line each.
pub fn compare(strike: &RecordedStrike, reference: &Waveform) -> Result<AgainstReference, String> {
    let number = strike.said.strike;
    if strike.settings.is_none() {
        return Err(format!(
            "strike {number} came without settings, so its samples have no units; choose another with --strike"
        ));
    }
    let signals = StrikeSignals::of(strike).ok_or_else(|| {
        let (missing, samples) = (strike.missing(), strike.said.samples);
        format!("strike {number} lacks {missing} of its {samples} samples; choose another with --strike")
    })?;
    let StrikeSignals { settings, rate, .. } = signals;
    let (force, acceleration) = (&signals.force, &signals.acceleration);
    let before = strike.said.trigger_index.saturating_sub(strike.said.first_index) as f64 / rate;
    let align = |trace: &Option<Trace>, name, bead: &[f64], first| {
        let aligned = |trace| aligned(name, bead, first, rate, trace, reference.start);
        trace.as_ref().map(aligned).transpose()
    };
    let of_force = align(&reference.force, "force", force, -before)?;
    let skewed = SCAN_SKEW - before;
    let of_acceleration = align(&reference.acceleration, "acceleration", acceleration, skewed)?;
    let (bead, around) = physics(settings);
    // The stretch of the reference that the bead's window saw, in the time of its traces.
    let window = |aligned: &AlignedQuantity, skew: f64| {
        let first = skew - before - aligned.delay - reference.start;
        GivenEstimates::of(reference, settings, first..first + force.len() as f64 / rate)
    };
    let measured = of_acceleration.as_ref().map(|aligned| window(aligned, SCAN_SKEW));
    let predicted = of_force.as_ref().map(|aligned| window(aligned, 0.0));
    let [left_measured, left_predicted] = signals.left();
    Ok(AgainstReference {
        absorbed_measured: Absorbed {
            bead: strike.said.absorbed_measured.joules(),
            f64_samples: signals.measured(&bead).last().copied().unwrap_or(0.0) + left_measured,
            reference: measured
                .and_then(|given| given.absorbed_measured)
                .map(|energy| energy + left_measured),
        },
        absorbed_predicted: Absorbed {
            bead: strike.said.absorbed_predicted.joules(),
            f64_samples: signals
                .predicted(&bead, &around)
                .last()
                .map_or(0.0, |[absorbed, _]| *absorbed)
                + left_predicted,
            reference: predicted
                .and_then(|given| given.absorbed_predicted)
                .map(|energy| energy + left_predicted),
        },
        force: of_force,
        acceleration: of_acceleration,
    })
}

/// Aligns a reference with the bead's samples, the first of which is `first` s after the trigger.
fn aligned(
    name: &str,
    bead: &[f64],
    first: f64,
    rate: f64,
    reference: &Trace,
    start: f64,
) -> Result<AlignedQuantity, String> {
    let long = reference.end() - reference.begin();
    if long > LONGEST {
        return Err(format!(
            "the reference is {long:.1} s long, and at most {LONGEST} s are searched; cut the strike out of it"
        ));
    }
    let mut reference = reference.clone();
    let coarse = coarse(bead, rate, &mut reference);
    // The overlap as it is at the coarse delay, so that all delays are judged by the same samples.
    let inside = |sample: &usize| {
        let time = *sample as f64 / rate + coarse;
        (reference.begin()..=reference.end()).contains(&time)
    };
    let overlap: Vec<usize> = (0..bead.len()).filter(inside).collect();
    let own: Vec<f64> = overlap.iter().map(|sample| bead[*sample]).collect();
    let (whole, square_own) = (product(bead, bead), product(&own, &own));
    if square_own < COVERED * whole || overlap.len() < 8 {
        return Err(format!(
            "the reference's {name} covers {:.0} % of the energy of the bead's, and {:.0} % are needed; give a longer record \
             of the same strike",
            100.0 * square_own / whole,
            100.0 * COVERED
        ));
    }
    // The bead sees no faster than from sample to sample.
    let at = |shift: f64, reference: &mut Trace| -> Vec<f64> {
        let mut value = |sample: &usize| reference.around(*sample as f64 / rate + shift, 1.0 / rate);
        overlap.iter().map(&mut value).collect()
    };
    let step = 1.5 / rate;
    let shift = least(coarse - step, coarse + step, |shift| {
        -correlation(&own, &at(shift, &mut reference.clone())).abs()
    });
    let other = at(shift, &mut reference);
    let square_other = product(&other, &other);
    if square_other == 0.0 || square_own == 0.0 {
        return Err(format!(
            "the {name} of the reference or of the bead is 0 all the time"
        ));
    }
    let gain = product(&own, &other) / square_other;
    let both = overlap.iter().zip(own.iter().zip(&other));
    let points = Vec::from_iter(both.map(|(sample, (bead, other))| AlignedPoint {
        time: first + *sample as f64 / rate,
        bead: *bead,
        reference: gain * other,
    }));
    let squares = points.iter().map(|point| (point.bead - point.reference).powi(2));
    let residual_rms = (squares.sum::<f64>() / points.len() as f64).sqrt();
    let [(bead_top, bead_height), (top, height)] = [&own, &other].map(|values| summit(values));
    let skipped = overlap[0] as f64;
    let time = |sample: f64| first + (skipped + sample) / rate;
    // Difference of an instant's time in the reference's file and its time since the trigger, s.
    let into_file = shift + start - first;
    Ok(AlignedQuantity {
        correlation: correlation(&own, &other),
        gain,
        delay: -into_file,
        arrival: BothSides {
            bead: time(bead_top),
            reference: time(top) + into_file,
        },
        arrival_off: (bead_top - top) / rate,
        peak: BothSides {
            bead: bead_height,
            reference: height,
        },
        energy: BothSides {
            bead: square_own / rate,
            reference: square_other / rate,
        },
        residual_rms,
        residual_part: residual_rms / bead_height.abs(),
        samples: points.len(),
        points,
    })
}

/// Time of the reference at the bead's first sample, s, to a sample: where the pulse and the reference have
/// the greatest cross-correlation. An inverted sensor is found too.
fn coarse(bead: &[f64], rate: f64, reference: &mut Trace) -> f64 {
    let peak = greatest(bead);
    let from = peak.saturating_sub(PULSE);
    let pulse = &bead[from..(peak + PULSE).min(bead.len())];
    let begin = reference.begin();
    let count = ((reference.end() - begin) * rate).floor() as usize + 1;
    // At rest before and after, so that the pulse may extend beyond either end.
    let mut resampled = vec![0.0; count + 2 * pulse.len()];
    for (sample, value) in resampled[pulse.len()..][..count].iter_mut().enumerate() {
        *value = reference.around(begin + sample as f64 / rate, 1.0 / rate);
    }
    let match_at = |lag: usize| product(&resampled[lag..], pulse).abs();
    // The pulse's energy up to each of its samples. Nothing can be said where the reference does not cover
    // it.
    let mut energy = vec![0.0];
    for value in pulse {
        energy.push(energy[energy.len() - 1] + value * value);
    }
    let covers = |lag: &usize| {
        let within = |sample: usize| (pulse.len() + sample).saturating_sub(*lag).min(pulse.len());
        energy[within(count)] - energy[within(0)] >= COVERED * energy[pulse.len()]
    };
    let lags = 0..count + pulse.len();
    let too_short = !lags.clone().any(|lag| covers(&lag));
    let matches = lags
        .filter(|lag| too_short || covers(lag))
        .map(|lag| (lag, match_at(lag)));
    let better = |best: (usize, f64), next: (usize, f64)| if next.1 > best.1 { next } else { best };
    let (best, _) = matches.fold((0, f64::NEG_INFINITY), better);
    begin + (best as f64 - pulse.len() as f64 - from as f64) / rate
}

fn greatest(values: &[f64]) -> usize {
    let order = |a: &usize, b: &usize| values[*a].abs().total_cmp(&values[*b].abs());
    (0..values.len()).max_by(order).unwrap_or(0)
}

fn product(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(a, b)| a * b).sum()
}

/// Pearson's coefficient; 0 where one of the two is constant.
fn correlation(one: &[f64], other: &[f64]) -> f64 {
    let [one, other] = [one, other].map(|values| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter().map(|value| value - mean).collect::<Vec<f64>>()
    });
    let squares = product(&one, &one) * product(&other, &other);
    if squares > 0.0 {
        product(&one, &other) / squares.sqrt()
    } else {
        0.0
    }
}

/// Place, in samples, and height of the top of the strongest pulse, of either sign: of the parabola through
/// the samples above nine tenths of it, by least squares, or through three.
fn summit(values: &[f64]) -> (f64, f64) {
    let top = greatest(values);
    let sign = values[top].signum();
    let high = |at: usize| values[at] * sign > 0.9 * values[top].abs();
    let last = values.len() - 1;
    let below = (0..top).rev().take_while(|at| high(*at)).last();
    let above = (top + 1..=last).take_while(|at| high(*at)).last();
    let (from, to) = (
        below.unwrap_or(top.saturating_sub(1)),
        above.unwrap_or((top + 1).min(last)),
    );
    // About the middle, the sums of odd powers are 0, and value = a + b x + c x² has a closed-form solution.
    let middle = 0.5 * (from + to) as f64;
    let sum = |of: fn(f64, f64) -> f64| -> f64 {
        let places = (from..).map(|at| at as f64 - middle);
        places
            .zip(&values[from..=to])
            .map(|(x, value)| of(x, *value))
            .sum()
    };
    let [s0, s2, s4] = [sum(|_, _| 1.0), sum(|x, _| x * x), sum(|x, _| x.powi(4))];
    let [v0, v1, v2] = [sum(|_, v| v), sum(|x, v| x * v), sum(|x, v| x * x * v)];
    let (b, c) = (v1 / s2, (s0 * v2 - s2 * v0) / (s0 * s4 - s2 * s2));
    let a = (v0 - c * s2) / s0;
    let place = -b / (2.0 * c);
    let is_near = (middle + place - top as f64).abs() <= (to - from) as f64;
    if place.is_finite() && is_near && c * sign < 0.0 {
        (middle + place, a + 0.5 * b * place)
    } else {
        (top as f64, values[top])
    }
}

#[cfg(test)]
mod tests {
    use hertz_chain::Scenario;

    use super::*;
    use crate::sensed::simulate_with_ring_down;
    use crate::testing::{recorded_strike, waveform};

    /// The paper's strike at bead 8 as another instrument would record it: at `rate_hz`, its time 0 `late` s
    /// after the striker hit, its values `gain` times as high.
    fn other(rate_hz: f64, late: f64, gain: f64) -> Waveform {
        let solution = simulate_with_ring_down(&Scenario::paper()).unwrap();
        let count = ((solution.end() - late) * rate_hz) as usize;
        let mut force = solution.force_curve(8);
        let mut acceleration = solution.acceleration_curve(8).unwrap();
        let along = |of: &mut dyn FnMut(f64) -> f64| -> Vec<f64> {
            (0..count).map(|n| gain * of(late + n as f64 / rate_hz)).collect()
        };
        let force = Trace::even(along(&mut |time| force.at(time)), rate_hz);
        let acceleration = Trace::even(along(&mut |time| acceleration.at(time)), rate_hz);
        Waveform {
            start: -5.0,
            ..waveform(Some(force), Some(acceleration))
        }
    }

    #[test]
    fn delay_and_gain_of_another_instrument_are_found_between_samples() {
        let strike = recorded_strike();
        // The strike of the test hits at 20 ms; index 1 is time 0.
        let trigger = (strike.said.trigger_index as f64 - 1.0) * 1e-5 - 0.02;
        for (rate_hz, late, gain) in [(1e6, 0.3e-3, 1.0), (44.1e3 * 3.0, 0.0, 0.35), (2.5e6, 1e-3, -2.0)] {
            let found = compare(&strike, &other(rate_hz, late, gain)).unwrap();
            for (aligned, noise) in [(found.force.unwrap(), 8e-3), (found.acceleration.unwrap(), 0.12)] {
                // Time since the trigger, less the file's, which is -5 s where the chain's is `late`.
                let delay = late - trigger + 5.0;
                let off = (aligned.delay - delay) * 1e6;
                println!("{rate_hz} Hz: delay off by {off:.4} µs, gain {:.5}", aligned.gain);
                assert!(off.abs() < 0.1, "{off} µs");
                assert!((aligned.gain * gain - 1.0).abs() < 1e-3, "{}", aligned.gain);
                let correlation = aligned.correlation * gain.signum();
                assert!(correlation > 0.9999, "{correlation}");
                assert!(aligned.residual_rms < noise, "{}", aligned.residual_rms);
                assert!(aligned.arrival_off.abs() < 0.2e-6, "{}", aligned.arrival_off);
                let peaks = aligned.peak.bead / aligned.peak.reference * gain;
                let energies = aligned.energy.bead / aligned.energy.reference * gain * gain;
                assert!((peaks - 1.0).abs() < 2e-3 && (energies - 1.0).abs() < 2e-3);
            }
        }
    }

    #[test]
    fn both_estimates_from_a_good_reference_are_the_beads() {
        let found = compare(&recorded_strike(), &other(1e6, 0.2e-3, 1.0)).unwrap();
        for (absorbed, most) in [(found.absorbed_measured, 1e-3), (found.absorbed_predicted, 2e-3)] {
            let off = absorbed.bead / absorbed.reference.unwrap() - 1.0;
            let samples = absorbed.bead / absorbed.f64_samples - 1.0;
            println!("{absorbed:?}: {off:.2e}, {samples:.2e}");
            assert!(off.abs() < most && samples.abs() < most, "{off} {samples}");
        }
    }

    #[test]
    fn a_reference_of_something_else_says_so() {
        let strike = recorded_strike();
        let mut short = other(1e6, 0.0, 1.0);
        let few = short.force.iter().flat_map(Trace::points).map(|(_, value)| value);
        short.force = Some(Trace::even(few.skip(1400).take(300).collect(), 1e6));
        let why = compare(&strike, &short).err().unwrap();
        assert!(
            why.contains(" covers ") && why.contains("90 % are needed"),
            "{why}"
        );
        // A sine has little in common with a solitary wave.
        let sine = (0..20_000).map(|n| (f64::from(n) * 0.9).sin()).collect();
        let strange = waveform(Some(Trace::even(sine, 1e6)), None);
        let found = compare(&strike, &strange).unwrap();
        let correlation = found.force.unwrap().correlation.abs();
        assert!(correlation < 0.3, "{correlation}");
        assert!(found.absorbed_measured.reference.is_none() && found.acceleration.is_none());
        // Nothing is known of the missing time.
        let mut lossy = recorded_strike();
        lossy.scans.truncate(100);
        assert!(compare(&lossy, &strange).err().unwrap().contains("lacks"));
    }
}
