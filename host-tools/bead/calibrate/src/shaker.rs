//! The shaker sweep: stiffness and damping of the intruder from |h| over frequency (appendix A1 of the
//! paper).
//!
//! # Design
//! [`hertz_chain::fit_response`] fits k and c to |h|. A gain error of either sensor shows as |h| ≠ 1 at low
//! frequency: the points below a third of the resonance give the scale, and all are divided by it. Fit and
//! scale are repeated until they agree. k and c scale with m, which comes from the balance.

use hertz_chain::{Oscillator, OscillatorFit, fit_response};

use crate::calibration::{Calibration, Check, Observation, ObservedValue};
use crate::model::{ModelInput, propagate};
use crate::points::{Measured, Points};
use crate::ring_down::{DAMPING, STIFFNESS, StatedMass, intruder_mass, key_correlations};

/// Least number of points.
const FEWEST: usize = 6;
/// Part of the natural frequency below which points set the scale.
const LOW: f64 = 1.0 / 3.0;
/// Rounds of fit and scale.
const ROUNDS: usize = 20;
/// Greatest rms distance of the points from the fit, as a part of its peak.
const RESIDUAL: f64 = 0.05;
/// Greatest deviation of the scale from 1 without a doubt.
const SCALE: f64 = 0.1;

/// Quantities that an operator states about a sweep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShakerInputs {
    /// m, the intruder.
    pub intruder: StatedMass,
    /// Worth of a code, m/s², for points in codes.
    pub acceleration_per_code: f64,
}

/// Evaluates points: the intruder's acceleration over that of the reference on the shell.
///
/// # Errors
/// One line: points of another unit, too few, or no resonance.
pub fn evaluate(points: &Points, stated: &ShakerInputs) -> Result<Calibration, String> {
    let takes = "a sweep needs the intruder's acceleration in m/s², or codes";
    let size = points.size(Measured::Acceleration, stated.acceleration_per_code, takes)?;
    if points.points.len() < FEWEST {
        return Err(format!(
            "{} points are too few for a resonance; sweep at least {FEWEST} frequencies over the peak",
            points.points.len()
        ));
    }
    let ratios: Vec<(f64, f64)> = points
        .points
        .iter()
        .map(|point| (point.frequency, size * point.measured / point.reference))
        .collect();
    let mass = stated.intruder.mass.value;
    let (fit, scale) = fit_with_scale(&ratios, mass)?;
    let oscillator = Oscillator {
        mass,
        stiffness: fit.stiffness,
        damping: fit.damping,
    };
    let checks = checks(&ratios, &oscillator, &fit, scale)?;
    let free = ratios.len() as f64 - 2.0;
    let of_fit = |name: &str, relative: f64| ModelInput {
        name: format!("scatter of the points, {name}"),
        ..ModelInput::repeatability(relative, 1, free)
    };
    let m = stated.intruder.mass;
    let inputs = [
        ModelInput::normal("intruder mass m", "kg", m.value, m.u),
        of_fit("k", fit.stiffness_error / fit.stiffness),
        of_fit("c", fit.damping_error / fit.damping),
    ];
    let names = [STIFFNESS, DAMPING, intruder_mass(stated.intruder.is_new)];
    let model = |values: &[f64]| {
        let by_mass = values[0] / mass;
        vec![
            fit.stiffness * by_mass * values[1],
            fit.damping * by_mass * values[2],
            values[0],
        ]
    };
    let (results, mut correlations) = propagate(&names, &inputs, &[(1, 2, fit.correlation)], model);
    key_correlations(&mut correlations);
    let observed = |((frequency, ratio), point): (&(f64, f64), &crate::points::Point)| {
        let fitted = scale * oscillator.transmissibility(*frequency).norm();
        Observation {
            subject: point.subject.clone(),
            values: vec![
                ObservedValue::new("frequency", "Hz", *frequency),
                ObservedValue::new("h, measured", "", *ratio),
                ObservedValue::new("h, fitted", "", fitted),
            ],
        }
    };
    Ok(Calibration {
        procedure: "shaker",
        title: "Stiffness and damping on the shaker",
        results,
        correlations,
        observations: ratios.iter().zip(&points.points).map(observed).collect(),
        checks,
        method: METHOD.map(str::to_owned).to_vec(),
        ..Calibration::default()
    })
}

/// Checks that the points extend to both sides of the peak, and that they are near the fit.
fn checks(
    ratios: &[(f64, f64)],
    oscillator: &Oscillator,
    fit: &OscillatorFit,
    scale: f64,
) -> Result<Vec<Check>, String> {
    let (peak, height) = oscillator.transmissibility_peak();
    let (lowest, highest) = ratios
        .iter()
        .fold((f64::INFINITY, 0.0_f64), |(low, high), (frequency, _)| {
            (low.min(*frequency), high.max(*frequency))
        });
    if !(lowest < 0.8 * peak && highest > 1.1 * peak) {
        return Err(format!(
            "the fitted resonance is at {peak:.0} Hz, but the points go from {lowest:.0} to {highest:.0} Hz; \
             sweep to both sides of the peak"
        ));
    }
    let residual = fit.residual / height;
    Ok(vec![
        Check {
            what: "distance of the points from the fit, relative to its peak".to_owned(),
            deviation_percent: 100.0 * residual,
            allowed_percent: 100.0 * RESIDUAL,
            holds: residual <= RESIDUAL,
            advice: "the disks are not linear, or another resonance is near: sweep with less amplitude, and see whether the peak moves",
        },
        Check {
            what: "response at low frequency against 1".to_owned(),
            deviation_percent: 100.0 * (scale - 1.0),
            allowed_percent: 100.0 * SCALE,
            holds: (scale - 1.0).abs() <= SCALE,
            advice: "the gain of one of the two sensors is wrong: calibrate the acceleration first",
        },
    ])
}

const METHOD: [&str; 2] = [
    "The closed bead is shaken by sines of many frequencies, with a reference accelerometer on its shell. The \
     ratio of the intruder's acceleration to the reference's is |h| = |(k + iωc)/(k + iωc − mω²)|, to which k \
     and c are fitted by least squares.",
    "Points at low frequency, where |h| is 1, give the ratio of both gains, which is divided out. k and c scale with the \
     mass m, which the balance gives.",
];

/// The fit, and the scale of the points at low frequency.
fn fit_with_scale(ratios: &[(f64, f64)], mass: f64) -> Result<(OscillatorFit, f64), String> {
    let fitted = |scale: f64| {
        let points: Vec<_> = ratios
            .iter()
            .map(|(frequency, ratio)| (*frequency, ratio / scale))
            .collect();
        fit_response(&points, mass).map_err(|error| error.to_string())
    };
    let (mut fit, mut scale) = (fitted(1.0)?, 1.0);
    for _ in 0..ROUNDS {
        let oscillator = Oscillator {
            mass,
            stiffness: fit.stiffness,
            damping: fit.damping,
        };
        let below = LOW * oscillator.natural_frequency();
        let low = ratios.iter().filter(|(frequency, _)| *frequency < below);
        let scales: Vec<f64> = low
            .map(|(frequency, ratio)| ratio / oscillator.transmissibility(*frequency).norm())
            .collect();
        if scales.is_empty() {
            return Err(format!(
                "no point is below {below:.0} Hz, where |h| is 1 and shows the ratio of both gains; start the \
                 sweep lower"
            ));
        }
        let next = scales.iter().sum::<f64>() / scales.len() as f64;
        let change = (next / scale - 1.0).abs();
        scale = next;
        fit = fitted(scale)?;
        if change < 1e-9 {
            break;
        }
    }
    Ok((fit, scale))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::Point;
    use crate::quantity::Stated;

    fn sweep(scale: f64, from: f64) -> Points {
        let point = |at: u32| {
            let frequency = from + 40.0 * f64::from(at);
            Point {
                subject: format!("line {at}"),
                frequency,
                reference: 2.0,
                measured: 2.0 * scale * Oscillator::PAPER.transmissibility(frequency).norm(),
            }
        };
        Points {
            points: (0..60).map(point).collect(),
            measured: Measured::Acceleration,
        }
    }

    #[test]
    fn k_and_c_are_found_behind_a_wrong_gain_and_are_as_wrong_as_the_mass() {
        let stated = ShakerInputs {
            intruder: StatedMass {
                mass: Stated {
                    value: 3.7e-3,
                    u: 3.7e-5,
                },
                is_new: true,
            },
            acceleration_per_code: 1.0,
        };
        let found = evaluate(&sweep(1.05, 100.0), &stated).unwrap();
        for (result, expected) in found.results.iter().zip([395e3, 12.0, 3.7e-3]) {
            assert!(
                (result.combined.value / expected - 1.0).abs() < 1e-6,
                "{result:?}"
            );
            assert!((result.relative_u - 0.01).abs() < 1e-4, "{result:?}");
        }
        let keys: Vec<_> = found.correlations.iter().filter_map(|one| one.key).collect();
        assert_eq!(keys.len(), 3, "{:?}", found.correlations);
        assert!(found.correlations.iter().all(|one| one.correlation > 0.99));
        assert_eq!(found.doubt(), None);
        let gain = evaluate(&sweep(1.3, 100.0), &stated).unwrap().doubt().unwrap();
        assert!(gain.contains("calibrate the acceleration first"), "{gain}");
        let late = evaluate(&sweep(1.0, 900.0), &stated).unwrap_err();
        assert!(late.contains("no point is below"), "{late}");
    }
}
