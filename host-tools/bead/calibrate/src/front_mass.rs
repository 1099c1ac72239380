//! The front mass: the force on the crystal over the acceleration, in a shaken bead whose cap is free.
//!
//! # Design
//! m_front = F/a at 50 to 500 Hz, far below every resonance. The force's gain is that of the settings, and
//! its uncertainty is an input. Each frequency gives a mass; their scatter is type A. A mass that changes
//! with frequency means a resonance of the mounting.

use crate::calibration::{Calibration, Check, ObservedValue};
use crate::model::{ModelInput, ResultName, mean_and_scatter, propagate};
use crate::points::{Measured, Point, Points};

/// Frequencies that count, Hz.
const RANGE: [f64; 2] = [50.0, 500.0];
/// Least number of points.
const FEWEST: usize = 3;
/// Greatest relative change of the mass over the frequencies, unless three standard errors are more.
const LEVEL: f64 = 0.02;

/// Quantities that an operator states, and those of the settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrontMassInputs {
    /// Relative standard uncertainty of the reference, by its certificate.
    pub reference_u: f64,
    /// Worth of a code, N, for points in codes.
    pub force_per_code: f64,
    /// Its relative standard uncertainty.
    pub force_gain_u: f64,
}

const FRONT_MASS: ResultName = ResultName {
    name: "front mass",
    unit: "kg",
    key: Some("bead.front_mass"),
    uncertainty_key: Some("uncertainty.front_mass"),
};

/// Evaluates points.
///
/// # Errors
/// One line: points of another unit, or too few.
pub fn evaluate(points: &Points, stated: &FrontMassInputs) -> Result<Calibration, String> {
    let takes = "the front mass needs a force in N, or codes";
    let newtons = points.size(Measured::Force, stated.force_per_code, takes)?;
    let [least, most] = RANGE;
    let counts = |frequency: f64| (least..=most).contains(&frequency);
    let (mut kept, left_out) = points.split(counts, |frequency| {
        format!("{frequency:.0} Hz is outside {least} to {most} Hz, where body and cap move as one")
    });
    if kept.len() < FEWEST {
        return Err(format!(
            "{} of {} points are between {least} and {most} Hz, but at least {FEWEST} are needed; shake at \
             more frequencies",
            kept.len(),
            points.points.len()
        ));
    }
    kept.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));
    let mass = |point: &Point| newtons * point.measured / point.reference;
    let masses: Vec<f64> = kept.iter().map(|point| mass(point)).collect();
    let (mean, scatter) = mean_and_scatter(&masses);
    let inputs = [
        ModelInput {
            name: format!("repeatability, {} points", masses.len()),
            ..ModelInput::repeatability(scatter / mean, masses.len(), masses.len() as f64 - 1.0)
        },
        ModelInput::normal("reference", "", 1.0, stated.reference_u),
        ModelInput::normal("force gain", "", 1.0, stated.force_gain_u),
    ];
    let model = |values: &[f64]| vec![mean * values[0] * values[2] / values[1]];
    let (results, _) = propagate(&[FRONT_MASS], &inputs, &[], model);
    let check = level(&kept, &masses, mean);
    let observed = |point: &&Point| {
        let found = ObservedValue::new("front mass", "g", 1e3 * mass(point));
        point.observed(points.measured, found)
    };
    Ok(Calibration {
        procedure: "front-mass",
        title: "Front mass against a reference",
        results,
        observations: kept.iter().map(observed).collect(),
        left_out,
        checks: vec![check],
        method: METHOD.map(str::to_owned).to_vec(),
        ..Calibration::default()
    })
}

/// Checks with a straight line through all points that the mass does not change over the frequencies.
fn level(points: &[&Point], masses: &[f64], mean: f64) -> Check {
    let count = masses.len() as f64;
    let middle = points.iter().map(|point| point.frequency).sum::<f64>() / count;
    let along: Vec<f64> = points.iter().map(|point| point.frequency - middle).collect();
    let spread = along.iter().map(|x| x * x).sum::<f64>().max(f64::MIN_POSITIVE);
    let slope = along.iter().zip(masses).map(|(x, mass)| x * mass).sum::<f64>() / spread;
    let residual = |(x, mass): (&f64, &f64)| (mass - mean - slope * x).powi(2);
    let variance = along.iter().zip(masses).map(residual).sum::<f64>() / (count - 2.0).max(1.0);
    let range = along
        .last()
        .zip(along.first())
        .map_or(0.0, |(last, first)| last - first);
    let [off, u] = [slope, (variance / spread).sqrt()].map(|of| of * range / mean);
    let allowed = LEVEL.max(3.0 * u);
    Check {
        what: "change of the mass from the lowest to the highest frequency".to_owned(),
        deviation_percent: 100.0 * off,
        allowed_percent: 100.0 * allowed,
        holds: off.abs() <= allowed,
        advice: "a mass that changes with frequency means a resonance of the mounting, or a cap that is not free",
    }
}

const METHOD: [&str; 2] = [
    "The body is shaken by a sine far below every resonance, with a reference accelerometer on it and the cap free. The \
     crystal then feels the cap alone: the front mass is the force over the acceleration.",
    "The result is the mean over the frequencies. The gain of the force is that of the settings, with its uncertainty: the \
     front mass is as wrong as the gain.",
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mass_is_force_over_acceleration_and_one_that_changes_with_frequency_fails() {
        let point = |frequency: f64, measured: f64| Point {
            subject: String::new(),
            frequency,
            reference: 10.0,
            measured,
        };
        let points = |slope: f64| {
            let within = (0..8).map(|at| 60.0 + 50.0 * f64::from(at));
            let within = within.map(|hz| point(hz, 0.084 * (1.0 + slope * hz / 500.0)));
            Points {
                points: within.chain([point(900.0, 0.2)]).collect(),
                measured: Measured::Force,
            }
        };
        let stated = FrontMassInputs {
            reference_u: 0.01,
            force_per_code: 0.0,
            force_gain_u: 0.002,
        };
        let found = evaluate(&points(0.0), &stated).unwrap();
        let result = &found.results[0].combined;
        assert!((result.value - 8.4e-3).abs() < 1e-9, "{result:?}");
        // The quotient is not linear over ± 1 %.
        assert!((result.u / result.value / f64::hypot(0.01, 0.002) - 1.0).abs() < 2e-4);
        assert_eq!((found.doubt(), found.left_out.len()), (None, 1));
        let doubt = evaluate(&points(0.05), &stated).unwrap().doubt();
        assert!(doubt.unwrap().contains("resonance"));
    }
}
