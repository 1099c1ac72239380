//! The measurement model of the drop test: a code's worth from a ball's momentum.

use crate::calibration::{Calibration, Check, Observation, ObservedValue};
use crate::landing::Landing;
use crate::model::{ModelInput, ResultName, mean_and_scatter, propagate};
use crate::quantity::Stated;
use bead_recording::clock::QUARTZ;

/// Relative standard uncertainty of the duration of contact, whose ends are below the noise.
const CONTACT_U: f64 = 0.03;
/// Greatest error of the time between two landings, s: each begins within a sample.
const LANDING: f64 = 1e-5;
/// Greatest nonlinearity of the converter, as a part of a pulse's area: three codes (DocID022152, ADC
/// accuracy) of the peak.
const NONLINEAR_CODES: f64 = 3.0;

/// Quantities that an operator states about a drop test.
#[derive(Debug, Clone, PartialEq)]
pub struct DropInputs {
    /// Mass of the ball, kg.
    pub ball_mass: Stated,
    /// Height of the ball's lowest point above the cap, m, for each series.
    pub heights: Vec<Stated>,
    /// Acceleration of free fall, m/s².
    pub gravity: Stated,
    /// Standard uncertainty of the axis's inclination in each of two directions, rad.
    pub tilt: f64,
    /// Time constant of the high-pass in front of the converter, s; none if there is none.
    pub high_pass: Option<Stated>,
}

/// A drop with both landings.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Drop {
    pub(crate) height: usize,
    pub(crate) landing: Landing,
    /// Time from landing to landing, samples.
    pub(crate) between: f64,
    /// Samples a second.
    pub(crate) rate: f64,
}

/// Indices of the inputs that all drops share; the heights follow, then a repeatability for each.
const MASS: usize = 0;
const GRAVITY: usize = 1;
const ALIGNMENT: usize = 2;
const CLOCK_RATE: usize = 3;
const FLIGHT: usize = 4;
const CONTACT: usize = 5;
const LINEARITY: usize = 6;
const HIGH_PASS: usize = 7;
const HEIGHTS: usize = 8;

/// A code's worth by one drop, N, at these values of the shared inputs.
fn gain(values: &[f64], drop: &Drop, has_high_pass: bool) -> f64 {
    let (mass, gravity) = (values[MASS], values[GRAVITY]);
    let dt = values[CLOCK_RATE] / drop.rate;
    let contact = drop.landing.contact * dt * values[CONTACT];
    let incoming = (2.0 * gravity * values[HEIGHTS + drop.height]).sqrt();
    let outgoing = 0.5 * gravity * (drop.between * dt + values[FLIGHT] - contact);
    let impulse = mass * (incoming + outgoing + gravity * contact) * values[ALIGNMENT];
    // After t, a high-pass leaves exp(-t/τ) of an impulse's area.
    let lost = if has_high_pass {
        (drop.landing.after_centre * dt / values[HIGH_PASS]).exp()
    } else {
        1.0
    };
    impulse / (dt * drop.landing.sum * lost * values[LINEARITY])
}

/// The estimates of the shared inputs and of the heights.
fn estimates(stated: &DropInputs) -> Vec<f64> {
    // The mean of the cosine of an angle with the standard deviation σ in each of two directions is 1 - σ²
    // (JCGM 100, F.2.4.4).
    let alignment = 1.0 - stated.tilt * stated.tilt;
    let high_pass = stated.high_pass.map_or(1.0, |tau| tau.value);
    let mut values = vec![
        stated.ball_mass.value,
        stated.gravity.value,
        alignment,
        1.0,
        0.0,
        1.0,
        1.0,
        high_pass,
    ];
    values.extend(stated.heights.iter().map(|height| height.value));
    values
}

/// A code's worth by one drop, N, at the estimates of all inputs.
pub(crate) fn gain_of(stated: &DropInputs, drop: &Drop) -> f64 {
    gain(&estimates(stated), drop, stated.high_pass.is_some())
}

/// The inputs of the model: the shared ones, the heights, then the repeatability of each height.
fn inputs(stated: &DropInputs, kept: &[(String, Drop, f64)]) -> Vec<ModelInput> {
    let values = estimates(stated);
    let peak = kept.iter().map(|(_, drop, _)| drop.landing.peak).sum::<f64>() / kept.len() as f64;
    let mut inputs = vec![
        ModelInput::normal("mass of the ball", "kg", values[MASS], stated.ball_mass.u),
        ModelInput::normal("free fall g", "m/s²", values[GRAVITY], stated.gravity.u),
        ModelInput::normal(
            "alignment of the axis",
            "",
            values[ALIGNMENT],
            stated.tilt.powi(2),
        ),
        ModelInput::within("sample clock", "", 1.0, QUARTZ),
        ModelInput::within("time between landings", "s", 0.0, LANDING),
        ModelInput::normal("duration of contact", "", 1.0, CONTACT_U),
        ModelInput::within(
            "linearity of the converter",
            "",
            1.0,
            NONLINEAR_CODES / peak.max(NONLINEAR_CODES),
        ),
        ModelInput::normal(
            "high-pass, time constant",
            "s",
            values[HIGH_PASS],
            stated.high_pass.map_or(0.0, |tau| tau.u),
        ),
    ];
    for height in &stated.heights {
        let name = format!("height {:.4} m", height.value);
        inputs.push(ModelInput::normal(name, "m", height.value, height.u));
    }
    for (place, height) in stated.heights.iter().enumerate() {
        let gains: Vec<f64> = gains_at(kept, place).collect();
        let (mean, scatter) = mean_and_scatter(&gains);
        let free = gains.len() as f64 - 1.0;
        let name = format!("repeatability, {} from {:.4} m", gains.len(), height.value);
        inputs.push(ModelInput {
            name,
            ..ModelInput::repeatability(scatter / mean, gains.len(), free)
        });
    }
    inputs
}

fn gains_at(kept: &[(String, Drop, f64)], height: usize) -> impl Iterator<Item = f64> {
    let at = kept.iter().filter(move |(_, drop, _)| drop.height == height);
    at.map(|(_, _, gain)| *gain)
}

const RESULT: ResultName = ResultName {
    name: "force per code",
    unit: "N",
    key: Some("force.per_code"),
    uncertainty_key: Some("uncertainty.force_gain"),
};

/// Combines the drops that are kept, with their numbers at each height.
pub(crate) fn combine(stated: &DropInputs, kept: &[(String, Drop, f64)], counts: &[usize]) -> Calibration {
    let inputs = inputs(stated, kept);
    let heights = counts.len();
    let has_high_pass = stated.high_pass.is_some();
    let ratio = ResultName {
        name: "ratio of two heights",
        ..ResultName::default()
    };
    let mut names = vec![ratio; heights];
    names[0] = RESULT;
    let model = |values: &[f64]| {
        let mean_at = |height: usize| {
            let at = kept.iter().filter(|(_, drop, _)| drop.height == height);
            let sum: f64 = at.map(|(_, drop, _)| gain(values, drop, has_high_pass)).sum();
            sum / counts[height] as f64 * values[HEIGHTS + heights + height]
        };
        let means: Vec<f64> = (0..heights).map(mean_at).collect();
        let weighted = means.iter().zip(counts).map(|(mean, count)| mean * *count as f64);
        let all = weighted.sum::<f64>() / kept.len() as f64;
        let ratios = means.iter().skip(1).map(|mean| mean / means[0]);
        std::iter::once(all).chain(ratios).collect()
    };
    let (mut results, _) = propagate(&names, &inputs, &[], model);
    let ratios = results.split_off(1);
    let checks = ratios.iter().zip(&stated.heights[1..]).map(|(ratio, height)| {
        let off = ratio.combined.value - 1.0;
        Check {
            what: format!(
                "gain from {:.4} m against that from {:.4} m",
                height.value, stated.heights[0].value
            ),
            deviation_percent: 100.0 * off,
            allowed_percent: 100.0 * ratio.combined.expanded,
            holds: off.abs() <= ratio.combined.expanded,
            advice: "a gain that changes with height means a pad that sticks, a cap that touches the body, or a wrong height",
        }
    });
    Calibration {
        procedure: "drop",
        title: "Force gain by drop test",
        checks: checks.collect(),
        results,
        observations: kept
            .iter()
            .map(|(subject, drop, gain)| observed(subject, drop, *gain))
            .collect(),
        method: METHOD.map(str::to_owned).to_vec(),
        ..Calibration::default()
    }
}

const METHOD: [&str; 3] = [
    "A ball of known mass falls from a known height onto the cap of the bead, whose axis is upright, and bounces. The \
     momentum that it hands over, m (v_in + v_out + g T_c) with v_in = √(2 g h) and v_out = g (T − T_c)/2, is the area \
     under the force. T is the time between two landings, T_c that of contact.",
    "The force per code is the momentum divided by the sum of the codes above their zero and by the sample \
     period. The mean of the quiet before the pulse is the zero. The result is corrected for the area that the \
     high-pass of the front end removes.",
    "The result is the mean over the drops. It holds near 0 Hz; the flatness of the sensor up to 5 kHz is not part of it.",
];

fn observed(subject: &str, drop: &Drop, gain: f64) -> Observation {
    let landing = &drop.landing;
    Observation {
        subject: subject.to_owned(),
        values: vec![
            ObservedValue::new("T", "ms", 1e3 * drop.between / drop.rate),
            ObservedValue::new("T_c", "ms", 1e3 * landing.contact / drop.rate),
            ObservedValue::new("peak", "codes", landing.peak),
            ObservedValue::new("sum", "codes", landing.sum),
            ObservedValue::new("u of sum by noise", "codes", landing.sum_u),
            ObservedValue::new("force per code", "mN", 1e3 * gain),
        ],
    }
}
