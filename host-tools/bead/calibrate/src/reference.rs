//! The accelerometer against a reference: gain of the acceleration, and flatness over frequency.
//!
//! # Design
//! The gain is found at one frequency from several points; their scatter is type A. For points in volts of
//! the open sensor, a code is worth VDDA / (4096 S D G), with sensitivity S, divider D and amplifier G. For
//! points in codes, it is the reference's acceleration over the codes. In the closed bead the intruder moves
//! more than its host, by |h| of eq. (A1), which is divided out with the k, c and m of the settings.
//! Flatness is the greatest deviation at any other frequency up to 5 kHz, as the half width of a rectangular
//! distribution.

use bead_compare::front_end::CODES;
use hertz_chain::Oscillator;

use crate::calibration::{Calibration, Observation, ObservedValue};
use crate::model::{ModelInput, ResultName, mean_and_scatter, propagate};
use crate::points::{Measured, Point, Points};
use crate::quantity::Stated;

/// Least number of points at the frequency of the gain.
const FEWEST: usize = 2;
/// Relative distance from the frequency of the gain within which points count.
const NEAR: f64 = 0.02;
/// Frequency up to which a sensor has to be flat, and least frequency that a table has to reach to show it,
/// Hz.
const FLAT_TO: f64 = 5000.0;
const REACHES: f64 = 4000.0;
/// Part of the intruder's natural frequency below which points of a closed bead count: beyond, the
/// correction is too large to trust its uncertainty.
const BELOW_RESONANCE: f64 = 0.3;

/// The intruder on its springs, from the settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Springs {
    /// m, k and c.
    pub oscillator: Oscillator,
    /// Relative standard uncertainty of k/m.
    pub relative_u: f64,
}

/// Conversion of the sensor's volts to codes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrontEndGain {
    /// VDDA, V.
    pub supply: Stated,
    /// Rb/(Ra + Rb).
    pub divider: Stated,
    /// Gain of the amplifier, at the high gain.
    pub gain: Stated,
}

/// Quantities that an operator states about the comparison.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceInputs {
    /// Relative standard uncertainty of the reference, by its certificate.
    pub reference_u: f64,
    /// Frequency of the gain, Hz.
    pub at: f64,
    /// Conversion of volts to codes, for points in V.
    pub front_end: Option<FrontEndGain>,
    /// The springs below the accelerometer, in a bead that is closed.
    pub springs: Option<Springs>,
}

const PER_CODE: ResultName = ResultName {
    name: "acceleration per code",
    unit: "m/s²",
    key: Some("acceleration.per_code"),
    uncertainty_key: Some("uncertainty.acceleration_gain"),
};

/// Evaluates points.
///
/// # Errors
/// One line: points of another unit, or too few.
pub fn evaluate(points: &Points, stated: &ReferenceInputs) -> Result<Calibration, String> {
    let volts = match (points.measured, stated.front_end) {
        (Measured::Volts, Some(front_end)) => Some(front_end),
        (Measured::Volts, None) => {
            return Err(
                "the points are in V; give --supply, --divider and --amplifier, which convert V to codes"
                    .to_owned(),
            );
        }
        (Measured::Codes, _) => None,
        (other, _) => {
            return Err(format!(
                "the points are in {}; a gain needs V of the sensor, or codes",
                other.unit()
            ));
        }
    };
    let limit = stated.springs.map_or(f64::INFINITY, |springs| {
        BELOW_RESONANCE * springs.oscillator.natural_frequency()
    });
    let (kept, left_out) = points.split(
        |frequency| frequency <= limit,
        |frequency| {
            format!(
                "{frequency:.0} Hz is beyond {limit:.0} Hz, where the intruder's springs take part; calibrate the open sensor \
                 there"
            )
        },
    );
    let is_at = |point: &&&Point| (point.frequency / stated.at - 1.0).abs() <= NEAR;
    let at: Vec<f64> = kept
        .iter()
        .filter(is_at)
        .map(|point| response(point, stated))
        .collect();
    if at.len() < FEWEST {
        return Err(format!(
            "{} of {} points are at {} Hz, where the gain is found, but their scatter needs at least {FEWEST}; \
             measure again with both channels swapped, or give another --at",
            at.len(),
            points.points.len(),
            stated.at
        ));
    }
    let mut calibration = combine(points, stated, volts, &at);
    calibration.observations = kept
        .iter()
        .map(|point| observed(point, points.measured, stated))
        .collect();
    calibration.left_out = left_out;
    if let Some(flatness) = flatness(&kept, stated, mean_and_scatter(&at).0) {
        calibration.results.push(flatness);
    }
    Ok(calibration)
}

/// Response of the sensor to 1 m/s² of its own acceleration.
fn response(point: &Point, stated: &ReferenceInputs) -> f64 {
    let springs = stated.springs.map_or(1.0, |springs| {
        springs.oscillator.transmissibility(point.frequency).norm()
    });
    point.measured / (point.reference * springs)
}

fn combine(
    points: &Points,
    stated: &ReferenceInputs,
    volts: Option<FrontEndGain>,
    at: &[f64],
) -> Calibration {
    let (mean, scatter) = mean_and_scatter(at);
    let free = at.len() as f64 - 1.0;
    // |h| is 1 + (f/f₀)² far below the resonance, so its relative u is (f/f₀)² times that of k/m.
    let springs = stated.springs.map(|springs| {
        let ratio = stated.at / springs.oscillator.natural_frequency();
        (
            springs.oscillator.transmissibility(stated.at).norm(),
            ratio * ratio * springs.relative_u,
        )
    });
    let mut inputs = vec![
        ModelInput {
            name: format!("repeatability, {} points", at.len()),
            ..ModelInput::repeatability(scatter / mean, at.len(), free)
        },
        ModelInput::normal("reference", "", 1.0, stated.reference_u),
        ModelInput::normal("springs |h|", "", 1.0, springs.map_or(0.0, |(_, u)| u)),
    ];
    if let Some(front_end) = volts {
        inputs.extend([
            ModelInput::normal("supply", "V", front_end.supply.value, front_end.supply.u),
            ModelInput::normal("divider", "", front_end.divider.value, front_end.divider.u),
            ModelInput::normal("amplifier", "", front_end.gain.value, front_end.gain.u),
        ]);
    }
    let model = |values: &[f64]| {
        let response = mean * values[0] * values[1] / values[2];
        let per_code = match values[3..] {
            [supply, divider, gain] => supply / (f64::from(CODES) * response * divider * gain),
            _ => 1.0 / response,
        };
        vec![per_code]
    };
    let (results, _) = propagate(&[PER_CODE], &inputs, &[], model);
    let mut method = vec![format!(
        "The accelerometer and a reference are shaken together by a sine. The gain is that at {} Hz, the mean of {} points; \
         the points at other frequencies give the flatness.",
        stated.at,
        at.len()
    )];
    method.push(match points.measured {
        Measured::Volts => {
            "The open sensor's voltage was measured; supply, divider and amplifier convert it to codes: VDDA / \
             (4096 S D G)."
                .to_owned()
        }
        _ => "The bead's own codes were used, at its high gain.".to_owned(),
    });
    method.extend(springs.map(|(h, _)| {
        format!(
            "The accelerometer was in the closed bead, on its springs: it moves |h| = {h:.4} times as much \
             as the bead, a factor that is divided out."
        )
    }));
    Calibration {
        procedure: "reference",
        title: "Acceleration gain against a reference",
        results,
        method,
        ..Calibration::default()
    }
}

/// Flatness up to 5 kHz, where the points reach that far.
fn flatness(kept: &[&Point], stated: &ReferenceInputs, mean: f64) -> Option<crate::model::CalibrationResult> {
    let within: Vec<&&Point> = kept.iter().filter(|point| point.frequency <= FLAT_TO).collect();
    let highest = within.iter().map(|point| point.frequency).fold(0.0, f64::max);
    if highest < REACHES {
        return None;
    }
    let off = |point: &&&Point| (response(point, stated) / mean - 1.0).abs();
    let most = within.iter().map(off).fold(0.0, f64::max);
    let name = ResultName {
        name: "flatness of the acceleration",
        uncertainty_key: Some("uncertainty.acceleration_flatness"),
        ..ResultName::default()
    };
    let input = ModelInput::within(
        format!("greatest deviation, up to {highest:.0} Hz"),
        "",
        1.0,
        most.max(1e-5),
    );
    let (mut results, _) = propagate(&[name], &[input], &[], |values| vec![values[0]]);
    results.pop()
}

fn observed(point: &Point, measured: Measured, stated: &ReferenceInputs) -> Observation {
    let (size, unit) = match measured {
        Measured::Volts => (1e3, "mV per m/s²"),
        _ => (1.0, "codes per m/s²"),
    };
    let sensitivity = ObservedValue::new("sensitivity", unit, size * response(point, stated));
    point.observed(measured, sensitivity)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(measured: Measured, rows: &[(f64, f64)]) -> Points {
        let point = |(line, (frequency, measured)): (usize, &(f64, f64))| Point {
            subject: format!("line {line}"),
            frequency: *frequency,
            reference: 10.0,
            measured: *measured,
        };
        Points {
            points: rows.iter().enumerate().map(point).collect(),
            measured,
        }
    }

    const STATED: ReferenceInputs = ReferenceInputs {
        reference_u: 0.005,
        at: 160.0,
        front_end: None,
        springs: None,
    };

    #[test]
    fn volts_give_a_code_its_worth_by_supply_divider_and_amplifier_and_the_points_their_flatness() {
        let half = |value: f64, u: f64| Stated { value, u: u * value };
        let stated = ReferenceInputs {
            front_end: Some(FrontEndGain {
                supply: half(3.3, 0.001),
                divider: half(0.322, 0.001),
                gain: half(2.0, 0.001),
            }),
            ..STATED
        };
        // 1.02 mV per m/s², which falls by 1.2 % at 4 kHz.
        let rows = [
            (160.0, 0.010_201),
            (160.0, 0.010_199),
            (50.0, 0.010_21),
            (4000.0, 0.010_2 * 0.988),
        ];
        let found = evaluate(&points(Measured::Volts, &rows), &stated).unwrap();
        let result = &found.results[0].combined;
        let expected = 3.3 / (4096.0 * 1.02e-3 * 0.322 * 2.0);
        assert!((result.value / expected - 1.0).abs() < 1e-6, "{result:?}");
        let parts = [0.005, 0.001, 0.001, 0.001, 1e-4];
        let u = parts.iter().map(|part| part * part).sum::<f64>().sqrt();
        assert!((result.u / result.value / u - 1.0).abs() < 1e-2, "{result:?}");
        let flat = found.results[1].relative_u;
        assert!((flat - 0.012 / 3.0_f64.sqrt()).abs() < 1e-5, "{flat}");
        let refused = evaluate(&points(Measured::Volts, &rows), &STATED).unwrap_err();
        assert!(refused.contains("--supply"), "{refused}");
    }

    #[test]
    fn in_the_closed_bead_the_springs_are_divided_out_and_frequencies_near_the_resonance_are_left_out() {
        let stated = ReferenceInputs {
            springs: Some(Springs {
                oscillator: Oscillator::PAPER,
                relative_u: 0.01,
            }),
            ..STATED
        };
        let h = Oscillator::PAPER.transmissibility(160.0).norm();
        assert!((h - 1.0096).abs() < 1e-4, "{h}");
        let rows = [
            (160.0, 10.0 * h / 0.122),
            (160.0, 10.0 * h / 0.122),
            (1600.0, 300.0),
        ];
        let found = evaluate(&points(Measured::Codes, &rows), &stated).unwrap();
        let result = &found.results[0].combined;
        assert!((result.value / 0.122 - 1.0).abs() < 1e-9, "{result:?}");
        assert_eq!((found.results.len(), found.left_out.len()), (1, 1));
        let few = evaluate(&points(Measured::Codes, &rows[1..]), &stated).unwrap_err();
        assert!(few.starts_with("1 of 2 points are at 160 Hz"), "{few}");
    }
}
