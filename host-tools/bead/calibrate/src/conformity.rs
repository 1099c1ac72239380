//! A statement of conformity: the agreement of settings with the results, within a tolerance.

use schemars::JsonSchema;
use serde::Serialize;

use crate::calibration::Calibration;

/// The rule in words.
pub const RULE: &str = "JCGM 106, 8.3.2, guarded acceptance: a setting conforms if its deviation plus its \
                        expanded uncertainty (95 %) is within the tolerance";

/// Statement of conformity of the settings before a calibration.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Conformity {
    /// Deviation that is allowed, per cent.
    pub tolerance_percent: f64,
    /// The rule of the decision.
    pub rule: &'static str,
    /// Each setting.
    pub settings: Vec<SettingConformity>,
}

/// Conformity of a setting.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct SettingConformity {
    /// The setting.
    pub key: &'static str,
    /// Deviation of the setting before from the result, per cent.
    pub deviation_percent: f64,
    /// Expanded uncertainty of the result, per cent.
    pub expanded_percent: f64,
    /// True if it conforms.
    pub conforms: bool,
}

impl Conformity {
    /// Judges the settings before a calibration against a tolerance, as a part.
    pub fn of(calibration: &Calibration, tolerance: f64) -> Self {
        let judged = calibration.results.iter().filter_map(|result| {
            let (key, before) = (result.key?, result.before?);
            let combined = &result.combined;
            let deviation = before / combined.value - 1.0;
            let expanded = combined.expanded / combined.value.abs();
            Some(SettingConformity {
                key,
                deviation_percent: 100.0 * deviation,
                expanded_percent: 100.0 * expanded,
                conforms: deviation.abs() + expanded <= tolerance,
            })
        });
        Self {
            tolerance_percent: 100.0 * tolerance,
            rule: RULE,
            settings: judged.collect(),
        }
    }

    /// True if every setting conforms, and there is one.
    pub fn passes(&self) -> bool {
        !self.settings.is_empty() && self.settings.iter().all(|setting| setting.conforms)
    }

    /// The statement in a sentence.
    pub fn sentence(&self) -> String {
        let each = self.settings.iter().map(|setting| {
            format!(
                "{} {} ({:+.2} % ± {:.2} %)",
                setting.key,
                if setting.conforms {
                    "conforms"
                } else {
                    "does not conform"
                },
                setting.deviation_percent,
                setting.expanded_percent
            )
        });
        let each: Vec<_> = each.collect();
        let each = if each.is_empty() {
            "no previous setting is known".to_owned()
        } else {
            each.join(", ")
        };
        format!(
            "conformity to {:.2} %: {each}; {}",
            self.tolerance_percent, self.rule
        )
    }
}
