//! A bead that hangs on threads and is tapped with a small ball, in the f64 chain.

use bead_compare::sensed::{Sensed, Timing, simulate_with_ring_down};
use bead_recording::file::RecordingError;
use bead_tables::whole::Target;
use hertz_chain::Scenario;

use crate::ring_down::RingDownInputs;
use crate::simulated::bead::{SimulatedBead, chance, deviate, truth};

/// Time before the first tap, s, and from tap to tap.
const LEAD_IN: f64 = 0.06;
const INTERVAL: f64 = 0.05;
/// Velocity of the tap, m/s.
const TAP: f64 = 0.15;
/// Relative standard deviations of the true k and c about those of the settings.
const SPREAD: [f64; 2] = [0.03, 0.08];

/// True values of a bead that rings: k in N/m, c in N·s/m, m and M in kg.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RingTruth {
    /// k, N/m.
    pub stiffness: f64,
    /// c, N·s/m.
    pub damping: f64,
    /// m, kg.
    pub intruder: f64,
    /// M, kg.
    pub bead: f64,
}

/// Simulated taps.
#[derive(Debug, Clone, Copy)]
pub struct TapRig {
    /// Statements of the operator, from which the truth is drawn.
    pub stated: RingDownInputs,
    /// Number of taps.
    pub taps: u32,
    /// Seed of the truth and of the noise.
    pub seed: u64,
}

impl TapRig {
    /// The truth of a bead with these settings.
    pub fn truth(&self, bead: &SimulatedBead) -> RingTruth {
        let mut random = chance(self.seed, 11);
        let settings = bead.settings.description();
        let intruder = truth(self.stated.intruder.mass, &mut random);
        let host = self
            .stated
            .bead
            .map_or(settings.bead.mass, |bead| truth(bead.mass, &mut random));
        RingTruth {
            stiffness: settings.intruder.stiffness * (1.0 + SPREAD[0] * deviate(&mut random)),
            damping: settings.intruder.damping * (1.0 + SPREAD[1] * deviate(&mut random)),
            intruder,
            bead: host,
        }
    }

    /// Signals at the sensors, and their length, s.
    ///
    /// # Errors
    /// No bead has these masses and springs.
    pub fn sensed(&self, bead: &SimulatedBead) -> Result<(Sensed, f64), String> {
        let truth = self.truth(bead);
        let mut scenario = Scenario::paper();
        scenario.duration = 2e-3;
        scenario.chain.beads = 1;
        let volume = 4.0 / 3.0 * std::f64::consts::PI * scenario.chain.radius.powi(3);
        // The chain's density includes the intruder's mass.
        scenario.chain.density = truth.bead / volume;
        scenario.striker.velocity = TAP;
        let Some(intruder) = scenario.intruders.first_mut() else {
            return Err("the paper's bead has no intruder".to_owned());
        };
        intruder.beads = vec![1];
        (intruder.mass, intruder.stiffness, intruder.damping) =
            (truth.intruder, truth.stiffness, truth.damping);
        let solution = simulate_with_ring_down(&scenario).map_err(|error| error.to_string())?;
        let timing = Timing {
            lead_in: LEAD_IN,
            strikes: self.taps,
            interval: INTERVAL,
        };
        let seconds = LEAD_IN + INTERVAL * f64::from(self.taps);
        Ok((Sensed::new(&solution, 1, timing), seconds))
    }

    /// Records the taps.
    ///
    /// # Errors
    /// No bead has these masses and springs, or the file cannot be written.
    pub fn record(&self, bead: &SimulatedBead, target: &Target) -> Result<(), String> {
        let (sensed, seconds) = self.sensed(bead)?;
        let recorded = bead.record(target, &sensed, seconds, self.seed);
        recorded.map_err(|error: RecordingError| error.to_string())
    }
}
