//! Waves that come to a bead after the main one.

use serde::Serialize;

use crate::comparison::strike::SensedPoint;

/// The least height of a wave, as a part of the main one, and in standard deviations of the force's noise.
const LEAST: f64 = 5e-3;
const NOISE: f64 = 6.0;
/// Between two waves the force falls to this part of the lower one.
const FALL: f64 = 0.5;

/// The strongest wave after the main one: by the bead, and by the chain at the same samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LaterWave {
    /// By the bead.
    pub device: Option<Wave>,
    /// By the chain.
    pub f64_chain: Option<Wave>,
}

/// A wave after the main one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Wave {
    /// Highest force, N.
    pub peak_force: f64,
    /// From the highest force of the main wave to that of this one, s.
    pub after: f64,
}

/// The strongest later wave of a strike, in a force with this noise, N rms. `None` if neither saw one.
pub fn later_wave(force: &[SensedPoint], noise: f64) -> Option<LaterWave> {
    let of = |value: fn(&SensedPoint) -> f64| {
        let values: Vec<f64> = force.iter().map(value).collect();
        let main = (0..values.len()).max_by(|a, b| values[*a].total_cmp(&values[*b]))?;
        let least = f64::max(LEAST * values[main], NOISE * noise);
        let later = waves(&values, main, least);
        let at = later.into_iter().max_by(|a, b| values[*a].total_cmp(&values[*b]))?;
        Some(Wave {
            peak_force: values[at],
            after: force[at].time - force[main].time,
        })
    };
    let found = LaterWave {
        device: of(|point| point.sensed),
        f64_chain: of(|point| point.simulated),
    };
    (found.device.is_some() || found.f64_chain.is_some()).then_some(found)
}

/// Where the waves after the main one are highest.
fn waves(values: &[f64], main: usize, least: f64) -> Vec<usize> {
    let mut waves = Vec::new();
    // The wave that is being looked at, and the least force since the one before.
    let (mut top, mut low) = (None, values[main]);
    for at in main + 1..values.len() {
        let value = values[at];
        match top {
            Some(before) if value > values[before] => top = Some(at),
            Some(before) if value < FALL * values[before] => {
                waves.push(before);
                (top, low) = (None, value);
            }
            Some(_) => {}
            None => {
                low = low.min(value);
                if value > least && low < FALL * value {
                    top = Some(at);
                }
            }
        }
    }
    waves
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bells of these heights, each 20 samples after the one before.
    fn force(heights: &[f64]) -> Vec<f64> {
        let bell = |at: f64, height: f64| height * (-(at / 4.0).powi(2)).exp();
        let samples = 20 * (heights.len() + 1);
        (0..samples)
            .map(|sample| {
                let after = |n: usize| sample as f64 - 20.0 * (n + 1) as f64;
                heights.iter().enumerate().map(|(n, height)| bell(after(n), *height)).sum()
            })
            .collect()
    }

    #[test]
    fn a_wave_is_what_rises_from_half_its_height_and_falls_to_it() {
        let found = |heights: &[f64], least| waves(&force(heights), 20, least);
        assert_eq!(found(&[7.0, 1.0, 0.5], 0.05), [40, 60]);
        assert_eq!(found(&[7.0, 0.0, 0.04], 0.05), [] as [usize; 0], "too low");
        // A shoulder of the main wave is none.
        let mut shoulder = force(&[7.0]);
        shoulder[26] += 0.1;
        assert_eq!(waves(&shoulder, 20, 0.05), [] as [usize; 0]);
        // One that the window cuts has no height.
        assert_eq!(waves(&force(&[7.0, 1.0])[..41], 20, 0.05), [] as [usize; 0]);
    }

    #[test]
    fn bead_and_chain_are_looked_at_in_the_same_way() {
        let point = |(n, sensed): (usize, f64)| SensedPoint {
            time: n as f64 * 1e-5,
            sensed,
            simulated: 0.5 * sensed,
        };
        let points: Vec<_> = force(&[7.0, 0.0, 1.0]).into_iter().enumerate().map(point).collect();
        let found = later_wave(&points, 0.005).unwrap();
        let (device, chain) = (found.device.unwrap(), found.f64_chain.unwrap());
        assert!((device.peak_force - 1.0).abs() < 1e-3 && (device.after - 40e-5).abs() < 1e-12);
        assert!((chain.peak_force - 0.5).abs() < 1e-3 && chain.after == device.after);
        assert_eq!(later_wave(&points, 1.0), None, "in the noise");
    }
}
