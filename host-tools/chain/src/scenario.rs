//! What is to be simulated: the tables of a scenario, their check, and reading them from TOML.

mod check;
mod tables;

pub(crate) use check::MOST_BEADS;
pub use check::ScenarioError;
pub(crate) use tables::Sphere;
pub use tables::{Chain, ContactForce, Intruder, Scenario, Section, Striker, Wall};
