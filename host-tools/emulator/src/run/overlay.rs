//! The shared object that QEMU loads: where it is, and how a copy of it is made for one version of QEMU.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use object::{Object, ObjectSection, ObjectSymbol};

use super::error::RunError;

const VERSION_SYMBOL: &str = "qemu_plugin_version";

/// The overlay's path: the one named, else what `STM32F405_QEMU_OVERLAY` names, else the newest build in
/// three folders. These are the folder of this executable, its `deps` folder (where cargo puts the overlay),
/// and the folder above (for tests, which run from `deps`).
///
/// # Errors
/// [`RunError::OverlayMissing`].
pub(super) fn find(named: Option<&Path>) -> Result<PathBuf, RunError> {
    let file = format!(
        "{}stm32f405_qemu{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    );
    let named = named.map(Path::to_path_buf);
    if let Some(named) = named.or_else(|| std::env::var_os("STM32F405_QEMU_OVERLAY").map(PathBuf::from)) {
        return match named.is_file() {
            true => Ok(named),
            false => Err(RunError::OverlayMissing(file, vec![named])),
        };
    }
    let exe = std::env::current_exe().unwrap_or_default();
    let folder = exe.parent().unwrap_or(Path::new("."));
    let mut looked = vec![folder.into(), folder.join("deps")];
    looked.extend(folder.parent().map(Path::to_path_buf));
    // If the overlay is built only as a dependency, cargo leaves an old build beside the executable.
    let built = |path: &PathBuf| {
        path.metadata()
            .and_then(|m| m.modified())
            .unwrap_or(SystemTime::UNIX_EPOCH)
    };
    let found = looked
        .iter()
        .map(|l| l.join(&file))
        .filter(|p| p.is_file())
        .max_by_key(built);
    found.ok_or(RunError::OverlayMissing(file, looked))
}

/// The overlay's bytes with its `qemu_plugin_version` set. QEMU loads only what was built for its own
/// interface version. The functions used are the same in all versions.
///
/// # Errors
/// [`RunError::OverlayOdd`].
pub(super) fn with_version(path: &Path, version: i32) -> Result<Vec<u8>, RunError> {
    let odd = |reason: String| RunError::OverlayOdd(path.into(), reason);
    let mut bytes = std::fs::read(path).map_err(|e| odd(e.to_string()))?;
    let at = version_offset(&bytes).map_err(odd)?;
    bytes
        .get_mut(at..at + size_of::<i32>())
        .ok_or_else(|| odd(format!("{VERSION_SYMBOL} lies past its end")))?
        .copy_from_slice(&version.to_ne_bytes());
    Ok(bytes)
}

/// Where in the file the version constant lies.
fn version_offset(bytes: &[u8]) -> Result<usize, String> {
    let file = object::File::parse(bytes).map_err(|e| e.to_string())?;
    let symbol = file
        .dynamic_symbols()
        .find(|s| s.name() == Ok(VERSION_SYMBOL))
        .ok_or_else(|| format!("it does not export {VERSION_SYMBOL}"))?;
    let section = symbol
        .section_index()
        .and_then(|i| file.section_by_index(i).ok())
        .ok_or_else(|| format!("{VERSION_SYMBOL} is in no section"))?;
    let (start, _) = section
        .file_range()
        .ok_or_else(|| format!("{VERSION_SYMBOL} has no bytes in the file"))?;
    Ok((start + symbol.address() - section.address()) as usize)
}
