//! How commands meet a terminal: output, files, signals, exit statuses.

// First, as the others use its macros.
#[macro_use]
pub mod failure;

pub mod beads;
pub mod interrupt;
pub mod output;
pub mod place;
pub mod prelude;
pub mod schema;

#[doc(hidden)]
pub use anyhow;
