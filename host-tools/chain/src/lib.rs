#![doc = include_str!("../README.md")]

mod check;
mod dop853;
mod flow;
mod model;
mod observe;
mod pulse;
mod quantity;
mod region;
mod scenario;
mod simulate;
mod solution;
mod split;

pub use check::ScenarioError;
pub use flow::{Flow, Passed};
pub use model::{Contact, Energies, Model, Resonator};
pub use observe::{ContactPeak, EnergySummary, FinalState, IntruderSummary, SolverSummary, Summary};
pub use pulse::{Pulse, PulseSearch};
pub use region::RegionEnergies;
pub use scenario::{Chain, ContactForce, Intruder, Scenario, Section, Striker};
pub use simulate::{Accuracy, Options, SimulateError, simulate};
pub use solution::{Sampler, Snapshot, Solution};
pub use split::Split;
