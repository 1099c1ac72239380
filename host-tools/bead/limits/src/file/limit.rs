//! Limits that were checked.

use crate::mask::Mask;
use crate::quantity::{Quantity, Scalar};
use crate::rule::{DecisionRule, Interval};

/// The limits of a file, and the strikes that they need.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// A name, for people.
    pub title: String,
    /// Least number of strikes of each bead.
    pub strikes: usize,
    /// The limits, one at least.
    pub limits: Vec<Limit>,
}

/// A limit.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// A name, for people.
    pub name: String,
    /// Its quantity.
    pub quantity: Quantity,
    /// The decision rule.
    pub rule: DecisionRule,
    /// The limits; none for a mask.
    pub interval: Interval,
    /// Limits over frequency, of a spectrum.
    pub mask: Option<Mask>,
    /// Addresses of the beads that it applies to; empty for all.
    pub beads: Vec<u8>,
}

impl Limits {
    /// True if a limit is on a spectrum.
    pub fn has_mask(&self) -> bool {
        self.limits.iter().any(|limit| limit.mask.is_some())
    }

    /// True if a limit needs the uncertainty of an energy.
    pub fn has_energy(&self) -> bool {
        use Scalar::{Measured, Predicted, Ratio};
        let is_energy = |limit: &Limit| match limit.quantity {
            Quantity::Scalar(scalar) => matches!(scalar, Measured | Predicted | Ratio),
            Quantity::RowShare => true,
            Quantity::Drift(_) | Quantity::Srs => false,
        };
        self.limits.iter().any(is_energy)
    }

    /// True if a limit is on the share that a row absorbs.
    pub fn has_row(&self) -> bool {
        let is_row = |limit: &Limit| limit.quantity == Quantity::RowShare;
        self.limits.iter().any(is_row)
    }
}
