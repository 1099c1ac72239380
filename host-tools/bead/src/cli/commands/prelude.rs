//! Names that most commands use.

pub(super) use std::path::{Path, PathBuf};

pub(super) use anyhow::Context;
pub(super) use clap::Args;
pub(super) use hertz_chain::Scenario;
pub(super) use schemars::JsonSchema;
pub(super) use serde::Serialize;

pub(super) use crate::cli::failure::Failure;
pub(super) use crate::cli::interrupt;
pub(super) use crate::cli::output::{self, Format, positive};
pub(super) use crate::cli::place::{self, FileKind, Overwrite};
pub(super) use bead_recording::file::Recording;
pub(super) use bead_recording::strikes::RecordedStrike;
pub(super) use bead_tables::whole::Target;
