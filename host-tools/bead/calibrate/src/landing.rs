//! The landing of a ball on the cap: area, duration and time of its force pulse, in codes and samples.

use bead_compare::front_end::CODES;
use bead_model::layout::BASELINE;
use bead_recording::strikes::RecordedStrike;
use bead_wire::StrikeFlags;

use crate::calibration::{all_samples, no_flag};

/// Thresholds of the codes that belong to the contact: a part of the peak, and standard deviations of the
/// quiet. Both must be exceeded.
const CONTACT_PART: f64 = 0.005;
const CONTACT_NOISE: f64 = 4.0;
/// Samples summed before and after the contact.
const MARGIN: usize = 16;

/// A landing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Landing {
    /// Sample index at which the contact begins.
    pub(crate) begin: f64,
    /// Duration of the contact, samples.
    pub(crate) contact: f64,
    /// Sum of the codes above their zero over the pulse.
    pub(crate) sum: f64,
    /// Standard uncertainty of the sum by noise and zero, codes.
    pub(crate) sum_u: f64,
    /// Time from the pulse's centre of area to the end of the sum, samples.
    pub(crate) after_centre: f64,
    /// Highest code above zero.
    pub(crate) peak: f64,
}

impl Landing {
    /// Measures the pulse of a strike.
    ///
    /// # Errors
    /// The strike is no complete landing. One line: the reason, and what would help.
    pub(crate) fn of(strike: &RecordedStrike) -> Result<Self, String> {
        all_samples(strike)?;
        let codes: Vec<u16> = strike.scans.iter().map(|scan| scan.sensitive[0]).collect();
        if codes.iter().any(|code| [0, CODES - 1].contains(code)) {
            return Err(
                "the force reached a rail of the converter at its high gain; put a softer pad on the cap, or \
                 drop from a lower height"
                    .to_owned(),
            );
        }
        let cut = [
            StrikeFlags::ANOTHER_WAVE,
            StrikeFlags::WINDOW_CUT,
            StrikeFlags::SENSOR_END,
        ];
        no_flag(strike, &cut, "let nothing else touch the bead")?;
        let codes: Vec<f64> = codes.into_iter().map(f64::from).collect();
        pulse(&codes, strike.said.first_index)
    }
}

/// The pulse in the codes of a window that begins at this sample index.
fn pulse(codes: &[f64], first_index: u64) -> Result<Landing, String> {
    let baseline = usize::from(BASELINE);
    let (Some(quiet), Some(rest)) = (codes.get(..baseline), codes.get(baseline..)) else {
        return Err("its window is too short to hold the quiet before the landing".to_owned());
    };
    let zero = quiet.iter().sum::<f64>() / quiet.len() as f64;
    let squares: f64 = quiet.iter().map(|code| (code - zero).powi(2)).sum();
    // The rounding scatters by 1/√12 of a code even without noise.
    let noise = (squares / (quiet.len() - 1) as f64).max(1.0 / 12.0).sqrt();
    let forces: Vec<f64> = rest.iter().map(|code| code - zero).collect();
    let peak = forces.iter().copied().fold(0.0, f64::max);
    let limit = f64::max(CONTACT_PART * peak, CONTACT_NOISE * noise);
    // Require two in a row, as noise may take a single code above the limit.
    let mut touching = forces.windows(2).enumerate();
    let is_touching = |(_, pair): &(usize, &[f64])| pair.iter().all(|force| *force > limit);
    let first = touching.clone().find(is_touching).map(|(at, _)| at);
    let last = touching.rfind(is_touching).map(|(at, _)| at + 1);
    let (Some(first), Some(last)) = (first, last) else {
        return Err("the force never rises above its noise; the ball missed the cap".to_owned());
    };
    let (from, to) = (first.saturating_sub(MARGIN), last + 1 + MARGIN);
    let Some(summed) = forces.get(from..to) else {
        return Err(
            "the force has not ended at the end of its window; use a stiffer pad, or make capture.length longer"
                .to_owned(),
        );
    };
    let sum: f64 = summed.iter().sum();
    let moment: f64 = summed
        .iter()
        .enumerate()
        .map(|(at, force)| at as f64 * force)
        .sum();
    let count = summed.len() as f64;
    Ok(Landing {
        // The force begins between two samples.
        begin: first_index as f64 + (baseline + first) as f64 - 0.5,
        contact: (last + 1 - first) as f64,
        sum,
        sum_u: noise * (count + count * count / quiet.len() as f64).sqrt(),
        after_centre: count - moment / sum,
        peak,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Codes of a half sine of 200 samples that begins at sample 160 of a window of 672.
    fn window(peak: f64) -> Vec<f64> {
        let sine = |at: usize| match at.checked_sub(160) {
            Some(since @ 0..=200) => peak * (std::f64::consts::PI * since as f64 / 200.0).sin(),
            _ => 0.0,
        };
        (0..672)
            .map(|at| 128.0 + sine(at).round() + f64::from(at as u32 % 2))
            .collect()
    }

    #[test]
    fn area_duration_and_centre_of_a_pulse_are_those_of_its_shape() {
        let found = pulse(&window(2000.0), 1000).unwrap();
        let area = 2000.0 * 400.0 / std::f64::consts::PI;
        assert!((found.sum / area - 1.0).abs() < 2e-4, "{found:?}");
        assert!((found.contact - 200.0).abs() <= 2.0, "{found:?}");
        assert!((found.begin - 1160.0).abs() <= 2.0, "{found:?}");
        let centre = 100.0 + MARGIN as f64;
        assert!((found.after_centre - centre).abs() < 2.0, "{found:?}");
    }

    #[test]
    fn a_window_without_a_whole_pulse_is_refused() {
        for (codes, why) in [
            (&[128.0; 672][..], "missed the cap"),
            (&window(2000.0)[..340], "has not ended"),
            (&[128.0; 60], "too short to hold the quiet"),
        ] {
            assert!(pulse(codes, 0).unwrap_err().contains(why), "{why}");
        }
    }
}
