//! Files: all below a folder, read and written with errors that name them.

use std::fmt::Display;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::step::Stop;

/// The error of something that cannot be done to a file or folder.
pub(crate) fn cannot<E: Display>(action: &str, path: &Path) -> impl Fn(E) -> Stop {
    move |error| Stop::failed(format!("cannot {action} {}: {error}", path.display()))
}

/// The files and folders in a folder, in the order of their names.
pub(crate) fn entries(folder: &Path) -> Result<Vec<PathBuf>, Stop> {
    let read = || {
        fs::read_dir(folder)?
            .map(|entry| Ok(entry?.path()))
            .collect::<io::Result<Vec<_>>>()
    };
    let mut entries = read().map_err(cannot("read", folder))?;
    entries.sort();
    Ok(entries)
}

/// All files below `dir`. A file or folder that `keep` refuses is left out.
pub(crate) fn below(dir: &Path, keep: &dyn Fn(&Path) -> bool) -> Result<Vec<PathBuf>, Stop> {
    let mut files = Vec::new();
    for path in entries(dir)?.into_iter().filter(|path| keep(path)) {
        if path.is_dir() {
            files.extend(below(&path, keep)?);
        } else {
            files.push(path);
        }
    }
    Ok(files)
}

/// The files below `root` whose names have this ending, with their text.
pub(crate) fn texts(root: &Path, ending: &str) -> Result<Vec<(PathBuf, String)>, Stop> {
    let keep = |path: &Path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if !path.is_dir() {
            return name.ends_with(ending);
        }
        // Build directories hold the files of others; this file marks them (bford.info/cachedir).
        !name.starts_with('.') && !path.join("CACHEDIR.TAG").exists()
    };
    let files = below(root, &keep)?.into_iter();
    files.map(|path| read(&path).map(|text| (path, text))).collect()
}

/// The text of a file.
pub(crate) fn read(path: &Path) -> Result<String, Stop> {
    fs::read_to_string(path).map_err(cannot("read", path))
}

/// The bytes of a file.
pub(crate) fn bytes(path: &Path) -> Result<Vec<u8>, Stop> {
    fs::read(path).map_err(cannot("read", path))
}

/// Makes a folder and those above it.
pub(crate) fn make(folder: &Path) -> Result<(), Stop> {
    fs::create_dir_all(folder).map_err(cannot("make", folder))
}

/// Writes a file and the folders that it needs, unless its bytes are there already: cargo does not compile a
/// file again that did not change.
pub(crate) fn write(path: &Path, text: impl AsRef<[u8]>) -> Result<(), Stop> {
    if fs::read(path).is_ok_and(|old| old == text.as_ref()) {
        return Ok(());
    }
    make(path.parent().unwrap_or(path))?;
    fs::write(path, text).map_err(cannot("write", path))
}

/// Copies a file, into folders that are made if they are missing.
pub(crate) fn copy(from: &Path, to: &Path) -> Result<(), Stop> {
    make(to.parent().unwrap_or(to))?;
    fs::copy(from, to).map(drop).map_err(cannot("write", to))
}

/// Copies the sources: no hidden entries but cargo's, nothing built.
pub(crate) fn copy_tree(from: &Path, to: &Path) -> Result<(), Stop> {
    let is_source = |path: &Path| {
        let name = path.file_name().unwrap_or_default();
        let hidden = name.to_string_lossy().starts_with('.') && name != ".cargo";
        !hidden && name != "target" && path != from.join("figures")
    };
    for path in below(from, &is_source)? {
        let goal = to.join(path.strip_prefix(from).unwrap_or(&path));
        write(&goal, bytes(&path)?)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copy_holds_the_source_and_nothing_built() {
        let (from, to) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let sources = ["src/a.rs", ".cargo/config.toml", "Cargo.lock"];
        let others = ["target/a", ".git/a", "figures/a.svg"];
        for name in sources.iter().chain(&others) {
            write(&from.path().join(name), "a").unwrap();
        }
        copy_tree(from.path(), to.path()).unwrap();
        let there = |name: &&str| to.path().join(name).exists();
        assert!(sources.iter().all(there) && !others.iter().any(there));
    }
}
