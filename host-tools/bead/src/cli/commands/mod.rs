//! One file a command: its arguments, its run, its table and its JSON.

pub(crate) mod clock;
pub(crate) mod command;
pub(crate) mod compare;
pub(crate) mod compare_reference;
pub(crate) mod compare_row;
mod compared;
pub(crate) mod decode;
pub(crate) mod emulate;
mod emulated;
pub(crate) mod export;
pub(crate) mod fetch;
pub(crate) mod figures;
pub(crate) mod manual;
pub(crate) mod optimise;
pub(crate) mod proof;
pub(crate) mod record;
pub(crate) mod recover;
pub(crate) mod replay;
pub(crate) mod settings;
mod settings_file;
pub(crate) mod simulate;
pub(crate) mod sweep;
pub(crate) mod sweep_cluster;
mod sweep_plot;
pub(crate) mod sweep_work;

/// Names that most commands use.
mod prelude {
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
    pub(super) use bead_recording::received::Received;
    pub(super) use bead_recording::strikes::RecordedStrike;
    pub(super) use bead_tables::whole::Target;
}
