//! How commands meet a terminal: output, files, signals, exit statuses.

// First, as the others use their macros.
#[macro_use]
pub mod failure;
#[macro_use]
pub mod output;

pub mod beads;
pub mod interrupt;
pub mod place;
pub mod prelude;
pub mod printer;
pub mod schema;
pub mod words;

// `failure!` makes its errors with it in every crate.
#[doc(hidden)]
pub use anyhow;
