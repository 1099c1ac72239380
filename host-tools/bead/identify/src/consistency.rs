//! Agreement of strikes and recordings with each other, and of the spring with a linear one.

use nalgebra::DVector;
use schemars::JsonSchema;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::fit::{Fit, FitError, fit, part};
use crate::model::HARDENING;
use crate::normal::Normal;
use crate::quantity::Quantity;
use crate::spread::{Goodness, LEAST_PROBABILITY, covariance};

/// Least relative difference of recordings that raises a doubt: the models are no more accurate.
const LEAST_DIFFERENCE: f64 = 0.002;
/// Least difference of recordings that raises a doubt, in standard errors.
const FAR: f64 = 4.0;
/// Least part of the spring's force at its greatest stroke that is called hardening.
const LEAST_HARDENING: f64 = 0.01;

/// Least part of the misfit beyond the noise that a cubic spring explains to count as its cause.
const LEAST_EXPLAINED: f64 = 0.5;

/// Something that speaks against a result: one line of what, why, and what next.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Doubt {
    /// `misfit`, `scatter`, `hardening` or `recordings_differ`.
    pub kind: &'static str,
    /// The line.
    pub text: String,
}

/// A spring that is harder at large strokes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Hardening {
    /// k₃ of the force k x + k₃ x³, N/m³; below 0 it softens.
    pub cubic_stiffness_n_per_m3: f64,
    /// Its standard error.
    pub standard_error_n_per_m3: f64,
    /// Greatest stroke of the strikes, m.
    pub stroke_m: f64,
    /// k₃ x²/k at this stroke.
    pub part: f64,
    /// Part of the residuals beyond the noise that such a spring explains; 1 if there are none.
    pub explained: f64,
}

impl Hardening {
    fn is_certain(&self) -> bool {
        self.part.abs() > LEAST_HARDENING
            && self.explained > LEAST_EXPLAINED
            && self.cubic_stiffness_n_per_m3.abs() > FAR * self.standard_error_n_per_m3
    }
}

/// Fitted values of one recording alone.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct RecordingValues {
    /// Path of the recording.
    pub recording: String,
    /// Strikes that have a part.
    pub strikes: usize,
    /// Value of each fitted quantity, in its order.
    pub values: Vec<f64>,
    /// Their relative standard errors.
    pub relative_errors: Vec<f64>,
}

/// Factor by which strikes scatter more than their noise explains; 1 if it explains them.
pub fn scatter(best: &Fit<'_>) -> f64 {
    let strikes = best.strikes.len();
    if strikes < 2 || best.free.is_empty() {
        return 1.0;
    }
    // The best fit of each strike alone is one step away from the common values.
    let mut squares = 0.0;
    for strike in &best.strikes {
        let (information, right) = part(&strike.normal.shared, &best.free);
        let Some(solved) = information.cholesky().map(|factor| factor.solve(&right)) else {
            return 1.0;
        };
        squares += right.dot(&solved);
    }
    let free = ((strikes - 1) * best.free.len()) as f64;
    let probability = ChiSquared::new(free).map_or(1.0, |distribution| distribution.sf(squares));
    if probability < LEAST_PROBABILITY {
        (squares / free).sqrt().max(1.0)
    } else {
        1.0
    }
}

/// The cubic stiffness that fits best, by one step from the best fit of a linear spring. `None` if the data
/// do not determine it.
pub fn hardening(best: &Fit<'_>, noise_free: f64) -> Option<Hardening> {
    let normal = &best.normal;
    let (information, _) = part(normal, &best.free);
    let mixed = DVector::from_fn(best.free.len(), |at, _| {
        normal.information[(best.free[at].place(), HARDENING)]
    });
    let explained = if best.free.is_empty() {
        0.0
    } else {
        mixed.dot(&information.cholesky()?.solve(&mixed))
    };
    let own = normal.information[(HARDENING, HARDENING)] - explained;
    if own.is_nan() || own <= 1e-12 * normal.information[(HARDENING, HARDENING)] {
        return None;
    }
    // At the best fit the right side of the fitted quantities is 0.
    let cubic = normal.right[HARDENING] / own;
    let gain = cubic * cubic * own;
    let beyond_noise = normal.squares - normal.free;
    let explained = Normal {
        squares: normal.squares - gain,
        ..normal.clone()
    };
    let scale = Goodness::of(&explained, best.free.len() + 1, noise_free).scale();
    let strokes = best
        .strikes
        .iter()
        .map(|strike| strike.model.stroke(&best.values, &strike.own));
    let stroke = strokes.fold(0.0, f64::max);
    Some(Hardening {
        cubic_stiffness_n_per_m3: cubic,
        standard_error_n_per_m3: scale / own.sqrt(),
        stroke_m: stroke,
        explained: if beyond_noise > gain {
            gain / beyond_noise
        } else {
            1.0
        },
        part: cubic * stroke * stroke / best.values[Quantity::Stiffness.place()],
    })
}

/// Fits each recording alone.
///
/// # Errors
/// A fit does not converge.
pub fn by_recording(
    best: &Fit<'_>,
    recording_of: &[usize],
    names: &[String],
    scale: f64,
) -> Result<Vec<RecordingValues>, FitError> {
    let mut present = recording_of.to_vec();
    present.sort_unstable();
    present.dedup();
    if present.len() < 2 || best.free.is_empty() {
        return Ok(Vec::new());
    }
    let mut all = Vec::new();
    for recording in present {
        let strikes = best.starts().into_iter().zip(recording_of);
        let own = strikes.filter(|(_, of)| **of == recording);
        let own: Vec<_> = own.map(|(start, _)| start).collect();
        let alone = fit(&own, &best.values, &best.free)?;
        let Some(covariance) = covariance(&alone.normal, &best.free) else {
            continue;
        };
        // The common scale includes differences between recordings, which are no scatter of this one.
        let own_scale = scatter(&alone).min(scale);
        all.push(RecordingValues {
            recording: names.get(recording).cloned().unwrap_or_default(),
            strikes: own.len(),
            values: best.free.iter().map(|one| alone.values[one.place()]).collect(),
            relative_errors: (0..best.free.len())
                .map(|at| own_scale * covariance[(at, at)].sqrt())
                .collect(),
        });
    }
    Ok(all)
}

/// A value with its unit.
fn shown(quantity: Quantity, value: f64) -> String {
    let text = if (1e-2..1e7).contains(&value.abs()) {
        let decade = value.abs().log10().floor() as i32;
        format!("{value:.*}", (5 - decade).max(0) as usize)
    } else {
        format!("{value:.5e}")
    };
    let unit = quantity.unit();
    if unit.is_empty() {
        text
    } else {
        format!("{text} {unit}")
    }
}

/// Lists the doubts about a result.
pub fn doubts(
    best: &Fit<'_>,
    goodness: &Goodness,
    scatter: f64,
    hardening: Option<&Hardening>,
    recordings: &[RecordingValues],
) -> Vec<Doubt> {
    let mut doubts = Vec::new();
    for (at, quantity) in best.free.iter().enumerate() {
        let of = |recording: &RecordingValues| (recording.values[at], recording.relative_errors[at]);
        let least = recordings.iter().min_by(|a, b| of(a).0.total_cmp(&of(b).0));
        let most = recordings.iter().max_by(|a, b| of(a).0.total_cmp(&of(b).0));
        let Some((least, most)) = least.zip(most) else {
            continue;
        };
        let ((low, low_error), (high, high_error)) = (of(least), of(most));
        let (part, error) = (high / low - 1.0, low_error.hypot(high_error));
        if part > LEAST_DIFFERENCE && part > FAR * error {
            doubts.push(Doubt {
                kind: "recordings_differ",
                text: format!(
                    "{} differs between recordings: {} in {}, {} in {}, {:+.2} %, where chance explains {:.2} \
                     %: the bead or its mounting has changed; identify each recording by itself",
                    quantity.symbol(),
                    shown(*quantity, low),
                    least.recording,
                    shown(*quantity, high),
                    most.recording,
                    100.0 * part,
                    200.0 * error
                ),
            });
        }
    }
    let differ = !doubts.is_empty();
    if let Some(hardening) = hardening.filter(|hardening| hardening.is_certain() && !differ) {
        let (verb, share) = if hardening.part > 0.0 {
            ("harder", 1.0)
        } else {
            ("softer", -1.0)
        };
        doubts.push(Doubt {
            kind: "hardening",
            text: format!(
                "the spring is {:.1} % {verb} at its greatest stroke of {:.2} µm: k and c hold only for \
                 strikes as loud as these; identify from strikes as loud as those to be measured, or make the \
                 spring linear",
                100.0 * share * hardening.part,
                1e6 * hardening.stroke_m
            ),
        });
    }
    if goodness.probability < LEAST_PROBABILITY && !differ {
        doubts.push(Doubt {
            kind: "misfit",
            text: format!(
                "the model does not explain the samples, χ²/ν = {:.2} (p = {:.1e}), and standard errors are \
                 enlarged by {:.2}: something else moves the intruder; check the residuals in the picture, how \
                 the bead is held, and the settings or the scenario",
                goodness.chi_squared / goodness.free,
                goodness.probability,
                goodness.scale()
            ),
        });
    }
    if scatter > 1.0 && !differ {
        doubts.push(Doubt {
            kind: "scatter",
            text: format!(
                "the strikes scatter {scatter:.1} times as much as their noise explains, and standard errors \
                 are enlarged by this factor: strikes differ in more than their speed; check how the bead is \
                 held and tapped"
            ),
        });
    }
    doubts
}
