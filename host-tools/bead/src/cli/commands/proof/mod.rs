//! `bead proof`: the project's own tables of errors, from runs of the flash image in QEMU.
//!
//! # Design
//! Each cell of a table is a run of the image on several strikes, with noise. Codes, image, frames and truth
//! are those of `bead emulate`.

pub(crate) mod accuracy;
mod measure;
pub(crate) mod silent;
pub(crate) mod spheres;

use clap::{Args, Subcommand};

use crate::cli::failure::Failure;

/// Arguments of `bead proof`.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    proof: Proof,
}

#[derive(Debug, Subcommand)]
enum Proof {
    /// Tabulate the error of the image's estimates over strikers and speeds.
    Accuracy(accuracy::Arguments),
    /// Tabulate the error of the image's estimates over materials and diameters of spheres.
    Spheres(spheres::Arguments),
    /// Play strikes at which the bead would be wrong, and see whether a flag names the cause.
    Silent(silent::Arguments),
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.proof {
        Proof::Accuracy(arguments) => accuracy::run(arguments),
        Proof::Spheres(arguments) => spheres::run(arguments),
        Proof::Silent(arguments) => silent::run(arguments),
    }
}
