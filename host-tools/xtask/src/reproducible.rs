//! Check that a commit yields equal flash images in another folder, for another person.
//!
//! # Design
//! The commit is cloned into a folder for temporary files: below this one cargo would read this one's
//! configuration too. Its cargo has another home, whose entries are links to the real ones, so that nothing
//! is downloaded again. Yet every path that the compiler sees differs. Both have spaces and an apostrophe in
//! their names, as folders of people do.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;

use crate::step::{CommandLine, Steps, Stop};
use crate::{board_table, boards, files, image, paths};

/// Sources that `firmware/build.rs` examines for "-dirty".
const SOURCES: &str = "Cargo.lock Cargo.toml firmware rust-toolchain.toml .cargo";

/// Builds the image for each board here and elsewhere, and compares all bytes: code, constants and debug
/// information.
///
/// # Errors
/// Sources of the image are not committed, it cannot be built, or the bytes differ.
pub(crate) fn check(steps: &Steps) -> Result<(), Stop> {
    let changed = CommandLine::new("git --no-optional-locks status --porcelain --").words(SOURCES);
    if !steps.read("what is not committed", &changed)?.is_empty() {
        return Err(Stop::failed(
            "sources of the image differ from the commit that the image names: commit them first",
        ));
    }
    boards::build_images(steps)?;
    image::build(steps)?;
    let elsewhere = std::env::temp_dir().join(format!("bead's other folder {}", std::process::id()));
    let home = elsewhere.join("another person/.cargo");
    let other = steps.of(elsewhere.join("a clone"));
    link_entries(&paths::cargo_home().unwrap_or_default(), &home)?;
    let clone = CommandLine::new("git clone --quiet --shared")
        .arg(&steps.root)
        .arg(&other.root);
    steps.run("a clone in another folder", &clone)?;
    paths::leave_out(&other, Some(&home))?;
    let boards = board_table::names(steps)?;
    let first = steps.root.join(image::path(steps));
    let mut images = Vec::new();
    for (number, board) in boards.iter().enumerate() {
        let build = boards::line(board).within(&other.root);
        let build = build
            .env("CARGO_HOME", &home.to_string_lossy())
            .env("CARGO_TARGET_DIR", &other.target.to_string_lossy());
        other.run(
            &format!("the flash image for {board} there, with another home"),
            &build,
        )?;
        let here = if number == 0 {
            first.clone()
        } else {
            boards::path(steps, board)
        };
        let there = other.root.join(image::path(&other));
        image::sign(&there, board)?;
        compare(board, &here, &there)?;
        images.push(here);
    }
    let _ = fs::remove_dir_all(&elsewhere);
    let sums = images
        .iter()
        .fold(CommandLine::new("sha256sum"), CommandLine::arg);
    print!("{}", steps.read("the SHA-256 of each", &sums)?);
    steps.announce(&format!(
        "two folders and two homes give the same images, byte for byte, for {}",
        boards.join(", ")
    ));
    Ok(())
}

/// Compares two images for a board, byte by byte. If they differ, both stay where they are, to be looked at.
fn compare(board: &str, here: &Path, there: &Path) -> Result<(), Stop> {
    let (one, other) = (files::bytes(here)?, files::bytes(there)?);
    if one == other {
        return Ok(());
    }
    let same = one
        .iter()
        .zip(&other)
        .take_while(|(one, other)| one == other)
        .count();
    Err(Stop::failed(format!(
        "two folders and two homes give different images for {board}, of {} and {} bytes, which differ from byte {same:#x} on. \
         They are {} and {}",
        one.len(),
        other.len(),
        here.display(),
        there.display()
    )))
}

/// A folder with links to all that is in another one.
fn link_entries(from: &Path, to: &Path) -> Result<(), Stop> {
    files::make(to)?;
    for entry in files::entries(from)? {
        let link = to.join(entry.file_name().unwrap_or_default());
        symlink(&entry, link).map_err(files::cannot("make", to))?;
    }
    Ok(())
}
