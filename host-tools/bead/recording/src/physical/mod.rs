//! A bead's settings as its owner writes them: the file `bead.toml`, changes on a command line, messages.
//!
//! [`KEYS`] lists every key of a [`Description`](bead_model::design::Description) once. File, changes,
//! columns and messages follow from it.

mod keys;
mod refusal;
mod text;
mod validity;
mod values;

pub use keys::{KEYS, KeyRow};
pub use refusal::refusal;
pub use text::{Change, changes, derived, parse, set, to_toml};
pub use validity::calibration_doubt;
pub(crate) use values::pointer;
pub use values::{shown, value};
