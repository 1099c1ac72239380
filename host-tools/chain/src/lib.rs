#![doc = include_str!("../README.md")]

mod check;
mod dop853;
mod model;
mod observe;
mod scenario;
mod simulate;
mod solution;

pub use check::ScenarioError;
pub use model::{Contact, Energies, Model, Resonator};
pub use observe::{ContactPeak, EnergySummary, FinalState, IntruderSummary, SolverSummary, Summary};
pub use scenario::{Chain, ContactForce, Intruder, Scenario, Section, Striker};
pub use simulate::{Accuracy, Options, SimulateError, simulate};
pub use solution::{Sampler, Snapshot, Solution};
