//! Names that most commands use.

pub use std::path::{Path, PathBuf};

pub use anyhow::Context;
pub use clap::Args;
pub use hertz_chain::Scenario;
pub use schemars::JsonSchema;
pub use serde::Serialize;

pub use crate::failure::Failure;
pub use crate::interrupt;
pub use crate::output::{self, Format, positive};
pub use crate::place::{self, FileKind, Overwrite};
pub use bead_tables::whole::Target;
