//! `bead proof`: the project's own tables of errors, from runs of the flash image in QEMU.
//!
//! # Design
//! Each cell of a table is a run of the image on several strikes, with noise. Codes, image, frames and truth
//! are those of `bead emulate`. `coverage`, `calibrate` and `identify` run the image's code on this computer,
//! for their many beads.

pub(crate) mod accuracy;
pub(crate) mod calibrate;
pub(crate) mod coverage;
mod healthy;
pub(crate) mod identify;
mod measure;
pub(crate) mod silent;
pub(crate) mod spheres;

use clap::{Args, Subcommand};

use bead_console::failure::Failure;

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
    /// Play strikes at which the bead would be wrong, and check whether a flag names the cause.
    Silent(silent::Arguments),
    /// Draw beads from a calibration, and check whether their uncertainties cover the truth.
    Coverage(coverage::Arguments),
    /// Draw beads and rigs, calibrate them, and check whether the uncertainties of the results cover the
    /// truth.
    Calibrate(calibrate::Arguments),
    /// Draw beads, identify them from their strikes, and check how far the results are off.
    Identify(identify::Arguments),
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.proof {
        Proof::Accuracy(arguments) => accuracy::run(arguments),
        Proof::Spheres(arguments) => spheres::run(arguments),
        Proof::Silent(arguments) => silent::run(arguments),
        Proof::Coverage(arguments) => coverage::run(arguments),
        Proof::Calibrate(arguments) => calibrate::run(arguments),
        Proof::Identify(arguments) => identify::run(arguments),
    }
}
