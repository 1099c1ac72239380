//! The file with the key of a bead.
//!
//! One line of 32 hexadecimal digits, readable only by its owner.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use bead_wire::{KEY, Key};
use rand::TryRng;

/// Greatest number of bytes read from a file, more than a key has.
const LONGEST: u64 = 256;

/// A key cannot be read or stored. The message is one line: what, why, what next.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct KeyError(String);

/// Reads a key.
///
/// # Errors
/// The file cannot be read, or holds something else.
pub fn read(path: &Path) -> Result<Key, KeyError> {
    let shown = path.display();
    let mut bytes = Vec::new();
    // A key and some blanks. A longer file holds no key and is not read to its end.
    File::open(path)
        .and_then(|file| file.take(LONGEST).read_to_end(&mut bytes))
        .map_err(|source| KeyError(format!("cannot read the key in {shown}: {source}")))?;
    let text = str::from_utf8(&bytes).unwrap_or_default();
    parse(text.trim()).ok_or_else(|| {
        let digits = 2 * KEY;
        KeyError(format!(
            "{shown} is not a key: give a file of {digits} hexadecimal digits, as `bead settings key --new` \
             writes it"
        ))
    })
}

fn parse(digits: &str) -> Option<Key> {
    let is_whole = digits.len() == 2 * KEY && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    let number = u128::from_str_radix(digits, 16).ok().filter(|_| is_whole)?;
    Key::new(number.to_be_bytes())
}

/// Makes a key from the system's randomness and stores it in a new file that only its owner can read.
///
/// # Errors
/// The file is there already, or cannot be written.
pub fn create(path: &Path) -> Result<Key, KeyError> {
    let unwritten = |source: io::Error| {
        let advice = match source.kind() {
            io::ErrorKind::AlreadyExists => "a new key replaces no other file: give another name",
            io::ErrorKind::NotFound => "make its folder first, or give a name in an existing folder",
            io::ErrorKind::PermissionDenied => "give a name in a folder that you may write to",
            io::ErrorKind::StorageFull => "make room on the disk, or give a name on another",
            _ => "give another name",
        };
        let shown = path.display();
        KeyError(format!("cannot write a new key to {shown}: {source}; {advice}"))
    };
    let mut bytes = [0; KEY];
    rand::rngs::SysRng
        .try_fill_bytes(&mut bytes)
        .map_err(|error| unwritten(io::Error::other(error)))?;
    let key = Key::new(bytes).ok_or_else(|| unwritten(io::Error::other("the random bytes are all zero")))?;
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
        let refused = |path: &Path| create(path).unwrap_err().to_string();
        assert!(refused(&path).contains("replaces no other file"));
        assert_eq!(read(&path).unwrap(), key, "it is still there");
        assert!(refused(&folder.path().join("no/bead.key")).ends_with("in an existing folder"));
    }

    #[test]
    fn a_file_without_a_key_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("some.key");
        let cases = [("", 1), ("00", 1), ("0", 32), ("g", 32), ("1", 33), ("é", 16)];
        for (text, count) in cases.into_iter().chain([(" ", 1000)]) {
            fs::write(&path, text.repeat(count)).unwrap();
            let message = read(&path).unwrap_err().to_string();
            let wanted = "some.key is not a key: give a file of 32";
            assert!(message.contains(wanted), "{text}: {message}");
        }
        fs::write(&path, format!("  {}\n", "aF".repeat(16))).unwrap();
        assert_eq!(read(&path).unwrap().bytes(), &[0xAF; KEY]);
        assert!(read(&folder.path().join("none.key")).is_err());
    }
}
