//! The result of `bead identify`.

use crate::cli::commands::identify::arguments::Method;
use crate::cli::commands::prelude::*;
use bead_identify::report::BeadResult;

/// The result as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct IdentifyReport {
    /// `ring_down`, `pairs` or `chain`.
    method: &'static str,
    /// One for each bead.
    pub(super) beads: Vec<BeadResult>,
}

impl IdentifyReport {
    pub(super) fn new(method: Method, beads: Vec<BeadResult>) -> Self {
        Self {
            method: match method {
                Method::RingDown => "ring_down",
                Method::Pairs => "pairs",
                Method::Chain => "chain",
            },
            beads,
        }
    }

    /// The method in words.
    pub(super) fn method(&self) -> &'static str {
        match self.method {
            "chain" => "strikes of the chain",
            "pairs" => "force and acceleration",
            _ => "free ringing",
        }
    }
}
