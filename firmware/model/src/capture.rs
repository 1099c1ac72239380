//! When a strike is taken, and when it is flagged.

use serde::{Deserialize, Serialize};

use crate::front_end::FrontEnd;
use crate::layout::{HISTORY_MAX, WINDOW_MAX};
use crate::physics::Bead;

/// Trigger, window and tolerances of a strike.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Capture {
    /// Sample rate, Hz.
    #[serde(rename = "sample_rate")]
    pub sample_rate_hz: u32,
    /// Rise of the force that triggers, N.
    pub threshold: f64,
    /// Time over which the force must rise by the threshold, s.
    pub lookback: f64,
    /// Time before the trigger, s.
    pub history: f64,
    /// Length of the whole window, s.
    pub length: f64,
    /// A strike is flagged if A and B differ by more than this part of the greater.
    pub disagreement: f64,
    /// Part by which the frequency of the ringing may be off before a strike is flagged.
    pub ring_frequency_tolerance: f64,
    /// Part by which the decay of the ringing may be off.
    pub ring_decay_tolerance: f64,
}

impl Capture {
    /// The default, with a threshold above the noise of this front end: at least ten standard deviations and
    /// seven codes. Where pulses are longer than those of the paper's bead, the times are longer in
    /// proportion, up to the limits of a window.
    pub fn of(bead: &Bead, front_end: &FrontEnd) -> Self {
        let force = &front_end.force;
        let least = f64::max(10.0 * force.noise, 7.0 * force.per_code);
        let default = Self::default();
        let longer = (bead.pulse_width(1.0) / Bead::paper().pulse_width(1.0)).max(1.0);
        let rate = f64::from(default.sample_rate_hz);
        let most = |time: f64, samples: f64| f64::min(longer * time, samples / rate);
        Self {
            threshold: default.threshold.max(least),
            history: most(default.history, HISTORY_MAX as f64),
            lookback: most(default.lookback, HISTORY_MAX as f64 - 1.0),
            length: most(default.length, WINDOW_MAX.into()),
            ..default
        }
    }
}

impl Default for Capture {
    /// 100 kHz. The history of 1.6 ms has 0.64 ms for the zeros and 0.64 ms for the noise. In the window of
    /// 6.72 ms the paper's intruder rings down to 1e-7 of its energy. The trigger is a rise of 0.1 N in 0.5
    /// ms. A strike is flagged if A and B differ by 3 %, ten times the effect of noise and half the effect of
    /// a chain without viscosity; or if the ringing is off by 3 % in frequency (6 % in k) or 30 % in decay.
    fn default() -> Self {
        Self {
            sample_rate_hz: 100_000,
            threshold: 0.1,
            lookback: 0.5e-3,
            history: 1.6e-3,
            length: 6.72e-3,
            disagreement: 0.03,
            ring_frequency_tolerance: 0.03,
            ring_decay_tolerance: 0.3,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_a_capture_grow_with_the_pulse_as_far_as_a_window_goes() {
        let (paper, front_end) = (Bead::paper(), FrontEnd::reference());
        let close = |found: f64, expected: f64| {
            assert!((found / expected - 1.0).abs() < 1e-9, "{found}, not {expected}");
        };
        let default = Capture::default();
        for (times, [history, length, lookback]) in [
            // Shorter pulses have the same times.
            (0.5, [1.6e-3, 6.72e-3, 0.5e-3]),
            (1.0, [1.6e-3, 6.72e-3, 0.5e-3]),
            (1.25, [2e-3, 8.4e-3, 0.625e-3]),
            (10.0, [2.56e-3, 10.24e-3, 2.55e-3]),
        ] {
            let mass = paper.mass * f64::powf(times, 2.5);
            let capture = Capture::of(&Bead { mass, ..paper }, &front_end);
            close(capture.history, history);
            close(capture.length, length);
            close(capture.lookback, lookback);
            assert_eq!(capture.threshold, default.threshold);
        }
        // The threshold stays above ten standard deviations of the noise, and above seven codes.
        for (noise, per_code, threshold) in [(0.02, 4e-3, 0.2), (0.0, 0.05, 0.35), (0.0, 4e-3, 0.1)] {
            let mut front_end = front_end;
            (front_end.force.noise, front_end.force.per_code) = (noise, per_code);
            close(Capture::of(&paper, &front_end).threshold, threshold);
        }
    }
}
