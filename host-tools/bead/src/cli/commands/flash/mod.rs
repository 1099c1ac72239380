//! `bead flash`: puts the image into a bead, over its line, through a probe, or with the part's own loader.

mod arguments;
mod image;
mod part;
mod probe;
mod probe_rs;
mod report;
mod rom;
mod update;

pub(crate) use arguments::Arguments;
pub(crate) use report::FlashReport;

use crate::cli::commands::prelude::*;
use image::FlashImage;

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let image = FlashImage::find(arguments.image.as_deref(), arguments.board.as_deref())?;
    let report = match &arguments.port {
        Some(port) if arguments.rom => Some(rom::run(arguments, port, &image)?),
        Some(port) => Some(update::run(arguments, port, &image)?),
        None => probe::run(arguments, &image)?,
    };
    let Some(report) = report else { return Ok(()) };
    output::print(arguments.format, &report, || report::table(&report))?;
    if report.brown_out_level.is_some_and(|level| level != 3) {
        note!(
            "the brown-out reset is at level {}: a bead needs level 3, since a core at 2 V may read flash wrongly; \
             --brownout sets it",
            report.brown_out_level.unwrap_or_default()
        );
    }
    Ok(())
}
