//! The file with the key of a bead.
//!
//! One line of 32 hexadecimal digits, for its owner's eyes only.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use bead_wire::{KEY, Key};
use rand::TryRng;

/// Bytes that are read of a file: more than a key has.
const LONGEST: u64 = 256;

/// Why there is no key. One line: what, why, what next.
#[derive(Debug, thiserror::Error)]
pub enum KeyError {
    /// The file cannot be read.
    #[error("cannot read the key in {path}: {source}")]
    Unread {
        /// The file.
        path: String,
        /// Error of the system.
        source: io::Error,
    },
    /// The file has something else in it.
    #[error("{path} is no key: give a file of {} hexadecimal digits, as `bead settings key --new` writes it", 2 * KEY)]
    NoKey {
        /// The file.
        path: String,
    },
    /// The file cannot be made.
    #[error("cannot keep a new key in {path}: {source}; {advice}")]
    Unwritten {
        /// The file.
        path: String,
        /// Error of the system.
        source: io::Error,
        /// Advice.
        advice: &'static str,
    },
}

/// Reads a key.
///
/// # Errors
/// The file cannot be read, or has no key in it.
pub fn read(path: &Path) -> Result<Key, KeyError> {
    let named = || path.display().to_string();
    let mut bytes = Vec::new();
    // A key and some blanks; what is longer is none, and is not read to its end.
    File::open(path)
        .and_then(|file| file.take(LONGEST).read_to_end(&mut bytes))
        .map_err(|source| KeyError::Unread {
            path: named(),
            source,
        })?;
    let text = str::from_utf8(&bytes).unwrap_or_default();
    parse(text.trim()).ok_or_else(|| KeyError::NoKey { path: named() })
}

fn parse(digits: &str) -> Option<Key> {
    let whole = digits.len() == 2 * KEY && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    let mut bytes = [0; KEY];
    for (at, byte) in bytes.iter_mut().enumerate() {
        *byte = u8::from_str_radix(digits.get(2 * at..2 * at + 2).filter(|_| whole)?, 16).ok()?;
    }
    Key::new(bytes)
}

/// Makes a key of the system's randomness and keeps it in a new file that only its owner can read.
///
/// # Errors
/// The file is there already, or cannot be written.
pub fn create(path: &Path) -> Result<Key, KeyError> {
    let unwritten = |source: io::Error| KeyError::Unwritten {
        path: path.display().to_string(),
        advice: match source.kind() {
            io::ErrorKind::AlreadyExists => "a key takes no other file's place: give another name",
            io::ErrorKind::NotFound => "make its folder first, or give a name in one that is there",
            io::ErrorKind::PermissionDenied => "give a name in a folder that you may write to",
            io::ErrorKind::StorageFull => "make room on the disk, or give a name on another",
            _ => "give another name",
        },
        source,
    };
    let mut bytes = [0; KEY];
    rand::rngs::SysRng
        .try_fill_bytes(&mut bytes)
        .map_err(|error| unwritten(io::Error::other(error)))?;
    let key = Key::new(bytes).ok_or_else(|| unwritten(io::Error::other("the system gave zeros")))?;
    let digits: String = key.bytes().iter().map(|byte| format!("{byte:02x}")).collect();
    let mut options = OpenOptions::new();
    let mut file = options
        .write(true)
        .create_new(true)
        .mode(0o600)
        .open(path)
        .map_err(unwritten)?;
    writeln!(file, "{digits}")
        .and_then(|()| file.sync_all())
        .map_err(unwritten)?;
    Ok(key)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn a_key_is_kept_for_its_owner_alone_and_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bead.key");
        let key = create(&path).unwrap();
        assert_eq!(read(&path).unwrap(), key);
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        assert_ne!(create(&folder.path().join("other.key")).unwrap(), key);
        let said = create(&path).unwrap_err().to_string();
        assert!(said.contains("takes no other file's place"), "{said}");
        assert_eq!(read(&path).unwrap(), key, "it is still there");
        let said = create(&folder.path().join("no/bead.key"))
            .unwrap_err()
            .to_string();
        assert!(said.contains("make its folder first"), "{said}");
        assert!(!said.contains("other file"), "{said}");
    }

    #[test]
    fn what_is_no_key_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("some.key");
        let wrong = [
            "",
            "00",
            &"0".repeat(32),
            &"g".repeat(32),
            &"1".repeat(33),
            &"é".repeat(16),
            &" ".repeat(1000),
        ];
        for text in wrong {
            fs::write(&path, text).unwrap();
            let said = read(&path).unwrap_err().to_string();
            assert!(
                said.contains("some.key is no key: give a file of 32"),
                "{text}: {said}"
            );
        }
        fs::write(&path, format!("  {}\n", "aF".repeat(16))).unwrap();
        assert_eq!(read(&path).unwrap().bytes(), &[0xAF; KEY]);
        assert!(read(&folder.path().join("none.key")).is_err());
        let said = read(Path::new("/dev/zero")).unwrap_err().to_string();
        assert!(said.contains("/dev/zero is no key"), "{said}");
    }
}
