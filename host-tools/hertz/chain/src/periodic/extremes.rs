//! Greatest and least values in a period.

use super::state::PeriodicState;
use crate::options::SimulateError;

/// Times in a period at which values are read. The greatest value of a sine is then right within 2e-5.
const LOOKS: usize = 500;

/// Greatest and least values of a motion in one period.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PeriodExtremes {
    /// Least and greatest force of each contact, N. A contact whose least force is 0 opens.
    pub forces: Vec<[f64; 2]>,
    /// Greatest speed of each bead, m/s.
    pub speeds: Vec<f64>,
    /// Greatest displacement of each intruder from its host, m, in the order of the beads.
    pub strokes: Vec<f64>,
}

impl PeriodicState {
    /// Greatest and least values at 500 times in a period.
    ///
    /// # Errors
    /// [`SimulateError`]: a period cannot be run.
    pub fn extremes(&self) -> Result<PeriodExtremes, SimulateError> {
        let mut run = self.run();
        let model = run.model();
        let hosts: Vec<usize> = model.intruders().iter().map(|intruder| intruder.bead).collect();
        let mut extremes = PeriodExtremes {
            forces: vec![[f64::INFINITY, f64::NEG_INFINITY]; model.contacts()],
            speeds: vec![0.0; model.bodies() - 1],
            strokes: vec![0.0; hosts.len()],
        };
        for look in 1..=LOOKS {
            run.to(self.period() * look as f64 / LOOKS as f64)?;
            let now = run.snapshot();
            for ([least, greatest], contact) in extremes.forces.iter_mut().zip(1..) {
                let force = now.force(contact);
                (*least, *greatest) = (least.min(force), greatest.max(force));
            }
            for (speed, bead) in extremes.speeds.iter_mut().zip(1..) {
                *speed = speed.max(now.velocity(bead).abs());
            }
            for (stroke, &host) in extremes.strokes.iter_mut().zip(&hosts) {
                *stroke = stroke.max(now.intruder_displacement(host).map_or(0.0, f64::abs));
            }
        }
        Ok(extremes)
    }
}
