//! The one rule by which a value agrees with another.

/// The rule in words.
pub const DECISION_RULE: &str = "JCGM 106, guarded rejection: a goal is missed where the deviation is beyond it by more than \
     its expanded uncertainty (95 %), shown after ±";

/// True unless the whole interval of `off` ± `expanded`, its expanded uncertainty, lies further from 0 than
/// `allowed` (JCGM 106, 8.3.3: guarded rejection). Where nothing is allowed, this is simple acceptance of a
/// difference by its expanded uncertainty.
pub(crate) fn agrees(off: f64, allowed: f64, expanded: f64) -> bool {
    off.abs() - expanded <= allowed
}
