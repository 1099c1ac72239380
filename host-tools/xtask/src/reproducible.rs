//! Check that a commit gives an equal flash image in another folder, to another person.
//!
//! # Design
//! The commit is cloned into a folder for temporary files: below this one cargo would read this one's
//! configuration too. Its cargo has a home of its own, whose entries are links to the real ones, so that
//! nothing is downloaded again. Yet every path that the compiler sees is another one. Both have spaces and an
//! apostrophe in their names, as folders of people do.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use crate::packages::IMAGE;
use crate::step::{CommandLine, Steps, Stop};
use crate::{image, paths};

/// Sources that `firmware/build.rs` examines for "-dirty".
const SOURCES: &str = "Cargo.lock Cargo.toml firmware memory.x rust-toolchain.toml .cargo";

/// Builds the image here and elsewhere, and compares all bytes: code, constants and debug information.
///
/// # Errors
/// Sources of the image are not committed, it cannot be built, or the bytes differ.
pub(crate) fn check(steps: &Steps) -> Result<(), Stop> {
    let changed = CommandLine::new("git --no-optional-locks status --porcelain --").words(SOURCES);
    if !steps.read("what is not committed", &changed)?.is_empty() {
        return Err(Stop::failed(
            "sources of the image differ from the commit, and the image names it: commit them first",
        ));
    }
    image::build(steps)?;
    let elsewhere = std::env::temp_dir().join(format!("bead's other folder {}", std::process::id()));
    let home = elsewhere.join("another person/.cargo");
    let other = steps.of(elsewhere.join("a clone"));
    link_entries(&paths::cargo_home().unwrap_or_default(), &home)
        .map_err(|error| Stop::failed(format!("cannot make {}: {error}", home.display())))?;
    let clone = CommandLine::new("git clone --quiet --shared")
        .arg(&steps.root)
        .arg(&other.root);
    steps.run("a clone in another folder", &clone)?;
    paths::leave_out(&other, Some(&home))?;
    let build = CommandLine::new("cargo build").words(IMAGE).within(&other.root);
    let build = build
        .env("CARGO_HOME", &home.to_string_lossy())
        .env("CARGO_TARGET_DIR", &other.target.to_string_lossy());
    other.run("the flash image there, with another home", &build)?;

    let files = [
        steps.root.join(image::path(steps)),
        other.root.join(image::path(&other)),
    ];
    let [here, there] = files
        .each_ref()
        .map(|path| fs::read(path).map_err(|error| Stop::failed(format!("{}: {error}", path.display()))));
    let (here, there) = (here?, there?);
    if here == there {
        let _ = fs::remove_dir_all(&elsewhere);
        steps.announce("two folders and two homes give the same image, byte for byte");
        return Ok(());
    }
    // Both stay there, to be looked at.
    let same = here
        .iter()
        .zip(&there)
        .take_while(|(one, other)| one == other)
        .count();
    Err(Stop::failed(format!(
        "two folders and two homes give two images, of {} and {} bytes, which differ from byte {same:#x} on. \
         They are {} and {}",
        here.len(),
        there.len(),
        files[0].display(),
        files[1].display()
    )))
}

/// A folder with links to all that is in another one.
fn link_entries(from: &Path, to: &PathBuf) -> std::io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        symlink(entry.path(), to.join(entry.file_name()))?;
    }
    Ok(())
}
