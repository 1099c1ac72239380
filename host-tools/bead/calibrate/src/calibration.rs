//! The outcome of a procedure: results, observations used and left out, and checks.

use bead_recording::strikes::RecordedStrike;
use bead_wire::StrikeFlags;
use schemars::JsonSchema;
use serde::Serialize;

use crate::model::{CalibrationResult, ResultCorrelation};

/// The outcome of a calibration procedure.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct Calibration {
    /// `drop`, `reference`, `front-mass`, `ring-down` or `shaker`.
    pub procedure: &'static str,
    /// The procedure in words.
    pub title: &'static str,
    /// The bead, where a recording names it.
    pub bead: Option<BeadIdentity>,
    /// The results.
    pub results: Vec<CalibrationResult>,
    /// Their correlations.
    pub correlations: Vec<ResultCorrelation>,
    /// Observations that the results come from: a drop, a tap or a frequency each.
    pub observations: Vec<Observation>,
    /// Observations that were left out.
    pub left_out: Vec<LeftOut>,
    /// Checks. One that does not hold is a verdict against the calibration.
    pub checks: Vec<Check>,
    /// Supply of the converter as the bead measured it, mean over the observations, V.
    pub supply_v: Option<f64>,
    /// The method, in sentences.
    pub method: Vec<String>,
}

/// The bead that was calibrated.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct BeadIdentity {
    /// Its address.
    pub address: u8,
    /// Its unique device id, hexadecimal.
    pub uid: Option<String>,
}

impl BeadIdentity {
    /// The bead of a strike.
    pub fn of(strike: &RecordedStrike) -> Self {
        let hex = |uid: [u8; 12]| uid.iter().map(|byte| format!("{byte:02x}")).collect();
        Self {
            address: strike.address,
            uid: strike.uid.map(hex),
        }
    }
}

/// An observation: a drop, a tap, a frequency.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Observation {
    /// Its name.
    pub subject: String,
    /// Its values.
    pub values: Vec<ObservedValue>,
}

/// A value of an observation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct ObservedValue {
    /// Its name.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// The value.
    pub value: f64,
}

impl ObservedValue {
    /// A value with its name and unit.
    pub fn new(name: &'static str, unit: &'static str, value: f64) -> Self {
        Self { name, unit, value }
    }
}

/// An observation that was left out.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct LeftOut {
    /// Its name.
    pub subject: String,
    /// Why, and what would help.
    pub why: String,
}

/// A check of the results against each other.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Check {
    /// The check in words.
    pub what: String,
    /// The deviation that was found, per cent.
    pub deviation_percent: f64,
    /// The deviation that is allowed, per cent.
    pub allowed_percent: f64,
    /// True if it holds.
    pub holds: bool,
    /// Meaning of a deviation.
    pub advice: &'static str,
}

impl Calibration {
    /// The first check that does not hold, in words.
    pub fn doubt(&self) -> Option<String> {
        let failed = self.checks.iter().find(|check| !check.holds)?;
        Some(format!(
            "{}: {:+.2} %, but at most {:.2} % is allowed; {}",
            failed.what, failed.deviation_percent, failed.allowed_percent, failed.advice
        ))
    }
}

/// Refuses a strike with missing samples.
pub(crate) fn all_samples(strike: &RecordedStrike) -> Result<(), String> {
    match strike.missing() {
        0 => Ok(()),
        missing => Err(format!(
            "{missing} of its {} samples are missing; fetch the strike: bead fetch --port P --out F.mcap",
            strike.said.samples
        )),
    }
}

/// Refuses a strike with one of these flags; `advice` says what next.
pub(crate) fn no_flag(strike: &RecordedStrike, flags: &[StrikeFlags], advice: &str) -> Result<(), String> {
    let found = flags.iter().find(|flag| strike.said.flags.has(**flag));
    found.map_or(Ok(()), |flag| {
        let name = flag.names().next().unwrap_or_default();
        Err(format!("its window has the flag {name}; {advice}"))
    })
}

/// A blank and, in brackets, the first observation that was left out with its reason; empty if there is
/// none.
pub(crate) fn because(left_out: &[LeftOut]) -> String {
    let first = left_out.first();
    first.map_or(String::new(), |out| format!(" ({}: {})", out.subject, out.why))
}

/// Mean supply next to these strikes, V.
pub fn supply<'a>(strikes: impl IntoIterator<Item = &'a RecordedStrike>) -> Option<f64> {
    let of = |strike: &RecordedStrike| Some(strike.shape?.conditions?.supply.volts());
    let volts: Vec<f64> = strikes.into_iter().filter_map(of).collect();
    (!volts.is_empty()).then(|| volts.iter().sum::<f64>() / volts.len() as f64)
}
