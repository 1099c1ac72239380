//! The map of a phase space that one period of a drive makes.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use super::error::PeriodicError;
use crate::options::{Accuracy, SimulateError};
use crate::scenario::{DriveQuantity, InputError, Scenario};
use crate::tangents::DrivenChain;

/// Accuracy of each period.
pub(super) const ACCURACY: Accuracy = Accuracy::REFERENCE;

/// Most beads and intruders together. The derivative of a period is a square matrix of twice that size, and
/// the time for its eigenvalues goes as the cube of it.
const MOST_BODIES: usize = 2000;

/// Refuses a chain whose motions do not repeat, or cannot be found from rest.
fn check(scenario: &Scenario) -> Result<(), InputError> {
    scenario.check()?;
    let chain = &scenario.chain;
    let hosted: usize = scenario.intruders.iter().map(|one| one.beads.len()).sum();
    if chain.beads + hosted > MOST_BODIES {
        let beads = chain.beads;
        let what = format!("{beads} beads and {hosted} intruders have too many multipliers");
        let advice = format!("give at most {MOST_BODIES} of both together");
        return Err(InputError::at("chain.beads", what, advice));
    }
    if scenario.holds_several() {
        let what = "motions that repeat can only be found for beads that hold at most one intruder each";
        return Err(InputError::at("intruder", what, "give each bead one at most"));
    }
    let pushed = scenario.drive.as_ref().map(|drive| drive.quantity) == Some(DriveQuantity::Force);
    if pushed && scenario.wall.is_none() {
        let what = "a chain that nothing holds in its place drifts, and its motion does not repeat";
        let advice = "give it a wall, or drive a displacement";
        return Err(InputError::at("wall", what, advice));
    }
    if chain.precompression == 0.0 && chain.gravity == 0.0 && scenario.starts.is_empty() {
        let what = "beads that just touch do not respond to a small push, so no motion is found from rest";
        let advice = "give a static load in N, or [[start]] tables near the motion";
        return Err(InputError::at("chain.precompression", what, advice));
    }
    Ok(())
}

/// The map of one period. Points are in units of their sizes, so that all coordinates are of one magnitude.
#[derive(Debug, Clone)]
pub(super) struct PeriodMap {
    pub(super) chain: DrivenChain,
    /// Length of a period, s.
    pub(super) period: f64,
    sizes: DVector<f64>,
}

impl PeriodMap {
    /// The map of a scenario's sine, without its ramp.
    ///
    /// # Errors
    /// The scenario is out of range, or its drive is no sine of one frequency.
    pub(super) fn of(scenario: &Scenario) -> Result<(Self, Scenario), InputError> {
        let refuse = |key: &str, what: &str, advice: &str| Err(InputError::at(key, what, advice));
        let mut scenario = scenario.clone();
        let Some(drive) = &mut scenario.drive else {
            let what = "a chain without a drive has no period";
            return refuse("drive", what, "give it a drive of one frequency");
        };
        drive.ramp = 0.0;
        let Some(frequency) = drive.frequency else {
            let what = "a record has no period";
            return refuse("drive.samples", what, "give a frequency instead");
        };
        if drive.frequency_end.is_some_and(|end| end != frequency) {
            let what = "a chirp has no period";
            return refuse("drive.frequency_end", what, "leave it out");
        }
        check(&scenario)?;
        let chain = DrivenChain::of(&scenario)?;
        let sizes = chain.sizes(chain.model.displacement_size(), TAU * frequency);
        let period = 1.0 / frequency;
        let map = Self { chain, period, sizes };
        Ok((map, scenario))
    }

    /// The map of another drive of the same chain, in the units of this one.
    pub(super) fn with_drive_of(&self, scenario: &Scenario) -> Result<Self, InputError> {
        let (mut map, _) = Self::of(scenario)?;
        map.sizes.clone_from(&self.sizes);
        Ok(map)
    }

    /// The point of a state of the model.
    pub(super) fn point(&self, state: &[f64]) -> DVector<f64> {
        self.chain.coordinates(state).component_div(&self.sizes)
    }

    /// The start of a period in the chain's coordinates.
    pub(super) fn start(&self, point: &DVector<f64>) -> DVector<f64> {
        point.component_mul(&self.sizes)
    }

    /// The point after a period that begins at this one.
    pub(super) fn image(&self, point: &DVector<f64>) -> Result<DVector<f64>, PeriodicError> {
        let end = self.chain.end(&self.start(point), self.period, ACCURACY)?;
        Ok(end.component_div(&self.sizes))
    }

    /// The point after a period that begins at this one, and its derivative.
    pub(super) fn image_and_derivative(
        &self,
        point: &DVector<f64>,
    ) -> Result<(DVector<f64>, DMatrix<f64>), PeriodicError> {
        let start = self.start(point);
        let (end, mut derivative) = self.chain.end_and_derivatives(&start, self.period, ACCURACY)?;
        if !derivative.iter().all(|value| value.is_finite()) {
            // The search for eigenvalues would never end.
            return Err(SimulateError::Stuck { time: self.period }.into());
        }
        for (mut column, size) in derivative.column_iter_mut().zip(&self.sizes) {
            column *= *size;
        }
        for (mut row, size) in derivative.row_iter_mut().zip(&self.sizes) {
            row /= *size;
        }
        Ok((end.component_div(&self.sizes), derivative))
    }
}
