//! The flash image that is run: the one named, the one built last, or the one that this program carries.

use std::env;
use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process;
use std::sync::OnceLock;

use crate::error::BenchError;

/// Path of the image that `cargo xtask build` writes, in the target directory.
const IMAGE: &str = "thumbv7em-none-eabihf/firmware/bead-firmware";

static CARRIED: OnceLock<&'static [u8]> = OnceLock::new();
/// The carried image in a file without a name, for QEMU.
static OPENED: OnceLock<File> = OnceLock::new();

/// Lets runs use this image where none is built. Call it first in `main`.
pub fn carry(image: &'static [u8]) {
    // An empty file stands for one that was not built.
    if !image.is_empty() {
        CARRIED.get_or_init(|| image);
    }
}

/// Finds the image: the given one; the built one in a target directory that holds this program or lies above
/// the working directory; the one that this program carries.
///
/// # Errors
/// There is none; the message says how to build it.
pub fn find_image(given: Option<&Path>) -> Result<PathBuf, BenchError> {
    if let Some(path) = given {
        let why = if path.is_file() {
            if is_arm_elf(path) {
                return Ok(path.to_owned());
            }
            "this is not an ARM ELF file; give the image that `cargo xtask build` makes"
        } else if path.exists() {
            "this is a directory, a device or a pipe; build the image with `cargo xtask build`"
        } else {
            "there is no such file; build the image with `cargo xtask build`"
        };
        let path = path.display();
        return Err(BenchError::Unfit(format!("--firmware {path}: {why}")));
    }
    // This program lies in the target directory itself, unless it was installed.
    let program = env::current_exe().unwrap_or_default();
    let here = env::current_dir().unwrap_or_default();
    let built_with = program.ancestors().map(|folder| folder.join(IMAGE));
    let above = here.ancestors().map(|folder| folder.join("target").join(IMAGE));
    let is_whole = |found: std::fs::Metadata| found.is_file() && found.len() > 0;
    let is_image = |path: &PathBuf| path.metadata().is_ok_and(is_whole);
    match built_with.chain(above).find(is_image) {
        Some(path) => Ok(path),
        None => carried(),
    }
}

/// True if a file begins like an ELF file for ARM. QEMU reads the rest, after the simulation.
fn is_arm_elf(path: &Path) -> bool {
    const MACHINE_ARM: [u8; 2] = [40, 0];
    let mut head = [0; 20];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut head));
    read.is_ok() && head.starts_with(b"\x7fELF") && head[18..] == MACHINE_ARM
}

/// The carried image, as a file without a name: nothing is left of it, however the program ends.
fn carried() -> Result<PathBuf, BenchError> {
    let Some(bytes) = CARRIED.get() else {
        return Err(BenchError::Unfit(format!(
            "the image {IMAGE} was not found in a target directory here or above, and this program carries none; \
             build it with `cargo xtask build`, or name one with --firmware"
        )));
    };
    let cannot = |error| BenchError::Unfit(format!("cannot keep the image in the temporary folder: {error}"));
    let file = match OPENED.get() {
        Some(file) => file,
        None => {
            let mut file = tempfile::tempfile().map_err(cannot)?;
            file.write_all(bytes).map_err(cannot)?;
            OPENED.get_or_init(|| file)
        }
    };
    Ok(link(file))
}

/// A path by which every process of this user can open the file while this one runs.
fn link(file: &File) -> PathBuf {
    use std::os::fd::AsRawFd;
    format!("/proc/{}/fd/{}", process::id(), file.as_raw_fd()).into()
}

/// The bytes that a part with this image has in flash from `address`. Where the image has nothing, flash is
/// erased. `None` if the file is no image, or has nothing there.
pub fn flash_bytes(image: &Path, address: u32, bytes: u32) -> Option<Vec<u8>> {
    use object::elf::{FileHeader32, PT_LOAD};
    use object::read::elf::{FileHeader, ProgramHeader};
    let file = std::fs::read(image).ok()?;
    let header = FileHeader32::<object::Endianness>::parse(&*file).ok()?;
    let endian = header.endian().ok()?;
    let wanted = u64::from(address)..u64::from(address) + u64::from(bytes);
    let mut flash = vec![0xff; bytes as usize];
    let mut found = false;
    for segment in header.program_headers(endian, &*file).ok()? {
        let start = u64::from(segment.p_paddr(endian));
        if segment.p_type(endian) != PT_LOAD || !wanted.contains(&start) {
            continue;
        }
        let data = segment.data(endian, &*file).ok()?;
        let place = (start - wanted.start) as usize;
        let length = data.len().min(flash.len() - place);
        flash[place..place + length].copy_from_slice(&data[..length]);
        found |= length > 0;
    }
    found.then_some(flash)
}

/// The place of an image, for messages.
pub fn shown(image: &Path) -> String {
    named(image, |path| path.display().to_string())
}

/// The name of an image without its folder: a recording holds nothing of the computer that made it.
pub(crate) fn file_name(image: &Path) -> String {
    let name = |path: &Path| path.file_name().unwrap_or_default().display().to_string();
    named(image, name)
}

fn named(image: &Path, name: impl Fn(&Path) -> String) -> String {
    match OPENED.get().map(link) {
        Some(carried) if carried == image => "carried by bead".to_owned(),
        _ => name(image),
    }
}
