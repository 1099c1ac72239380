//! A bead that moves away from its settings, over the strikes of a recording.
//!
//! # Design
//!
//! One strike determines k within 0.1 to 0.3 % and c within 0.5 %, far less than what raises a flag. The mean
//! over several strikes is precise enough to detect a bead whose k is 0.5 % off.
//!
//! The ringing is unsuitable: contacts that have not opened yet change its frequency by up to 3 %, and its
//! decay by 10 %. The wave form is suitable, since the reduced chain knows these contacts. The bead's own
//! code computes its residual again with k, c and the gain of the accelerometer changed by `STEP`, singly and
//! in pairs; the quadratic form through these ten residuals has its minimum at the bead's true k, c and gain.
//! Everything follows from the recorded codes and settings, so anyone with the recording gets the same
//! result.

use bead_model::design::Description;
use bead_model::{Scan, Settings};
use bead_recording::strikes::{RecordedStrike, ScanCodes};
use bead_wire::StrikeFlags;
use schemars::JsonSchema;
use serde::Serialize;

use crate::agreement::agrees;
use crate::budget::measured_again;
use crate::spread::RunningMean;

/// Part by which a quantity is changed.
const STEP: f64 = 0.03;
/// Least number of strikes for which a mean is judged.
pub const LEAST_STRIKES: u32 = 5;
/// Coverage factor of a mean.
const SIGMAS: f64 = 3.0;
/// Flags of a strike whose wave form says nothing about the bead.
const UNFIT: StrikeFlags = StrikeFlags::FORCE_RAILED
    .with(StrikeFlags::ACCELERATION_RAILED)
    .with(StrikeFlags::ANOTHER_WAVE)
    .with(StrikeFlags::WINDOW_CUT)
    .with(StrikeFlags::CHAIN_RANGE)
    .with(StrikeFlags::SENSOR_END)
    .with(StrikeFlags::NOT_AT_REST)
    .with(StrikeFlags::WAVE_TRAIN)
    .with(StrikeFlags::PLAYED);

/// Names of the quantities, and the part by which a good bead may seem off: 0.3 %, and more for c and B,
/// which the end of the reduced chain affects.
const QUANTITIES: [(&str, f64); 6] = [
    ("k", 0.003),
    ("c", 0.01),
    ("gain of acceleration over force", 0.003),
    ("low over high gain of the force", 0.003),
    ("low over high gain of the acceleration", 0.003),
    ("A over B", 0.01),
];

/// Means over the strikes of a bead since its settings changed last.
#[derive(Debug, Default)]
pub struct Drift {
    settings: Option<Settings>,
    means: [Mean; QUANTITIES.len()],
}

/// A mean over strikes, as a part by which the bead is above its settings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct DriftMean {
    /// The quantity.
    pub quantity: &'static str,
    /// Strikes in the mean.
    pub strikes: u32,
    /// The mean.
    pub mean: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// True if it is three standard errors off, and by more than a good bead may seem to be.
    pub drifting: bool,
}

#[derive(Debug, Default, Clone, Copy)]
struct Mean {
    running: RunningMean,
    /// Greatest part by which a good bead may have seemed off.
    allowed: f64,
}

impl Drift {
    /// Adds a strike, if it has all of its samples and no flag that makes it unfit.
    pub fn add(&mut self, strike: &RecordedStrike) {
        let Some(settings) = strike.settings else { return };
        if self.settings.replace(settings) != Some(settings) {
            self.means = Default::default();
        }
        if strike.missing() > 0 || strike.said.flags.has(UNFIT) {
            return;
        }
        let wave_form = best(strike, &settings);
        let predicted = strike.said.absorbed_predicted.joules();
        let ratio = (predicted > 0.0).then(|| strike.said.absorbed_measured.joules() / predicted - 1.0);
        let shape = strike.shape.unwrap_or_default();
        // Where the pulse has few samples, the reduced chain itself is less exact.
        let tolerance = |width: f32| f64::from(settings.waveform.tolerance(width));
        let coarse = tolerance(shape.width.samples() as f32) / tolerance(f32::MAX);
        // Similar strikes have the same codes at the low gain, so their rounding does not average out.
        let gains = [shape.force_gains, shape.acceleration_gains]
            .map(|gains| gains.map(|gains| (gains.deviation.ratio(), SIGMAS * gains.uncertainty.ratio())));
        let of_wave_form = |place: usize| wave_form.map(|parts| (parts[place], QUANTITIES[place].1 * coarse));
        let values = [
            of_wave_form(0),
            of_wave_form(1),
            of_wave_form(2),
            gains[0],
            gains[1],
            ratio.map(|ratio| (ratio, QUANTITIES[5].1 * coarse)),
        ];
        for ((mean, value), (_, least)) in self.means.iter_mut().zip(values).zip(QUANTITIES) {
            if let Some((value, allowed)) = value {
                mean.running.push(value);
                mean.allowed = mean.allowed.max(allowed).max(least);
            }
        }
    }

    /// The means over two or more strikes.
    pub fn means(&self) -> Vec<DriftMean> {
        let of = |(mean, (quantity, _)): (&Mean, (&'static str, f64))| mean.result(quantity);
        self.means.iter().zip(QUANTITIES).filter_map(of).collect()
    }
}

impl Mean {
    fn result(&self, quantity: &'static str) -> Option<DriftMean> {
        let RunningMean { count, mean, .. } = self.running;
        let standard_error = self.running.standard_error()?;
        Some(DriftMean {
            quantity,
            strikes: count as u32,
            mean,
            standard_error,
            drifting: count >= LEAST_STRIKES as usize
                && !agrees(mean, self.allowed, 0.0)
                && !agrees(mean, 0.0, SIGMAS * standard_error),
        })
    }
}

/// Relative changes of k, c and the gain of the accelerometer over that of the force that fit the wave form
/// best. `None` if there is no best fit: the strike is too weak.
fn best(strike: &RecordedStrike, settings: &Settings) -> Option<[f64; 3]> {
    let scans: Vec<Scan> = strike.scans.iter().map(ScanCodes::scan).collect();
    let power = |steps: [f64; 3]| {
        let change = |one: &mut Description| {
            let factors = steps.map(|steps| 1.0 + steps * STEP);
            one.intruder.stiffness *= factors[0];
            one.intruder.damping *= factors[1];
            one.acceleration.per_code *= factors[2];
            one.acceleration.wide_per_code *= factors[2];
        };
        let (_, shape) = measured_again(&strike.said, &settings.with(change).ok()?, &scans);
        let matched = shape.waveform?;
        Some(matched.residual.ratio().powi(2) + matched.noise.ratio().powi(2))
    };
    let along = |place: usize, steps: f64| [0, 1, 2].map(|at| if at == place { steps } else { 0.0 });
    let middle = power([0.0; 3])?;
    let mut curves = [[0.0; 3]; 3];
    let mut slopes = [0.0; 3];
    let mut ahead = [0.0; 3];
    for place in 0..3 {
        let behind = power(along(place, -1.0))?;
        ahead[place] = power(along(place, 1.0))?;
        curves[place][place] = ahead[place] + behind - 2.0 * middle;
        slopes[place] = 0.5 * (behind - ahead[place]);
    }
    for (one, other) in [(0, 1), (0, 2), (1, 2)] {
        let mut both = along(one, 1.0);
        both[other] = 1.0;
        let mixed = power(both)? - ahead[one] - ahead[other] + middle;
        (curves[one][other], curves[other][one]) = (mixed, mixed);
    }
    solved(curves, slopes).map(|steps| steps.map(|steps| steps * STEP))
}

/// The solution of three equations, by Cramer's rule; `None` if the form has no least value.
fn solved(curves: [[f64; 3]; 3], slopes: [f64; 3]) -> Option<[f64; 3]> {
    let determinant = |m: [[f64; 3]; 3]| {
        let minor = |a: usize, b: usize| m[1][a] * m[2][b] - m[1][b] * m[2][a];
        m[0][0] * minor(1, 2) - m[0][1] * minor(0, 2) + m[0][2] * minor(0, 1)
    };
    let whole = determinant(curves);
    let is_bowl = curves[0][0] > 0.0 && curves[0][0] * curves[1][1] > curves[0][1].powi(2) && whole > 0.0;
    is_bowl.then(|| {
        [0, 1, 2].map(|place| {
            let mut replaced = curves;
            for (row, slope) in replaced.iter_mut().zip(slopes) {
                row[place] = slope;
            }
            determinant(replaced) / whole
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::recorded;
    use hertz_chain::Scenario;

    /// The means over `strikes` of a bead whose intruder is the paper's after `change`.
    fn means(strikes: u64, change: impl Fn(&mut Scenario)) -> Vec<DriftMean> {
        let believed = Scenario::paper();
        let mut scenario = Scenario::paper();
        change(&mut scenario);
        let mut drift = Drift::default();
        (1..=strikes).for_each(|seed| drift.add(&recorded(&scenario, &believed, seed)));
        drift.means()
    }

    #[test]
    fn a_bead_that_is_off_by_less_than_what_flags_a_strike_drifts_in_that_quantity() {
        for (stiffness, damping, drifting) in [
            (1.0, 1.0, &[][..]),
            (1.005, 1.0, &["k"]),
            (1.0, 0.98, &["c", "A over B"]),
        ] {
            let means = means(6, |scenario| {
                scenario.intruders[0].stiffness *= stiffness;
                scenario.intruders[0].damping *= damping;
            });
            for (mean, stated) in means.iter().zip([stiffness - 1.0, damping - 1.0, 0.0]) {
                let bound = 0.002 + SIGMAS * mean.standard_error;
                assert!((mean.mean - stated).abs() < bound, "{mean:?}, {stated}");
            }
            let found: Vec<_> = means
                .iter()
                .filter(|mean| mean.drifting)
                .map(|mean| mean.quantity)
                .collect();
            assert_eq!(found, drifting, "{stiffness}, {damping}");
        }
    }

    #[test]
    fn a_mean_of_few_strikes_is_not_judged_and_new_settings_begin_anew() {
        let few = means(LEAST_STRIKES.into(), |scenario| {
            scenario.intruders[0].stiffness *= 1.01
        });
        assert!(few[0].drifting && few[0].strikes == LEAST_STRIKES, "{few:?}");
        let fewer = means(LEAST_STRIKES as u64 - 1, |scenario| {
            scenario.intruders[0].stiffness *= 1.01;
        });
        assert!(!fewer[0].drifting, "{fewer:?}");
        let mut drift = Drift::default();
        let mut strike = recorded(&Scenario::paper(), &Scenario::paper(), 1);
        for address in [1, 1, 2, 2, 2] {
            let changed = strike.settings.unwrap().with(|one| one.address = address);
            strike.settings = Some(changed.unwrap());
            drift.add(&strike);
        }
        assert_eq!(drift.means()[0].strikes, 3);
    }
}
