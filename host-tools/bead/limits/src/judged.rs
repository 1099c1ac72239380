//! The results of limits: every value that was compared with one, and the worst of them.

use bead_spectra::strike::FLAT_TO;
use schemars::JsonSchema;
use serde::Serialize;

use crate::file::Limit;
use crate::mask::MaskedPoint;
use crate::quantity::{Quantity, Scalar};
use crate::rule::{DecisionRule, Interval, Outcome};

/// A recording against limits.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct JudgedRecording {
    /// Path of the recording.
    pub recording: String,
    /// The worst outcome of its limits.
    pub outcome: Outcome,
    /// Its missing parts; null for a whole one.
    pub incomplete: Option<String>,
    /// One for each limit and bead.
    pub limits: Vec<JudgedLimit>,
}

/// A limit against the strikes of a bead.
#[derive(Clone, Debug, Default, Serialize, JsonSchema)]
pub struct JudgedLimit {
    /// Name of the limit.
    pub name: String,
    /// Its quantity.
    pub quantity: String,
    /// Unit of the values; empty for a ratio.
    pub unit: &'static str,
    /// Decision rule (JCGM 106).
    pub rule: DecisionRule,
    /// Address of the bead; null for a row, and where no bead sent a strike.
    pub bead: Option<u8>,
    /// The outcome: that of the worst strike.
    pub outcome: Outcome,
    /// Number of strikes that pass.
    pub passed: usize,
    /// Number of strikes about which nothing is decided.
    pub undecided: usize,
    /// Number of strikes that fail.
    pub failed: usize,
    /// The worst strike: its number, as its bead counts; null for a value over several.
    pub strike: Option<u32>,
    /// The worst value; null if it is absent.
    pub value: Option<f64>,
    /// Its expanded uncertainty U, 95 %; null if it is unknown.
    pub expanded: Option<f64>,
    /// Of a spectrum: the frequency of the worst value, Hz.
    pub frequency_hz: Option<f64>,
    /// The limits that the worst value was held against.
    #[serde(flatten)]
    pub interval: Interval,
    /// Why nothing was decided, and what next.
    pub why: Option<String>,
    /// Every value, for pictures.
    #[serde(skip)]
    pub(crate) points: Vec<JudgedValue>,
    /// The greatest of the spectra at each frequency, with the limits there.
    #[serde(skip)]
    pub(crate) envelope: Vec<EnvelopePoint>,
}

/// A value that was compared with limits.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct JudgedValue {
    /// Number of the strike; `None` for a value over several.
    pub(crate) strike: Option<u32>,
    pub(crate) value: Option<f64>,
    pub(crate) expanded: Option<f64>,
    pub(crate) frequency: Option<f64>,
    pub(crate) interval: Interval,
    pub(crate) outcome: Outcome,
    pub(crate) why: Option<String>,
}

/// The spectra of several strikes at a frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EnvelopePoint {
    pub(crate) frequency: f64,
    pub(crate) greatest: f64,
    pub(crate) limits: Interval,
}

/// The quantity of a bead's least number of strikes.
pub(crate) const STRIKES: &str = "number of strikes";

/// The result of a bead that has fewer strikes than are wanted.
pub(crate) fn too_few(address: u8, found: usize, wanted: usize) -> JudgedLimit {
    JudgedLimit {
        name: "strikes".to_owned(),
        quantity: STRIKES.to_owned(),
        bead: Some(address),
        outcome: Outcome::Fail,
        value: Some(found as f64),
        interval: Interval {
            min: Some(wanted as f64),
            max: None,
        },
        ..JudgedLimit::default()
    }
}

/// Why a value without an uncertainty is not decided under a guarded rule, and what next.
const NO_UNCERTAINTY: &str = "its uncertainty is unknown, and the rule needs it; state the uncertainty of the calibration \
     in the bead's settings, or give --uncertainty, or use rule = \"simple\"";
const NONE_OF_RINGING: &str = "the bead sends no uncertainty of this frequency, and the rule needs one; give this limit \
     rule = \"simple\"";
const NONE_ABOVE: &str = "no calibration states how flat a sensor is above 5 kHz, and the rule needs its uncertainty; end the \
     mask there, or give this limit rule = \"simple\"";

impl JudgedValue {
    pub(crate) fn absent(strike: Option<u32>, why: String) -> Self {
        Self {
            strike,
            why: Some(why),
            ..Self::default()
        }
    }

    pub(crate) fn decided(strike: Option<u32>, value: f64, expanded: Option<f64>, limit: &Limit) -> Self {
        let outcome = limit.rule.decide(value, expanded, limit.interval);
        let why = match limit.quantity {
            Quantity::Scalar(Scalar::RingFrequency) => NONE_OF_RINGING,
            _ => NO_UNCERTAINTY,
        };
        Self {
            strike,
            value: Some(value),
            expanded,
            frequency: None,
            interval: limit.interval,
            outcome,
            why: (outcome == Outcome::Undecided).then(|| why.to_owned()),
        }
    }

    pub(crate) fn masked(strike: Option<u32>, point: MaskedPoint) -> Self {
        let why = if point.frequency > FLAT_TO {
            NONE_ABOVE
        } else {
            NO_UNCERTAINTY
        };
        Self {
            strike,
            value: Some(point.value),
            expanded: point.expanded,
            frequency: Some(point.frequency),
            interval: point.limits,
            outcome: point.outcome,
            why: (point.outcome == Outcome::Undecided).then(|| why.to_owned()),
        }
    }

    /// The value that counts: the worst outcome, and of equal ones the least room, as a part of the value.
    pub(crate) fn worst(values: impl IntoIterator<Item = Self>) -> Option<Self> {
        let room = |one: &Self| {
            let value = one.value.unwrap_or(f64::NAN);
            one.interval.room(value) / value.abs().max(f64::MIN_POSITIVE)
        };
        values.into_iter().min_by(|one, other| {
            let by_outcome = other.outcome.cmp(&one.outcome);
            by_outcome.then(room(one).total_cmp(&room(other)))
        })
    }
}
