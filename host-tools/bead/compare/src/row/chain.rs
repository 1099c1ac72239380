//! The chain that a row of beads is compared with, and the beads of a recording that belong to it.

use std::sync::Arc;

use hertz_chain::{Scenario, Solution};

use crate::error::CompareError;
use crate::sensed::simulate_with_ring_down;
use bead_recording::file::{Part, Recording};

/// A chain and its motion.
#[derive(Clone)]
pub struct RowChain {
    /// The scenario.
    pub scenario: Scenario,
    /// Its motion, with ring-down.
    pub solution: Arc<Solution>,
    /// Its hosts, from the striker on.
    pub hosts: Vec<usize>,
}

impl RowChain {
    /// Simulates a scenario.
    ///
    /// # Errors
    /// It cannot be integrated.
    pub fn of(scenario: Scenario) -> Result<Self, CompareError> {
        Ok(Self {
            solution: Arc::new(simulate_with_ring_down(&scenario)?),
            hosts: scenario.hosts(),
            scenario,
        })
    }
}

/// A bead of a recording at its place in the chain.
#[derive(Debug, Clone)]
pub struct PlacedBead {
    /// Its place.
    pub bead: usize,
    /// Its frames.
    pub received: Recording,
}

/// The beads of a recording that have a place in the chain, from the striker on; and a line for each bead
/// that is left out and for each host without a bead. A bead whose scenario differs from `text`, as its
/// author wrote it, is left out.
pub fn among(received: &Recording, chain: &RowChain, text: Option<&str>) -> (Vec<PlacedBead>, Vec<String>) {
    let mut places: Vec<PlacedBead> = Vec::new();
    let mut notes = Vec::new();
    for (bead, received) in received.beads.iter().zip(received.each()) {
        let (address, at) = (bead.origin.address, bead.place());
        let own = bead.parts.get(&Part::Scenario);
        let why = if !chain.hosts.contains(&at) {
            Some("has no intruder in this scenario")
        } else if places.iter().any(|other| other.bead == at) {
            Some("is in the recording twice")
        } else {
            let both = own.zip(text);
            let is_other = both.is_some_and(|(own, text)| **own != *text.as_bytes());
            is_other.then_some("has another scenario")
        };
        match why {
            Some(why) => notes.push(format!("bead {at} (address {address}) is left out: it {why}")),
            None => places.push(PlacedBead { bead: at, received }),
        }
    }
    places.sort_by_key(|place| place.bead);
    if places.is_empty() {
        return (places, notes);
    }
    let is_missing = |host: &&usize| places.iter().all(|place| place.bead != **host);
    let missing = chain.hosts.iter().filter(is_missing).map(usize::to_string);
    let missing: Vec<String> = missing.collect();
    if !missing.is_empty() {
        let is_one = missing.len() == 1;
        let (beads, took) = if is_one {
            ("bead", "its intruder")
        } else {
            ("beads", "their intruders")
        };
        let missing = missing.join(", ");
        notes.push(format!(
            "{beads} {missing} of the scenario did not record: the energy of {took} is the simulation's"
        ));
    }
    (places, notes)
}
