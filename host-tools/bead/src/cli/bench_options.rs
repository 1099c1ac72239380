//! The options that `bead emulate` and `bead proof` share: scenario, bead and image.

use std::path::PathBuf;

use clap::Args;

use crate::cli::beads::one_bead;
use crate::cli::failure::Failure;
use bead_bench::image::find_image;

/// Scenario, bead and image.
#[derive(Debug, Args)]
pub(crate) struct BenchOptions {
    /// The scenario, a TOML file in SI units.
    pub(crate) scenario: PathBuf,
    /// The bead that senses: one with an intruder.
    #[arg(long, value_name = "N", value_parser = one_bead)]
    pub(crate) bead: usize,
    /// The flash image [default: as `cargo xtask build` leaves it, else the one inside this program].
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
}

impl BenchOptions {
    /// The image: as given, or as built.
    pub(crate) fn image(&self) -> Result<PathBuf, Failure> {
        Ok(find_image(self.firmware.as_deref())?)
    }
}
