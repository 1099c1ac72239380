//! `bead flash --port`: another image over the bead's own line.

use bead_line::port::Address;
use bead_line::update::BeadImage;
use bead_update::file::UpdateFile;
use bead_update::manifest::{DEVELOPMENT_KEY, Manifest};

use crate::cli::commands::flash::arguments::Arguments;
use crate::cli::commands::flash::image::{FlashImage, ImageName};
use crate::cli::commands::flash::report::FlashReport;
use crate::cli::commands::prelude::*;
use crate::cli::line_options::{TIMEOUT, open};
use bead_bench::image::shown;

/// Rate of the bead's line, bits a second.
const BAUD: u32 = 2_000_000;
/// Sectors of the image that runs (`memory.x`).
const SECTORS: [u8; 2] = [5, 6];

/// Sends an image to the bead at a port, and waits until it runs.
///
/// # Errors
/// [`Failure`]: no image that can be sent, the bead refuses it or does not keep it, or the line fails.
pub(crate) fn run(arguments: &Arguments, port: &Address, image: &FlashImage) -> Result<FlashReport, Failure> {
    let shown = shown(&image.path);
    let bytes = std::fs::read(&image.path).with_context(|| format!("cannot read {shown}"))?;
    let file = UpdateFile::read(&bytes).map_err(|error| {
        failure!(
            Input,
            "{shown}: {error}; give the image that `cargo xtask build` makes and signs"
        )
    })?;
    let (baud, key) = (arguments.baud.unwrap_or(BAUD), arguments.key.as_deref());
    let mut bead = open(port, baud, arguments.address, key, TIMEOUT)?;
    let how = "the bead runs a complete image, the old or the new one; if it still waits for the rest, it measures \
               again in ten seconds; run the same command again";
    interrupt::resumable(how.to_owned());
    let bar = output::progress(file.image.len() as u64);
    bar.set_message(format!("sending {}", image.name));
    let updated = bead.update(&file, arguments.older, |part| {
        bar.set_position((part * file.image.len() as f64) as u64);
        if part >= 1.0 {
            bar.set_message("the bead swaps images and checks the new one: about ten seconds");
        }
    });
    bar.finish_and_clear();
    let [before, after] = updated?;
    let Some(board) = &after.board else {
        bail!(
            Device,
            "the bead runs an image that does not name its board; ask it for its identity"
        );
    };
    if after.identity.git.as_str() != image.name.git {
        bail!(
            Device,
            "the bead did not take the image: it runs {}, not {}; run the same command again",
            name(&after),
            image.name
        );
    }
    if Manifest::verified(&file.manifest, &DEVELOPMENT_KEY).is_ok() {
        note!(
            "the image is signed with the development key, which everybody has: anybody can sign another image"
        );
    }
    Ok(FlashReport {
        part: board.part,
        brown_out_level: Some(board.brown_out_level),
        read_protection: board.read_protection,
        before: Some(name(&before)),
        after: name(&after),
        sectors: SECTORS.to_vec(),
        bytes: file.image.len(),
    })
}

/// The name of the image that a bead runs.
fn name(running: &BeadImage) -> ImageName {
    let board = running.board.as_ref().map(|board| board.name.as_str());
    ImageName {
        version: running.identity.firmware.as_str().to_owned(),
        git: running.identity.git.as_str().to_owned(),
        board: board.unwrap_or("an unnamed board").to_owned(),
    }
}
