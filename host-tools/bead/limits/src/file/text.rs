//! The keys of a file of limits, as they are written.

use serde::Deserialize;

use crate::rule::DecisionRule;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FileText {
    #[serde(default)]
    pub(super) title: String,
    #[serde(default)]
    pub(super) rule: DecisionRule,
    pub(super) strikes: Option<usize>,
    #[serde(default)]
    pub(super) limit: Vec<LimitText>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LimitText {
    pub(super) quantity: String,
    pub(super) name: Option<String>,
    pub(super) of: Option<String>,
    pub(super) rule: Option<DecisionRule>,
    pub(super) min: Option<f64>,
    pub(super) max: Option<f64>,
    #[serde(default)]
    pub(super) beads: Vec<u8>,
    pub(super) mask: Option<Vec<PointText>>,
    pub(super) response: Option<ResponseName>,
    pub(super) quality: Option<f64>,
    pub(super) per_octave: Option<u32>,
    pub(super) unit: Option<UnitName>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PointText {
    pub(super) frequency: f64,
    pub(super) min: Option<f64>,
    pub(super) max: Option<f64>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum ResponseName {
    AbsoluteAcceleration,
    PseudoVelocity,
    RelativeDisplacement,
}

#[derive(Clone, Copy, Deserialize, PartialEq)]
pub(super) enum UnitName {
    #[serde(rename = "m/s²")]
    Si,
    #[serde(rename = "g")]
    Gravities,
}
