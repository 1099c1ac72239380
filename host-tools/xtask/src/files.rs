//! Files: all below a folder, read and written with errors that name them.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::step::Stop;

/// All files below `dir`. A file or folder that `keep` refuses is left out.
pub(crate) fn below(dir: &Path, keep: &dyn Fn(&Path) -> bool) -> io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(dir)? {
        let path = entry?.path();
        match keep(&path) {
            true if path.is_dir() => files.extend(below(&path, keep)?),
            true => files.push(path),
            false => {}
        }
    }
    Ok(files)
}

/// The files below `root` whose names end so, with their text.
pub(crate) fn texts(root: &Path, ending: &str) -> Result<Vec<(PathBuf, String)>, Stop> {
    let keep = |path: &Path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        match path.is_dir() {
            // Build directories hold the files of others; they are marked so (bford.info/cachedir).
            true => !name.starts_with('.') && !path.join("CACHEDIR.TAG").exists(),
            false => name.ends_with(ending),
        }
    };
    let files = below(root, &keep);
    let files = files.map_err(|error| Stop::failed(format!("{}: {error}", root.display())))?;
    files
        .into_iter()
        .map(|path| Ok((path.clone(), read(&path)?)))
        .collect()
}

/// The text of a file.
pub(crate) fn read(path: &Path) -> Result<String, Stop> {
    fs::read_to_string(path).map_err(|error| Stop::failed(format!("cannot read {}: {error}", path.display())))
}

/// Writes a file and the folders that it needs, unless its bytes are there already: cargo does not compile a
/// file again that did not change.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if fs::read(path).is_ok_and(|old| old == bytes) {
        return Ok(());
    }
    fs::create_dir_all(path.parent().unwrap_or(path))?;
    fs::write(path, bytes)
}
