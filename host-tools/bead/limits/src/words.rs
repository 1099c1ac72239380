//! Results in words, and values in units that fit them.

use bead_compare::report::{DASH, EnergyUnit, number};
use bead_tables::printable::one_line;

use crate::judged::{JudgedLimit, STRIKES};
use crate::quantity::ROW_SHARE;
use crate::rule::Outcome;

/// The limit and the bead, in words.
pub fn subject(limit: &JudgedLimit) -> String {
    match limit.bead {
        Some(bead) => format!("{}, bead {bead}", one_line(&limit.name)),
        None if limit.quantity == ROW_SHARE => format!("{}, the row", one_line(&limit.name)),
        None => one_line(&limit.name).into_owned(),
    }
}

/// The result of a limit in a sentence: what, why, and what next where nothing was decided.
pub fn sentence(limit: &JudgedLimit) -> String {
    let strike = limit
        .strike
        .map_or_else(String::new, |strike| format!("strike {strike}: "));
    if let Some(why) = &limit.why {
        return format!("{strike}{}: not decided: {why}", limit.quantity);
    }
    let unit = Shown::of(limit);
    let value = limit
        .value
        .map_or_else(|| DASH.to_owned(), |value| unit.with(value, limit.expanded));
    let at = limit
        .frequency_hz
        .map_or_else(String::new, |at| format!(" at {at:.0} Hz"));
    let side = match (limit.interval.min, limit.interval.max, limit.value) {
        (Some(min), _, Some(value)) if value < min => format!("below the limit {}", unit.plain(min)),
        (_, Some(max), Some(value)) if value > max => format!("above the limit {}", unit.plain(max)),
        (.., Some(value)) => {
            let nearest = limit.interval.nearest(value);
            let nearest = nearest.map_or_else(|| DASH.to_owned(), |nearest| unit.plain(nearest));
            match limit.outcome {
                Outcome::Pass => format!("within the limit {nearest}"),
                _ => format!("within U of the limit {nearest}"),
            }
        }
        _ => "absent".to_owned(),
    };
    format!("{strike}{} is {value}{at}, {side}", limit.quantity)
}

/// The unit and the digits in which the values of a limit are shown.
pub(crate) struct Shown {
    symbol: &'static str,
    pub(crate) scale: f64,
    /// Digits after the point.
    digits: usize,
}

impl Shown {
    pub(crate) fn of(limit: &JudgedLimit) -> Self {
        let (symbol, scale) = match limit.unit {
            "J" => {
                let unit = EnergyUnit::of(limit.value.into_iter().chain(limit.expanded));
                (unit.symbol, unit.scale)
            }
            unit => (unit, 1.0),
        };
        // Five digits of the value, or else of a limit.
        let bound = limit.interval.max.or(limit.interval.min);
        let greatest = limit.value.or(bound).map_or(0.0, |value| (value * scale).abs());
        let digits = if greatest > 0.0 && limit.quantity != STRIKES {
            (4.0 - greatest.log10().floor()).clamp(0.0, 9.0) as usize
        } else {
            0
        };
        Self {
            symbol,
            scale,
            digits,
        }
    }

    /// The unit in brackets, after a blank; empty without one.
    pub(crate) fn suffix(&self) -> String {
        match self.symbol {
            "" => String::new(),
            symbol => format!(" ({symbol})"),
        }
    }

    pub(crate) fn number(&self, value: f64) -> String {
        number(value * self.scale, self.digits)
    }

    fn plain(&self, value: f64) -> String {
        self.with(value, None)
    }

    fn with(&self, value: f64, expanded: Option<f64>) -> String {
        let within = expanded.map_or_else(String::new, |expanded| format!(" ± {}", self.number(expanded)));
        let shown = format!("{}{within} {}", self.number(value), self.symbol);
        shown.trim_end().to_owned()
    }
}
