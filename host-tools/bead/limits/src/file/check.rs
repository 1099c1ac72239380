//! Checks of a file of limits. An error names the key, what is wrong, and what would do.

use bead_spectra::shock::ResponseKind;
use hertz_chain::InputError;

use crate::file::limit::{Limit, Limits};
use crate::file::text::{FileText, LimitText, PointText, ResponseName, UnitName};
use crate::mask::{Mask, MaskPoint};
use crate::quantity::{DRIFT, Quantity, ROW_SHARE, SRS, Scalar};
use crate::rule::{DecisionRule, Interval};

/// Quality of the oscillators of a mask without one: 5 % of critical damping.
const QUALITY: f64 = 10.0;
const PER_OCTAVE: u32 = 12;

impl FileText {
    /// The limits, if each of them is valid.
    pub(super) fn checked(self) -> Result<Limits, InputError> {
        if self.limit.is_empty() {
            let advice = "add a [[limit]], such as quantity = \"peak_force\" with max = 10.0; `bead judge --template` shows all keys";
            return Err(InputError::at("", "the file has no limit", advice));
        }
        let (rule, strikes) = (self.rule, self.strikes.unwrap_or(1));
        let limits = (1..)
            .zip(self.limit)
            .map(|(number, limit)| limit.checked(number, rule));
        Ok(Limits {
            title: self.title,
            strikes,
            limits: limits.collect::<Result<_, _>>()?,
        })
    }
}

impl LimitText {
    fn checked(self, number: usize, rule: DecisionRule) -> Result<Limit, InputError> {
        let at = |key: &str| format!("limit[{number}].{key}");
        let refused = |key: &str, what: &str, advice: &str| Err(InputError::at(at(key), what, advice));
        let quantity = self.quantity(number)?;
        let interval = Interval {
            min: self.min,
            max: self.max,
        };
        let mask = match (quantity, &self.mask) {
            (Quantity::Srs, Some(points)) => Some(self.checked_mask(number, points)?),
            (Quantity::Srs, None) => {
                let advice = "give mask = [{ frequency = 500, max = 300 }, { frequency = 5000, max = 900 }], in Hz and m/s²";
                return refused("mask", "a limit on srs needs a mask", advice);
            }
            (_, Some(_)) => {
                let advice = "give min or max, or quantity = \"srs\"";
                return refused("mask", "only srs has a mask", advice);
            }
            (_, None) => None,
        };
        if mask.is_some() && interval != Interval::default() {
            let key = if self.min.is_some() { "min" } else { "max" };
            let advice = "give it in each point of the mask";
            return refused(key, "the limits of srs belong in its mask", advice);
        }
        let of_mask = [
            ("response", self.response.is_some()),
            ("quality", self.quality.is_some()),
            ("per_octave", self.per_octave.is_some()),
            ("unit", self.unit.is_some()),
        ];
        if let Some((key, _)) = of_mask.iter().find(|(_, given)| *given && mask.is_none()) {
            return refused(
                key,
                "only a limit on srs has this key",
                "leave it out; values are in SI units",
            );
        }
        if mask.is_none() {
            check(&at, interval)?;
        }
        Ok(Limit {
            name: self.name.unwrap_or_else(|| quantity.name()),
            quantity,
            rule: self.rule.unwrap_or(rule),
            interval,
            mask,
            beads: self.beads,
        })
    }

    fn quantity(&self, number: usize) -> Result<Quantity, InputError> {
        let at = |key: &str| format!("limit[{number}].{key}");
        if let Some(of) = &self.of {
            let scalar = Scalar::named(of).filter(|_| self.quantity == DRIFT);
            return scalar.map(Quantity::Drift).ok_or_else(|| {
                let names = Scalar::ALL.map(Scalar::name).join(", ");
                let what = if self.quantity == DRIFT {
                    format!("`{}` is not a value of a strike", shortened(of))
                } else {
                    "only a limit on drift has this key".to_owned()
                };
                InputError::at(
                    at("of"),
                    what,
                    format!("with quantity = \"drift\" give one of {names}"),
                )
            });
        }
        match self.quantity.as_str() {
            DRIFT => Ok(Quantity::Drift(Scalar::Measured)),
            ROW_SHARE => Ok(Quantity::RowShare),
            SRS => Ok(Quantity::Srs),
            name => Scalar::named(name).map(Quantity::Scalar).ok_or_else(|| {
                let what = format!("`{}` is not a quantity", shortened(name));
                InputError::at(at("quantity"), what, format!("give one of {}", Quantity::names()))
            }),
        }
    }

    fn checked_mask(&self, number: usize, points: &[PointText]) -> Result<Mask, InputError> {
        let at = |place: usize, key: &str| format!("limit[{number}].mask[{place}].{key}");
        let refused = |key: String, what: &str, advice: &str| Err(InputError::at(key, what, advice));
        let own = |key: &str| format!("limit[{number}].{key}");
        if points.len() < 2 {
            let advice = "give two points or more; between them the limit is a straight line over logarithms";
            return refused(own("mask"), "it has fewer than two points", advice);
        }
        let mut checked: Vec<MaskPoint> = Vec::new();
        for (place, point) in (1..).zip(points) {
            let is_later = checked.last().is_none_or(|last| last.frequency < point.frequency);
            if !(point.frequency.is_finite() && point.frequency > 0.0 && is_later) {
                let what = format!("{} Hz is not above 0 and above the point before", point.frequency);
                let advice = "give frequencies in Hz, ascending";
                return refused(at(place, "frequency"), &what, advice);
            }
            let limits = Interval {
                min: point.min,
                max: point.max,
            };
            check(&|key: &str| at(place, key), limits)?;
            for (key, limit) in [("min", limits.min), ("max", limits.max)] {
                if limit.is_some_and(|limit| limit <= 0.0) {
                    let what = "a limit of a spectrum must be above 0";
                    return refused(at(place, key), what, "give more than 0");
                }
            }
            let sides = |limits: Interval| (limits.min.is_some(), limits.max.is_some());
            let differs = |last: &MaskPoint| sides(last.limits) != sides(limits);
            if checked.last().is_some_and(differs) {
                let advice = "give every point the same keys (min, max or both), or write two limits";
                let what = "this point has other limits than the point before";
                return refused(at(place, "frequency"), what, advice);
            }
            checked.push(MaskPoint {
                frequency: point.frequency,
                limits,
            });
        }
        let quality = self.quality.unwrap_or(QUALITY);
        if !(quality > 0.5 && quality <= 1e6) {
            let what = format!("{quality} is not a quality of an oscillator");
            let advice = "give a number above 0.5, at most 1e6, such as 10 (5 % of critical damping)";
            return refused(own("quality"), &what, advice);
        }
        let per_octave = self.per_octave.unwrap_or(PER_OCTAVE);
        if !(1..=96).contains(&per_octave) {
            let what = format!("{per_octave} frequencies in an octave are out of range");
            return refused(own("per_octave"), &what, "give 1 to 96");
        }
        let response = match self.response.unwrap_or(ResponseName::AbsoluteAcceleration) {
            ResponseName::AbsoluteAcceleration => ResponseKind::AbsoluteAcceleration,
            ResponseName::PseudoVelocity => ResponseKind::PseudoVelocity,
            ResponseName::RelativeDisplacement => ResponseKind::RelativeDisplacement,
        };
        let gravities = self.unit == Some(UnitName::Gravities);
        if self.unit.is_some() && response != ResponseKind::AbsoluteAcceleration {
            let what = "only an absolute acceleration is in m/s² or g";
            return refused(own("unit"), what, "leave it out");
        }
        Ok(Mask {
            points: checked,
            response,
            quality,
            per_octave,
            gravities,
        })
    }
}

/// Checks that there is a limit, that limits are numbers, and that the lower is below the upper.
fn check(at: &dyn Fn(&str) -> String, limits: Interval) -> Result<(), InputError> {
    for (key, limit) in [("min", limits.min), ("max", limits.max)] {
        if limit.is_some_and(|limit| !limit.is_finite()) {
            return Err(InputError::at(
                at(key),
                "it is not a finite number",
                "give a number in SI units, or leave it out",
            ));
        }
    }
    match (limits.min, limits.max) {
        (None, None) => Err(InputError::at(
            at("max"),
            "there is neither min nor max",
            "give one of them, or both",
        )),
        (Some(min), Some(max)) if min > max => {
            let what = format!("min {min} is above max {max}");
            Err(InputError::at(at("min"), what, "give the lower limit as min"))
        }
        _ => Ok(()),
    }
}

/// Greatest number of characters of a word of the file in a message.
const WORD_MOST: usize = 40;

fn shortened(word: &str) -> String {
    bead_tables::printable::beginning(word, WORD_MOST).into_owned()
}
