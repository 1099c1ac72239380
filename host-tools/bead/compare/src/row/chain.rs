//! The chain that a row of beads is held against.

use std::sync::Arc;

use hertz_chain::{Scenario, Solution};

use crate::error::CompareError;
use crate::sensed::simulate_with_ring_down;

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
