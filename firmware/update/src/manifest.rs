//! The signed statement that comes before an image: its board, version, length and hash.
//!
//! # Design
//! ```text
//! "bead-image-1" | board, 24 bytes | version, 24 bytes | length u32 | SHA-512 of the image | Ed25519
//! signature
//! ```
//!
//! The signature (RFC 8032) is over all bytes before it. As the hash of the image is among them, it covers
//! the image too. So a bead can refuse an image before anything is erased, and refuse any other bytes before
//! they are tried. The block is at the end of the image's ELF file, like the signature of a Linux module.

use core::str;

use salty::{Keypair, PublicKey, Sha512, Signature};

/// Bytes that are signed.
const SIGNED: usize = NAME.len() + 2 * TEXT + 4 + HASH;
/// Bytes of a signed manifest.
pub const MANIFEST: usize = SIGNED + SIGNATURE;
/// Longest board and version, bytes.
pub const TEXT: usize = 24;
/// Bytes of a hash.
pub const HASH: usize = 64;
const SIGNATURE: usize = 64;
/// First bytes. A different layout has a different number.
pub const NAME: &[u8; 12] = b"bead-image-1";

/// Seed of the development key. It is in the repository, so a signature with that key proves nothing. An
/// owner who wants nobody else to update a bead builds the image with a public key of their own
/// (`BEAD_UPDATE_KEY`).
pub const DEVELOPMENT_SEED: [u8; 32] = *b"development key: no protection. ";

/// Public part of the development key.
pub const DEVELOPMENT_KEY: [u8; 32] = [
    0xad, 0x34, 0x3d, 0x0e, 0xd0, 0x8c, 0x1d, 0xba, 0x74, 0xed, 0x13, 0xbd, 0xbb, 0xa1, 0xf4, 0xf4, 0x41,
    0xf6, 0x8b, 0x44, 0xe2, 0x63, 0xd3, 0x6e, 0x5b, 0x0e, 0x7c, 0x08, 0x82, 0xda, 0x53, 0xea,
];

/// A statement about an image, without its signature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Manifest<'a> {
    /// Name of the board that it is built for.
    pub board: &'a str,
    /// Version of its package.
    pub version: &'a str,
    /// Bytes of the image.
    pub length: u32,
    /// SHA-512 of them.
    pub hash: [u8; HASH],
}

/// Reason why bytes are not a valid manifest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ManifestError {
    /// The bytes do not begin or end like a manifest.
    Form,
    /// It is not signed with the key.
    Unsigned,
}

impl<'a> Manifest<'a> {
    /// The manifest with its signature, by the key derived from this seed; `None` for a name or a version
    /// that is too long.
    pub fn signed(&self, seed: &[u8; 32]) -> Option<[u8; MANIFEST]> {
        let mut bytes = [0; MANIFEST];
        let (signed, signature) = bytes.split_at_mut(SIGNED);
        let (name, rest) = signed.split_at_mut(NAME.len());
        name.copy_from_slice(NAME);
        let (board, rest) = rest.split_at_mut(TEXT);
        board
            .get_mut(..self.board.len())?
            .copy_from_slice(self.board.as_bytes());
        let (version, rest) = rest.split_at_mut(TEXT);
        version
            .get_mut(..self.version.len())?
            .copy_from_slice(self.version.as_bytes());
        let (length, hash) = rest.split_at_mut(4);
        length.copy_from_slice(&self.length.to_le_bytes());
        hash.copy_from_slice(&self.hash);
        signature.copy_from_slice(&Keypair::from(seed).sign(signed).to_bytes());
        Some(bytes)
    }

    /// Reads a manifest without checking its signature.
    ///
    /// # Errors
    /// [`ManifestError::Form`].
    pub fn read(bytes: &'a [u8]) -> Result<Self, ManifestError> {
        let bytes: &[u8; MANIFEST] = bytes.try_into().map_err(|_| ManifestError::Form)?;
        let (name, rest) = bytes.split_at(NAME.len());
        if name != NAME {
            return Err(ManifestError::Form);
        }
        let (board, rest) = rest.split_at(TEXT);
        let (version, rest) = rest.split_at(TEXT);
        let (length, rest) = rest.split_at(4);
        let hash = rest[..HASH].try_into();
        Ok(Self {
            board: text(board)?,
            version: text(version)?,
            length: u32::from_le_bytes(length.try_into().map_err(|_| ManifestError::Form)?),
            hash: hash.map_err(|_| ManifestError::Form)?,
        })
    }

    /// Reads a manifest that is signed with the key whose public part this is.
    ///
    /// # Errors
    /// See [`ManifestError`].
    // Never inlined: it takes some KB of stack, which its caller need not hold.
    #[inline(never)]
    pub fn verified(bytes: &'a [u8], key: &[u8; 32]) -> Result<Self, ManifestError> {
        let manifest = Self::read(bytes)?;
        let (signed, signature) = bytes.split_at(SIGNED);
        let signature: [u8; SIGNATURE] = signature.try_into().map_err(|_| ManifestError::Form)?;
        let key = PublicKey::try_from(key).map_err(|_| ManifestError::Unsigned)?;
        key.verify(signed, &Signature::from(&signature))
            .map_err(|_| ManifestError::Unsigned)?;
        Ok(manifest)
    }
}

/// Text padded with zeros.
fn text(bytes: &[u8]) -> Result<&str, ManifestError> {
    let length = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    let (text, zeros) = bytes.split_at(length);
    match str::from_utf8(text) {
        Ok(text) if zeros.iter().all(|byte| *byte == 0) && text.chars().all(|c| c.is_ascii_graphic()) => {
            Ok(text)
        }
        _ => Err(ManifestError::Form),
    }
}

/// The public part of the key derived from this seed.
pub fn public_key(seed: &[u8; 32]) -> [u8; 32] {
    Keypair::from(seed).public.to_bytes()
}

/// The hash of an image.
pub fn hash(image: &[u8]) -> [u8; HASH] {
    let mut sha = Sha512::new();
    sha.update(image);
    sha.finalize()
}

/// The three numbers of a version, for comparison; what follows them does not count. `None` for a text that
/// does not begin with them.
pub fn numbers(version: &str) -> Option<[u32; 3]> {
    let end = version.find(['-', '+']).unwrap_or(version.len());
    let mut parts = version[..end].split('.').map(|part| part.parse().ok());
    let numbers = [parts.next()??, parts.next()??, parts.next()??];
    parts.next().is_none().then_some(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MANIFEST_OF_AN_IMAGE: Manifest<'_> = Manifest {
        board: "stm32f405rg",
        version: "0.1.0",
        length: 180_000,
        hash: [7; HASH],
    };

    #[test]
    fn a_manifest_is_taken_with_its_own_key_only_and_as_it_was_signed() {
        let bytes = MANIFEST_OF_AN_IMAGE.signed(&DEVELOPMENT_SEED).unwrap();
        let key = public_key(&DEVELOPMENT_SEED);
        assert_eq!(key, DEVELOPMENT_KEY);
        assert_eq!(Manifest::verified(&bytes, &key), Ok(MANIFEST_OF_AN_IMAGE));
        let other = public_key(&[1; 32]);
        assert_eq!(Manifest::verified(&bytes, &other), Err(ManifestError::Unsigned));
        for at in 0..MANIFEST {
            let mut changed = bytes;
            changed[at] ^= 1;
            assert!(Manifest::verified(&changed, &key).is_err(), "byte {at}");
        }
        assert_eq!(Manifest::read(&bytes[1..]), Err(ManifestError::Form));
    }

    #[test]
    fn the_hash_is_sha_512() {
        // FIPS 180-4: the first eight bytes for "abc".
        assert_eq!(
            hash(b"abc")[..8],
            [0xdd, 0xaf, 0x35, 0xa1, 0x93, 0x61, 0x7a, 0xba]
        );
    }

    #[test]
    fn versions_are_compared_by_their_numbers() {
        let ordered = ["0.1.0", "0.1.9", "0.1.10", "0.2.0", "1.0.0", "10.0.0"];
        assert!(ordered.is_sorted_by(|a, b| numbers(a) < numbers(b)));
        assert_eq!(numbers("1.2.3-rc1"), Some([1, 2, 3]));
        for odd in ["", "1.2", "1.2.3.4", "a.b.c", "1.2.-3", "99999999999.0.0"] {
            assert_eq!(numbers(odd), None, "{odd}");
        }
    }
}
