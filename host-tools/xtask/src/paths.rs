//! Keeps the paths of this machine out of the flash image.
//!
//! # Design
//! A panic names its source file, and the compiler writes the file's path into flash: for a dependency, below
//! the home of the person that builds. So two people would get two images of one commit, each with a name in
//! it. The compiler can write a shorter path for each of these folders, but cargo cannot express "the folder
//! that I am in" yet. So the folders are written into a file, which `.cargo/config.toml` includes: every
//! cargo of this workspace then builds the same image, `cargo xtask` or not.

use std::fs;
use std::path::{Path, PathBuf};

use crate::files::write;
use crate::setup::{TARGET, output};
use crate::step::{Steps, Stop};

/// Path at which cargo looks for the file; git ignores it.
pub(crate) const FILE: &str = ".cargo/paths.toml";

/// Writes the file for these steps and this home of cargo, unless it is right already.
pub(crate) fn leave_out(steps: &Steps, home: Option<&Path>) -> Result<(), Stop> {
    write(&steps.root.join(FILE), config(&folders(steps, home)))
}

/// Folders and their replacements. Of two that match, the compiler takes the later one.
fn folders(steps: &Steps, home: Option<&Path>) -> Vec<(PathBuf, String)> {
    let mut folders = Vec::new();
    if let Some(home) = home {
        let sources = home.join("registry/src");
        folders.push((home.to_owned(), "cargo".to_owned()));
        // One for each registry; mirrors have names of their own. The version is in the name of the crate's
        // folder.
        let entries = fs::read_dir(sources).into_iter().flatten().flatten();
        let mut registries: Vec<_> = entries.map(|entry| entry.path()).collect();
        registries.sort();
        folders.extend(registries.into_iter().map(|path| (path, "crates".to_owned())));
    }
    // The standard library's sources, if they are installed, under the name that they have where they are
    // not.
    let verbose = output("rustc -vV").unwrap_or_default();
    let commit = verbose
        .lines()
        .find_map(|line| line.strip_prefix("commit-hash: "));
    if let (Some(sysroot), Some(commit)) = (output("rustc --print sysroot"), commit) {
        let sources = Path::new(&sysroot).join("lib/rustlib/src/rust");
        folders.push((sources, format!("/rustc/{commit}")));
    }
    folders.push((steps.root.clone(), ".".to_owned()));
    folders.push((steps.target.clone(), "target".to_owned()));
    let resolved = |(path, name): (PathBuf, String)| {
        // The compiler asks the system for the folder that it runs in, which resolves links; cargo does not.
        let resolved = fs::canonicalize(&path).ok().filter(|resolved| *resolved != path);
        [resolved.map(|path| (path, name.clone())), Some((path, name))]
    };
    folders.into_iter().flat_map(resolved).flatten().collect()
}

/// The folder that cargo keeps its registries in.
pub(crate) fn cargo_home() -> Option<PathBuf> {
    let set = |name| std::env::var_os(name).map(PathBuf::from);
    set("CARGO_HOME").or_else(|| Some(set("HOME")?.join(".cargo")))
}

fn config(folders: &[(PathBuf, String)]) -> String {
    let mut text = format!(
        "# Written by `cargo xtask`: folders of this machine, which the image shall not name.\n[target.{TARGET}]\nrustflags = [\n"
    );
    for (folder, name) in folders {
        let folder = folder.to_string_lossy();
        // A TOML string without escapes; a path with both kinds of quotes stays in the image.
        let quote = if folder.contains('\'') { '"' } else { '\'' };
        if !folder.contains(quote) && !folder.contains('\\') {
            text += &format!("    {quote}--remap-path-prefix={folder}={name}{quote},\n");
        }
    }
    text + "]\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_behind_a_link_is_left_out_by_both_of_its_names() {
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (folder.path().join("real"), folder.path().join("link"));
        fs::create_dir_all(real.join("registry/src/mirror")).unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        let folders = folders(&Steps::start().unwrap(), Some(&link));
        for home in [real, link] {
            let sources = home.join("registry/src/mirror");
            assert!(folders.contains(&(home, "cargo".to_owned())), "{folders:?}");
            assert!(folders.contains(&(sources, "crates".to_owned())), "{folders:?}");
        }
    }

    #[test]
    fn each_folder_has_a_line_whatever_is_in_its_name() {
        let folders =
            ["/home/a b/.cargo", "/it's", "/both'\""].map(|path| (PathBuf::from(path), "x".to_owned()));
        let text = config(&folders);
        let (_, flags) = text.split_once("rustflags = ").unwrap();
        let plain = "    '--remap-path-prefix=/home/a b/.cargo=x',\n";
        let quoted = "    \"--remap-path-prefix=/it's=x\",\n";
        assert_eq!(flags, format!("[\n{plain}{quoted}]\n"));
    }
}
