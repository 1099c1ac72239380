#![doc = include_str!("../README.md")]

mod absorption;
mod check;
mod collision;
mod dop853;
mod flow;
mod injection;
mod model;
mod observe;
mod pulse;
mod quantity;
mod region;
mod scenario;
mod signal;
mod simulate;
pub mod solitary;
mod solution;
mod spectrum;
mod split;
mod transmission;

pub use absorption::Absorption;
pub use check::ScenarioError;
pub use collision::Collision;
pub use flow::{Flow, Passed};
pub use injection::{Injection, injection_curve};
pub use model::{Contact, Energies, Model, Resonator};
pub use observe::{ContactPeak, EnergySummary, FinalState, IntruderSummary, SolverSummary, Summary};
pub use pulse::{Pulse, PulseSearch};
pub use realfft::num_complex::Complex64;
pub use region::RegionEnergies;
pub use scenario::{Chain, ContactForce, Intruder, Scenario, Section, Striker};
pub use signal::Signal;
pub use simulate::{Accuracy, Options, SimulateError, simulate};
pub use solution::{Sampler, Snapshot, Solution};
pub use spectrum::{Spectrum, Taper};
pub use split::Split;
pub use transmission::TransmissionFit;
