//! Scenarios: their tables, the check of their values, and reading them from TOML.

mod check;
mod check_laws;
mod contact;
mod drive;
mod paper;
mod read;
mod tables;
mod words;

pub use check::MOST_BEADS;
pub(crate) use check::{TableCheck, ValueRange};
pub use contact::{ContactLaw, Damping};
pub use drive::{Drive, DriveQuantity};
pub use read::{InputError, TomlFile, read_table, read_text};
pub(crate) use tables::Sphere;
pub use tables::{Chain, ContactForce, Intruder, Material, Scenario, Section, Start, Striker, Wall};
pub use words::plain_words;
