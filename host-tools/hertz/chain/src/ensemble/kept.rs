//! The steps of a group, kept for a backward pass.

use std::ops::Range;

use super::crossing::{Changes, ContactBatch};
use super::eight::Eight;
use super::peak::PlaceState;

/// A step of a group.
#[derive(Debug)]
pub(super) struct KeptStep {
    /// Time at its start, and its length, which is 0 in lanes that did not take it, s.
    pub(super) time: Eight,
    pub(super) length: Eight,
    /// Computed contacts in runs of neighbours, and computed intruders.
    pub(super) runs: Vec<Range<usize>>,
    pub(super) guests: Vec<usize>,
    /// Displacement and velocity of the bodies of all runs, and of these intruders.
    pub(super) bodies: Vec<[Eight; 2]>,
    pub(super) intruders: Vec<[Eight; 2]>,
    pub(super) crossings: Vec<KeptCrossing>,
    pub(super) peaks: Vec<KeptOverlap>,
}

/// Overlap of a contact at both ends of a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct KeptOverlap {
    pub(super) contact: usize,
    pub(super) lane: usize,
    pub(super) ends: [PlaceState; 2],
}

/// A contact that opens or closes in a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct KeptCrossing {
    pub(super) overlap: KeptOverlap,
    /// The change of displacement and velocity, times the mass of a body.
    pub(super) change: [f64; 2],
}

/// All steps so far, and what is known of the present one.
#[derive(Debug, Default)]
pub(super) struct KeptSteps {
    pub(super) steps: Vec<KeptStep>,
    crossings: Vec<KeptCrossing>,
    peaks: Vec<KeptOverlap>,
}

impl KeptSteps {
    /// Keeps contacts that open or close, each by number and lane.
    pub(super) fn crossed(&mut self, some: &[(usize, usize)], contacts: &ContactBatch, changes: &Changes) {
        for (index, &(contact, lane)) in some.iter().enumerate() {
            let ends = [&contacts.start, &contacts.end].map(|of| of.map(|of| of.0[index]));
            let change = [changes.displacement, changes.velocity].map(|of| of.0[index]);
            let overlap = KeptOverlap { contact, lane, ends };
            self.crossings.push(KeptCrossing { overlap, change });
        }
    }

    /// Keeps the overlap of a contact whose greatest force is wanted.
    pub(super) fn searched(&mut self, overlap: KeptOverlap) {
        self.peaks.push(overlap);
    }

    /// Keeps a step with these displacements and velocities at its start.
    pub(super) fn take(
        &mut self,
        (time, length): (Eight, Eight),
        (runs, [u, v]): (&[Range<usize>], [&[Eight]; 2]),
        (guests, [x, w]): (&[usize], [&[Eight]; 2]),
    ) {
        let places = runs.iter().flat_map(|run| run.start - 1..run.end);
        let crossings = self.crossings.drain(..);
        self.steps.push(KeptStep {
            time,
            length,
            runs: runs.to_vec(),
            guests: guests.to_vec(),
            bodies: places.map(|body| [u[body], v[body]]).collect(),
            intruders: guests.iter().map(|&guest| [x[guest], w[guest]]).collect(),
            crossings: crossings.filter(|one| length.0[one.overlap.lane] > 0.0).collect(),
            peaks: std::mem::take(&mut self.peaks),
        });
    }
}
