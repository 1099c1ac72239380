//! `bead calibrate`: the procedures of docs/calibration.md, over recorded, live or simulated data.

mod arguments;
mod drop;
mod finish;
mod front_mass;
mod live;
mod live_tones;
mod point_files;
mod reference;
pub(crate) mod report;
mod ring_down;
mod shaker;
mod source;

pub(crate) use arguments::Arguments;
pub(super) use source::reference as reference_description;

use crate::cli::commands::prelude::*;
use arguments::{AboutArguments, ProcedureCommand};
use bead_calibrate::about::About;

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.procedure {
        ProcedureCommand::Drop(arguments) => drop::run(arguments),
        ProcedureCommand::Reference(arguments) => reference::run(arguments),
        ProcedureCommand::FrontMass(arguments) => front_mass::run(arguments),
        ProcedureCommand::RingDown(arguments) => ring_down::run(arguments),
        ProcedureCommand::Shaker(arguments) => shaker::run(arguments),
        ProcedureCommand::About(arguments) => about(arguments),
    }
}

fn about(arguments: &AboutArguments) -> Result<(), Failure> {
    let target = place::target(&arguments.file, FileKind::Scenario, &[], arguments.overwrite)?;
    target.write_bytes(About::TEMPLATE)?;
    let name = arguments.file.display();
    note!("wrote {name}; edit it, then give it to a procedure: --about {name}");
    Ok(())
}
