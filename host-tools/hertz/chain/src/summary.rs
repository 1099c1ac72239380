//! Peaks, widths and energies of a run, in one structure.

use serde::Serialize;

/// The results of a run, with the names of the JSON of `bead simulate`. SI units.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct Summary {
    /// Greatest force of every contact that ever carried one.
    pub peak_force: Vec<ContactPeak>,
    /// Where the bodies are at the end.
    #[serde(rename = "final")]
    pub final_state: FinalState,
    /// Where the striker's energy is at the end.
    pub energy: EnergySummary,
    /// Each intruder, in the order of the beads.
    pub intruders: Vec<IntruderSummary>,
    /// Cost of the run.
    pub solver: SolverSummary,
}

/// The greatest force of one contact.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct ContactPeak {
    /// The contact, which joins bodies `contact - 1` and `contact`; N + 1 joins the last bead and the wall.
    pub contact: usize,
    /// Greatest total force, N.
    pub force: f64,
    /// When, s. It is the end of the run for a force that still rises then, and 0 for a static load that no
    /// wave has added to.
    pub time: f64,
    /// Full width at half of `force`, s, or half way from the static load to it. None if the run ends before
    /// the force has fallen to that.
    pub fwhm: Option<f64>,
}

/// Displacements (m) and velocities (m/s) of bodies 0..=N at one time (s).
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct FinalState {
    /// When.
    pub time: f64,
    /// Displacements.
    pub displacement: Vec<f64>,
    /// Velocities.
    pub velocity: Vec<f64>,
}

/// Energies, J, as [`Energies`](crate::Energies) has them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct EnergySummary {
    /// Kinetic energy of the striker at t = 0.
    pub striker_initial: f64,
    /// Energy of the striker at the end, J.
    pub striker_final: f64,
    /// Energy of the chain at the end, with M - m for hosts, without intruders.
    pub chain_final: f64,
    /// Energy of the intruders at the end.
    pub intruders_final: f64,
    /// Greatest energy of the chain in the run.
    pub chain_max: f64,
    /// Dissipated in contacts.
    pub dissipated_contacts: f64,
    /// Dissipated in intruders.
    pub dissipated_intruders: f64,
    /// Dissipated on the ground; none unless it drags.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dissipated_ground: Option<f64>,
    /// Work of a drive, and of the weight of a striker that falls; none without them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drive_work: Option<f64>,
    /// Greatest distance of the sum, less the work of a drive, from what it was at t = 0, which is
    /// `striker_initial` unless other beads moved then, at the end of any step. It is a part of that sum, or
    /// under a drive of the greatest energy of the bodies at any time.
    pub balance_error: f64,
}

/// Motion and losses of one intruder.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct IntruderSummary {
    /// The host bead.
    pub bead: usize,
    /// Its place among the intruders of a bead that holds several, from 1, in the order of their tables.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub place: Option<usize>,
    /// Greatest absolute acceleration, m/s².
    pub acceleration_max: f64,
    /// Least absolute acceleration, m/s².
    pub acceleration_min: f64,
    /// Greatest distance from its place in the host, m.
    pub relative_displacement_max: f64,
    /// Energy dissipated in its damper, J.
    pub dissipated: f64,
}

/// Cost of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct SolverSummary {
    /// Steps taken.
    pub steps: u64,
    /// Number of evaluations of the equations of motion.
    pub evaluations: u64,
    /// Wall-clock time, s.
    pub seconds: f64,
}
