//! Parts of one, as a calibration states them.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Units of [`Relative`] in one.
const IN_ONE: f64 = 1e7;

/// A relative standard uncertainty, or a correlation, in steps of 1e-7. A number in JSON and TOML, an integer
/// of few bytes in a block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Relative(#[cfg_attr(feature = "schema", schemars(with = "f64"))] i32);

impl Relative {
    /// The nearest step to `part`; saturates at ±214.
    pub fn new(part: f64) -> Self {
        Self(libm::rint(part * IN_ONE) as i32)
    }

    /// The part, 0.01 for 1 %.
    pub fn part(self) -> f64 {
        f64::from(self.0) / IN_ONE
    }
}

impl Serialize for Relative {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if serializer.is_human_readable() {
            self.part().serialize(serializer)
        } else {
            self.0.serialize(serializer)
        }
    }
}

impl<'de> Deserialize<'de> for Relative {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        if deserializer.is_human_readable() {
            f64::deserialize(deserializer).map(Self::new)
        } else {
            i32::deserialize(deserializer).map(Self)
        }
    }
}
