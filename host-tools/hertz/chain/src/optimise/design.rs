//! A design, and the scenario that has it.

use serde::Serialize;

use super::bounds::Properties;
use crate::scenario::{Scenario, Section};

/// The intruders of all hosts, and the radii of the beads that may vary.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Design {
    /// One entry for each host, or one for all.
    pub(super) intruders: Vec<Properties>,
    /// Radius of each bead of the search's [`Sizes`], m, in their order.
    pub(super) radii: Vec<f64>,
}

/// Beads whose radii a search may vary, each by itself. Their material stays, and so does the mass of their
/// intruders: the shells become lighter or heavier.
#[derive(Debug, Clone, PartialEq)]
pub struct Sizes {
    /// The beads.
    pub beads: Vec<usize>,
    /// Least and greatest radius of each, m.
    pub radius: [f64; 2],
}

/// The radius that a search found for a bead.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct BeadRadius {
    /// The bead.
    pub bead: usize,
    /// Its radius, m.
    #[serde(rename = "radius_m")]
    pub radius: f64,
}

/// The scenario with other radii of some beads.
pub(super) fn with_radii(scenario: &Scenario, radii: impl IntoIterator<Item = BeadRadius>) -> Scenario {
    let mut sized = scenario.clone();
    for BeadRadius { bead, radius } in radii {
        let mut section = Section::of([bead]);
        let mut sections = sized.sections.iter_mut();
        // A bead belongs to one section at most, and takes the other values of it along.
        if let Some(other) = sections.find(|section| section.beads.contains(&bead)) {
            other.beads.retain(|&one| one != bead);
            section = Section {
                beads: section.beads,
                ..other.clone()
            };
        }
        section.radius = Some(radius);
        sized.sections.retain(|section| !section.beads.is_empty());
        sized.sections.push(section);
    }
    sized
}
