//! Reception of an image in pieces.

use embedded_storage::nor_flash::NorFlash;
use salty::Sha512;

use crate::manifest::{HASH, Manifest, ManifestError, numbers};
use crate::swap::Images;

/// Reason for refusing an image, or a piece of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The bytes are no manifest.
    NoManifest,
    /// It is not signed with the key of this bead.
    Unsigned,
    /// It is for another board.
    Board,
    /// It is older than the one that runs.
    Older,
    /// It is too long, or has no bytes.
    Length,
    /// No image was announced.
    NotBegun,
    /// The piece lies beyond the end that was announced, or is no whole number of words.
    Place,
    /// Other bytes are already there.
    Differs,
    /// The bytes are not the image that the manifest announced.
    NotThatImage,
    /// The flash fails.
    Flash,
}

/// Conditions that an image has to meet.
#[derive(Clone, Copy, Debug)]
pub struct Expected<'a> {
    /// Public key of those who may sign.
    pub key: &'a [u8; 32],
    /// The board.
    pub board: &'a str,
    /// The version that runs.
    pub version: &'a str,
    /// Longest image, bytes.
    pub capacity: u32,
}

impl Expected<'_> {
    /// Judges an image by its manifest. Nothing is changed.
    ///
    /// # Errors
    /// The reason for refusing it. With `older`, an older image is accepted.
    pub fn judge<'m>(&self, manifest: &'m [u8], older: bool) -> Result<Manifest<'m>, Refusal> {
        let manifest = Manifest::verified(manifest, self.key).map_err(|error| match error {
            ManifestError::Form => Refusal::NoManifest,
            ManifestError::Unsigned => Refusal::Unsigned,
        })?;
        if manifest.board != self.board {
            return Err(Refusal::Board);
        }
        if manifest.length == 0 || manifest.length > self.capacity {
            return Err(Refusal::Length);
        }
        if !older && numbers(manifest.version) < numbers(self.version) {
            return Err(Refusal::Older);
        }
        Ok(manifest)
    }
}

/// An announced image. Its pieces may come in any order, and more than once.
#[derive(Debug)]
pub struct Reception {
    length: u32,
    hash: [u8; HASH],
}

/// Bytes of a word.
const WORD: usize = 4;

impl Reception {
    /// Erases room for the image of this manifest, which was judged.
    ///
    /// # Errors
    /// The flash fails.
    pub fn begin<F: NorFlash, const PAGE: usize>(
        images: &Images<F>,
        manifest: &Manifest<'_>,
    ) -> Result<Self, Refusal> {
        images
            .erase::<PAGE>(manifest.length)
            .map_err(|_| Refusal::Flash)?;
        Ok(Self {
            length: manifest.length,
            hash: manifest.hash,
        })
    }

    /// Takes a piece. The last one may end within a word.
    ///
    /// # Errors
    /// The reason for refusing the piece.
    pub fn take<F: NorFlash>(&self, images: &Images<F>, offset: u32, piece: &[u8]) -> Result<(), Refusal> {
        let end = offset.checked_add(piece.len() as u32);
        let end = end.filter(|end| *end <= self.length).ok_or(Refusal::Place)?;
        if !offset.is_multiple_of(WORD as u32) || !(end.is_multiple_of(WORD as u32) || end == self.length) {
            return Err(Refusal::Place);
        }
        for (at, bytes) in (offset..).step_by(WORD).zip(piece.chunks(WORD)) {
            let mut word = [0xFF; WORD];
            word[..bytes.len()].copy_from_slice(bytes);
            if self.holds(images, at, word)? {
                continue;
            }
            if !self.holds(images, at, [0xFF; WORD])? {
                return Err(Refusal::Differs);
            }
            images.write(at, &word).map_err(|_| Refusal::Flash)?;
            if !self.holds(images, at, word)? {
                return Err(Refusal::Flash);
            }
        }
        Ok(())
    }

    fn holds<F: NorFlash>(&self, images: &Images<F>, at: u32, word: [u8; WORD]) -> Result<bool, Refusal> {
        let mut there = [0; WORD];
        images.read(at, &mut there).map_err(|_| Refusal::Flash)?;
        Ok(there == word)
    }

    /// Compares the received image with the signed hash, and lets the next start try it. It erases.
    ///
    /// # Errors
    /// The reason for refusing the image.
    pub fn finish<F: NorFlash>(&self, images: &Images<F>) -> Result<(), Refusal> {
        let mut sha = Sha512::new();
        let mut bytes = [0; 256];
        for offset in (0..self.length).step_by(bytes.len()) {
            let bytes = &mut bytes[..(self.length - offset).min(256) as usize];
            images.read(offset, bytes).map_err(|_| Refusal::Flash)?;
            sha.update(bytes);
        }
        if sha.finalize() != self.hash {
            return Err(Refusal::NotThatImage);
        }
        images.mark().map_err(|_| Refusal::Flash)
    }
}
