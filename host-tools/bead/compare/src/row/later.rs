//! Waves that come to a bead after the main one.
//!
//! # Design
//! A later wave is low and rides on the tail of the main one, where noise makes and hides dips. The simulated
//! force, which has no noise, shows where a wave is; the bead's is the highest force that it sensed near that
//! time. Where the simulation has no wave, the bead's own must be distinct. Both forces are averaged over
//! `SMOOTH` samples, which lowers a wave of 0.3 ms by 1 %.

use std::ops::Range;

use serde::Serialize;

use crate::traces::SensedPoint;

/// Samples in a mean, an odd number.
const SMOOTH: usize = 9;
/// Greatest distance of the bead's wave from the simulated one, in samples.
const NEAR: usize = 15;

/// Conditions for a wave: its least height, as a part of the main one's, and the part of its own height below
/// which the force falls before and after it.
type Plain = [f64; 2];

const SIMULATED: Plain = [5e-3, 0.5];
const UNEXPECTED: Plain = [2e-2, 0.25];

/// The strongest wave after the main one: by the bead, and by the chain at the same samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct LaterWave {
    /// By the bead.
    pub device: Option<Wave>,
    /// By the chain.
    pub f64_chain: Option<Wave>,
}

/// A wave after the main one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Wave {
    /// Highest force, N.
    pub peak_force: f64,
    /// From the highest force of the main wave to that of this one, s.
    pub after: f64,
}

/// The strongest later wave of a strike. `None` if neither bead nor chain has one.
pub(super) fn later_wave(force: &[SensedPoint]) -> Option<LaterWave> {
    let smooth = |value: fn(&SensedPoint) -> f64| -> Vec<f64> {
        let values: Vec<f64> = force.iter().map(value).collect();
        let means = values.windows(SMOOTH).map(|some| some.iter().sum::<f64>());
        means.map(|sum| sum / SMOOTH as f64).collect()
    };
    let (sensed, simulated) = (smooth(|point| point.sensed), smooth(|point| point.simulated));
    let main_sensed = highest(&sensed, 0..sensed.len())?;
    let main = highest(&simulated, 0..simulated.len())?;
    let wave = |values: &[f64], main: usize, at: usize| Wave {
        peak_force: values[at],
        after: force[at].time - force[main].time,
    };
    let Some(at) = strongest(&simulated, main, SIMULATED) else {
        let own = strongest(&sensed, main_sensed, UNEXPECTED)?;
        return Some(LaterWave {
            device: Some(wave(&sensed, main_sensed, own)),
            f64_chain: None,
        });
    };
    let near = at.saturating_sub(NEAR)..(at + NEAR + 1).min(sensed.len());
    Some(LaterWave {
        device: highest(&sensed, near).map(|own| wave(&sensed, main_sensed, own)),
        f64_chain: Some(wave(&simulated, main, at)),
    })
}

fn highest(values: &[f64], mut range: Range<usize>) -> Option<usize> {
    let first = range.next()?;
    let higher = |best: usize, at: usize| if values[at] > values[best] { at } else { best };
    Some(range.fold(first, higher))
}

/// The place of the top of the strongest wave after the main one.
fn strongest(values: &[f64], main: usize, plain: Plain) -> Option<usize> {
    let later = waves(values, main, plain);
    later.into_iter().max_by(|a, b| values[*a].total_cmp(&values[*b]))
}

fn waves(values: &[f64], main: usize, [height, fall]: Plain) -> Vec<usize> {
    let least = height * values[main];
    let mut waves = Vec::new();
    // The top of the current wave, and the least force since the wave before.
    let (mut top, mut low) = (None, values[main]);
    for at in main + 1..values.len() {
        let value = values[at];
        match top {
            Some(before) if value > values[before] => top = Some(at),
            Some(before) if value < fall * values[before] => {
                waves.push(before);
                (top, low) = (None, value);
            }
            Some(_) => {}
            None => {
                low = low.min(value);
                if value > least && low < fall * value {
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
        let sample = |sample: usize| {
            let bells = (1..).zip(heights);
            let bell = |(n, height): (usize, &f64)| {
                let at = sample as f64 - 20.0 * n as f64;
                height * (-(at / 4.0).powi(2)).exp()
            };
            bells.map(bell).sum()
        };
        (0..20 * (heights.len() + 1)).map(sample).collect()
    }

    #[test]
    fn a_wave_is_what_rises_from_half_its_height_and_falls_to_it() {
        let found = |force: &[f64]| waves(force, 20, SIMULATED);
        assert_eq!(found(&force(&[7.0, 1.0, 0.5])), [40, 60]);
        assert_eq!(found(&force(&[7.0, 0.0, 0.03])), [0; 0], "too low");
        // A shoulder of the main wave is not a wave.
        let mut shoulder = force(&[7.0]);
        shoulder[26] += 0.1;
        assert_eq!(found(&shoulder), [0; 0]);
        // A wave that the window cuts has no height.
        assert_eq!(found(&force(&[7.0, 1.0])[..41]), [0; 0]);
    }

    fn later(sensed: &[f64], simulated: &[f64]) -> Option<LaterWave> {
        let both = sensed.iter().zip(simulated).enumerate();
        let points = both.map(|(n, (&sensed, &simulated))| SensedPoint {
            time: n as f64 * 1e-5,
            sensed,
            simulated,
        });
        later_wave(&points.collect::<Vec<_>>())
    }

    #[test]
    fn the_bead_says_what_it_sensed_where_the_chain_has_a_wave() {
        let sensed = force(&[7.0, 0.0, 0.8]);
        let simulated: Vec<f64> = sensed.iter().map(|force| 0.5 * force).collect();
        let found = later(&sensed, &simulated).unwrap();
        let (device, chain) = (found.device.unwrap(), found.f64_chain.unwrap());
        let ratio = device.peak_force / chain.peak_force;
        assert!((ratio - 2.0).abs() < 1e-9, "{found:?}");
        assert!((device.after - 40e-5).abs() < 1e-12 && chain.after == device.after);
    }

    #[test]
    fn a_wave_of_the_bead_alone_must_be_plain() {
        let mut simulated = force(&[7.0]);
        simulated.resize(80, 0.0);
        let alone = |height| later(&force(&[7.0, 0.0, height]), &simulated);
        let found = alone(0.8).unwrap();
        assert!(found.f64_chain.is_none() && found.device.is_some());
        assert_eq!(alone(0.1), None);
    }
}
