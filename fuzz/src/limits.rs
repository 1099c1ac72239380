//! Files of limits in TOML.

use bead_limits::file::{Limit, Limits};

use crate::text;

/// Reads the bytes as a file of limits.
///
/// # Panics
/// A file that is accepted has a limit that nothing can be held against.
pub fn check(bytes: &[u8]) {
    let Some(limits) = text::read(bytes, |text| Limits::parse(text, "a.toml")) else {
        return;
    };
    assert!(!limits.limits.is_empty());
    limits.limits.iter().for_each(hold);
}

fn hold(limit: &Limit) {
    let is_number = |bound: Option<f64>| bound.is_none_or(f64::is_finite);
    let interval = limit.interval;
    assert!(is_number(interval.min) && is_number(interval.max));
    let Some(mask) = &limit.mask else {
        assert!(interval.min.is_some() || interval.max.is_some());
        return;
    };
    let (from, to) = mask.range();
    assert!(0.0 < from && from < to);
    for part in [0.0, 0.3, 1.0] {
        let limits = mask.limits(from + part * (to - from));
        assert!(limits.min.is_some() || limits.max.is_some());
    }
}
