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
        if !keep(&path) {
            continue;
        }
        if path.is_dir() {
            files.extend(below(&path, keep)?);
        } else {
            files.push(path);
        }
    }
    Ok(files)
}

/// The files below `root` whose names end so, with their text.
pub(crate) fn texts(root: &Path, ending: &str) -> Result<Vec<(PathBuf, String)>, Stop> {
    let keep = |path: &Path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if !path.is_dir() {
            return name.ends_with(ending);
        }
        // Build directories hold the files of others; they are marked so (bford.info/cachedir).
        !name.starts_with('.') && !path.join("CACHEDIR.TAG").exists()
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

/// Copies the sources: no hidden entries but cargo's, nothing built.
pub(crate) fn copy_tree(from: &Path, to: &Path) -> std::io::Result<()> {
    let is_source = |path: &Path| {
        let name = path.file_name().unwrap_or_default();
        let hidden = name.to_string_lossy().starts_with('.') && name != ".cargo";
        !hidden && name != "target" && path != from.join("figures")
    };
    for path in below(from, &is_source)? {
        let goal = to.join(path.strip_prefix(from).unwrap_or(&path));
        write(&goal, &std::fs::read(path)?)?;
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
            write(&from.path().join(name), b"a").unwrap();
        }
        copy_tree(from.path(), to.path()).unwrap();
        let there = |name: &&str| to.path().join(name).exists();
        assert!(sources.iter().all(there) && !others.iter().any(there));
    }
}
