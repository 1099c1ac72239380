//! Files with the addresses that runs execute, if the environment requests them.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::PathBuf;

use super::error::{RunError, io};

/// The folder in which each run leaves a file `IMAGE.PROCESS.bits` of executed half-words, and `IMAGE.elf`, a
/// copy of its image.
const NAME: &str = "STM32F405_QEMU_COVERAGE";

/// The path of a run's file without its extension, with the image copied beside it. `None` if not requested.
///
/// # Errors
/// The folder cannot be written to.
pub(super) fn stem(image: &[u8]) -> Result<Option<PathBuf>, RunError> {
    let Some(folder) = std::env::var_os(NAME).filter(|folder| !folder.is_empty()) else {
        return Ok(None);
    };
    let mut hasher = DefaultHasher::new();
    image.hash(&mut hasher);
    let stem = PathBuf::from(folder).join(format!("{:016x}", hasher.finish()));
    let copy = stem.with_extension("elf");
    if !copy.exists() {
        let failed = io("cannot write to the folder that STM32F405_QEMU_COVERAGE names");
        // Parallel runs write the same bytes, so the final name is given only to a complete file.
        let part = stem.with_extension(format!("{}.part", std::process::id()));
        std::fs::write(&part, image)
            .and_then(|()| std::fs::rename(&part, &copy))
            .map_err(failed)?;
    }
    Ok(Some(stem))
}
