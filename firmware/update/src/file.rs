//! The ELF file of an image, with its signed manifest at the end.

use std::format;
use std::string::String;
use std::vec::Vec;

use object::Endianness;
use object::elf::PT_LOAD;
use object::read::elf::{ElfFile32, ProgramHeader};

use crate::layout::{FLASH, Layout};
use crate::manifest::{MANIFEST, Manifest, ManifestError, NAME, hash};

/// Reason why a file is not an image that can be sent.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// No ELF file.
    #[error("this is not a 32-bit ELF file ({0})")]
    NotElf(String),
    /// No bytes in the place of an image.
    #[error("the file has no image at {:#010x}, behind a loader: it is older than updates over the line", FLASH + Layout::BEAD.active.start)]
    NoImage,
    /// More bytes than there is room for.
    #[error("the image has {0} bytes, but there is room for only {room}", room = Layout::BEAD.capacity())]
    TooLong(usize),
    /// Board or version is too long, or not plain text.
    #[error("`{0}` is not a valid board and version of an image")]
    Name(String),
    /// No manifest at the end.
    #[error("the image is not signed")]
    Unsigned,
    /// The manifest is that of another image.
    #[error("the image was changed after it was signed, or is cut short")]
    Changed,
}

/// An image that can be sent to a bead.
#[derive(Debug, Clone)]
pub struct UpdateFile {
    /// The image, as flash holds it.
    pub image: Vec<u8>,
    /// Its signed manifest.
    pub manifest: [u8; MANIFEST],
}

impl UpdateFile {
    /// Reads an ELF file. The bead itself checks the signature.
    ///
    /// # Errors
    /// See [`FileError`].
    pub fn read(file: &[u8]) -> Result<Self, FileError> {
        let image = image(file)?;
        let manifest = signature_of(file).ok_or(FileError::Unsigned)?;
        let read = Manifest::read(manifest).map_err(|_: ManifestError| FileError::Unsigned)?;
        if read.length as usize != image.len() || read.hash != hash(&image) {
            return Err(FileError::Changed);
        }
        Ok(Self {
            image,
            manifest: *manifest,
        })
    }
}

/// The manifest at the end of a file, if there is one.
fn signature_of(file: &[u8]) -> Option<&[u8; MANIFEST]> {
    file.last_chunk().filter(|last| last.starts_with(NAME))
}

/// Signs an ELF file. Returns it with its manifest at the end, in place of an earlier one.
///
/// # Errors
/// See [`FileError`].
pub fn sign(file: &[u8], board: &str, version: &str, seed: &[u8; 32]) -> Result<Vec<u8>, FileError> {
    let image = image(file)?;
    let manifest = Manifest {
        board,
        version,
        length: image.len() as u32,
        hash: hash(&image),
    };
    let signed = manifest.signed(seed);
    let signed = signed.filter(|signed| Manifest::read(signed).is_ok());
    let signed = signed.ok_or_else(|| FileError::Name(format!("{board} {version}")))?;
    let length = file.len() - signature_of(file).map_or(0, |_| MANIFEST);
    Ok([&file[..length], &signed].concat())
}

/// The image in an ELF file, as flash holds it: what a probe would put into the sectors of the active image.
fn image(file: &[u8]) -> Result<Vec<u8>, FileError> {
    let not_elf = |error: object::Error| FileError::NotElf(format!("{error}"));
    let elf = ElfFile32::<Endianness>::parse(file).map_err(not_elf)?;
    let endian = elf.endian();
    let active = Layout::BEAD.active;
    let mut image = Vec::new();
    for header in elf.elf_program_headers() {
        let place = header.p_paddr(endian).checked_sub(FLASH + active.start);
        let Some(place) = place.filter(|place| *place < active.len() as u32) else {
            continue;
        };
        let bytes = header.data(endian, file);
        let bytes = bytes.map_err(|()| FileError::NotElf("a segment is cut short".into()))?;
        let end = place as usize + bytes.len();
        if header.p_type(endian) != PT_LOAD || bytes.is_empty() {
            continue;
        }
        if end > active.len() {
            return Err(FileError::TooLong(end));
        }
        // Erased flash lies between segments.
        image.resize(image.len().max(end), 0xFF);
        image[place as usize..end].copy_from_slice(bytes);
    }
    if image.is_empty() {
        return Err(FileError::NoImage);
    }
    Ok(image)
}
