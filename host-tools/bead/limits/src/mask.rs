//! Limits over frequency, for shock response spectra.
//!
//! # Design
//! Between the points of a mask its limits run straight over the logarithms of frequency and value, as
//! specifications draw them. The spectrum is computed at its usual natural frequencies and at the mask's own
//! points, and the frequency with the least room counts.

use bead_spectra::bead::GRAVITY;
use bead_spectra::shock::{ResponseKind, SAMPLES_IN_A_PERIOD, frequencies, spectrum};
use bead_spectra::strike::{FLAT_TO, StrikeSignal};

use crate::rule::{DecisionRule, Interval, Outcome};

/// A point of a mask.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaskPoint {
    /// Frequency, Hz.
    pub frequency: f64,
    /// Limits there.
    pub limits: Interval,
}

/// Limits over frequency.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    /// Two points or more, by frequency.
    pub points: Vec<MaskPoint>,
    /// Response of the oscillators.
    pub response: ResponseKind,
    /// Their quality.
    pub quality: f64,
    /// Natural frequencies in an octave.
    pub per_octave: u32,
    /// True for accelerations in g.
    pub gravities: bool,
}

/// A spectrum at a frequency, compared with the mask.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaskedPoint {
    /// Frequency, Hz.
    pub frequency: f64,
    /// Maximax response, in the mask's unit.
    pub value: f64,
    /// Its expanded uncertainty; `None` if it is unknown.
    pub expanded: Option<f64>,
    /// Limits at this frequency.
    pub limits: Interval,
    /// The decision.
    pub outcome: Outcome,
}

impl Mask {
    /// The unit of its values.
    pub fn unit(&self) -> &'static str {
        match self.response {
            ResponseKind::AbsoluteAcceleration if self.gravities => "g",
            ResponseKind::AbsoluteAcceleration => "m/s²",
            ResponseKind::PseudoVelocity => "m/s",
            ResponseKind::RelativeDisplacement => "m",
        }
    }

    /// The first and the last frequency, Hz.
    pub fn range(&self) -> (f64, f64) {
        let at = |point: Option<&MaskPoint>| point.map_or(f64::NAN, |point| point.frequency);
        (at(self.points.first()), at(self.points.last()))
    }

    /// The limits at a frequency.
    pub fn limits(&self, frequency: f64) -> Interval {
        let Some(pair) = self.points.windows(2).find(|pair| frequency <= pair[1].frequency) else {
            return self
                .points
                .last()
                .map_or_else(Interval::default, |last| last.limits);
        };
        let [from, to] = [pair[0], pair[1]];
        let part = (frequency / from.frequency).ln() / (to.frequency / from.frequency).ln();
        let between = |of: fn(Interval) -> Option<f64>| {
            let (low, high) = (of(from.limits)?, of(to.limits)?);
            Some(low * (high / low).powf(part.clamp(0.0, 1.0)))
        };
        Interval {
            min: between(|limits| limits.min),
            max: between(|limits| limits.max),
        }
    }

    /// A strike's spectrum against the mask, by frequency.
    ///
    /// # Errors
    /// The strike's window is too short for the mask, or its sampling too slow: why, and what next.
    pub fn hold(&self, signal: &StrikeSignal, rule: DecisionRule) -> Result<Vec<MaskedPoint>, String> {
        let (from, to) = self.range();
        let (lowest, highest) = (1.0 / signal.after_trigger(), signal.rate / SAMPLES_IN_A_PERIOD);
        if from < lowest * (1.0 - 1e-9) {
            return Err(format!(
                "the mask begins at {from} Hz, and the window holds no period below {lowest:.1} Hz after the trigger; begin the \
                 mask there, or let the bead keep a longer window (capture.length of its settings)"
            ));
        }
        if to > highest * (1.0 + 1e-9) {
            return Err(format!(
                "the mask ends at {to} Hz, and above {highest} Hz, a tenth of the sampling rate, a peak may lie between two \
                 samples; end the mask there"
            ));
        }
        let mut at = frequencies(from, to, self.per_octave);
        at.extend(self.points.iter().map(|point| point.frequency));
        at.sort_by(f64::total_cmp);
        at.dedup_by(|one, other| (*one / *other - 1.0).abs() < 1e-9);
        let unit = if self.unit() == "g" { GRAVITY } else { 1.0 };
        let responses = spectrum(&signal.acceleration, signal.rate, self.quality, &at);
        let points = at.into_iter().zip(&responses).map(|(frequency, response)| {
            let [value, ..] = response.values(self.response);
            let value = value / unit;
            let part = signal.gain_uncertainty.filter(|_| frequency <= FLAT_TO);
            let expanded = part.map(|part| 2.0 * part * value);
            let limits = self.limits(frequency);
            MaskedPoint {
                frequency,
                value,
                expanded,
                limits,
                outcome: rule.decide(value, expanded, limits),
            }
        });
        Ok(points.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judged::JudgedValue;

    fn mask(points: &[(f64, f64)]) -> Mask {
        let point = |(frequency, max): &(f64, f64)| MaskPoint {
            frequency: *frequency,
            limits: Interval {
                min: None,
                max: Some(*max),
            },
        };
        Mask {
            points: points.iter().map(point).collect(),
            response: ResponseKind::AbsoluteAcceleration,
            quality: 10.0,
            per_octave: 12,
            gravities: false,
        }
    }

    /// A half sine of 100 m/s² and 1 ms, 100 000 samples a second, after 1 ms of quiet.
    fn half_sine() -> StrikeSignal {
        let sine = |sample: i32| match sample - 100 {
            at @ 0..=100 => 100.0 * (std::f64::consts::PI * f64::from(at) / 100.0).sin(),
            _ => 0.0,
        };
        StrikeSignal {
            recording: "x.mcap".into(),
            strike: 0,
            rate: 1e5,
            trigger: 100,
            force: vec![0.0; 1100],
            acceleration: (0..1100).map(sine).collect(),
            gain_uncertainty: Some(0.01),
            zero_uncertainty: 0.0,
            flags: Vec::new(),
        }
    }

    #[test]
    fn limits_run_straight_over_logarithms() {
        let mask = mask(&[(100.0, 10.0), (1000.0, 1000.0), (2000.0, 1000.0)]);
        for (frequency, limit) in [
            (100.0, 10.0),
            (1e3 / 10_f64.sqrt(), 100.0),
            (1000.0, 1000.0),
            (1500.0, 1000.0),
        ] {
            let found = mask.limits(frequency).max.unwrap();
            assert!((found / limit - 1.0).abs() < 1e-12, "{frequency} Hz: {found}");
        }
    }

    #[test]
    fn the_worst_frequency_counts_and_the_guard_is_the_gain_twice() {
        // The maximax of an undamped oscillator under a half sine is 1.77 of its height; with Q = 10 some
        // 1.65.
        let signal = half_sine();
        let hold = |max: f64, rule| {
            let points = mask(&[(200.0, max), (5000.0, max)]).hold(&signal, rule).unwrap();
            let points = points.into_iter().map(|point| JudgedValue::masked(None, point));
            JudgedValue::worst(points).unwrap()
        };
        let worst = hold(1e3, DecisionRule::Simple);
        assert!((700.0..1000.0).contains(&worst.frequency.unwrap()), "{worst:?}");
        let value = worst.value.unwrap();
        assert!((160.0..170.0).contains(&value), "{worst:?}");
        assert_eq!(worst.expanded, Some(0.02 * value));
        for (max, rule, outcome) in [
            (0.99, DecisionRule::Simple, Outcome::Fail),
            (1.01, DecisionRule::Simple, Outcome::Pass),
            (1.01, DecisionRule::GuardedAcceptance, Outcome::Fail),
            (1.03, DecisionRule::GuardedAcceptance, Outcome::Pass),
            (0.99, DecisionRule::GuardedRejection, Outcome::Pass),
            (0.97, DecisionRule::GuardedRejection, Outcome::Fail),
        ] {
            assert_eq!(hold(max * value, rule).outcome, outcome, "{max} {rule:?}");
        }
    }

    #[test]
    fn a_window_that_cannot_tell_the_mask_is_refused_with_what_to_do() {
        let refused = |points| mask(points).hold(&half_sine(), DecisionRule::Simple).unwrap_err();
        let low = refused(&[(50.0, 1.0), (1e3, 1.0)]);
        assert!(
            low.contains("no period below 100.0 Hz") && low.contains("capture.length"),
            "{low}"
        );
        let high = refused(&[(500.0, 1.0), (2e4, 1.0)]);
        assert!(
            high.contains("above 10000 Hz") && high.contains("end the mask there"),
            "{high}"
        );
    }
}
