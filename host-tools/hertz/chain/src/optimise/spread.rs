//! Spreads of springs and dampers that a robust design has to bear.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use crate::scenario::{InputError, Intruder};

/// Relative deviations to either side of the stiffness and the damping of all intruders, common to all, as a
/// batch of springs or a temperature causes them. Masses are exact.
///
/// As text it is `stiffness:15%`, `damping:0.3` or `stiffness:15%,damping:30%`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct Spread {
    /// Of the stiffness: 0.15 stands for k ± 15 %.
    pub stiffness: f64,
    /// Of the damping.
    pub damping: f64,
}

/// Factors of stiffness and damping.
pub(super) type Deviation = [f64; 2];

impl Spread {
    /// A spread of k ± `stiffness` and c ± `damping`, as parts of them.
    pub const fn new(stiffness: f64, damping: f64) -> Self {
        Self { stiffness, damping }
    }

    /// Returns true if nothing deviates.
    pub fn is_none(self) -> bool {
        self == Self::default()
    }

    /// The corners of the spread, by which a search judges; without a spread, the nominal values.
    pub(super) fn corners(self) -> Vec<Deviation> {
        self.grid(|spread| vec![1.0 - spread, 1.0 + spread])
    }

    /// The corners, the middles of the edges, and the nominal values.
    pub(super) fn corners_and_edges(self) -> Vec<Deviation> {
        self.grid(|spread| vec![1.0 - spread, 1.0, 1.0 + spread])
    }

    fn grid(self, points: impl Fn(f64) -> Vec<f64>) -> Vec<Deviation> {
        let [stiffnesses, dampings] = [self.stiffness, self.damping]
            .map(|spread| if spread == 0.0 { vec![1.0] } else { points(spread) });
        let pairs = stiffnesses.iter().map(|&k| dampings.iter().map(move |&c| [k, c]));
        pairs.flatten().collect()
    }

    pub(super) fn check(self) -> Result<(), InputError> {
        for (name, spread) in [("stiffness", self.stiffness), ("damping", self.damping)] {
            if !(0.0..=MOST).contains(&spread) {
                let what = format!("{spread} is not a spread of the {name}");
                let advice = format!("give a part from 0 to {MOST}, such as 0.15 or 15%");
                return Err(InputError::at("spread", what, advice));
            }
        }
        Ok(())
    }
}

/// Greatest spread: springs and dampers must not vanish.
const MOST: f64 = 0.9;

/// The intruders with deviating springs and dampers.
pub(super) fn deviating(intruders: &[Intruder], [stiffness, damping]: Deviation) -> Vec<Intruder> {
    let deviate = |intruder: &Intruder| Intruder {
        stiffness: intruder.stiffness * stiffness,
        damping: intruder.damping * damping,
        ..intruder.clone()
    };
    intruders.iter().map(deviate).collect()
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Without the rounding of a product.
        let percent = |part: f64| (1e5 * part).round() / 1e3;
        let (stiffness, damping) = (percent(self.stiffness), percent(self.damping));
        write!(f, "k ± {stiffness} %, c ± {damping} %")
    }
}

impl FromStr for Spread {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        const ADVICE: &str = "write stiffness:15%,damping:30%, or one of them";
        let (mut spread, mut seen) = (Self::default(), [false; 2]);
        for part in text.split(',') {
            let (name, number) = part.split_once(':').ok_or(ADVICE)?;
            let (at, place) = match name.trim() {
                "stiffness" => (0, &mut spread.stiffness),
                "damping" => (1, &mut spread.damping),
                _ => return Err(ADVICE.to_owned()),
            };
            if std::mem::replace(&mut seen[at], true) {
                return Err(format!("{} is named twice", name.trim()));
            }
            let number = number.trim();
            let (digits, unit) = number
                .strip_suffix('%')
                .map_or((number, 1.0), |digits| (digits, 100.0));
            *place = digits.trim().parse::<f64>().map_err(|_| ADVICE)? / unit;
        }
        spread.check().map_err(|error| error.to_string())?;
        Ok(spread)
    }
}
