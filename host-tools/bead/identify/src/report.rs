//! The result of a bead in SI units, for JSON and tables.

use bead_recording::strikes::LeftOut;
use schemars::JsonSchema;
use serde::Serialize;

use crate::consistency::{Doubt, Hardening, RecordingValues};
use crate::identified::{Candidate, Identified, Wanted};
use crate::method::Method;
use crate::quantity::{QUANTITIES, Quantity};

/// A quantity of a bead.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct QuantityResult {
    /// The quantity.
    pub quantity: Quantity,
    /// Its letter.
    pub symbol: &'static str,
    /// Its unit; empty for a factor.
    pub unit: &'static str,
    /// Value at the start of the fit.
    pub start: f64,
    /// Best value.
    pub value: f64,
    /// True if it was fitted; else it was held at its start.
    pub fitted: bool,
    /// Standard error by the scatter of the samples; null if it was held.
    pub standard_error: Option<f64>,
    /// Ends of the interval of 95 % by this scatter; null if it was held.
    pub interval: Option<[f64; 2]>,
    /// `profile` or `linear`; null if it was held.
    pub interval_by: Option<&'static str>,
    /// Relative standard uncertainty with what held quantities add; null where nothing is known of it.
    pub relative_uncertainty: Option<f64>,
    /// Reason why it was held, though it was wanted.
    pub held_because: Option<String>,
}

/// Agreement of the residuals with the noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct GoodnessResult {
    /// Sum of squared residuals over the noise.
    pub chi_squared: f64,
    /// Residuals less fitted numbers.
    pub degrees_of_freedom: f64,
    /// Probability of a sum that is as great or greater.
    pub probability: f64,
    /// Factor in all standard errors.
    pub error_scale: f64,
}

/// Noise of a channel before the trigger.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct NoiseResult {
    /// `force`, `wide_force`, `acceleration` or `wide_acceleration`.
    pub channel: &'static str,
    /// Standard deviation, N or m/s².
    pub deviation: f64,
    /// Coefficients of its autoregression; 0 is white.
    pub order: usize,
}

/// A strike that had a part.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct UsedStrike {
    /// Path of the recording.
    pub recording: String,
    /// Number of the strike, as its bead counts.
    pub strike: u32,
    /// χ² over its degrees of freedom.
    pub reduced_chi_squared: f64,
}

/// The identification of a bead.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct BeadResult {
    /// Address of the bead.
    pub address: u8,
    /// Device id, hexadecimal.
    pub uid: Option<String>,
    /// All quantities that have a part.
    pub quantities: Vec<QuantityResult>,
    /// Correlations of the fitted quantities by the scatter, in their order.
    pub correlations: Vec<Vec<f64>>,
    /// Singular values of the whitened Jacobian of the wanted quantities, by their logarithms, descending:
    /// one over each is the standard error of a combination, as a part.
    pub singular_values: Vec<f64>,
    /// Agreement of the residuals with the noise.
    pub goodness: GoodnessResult,
    /// Noise of the channels.
    pub noise: Vec<NoiseResult>,
    /// A spring that hardens or softens; null where the data know nothing of it.
    pub hardening: Option<Hardening>,
    /// Each recording by itself, if there are several. Values are those of the fitted quantities, in their
    /// order.
    pub recordings: Vec<RecordingValues>,
    /// Doubts about the result.
    pub doubts: Vec<Doubt>,
    /// Strikes that had a part.
    pub strikes: Vec<UsedStrike>,
    /// Strikes that had none.
    pub left_out: Vec<LeftOut>,
}

/// The result of all beads, as JSON.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct IdentifyReport {
    /// `ring_down`, `pairs` or `chain`.
    method: &'static str,
    /// One for each bead.
    pub beads: Vec<BeadResult>,
}

impl IdentifyReport {
    /// The results of a method.
    pub fn new(method: Method, beads: Vec<BeadResult>) -> Self {
        let method = method.name();
        Self { method, beads }
    }

    /// The method in words.
    pub fn method(&self) -> &'static str {
        match self.method {
            "chain" => "strikes of the chain",
            "pairs" => "force and acceleration",
            _ => "free ringing",
        }
    }
}

/// Who the bead is, and what is known beside the fit.
#[derive(Debug, Clone, PartialEq)]
pub struct About {
    /// Address of the bead.
    pub address: u8,
    /// Device id, hexadecimal.
    pub uid: Option<String>,
    /// Noise of the channels.
    pub noise: Vec<NoiseResult>,
    /// Strikes that had no signals to begin with.
    pub left_out: Vec<LeftOut>,
}

/// The names of quantities, as in `k, c and m`.
pub fn listed(quantities: &[Quantity]) -> String {
    let names: Vec<_> = quantities.iter().map(|one| one.symbol()).collect();
    match names.split_last() {
        Some((last, [])) => (*last).to_owned(),
        Some((last, others)) => format!("{} and {last}", others.join(", ")),
        None => String::new(),
    }
}

impl BeadResult {
    /// The result of an identification.
    pub fn new(found: &Identified<'_>, candidates: &[Candidate], wanted: &Wanted, about: About) -> Self {
        let best = &found.best;
        let has_part = |quantity: &Quantity| {
            best.free.contains(quantity)
                || best.normal.information[(quantity.place(), quantity.place())] > 0.0
                || wanted.free.contains(quantity)
        };
        let quantities = QUANTITIES.into_iter().filter(has_part);
        let quantities = quantities
            .map(|quantity| result_of(found, wanted, quantity))
            .collect();
        let count = best.free.len();
        let correlation = |a: usize, b: usize| {
            found.covariance[(a, b)] / (found.covariance[(a, a)] * found.covariance[(b, b)]).sqrt()
        };
        let correlations = (0..count)
            .map(|a| (0..count).map(|b| correlation(a, b)).collect())
            .collect();
        let name = |place: usize| {
            let recording = candidates[place].recording;
            (
                wanted.recordings.get(recording).cloned().unwrap_or_default(),
                candidates[place].number,
            )
        };
        let strikes = found.used.iter().zip(&best.strikes).map(|(place, strike)| {
            let (recording, number) = name(*place);
            UsedStrike {
                recording,
                strike: number,
                reduced_chi_squared: strike.normal.shared.squares / strike.normal.shared.free.max(1.0),
            }
        });
        let left_out = found.left_out.iter().map(|(place, why)| {
            let (recording, strike) = name(*place);
            LeftOut {
                recording,
                strike,
                why: why.clone(),
            }
        });
        Self {
            address: about.address,
            uid: about.uid,
            quantities,
            correlations,
            singular_values: found.singular.clone(),
            goodness: GoodnessResult {
                chi_squared: found.goodness.chi_squared,
                degrees_of_freedom: found.goodness.free,
                probability: found.goodness.probability,
                error_scale: found.scale,
            },
            noise: about.noise,
            hardening: found.hardening,
            recordings: found.recordings.clone(),
            doubts: found.doubts.clone(),
            strikes: strikes.collect(),
            left_out: about.left_out.into_iter().chain(left_out).collect(),
        }
    }
}

fn result_of(found: &Identified<'_>, wanted: &Wanted, quantity: Quantity) -> QuantityResult {
    let (best, at) = (&found.best, quantity.place());
    let place = best.free.iter().position(|one| *one == quantity);
    let value = best.values[at];
    let degenerate = found.degenerate.iter().find(|one| one.held == quantity);
    let held_because = degenerate.map(|one| {
        let known = if one.error.is_finite() {
            format!(
                "the data determine a combination of them only to {:.0} %",
                100.0 * one.error
            )
        } else {
            "the data say nothing about a combination of them".to_owned()
        };
        match one.together[..] {
            [_] => format!(
                "the data do not determine {}: it keeps its start value",
                quantity.symbol()
            ),
            _ => format!("{} cannot be told apart: {known}", listed(&one.together)),
        }
    });
    // A held quantity without a stated uncertainty leaves those that go with it without one.
    let lacks = QUANTITIES.into_iter().any(|held| {
        let is_held = !best.free.contains(&held) && wanted.stated[held.place()].is_none();
        is_held && best.normal.information[(held.place(), at)].abs() > 0.0
    });
    let is_known = if place.is_some() {
        !lacks
    } else {
        wanted.stated[at].is_some()
    };
    QuantityResult {
        quantity,
        symbol: quantity.symbol(),
        unit: quantity.unit(),
        start: wanted.start[at],
        value,
        fitted: place.is_some(),
        standard_error: place.map(|place| value * found.covariance[(place, place)].sqrt()),
        interval: place.map(|place| found.intervals[place].0),
        interval_by: place.map(|place| {
            if found.intervals[place].1 {
                "profile"
            } else {
                "linear"
            }
        }),
        relative_uncertainty: is_known.then(|| found.combined[(at, at)].sqrt()),
        held_because,
    }
}
