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
    match difference(&here?, &there?) {
        None => {
            let _ = fs::remove_dir_all(&elsewhere);
            steps.announce("two folders and two homes give the same image, byte for byte");
            Ok(())
        }
        // Both stay there, to be looked at.
        Some(how) => Err(Stop::failed(format!(
            "two folders and two homes give two images: {how}. They are {} and {}",
            files[0].display(),
            files[1].display()
        ))),
    }
}

/// How two files differ; `None` if they do not.
fn difference(a: &[u8], b: &[u8]) -> Option<String> {
    if a.len() != b.len() {
        return Some(format!("one has {} bytes, the other {}", a.len(), b.len()));
    }
    let mut differ = a.iter().zip(b).enumerate().filter(|(_, (a, b))| a != b);
    let (first, _) = differ.next()?;
    let (count, all) = (1 + differ.count(), a.len());
    Some(format!("{count} of {all} bytes differ, the first at {first:#x}"))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_that_differ_are_told_apart_with_the_first_place() {
        assert_eq!(difference(b"abc", b"abc"), None);
        assert_eq!(
            difference(b"abcd", b"aBcD").unwrap(),
            "2 of 4 bytes differ, the first at 0x1"
        );
        assert!(difference(b"abc", b"abcd").unwrap().contains("3 bytes"));
    }
}
