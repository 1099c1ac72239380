//! Reads files made by tests.

use crate::{Choice, Waveform};

/// Reads a file with these bytes. In an error, `F` stands for its path.
pub(crate) fn read(bytes: impl AsRef<[u8]>, choice: &Choice) -> Result<Waveform, String> {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    let waveform = Waveform::read(file.path(), choice, None);
    waveform.map_err(|error| error.to_string().replace(&*file.path().to_string_lossy(), "F"))
}
