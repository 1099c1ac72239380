//! The shared object that QEMU loads: finds it, and makes a copy of it for one version of QEMU.

use std::borrow::Cow;
use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::SystemTime;

use object::{Object, ObjectSection, ObjectSymbol};

use super::error::RunError;

const VERSION_SYMBOL: &str = "qemu_plugin_version";

/// The overlay embedded in this program.
static CARRIED: OnceLock<&'static [u8]> = OnceLock::new();

/// Makes runs use this overlay: see [`carry_overlay!`](crate::carry_overlay).
#[doc(hidden)]
pub fn carry(overlay: &'static [u8]) {
    // An empty file marks an overlay that was not built, in `cargo check`.
    if !overlay.is_empty() {
        CARRIED.get_or_init(|| overlay);
    }
}

/// Embeds the overlay in a program, so that it runs wherever it is copied to or installed. Call this first in
/// `main`. The build script of the program's package sets `STM32F405_QEMU_BUILT` to the path of the overlay:
/// see `build.rs`, which does so for this crate's own examples.
#[macro_export]
macro_rules! carry_overlay {
    () => {
        $crate::carry(include_bytes!(env!("STM32F405_QEMU_BUILT")))
    };
}

pub(super) struct OverlayFile {
    /// Origin of the bytes, for messages.
    place: PathBuf,
    bytes: Cow<'static, [u8]>,
}

/// Finds the overlay: the one named, else the one in `STM32F405_QEMU_OVERLAY`, else the embedded one, else
/// the newest build in some folders. These are the folder of this executable, its `deps` folder (where cargo
/// puts the overlay), the folder above (for tests, which run from `deps`) and the `deps` folder there (for
/// examples).
///
/// # Errors
/// [`RunError::OverlayMissing`] and [`RunError::OverlayOdd`].
pub(super) fn find(named: Option<&Path>) -> Result<OverlayFile, RunError> {
    let named = named.map(Path::to_path_buf);
    let named = named.or_else(|| std::env::var_os("STM32F405_QEMU_OVERLAY").map(PathBuf::from));
    if named.is_none()
        && let Some(bytes) = CARRIED.get()
    {
        let place = std::env::current_exe().unwrap_or_default();
        let bytes = Cow::Borrowed(*bytes);
        return Ok(OverlayFile { place, bytes });
    }
    let place = find_file(named)?;
    let bytes = std::fs::read(&place).map_err(|e| RunError::OverlayOdd(place.clone(), e.to_string()))?;
    let bytes = bytes.into();
    Ok(OverlayFile { place, bytes })
}

fn find_file(named: Option<PathBuf>) -> Result<PathBuf, RunError> {
    let stem = format!("{DLL_PREFIX}stm32f405_qemu");
    let file = format!("{stem}{DLL_SUFFIX}");
    if let Some(named) = named {
        let found = named.is_file();
        return if found {
            Ok(named)
        } else {
            Err(RunError::OverlayMissing(file, vec![named]))
        };
    }
    let exe = std::env::current_exe().unwrap_or_default();
    let folder = exe.parent().unwrap_or(Path::new("."));
    let mut looked = vec![folder.into(), folder.join("deps")];
    if let Some(above) = folder.parent() {
        looked.extend([above.into(), above.join("deps")]);
    }
    // If the overlay is built only as a dependency, cargo leaves an old build beside the executable.
    let built = |path: &PathBuf| {
        let modified = path.metadata().and_then(|metadata| metadata.modified());
        modified.unwrap_or(SystemTime::UNIX_EPOCH)
    };
    // Cargo adds a hash to the name where this crate comes from a registry or from git.
    let is_overlay = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let rest = name
            .strip_prefix(&stem)
            .and_then(|rest| rest.strip_suffix(DLL_SUFFIX));
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('-'))
            && path.metadata().is_ok_and(|m| m.is_file() && m.len() > 0)
    };
    let found = looked
        .iter()
        .filter_map(|folder| std::fs::read_dir(folder).ok())
        .flat_map(|entries| entries.flatten().map(|entry| entry.path()))
        .filter(is_overlay)
        .max_by_key(built);
    found.ok_or(RunError::OverlayMissing(file, looked))
}

/// The overlay's bytes with its `qemu_plugin_version` set. QEMU loads only a plugin built for its own
/// interface version. The functions used are the same in all versions.
///
/// # Errors
/// [`RunError::OverlayOdd`].
pub(super) fn with_version(overlay: &OverlayFile, version: i32) -> Result<Vec<u8>, RunError> {
    let odd = |reason: String| RunError::OverlayOdd(overlay.place.clone(), reason);
    let mut bytes = overlay.bytes.to_vec();
    let at = version_offset(&bytes).map_err(odd)?;
    let place = bytes.get_mut(at..at + size_of::<i32>());
    let place = place.ok_or_else(|| odd(format!("{VERSION_SYMBOL} is past the end of the file")))?;
    place.copy_from_slice(&version.to_ne_bytes());
    Ok(bytes)
}

/// Position of the version constant in the file.
fn version_offset(bytes: &[u8]) -> Result<usize, String> {
    let file = object::File::parse(bytes).map_err(|e| e.to_string())?;
    let symbol = file.dynamic_symbols().find(|s| s.name() == Ok(VERSION_SYMBOL));
    let symbol = symbol.ok_or_else(|| format!("it does not export {VERSION_SYMBOL}"))?;
    let section = symbol.section_index().and_then(|i| file.section_by_index(i).ok());
    let section = section.ok_or_else(|| format!("{VERSION_SYMBOL} is in no section"))?;
    let range = section.file_range();
    let (start, _) = range.ok_or_else(|| format!("{VERSION_SYMBOL} has no bytes in the file"))?;
    Ok((start + symbol.address() - section.address()) as usize)
}
