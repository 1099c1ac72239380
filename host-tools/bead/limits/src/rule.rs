//! Decision rules for a value with an uncertainty against limits.
//!
//! # Design
//! JCGM 106:2012, clause 8. U is the expanded uncertainty of the value, about 95 %. Where a rule needs U and
//! it is unknown, nothing is decided, unless every U would lead to the same decision.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A decision rule.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum DecisionRule {
    /// Simple acceptance (8.2): the value itself must be within the limits.
    #[default]
    Simple,
    /// Guarded acceptance (8.3.2): the whole interval of value ± U must be within the limits.
    GuardedAcceptance,
    /// Guarded rejection (8.3.3): the whole interval must not be beyond a limit.
    GuardedRejection,
}

/// The result of a decision.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Within the limits by the rule.
    Pass,
    /// Not decided: the value or its uncertainty is unknown.
    #[default]
    Undecided,
    /// Beyond a limit by the rule.
    Fail,
}

impl Outcome {
    /// In a word.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Undecided => "undecided",
            Self::Fail => "fail",
        }
    }
}

/// Limits of a value, in its unit; one of them at least is there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Interval {
    /// Lower limit.
    pub min: Option<f64>,
    /// Upper limit.
    pub max: Option<f64>,
}

impl DecisionRule {
    /// The rule in words.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Simple => "JCGM 106, simple acceptance: a value passes if it is within the limits",
            Self::GuardedAcceptance => {
                "JCGM 106, guarded acceptance: a value passes if all of value ± U (95 %) is within the limits"
            }
            Self::GuardedRejection => {
                "JCGM 106, guarded rejection: a value fails if all of value ± U (95 %) is beyond a limit"
            }
        }
    }

    /// Decides about a value with its expanded uncertainty.
    pub fn decide(self, value: f64, expanded: Option<f64>, limits: Interval) -> Outcome {
        let room = limits.room(value);
        match (self, expanded) {
            _ if value.is_nan() => Outcome::Undecided,
            (Self::Simple, _) if room >= 0.0 => Outcome::Pass,
            (Self::Simple, _) => Outcome::Fail,
            (Self::GuardedAcceptance, _) if room < 0.0 => Outcome::Fail,
            (Self::GuardedAcceptance, Some(expanded)) if room >= expanded => Outcome::Pass,
            (Self::GuardedAcceptance, Some(_)) => Outcome::Fail,
            (Self::GuardedRejection, _) if room >= 0.0 => Outcome::Pass,
            (Self::GuardedRejection, Some(expanded)) if -room > expanded => Outcome::Fail,
            (Self::GuardedRejection, Some(_)) => Outcome::Pass,
            (Self::GuardedAcceptance | Self::GuardedRejection, None) => Outcome::Undecided,
        }
    }
}

impl Interval {
    /// Distance from the value to the nearest limit: negative beyond it.
    pub fn room(self, value: f64) -> f64 {
        let below = self.min.map_or(f64::INFINITY, |min| value - min);
        let above = self.max.map_or(f64::INFINITY, |max| max - value);
        below.min(above)
    }

    /// The limit that a value is nearest to, or beyond.
    pub fn nearest(self, value: f64) -> Option<f64> {
        match (self.min, self.max) {
            (Some(min), Some(max)) => Some(if value - min < max - value { min } else { max }),
            (min, max) => min.or(max),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_rule_decides_as_its_clause_says() {
        use DecisionRule::{GuardedAcceptance, GuardedRejection, Simple};
        use Outcome::{Fail, Pass, Undecided};
        let limits = Interval {
            min: Some(8.0),
            max: Some(10.0),
        };
        for (value, expanded, [simple, accepted, rejected]) in [
            (9.0, Some(0.5), [Pass, Pass, Pass]),
            (9.0, Some(1.5), [Pass, Fail, Pass]),
            (9.8, Some(0.5), [Pass, Fail, Pass]),
            (10.2, Some(0.5), [Fail, Fail, Pass]),
            (10.8, Some(0.5), [Fail, Fail, Fail]),
            (7.8, Some(0.5), [Fail, Fail, Pass]),
            (7.0, Some(0.5), [Fail, Fail, Fail]),
            // With an unknown uncertainty, only what no uncertainty would change is decided.
            (9.0, None, [Pass, Undecided, Pass]),
            (10.2, None, [Fail, Fail, Undecided]),
            (f64::NAN, Some(0.5), [Undecided; 3]),
        ] {
            let found = [Simple, GuardedAcceptance, GuardedRejection]
                .map(|rule| rule.decide(value, expanded, limits));
            assert_eq!(found, [simple, accepted, rejected], "{value} ± {expanded:?}");
        }
        let above = Interval {
            min: None,
            max: Some(1.0),
        };
        assert_eq!(GuardedAcceptance.decide(-1e9, Some(0.5), above), Pass);
        assert_eq!(
            (limits.nearest(8.9), limits.nearest(9.1)),
            (Some(8.0), Some(10.0))
        );
    }
}
