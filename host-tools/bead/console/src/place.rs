//! One rule for the place of every output of every command.
//!
//! # Design
//! An output never takes the place of an input, of another kind of file, or of anything but a file. It takes
//! the place of a file of its own kind only with `--overwrite`. All this is known before the work begins, and
//! so is whether the directory can be written to. [`Target`] then makes sure of the rest: a file is whole or
//! not there, and two programs that write one name do not lose a result.

use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

use anyhow::Context;
use clap::Args;

use crate::failure::Failure;
use crate::output;
use bead_tables::whole::{STANDARD_OUTPUT, Target};

/// `--overwrite`.
#[derive(Debug, Clone, Copy, Default, Args)]
pub struct Overwrite {
    /// Replace outputs of the same kind. Inputs and other files are never replaced.
    #[arg(long)]
    pub overwrite: bool,
}

impl Overwrite {
    /// The place of an output that may not have been asked for.
    ///
    /// # Errors
    /// As [`targets`].
    pub fn optional(
        self,
        path: Option<&Path>,
        kind: FileKind,
        inputs: &[&Path],
    ) -> Result<Option<Target>, Failure> {
        path.map(|path| target(path, kind, inputs, self)).transpose()
    }
}

/// The kinds of files that commands read and write.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "each is what it is called")]
pub enum FileKind {
    Recording,
    Parquet,
    Universal,
    Page,
    Drawing,
    Picture,
    Program,
    Archive,
    Settings,
    Key,
    Table,
    Text,
    Scenario,
    Json,
    Xml,
}

/// Each kind as messages name it, with the first bytes of its files and the endings of their names.
const KINDS: [(FileKind, &str, &[&[u8]], &str); 15] = [
    (
        FileKind::Recording,
        "a recording",
        &[b"\x89MCAP0\r\n"],
        "mcap partial",
    ),
    (FileKind::Parquet, "a Parquet file", &[b"PAR1"], "parquet"),
    (FileKind::Universal, "a UFF file", &[], "uff unv"),
    (FileKind::Page, "a web page", &[b"<!doctype html"], "html"),
    (FileKind::Drawing, "an SVG picture", &[b"<svg"], "svg"),
    (
        FileKind::Picture,
        "a picture",
        &[b"\x89PNG", b"GIF8", b"%PDF-"],
        "png gif jpg pdf",
    ),
    (FileKind::Program, "a program", &[b"\x7fELF"], "elf"),
    (FileKind::Archive, "an archive", &[b"\x1f\x8b", b"PK\x03\x04"], ""),
    (FileKind::Settings, "a settings block", &[b"BEAD"], "settings"),
    (FileKind::Key, "a key", &[], "key"),
    (FileKind::Table, "a CSV table", &[], "csv"),
    (FileKind::Text, "a text", &[], "md txt"),
    (FileKind::Scenario, "a TOML file", &[], "toml"),
    (FileKind::Json, "a JSON file", &[], "json"),
    (FileKind::Xml, "an XML file", &[b"<?xml"], "xml"),
];

impl FileKind {
    fn name(self) -> &'static str {
        let described = KINDS.iter().find(|(kind, ..)| *kind == self);
        described.map_or("", |(_, name, ..)| name)
    }

    /// The kind of an existing file: by its first bytes, else by its name. `None` if neither is known, or
    /// if the file is empty.
    fn of(path: &Path) -> Option<Self> {
        let mut head = Vec::new();
        // A file that cannot be read is judged by its name.
        let _ = File::open(path).and_then(|file| file.take(16).read_to_end(&mut head));
        if head.is_empty() && path.metadata().is_ok_and(|found| found.len() == 0) {
            return None;
        }
        let begins = |start: &&[u8]| {
            let begin = head.get(..start.len());
            begin.is_some_and(|begin| begin.eq_ignore_ascii_case(start))
        };
        let by_head = KINDS.iter().find(|(_, _, heads, _)| heads.iter().any(begins));
        let by_name = || {
            let ending = path.extension()?.to_str()?.to_ascii_lowercase();
            KINDS
                .iter()
                .find(|(.., endings)| endings.split_whitespace().any(|end| end == ending))
        };
        by_head.or_else(by_name).map(|(kind, ..)| *kind)
    }
}

/// Refuses one name for two outputs of a command: the second would find the first in its place.
///
/// # Errors
/// Both are given, and are the same.
pub fn apart(one: Option<&Path>, other: Option<&Path>) -> Result<(), Failure> {
    match one {
        Some(one) if Some(one) == other && one != Path::new(STANDARD_OUTPUT) => bail!(
            Input,
            "{} is given for two outputs; give each a name of its own",
            one.display()
        ),
        _ => Ok(()),
    }
}

/// The file at `path` as a result of `kind`, or standard output for `-`. Call it before the work.
///
/// # Errors
/// As [`targets`].
pub fn target(
    path: &Path,
    kind: FileKind,
    inputs: &[&Path],
    overwrite: Overwrite,
) -> Result<Target, Failure> {
    let target = allowed(path, kind, inputs, overwrite)?;
    target.try_out()?;
    Ok(target)
}

/// Files in a directory that need not be there yet, each with its kind. Make the directory with
/// [`make_directory`] when there is something to write.
///
/// # Errors
/// A file is one of `inputs`, is no regular file, is of another kind, or exists and must not be
/// overwritten; or its directory is a file, or can neither be written to nor made.
pub fn targets<N: AsRef<str>>(
    directory: &Path,
    files: impl IntoIterator<Item = (N, FileKind)>,
    inputs: &[&Path],
    overwrite: Overwrite,
) -> Result<Vec<Target>, Failure> {
    let there = directory.ancestors().find(|folder| folder.exists());
    let there = there.filter(|there| !there.as_os_str().is_empty());
    let there = there.unwrap_or(Path::new("."));
    if !there.is_dir() {
        bail!(
            Input,
            "cannot make the directory {}: {} is a file; give another directory",
            directory.display(),
            there.display()
        );
    }
    Target::new(there.join("result")).try_out()?;
    let files = files.into_iter();
    files
        .map(|(name, kind)| allowed(&directory.join(name.as_ref()), kind, inputs, overwrite))
        .collect()
}

/// Makes the directory of [`targets`].
///
/// # Errors
/// The directory cannot be made.
pub fn make_directory(directory: &Path) -> Result<(), Failure> {
    let made = fs::create_dir_all(directory);
    Ok(made.with_context(|| format!("cannot make the directory {}; give another", directory.display()))?)
}

fn allowed(path: &Path, kind: FileKind, inputs: &[&Path], overwrite: Overwrite) -> Result<Target, Failure> {
    if path != Path::new(STANDARD_OUTPUT) {
        let refused = |why| failure!(Input, "{} {why}", path.display());
        return file(path, kind, inputs, overwrite).map_err(refused);
    }
    if kind == FileKind::Recording {
        bail!(
            Input,
            "a recording goes to a file; give the output a name in place of -"
        );
    }
    if output::take_standard_output() {
        return Ok(Target::standard_output());
    }
    bail!(
        Input,
        "standard output takes only one result; give the other outputs file names"
    )
}

/// The file at `path`, or the reason why it takes no result of `kind`.
fn file(path: &Path, kind: FileKind, inputs: &[&Path], overwrite: Overwrite) -> Result<Target, String> {
    let same = |one: &Path, other: &Path| {
        fs::canonicalize(one).is_ok_and(|one| fs::canonicalize(other).is_ok_and(|other| one == other))
    };
    let refused = |why: &str| Err(why.to_owned());
    if path.file_name().is_none() {
        return refused("is not a file name; give the output one");
    }
    if inputs.iter().any(|input| same(path, input)) {
        return refused("is an input of this command and would be lost; give the output another name");
    }
    if fs::symlink_metadata(path).is_err() {
        return Ok(Target::new(path));
    }
    let Ok(found) = fs::metadata(path) else {
        return refused("is a link that leads nowhere; remove it, or give the output another name");
    };
    if found.is_dir() {
        return refused("is a directory; give the output a file's name");
    }
    if !found.is_file() {
        let what = "is a device, a pipe or a socket, and a result goes to a file";
        return Err(format!("{what}; give the output another name"));
    }
    if let Some(other) = FileKind::of(path).filter(|other| *other != kind) {
        let (other, new) = (other.name(), kind.name());
        return Err(format!(
            "is {other}, and {new} would take its place; give the output another name"
        ));
    }
    if !overwrite.overwrite {
        return refused("already exists; give another name, or --overwrite to replace it");
    }
    if found.permissions().readonly() {
        return refused("is read-only; give the output another name");
    }
    // A link stays, and what it leads to is replaced.
    let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    Ok(Target::new(path).replacing(true))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn a_file_is_of_the_kind_of_its_content_and_a_link_stays_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let overwrite = Overwrite { overwrite: true };
        let page = |name: &str| target(&at(name), FileKind::Page, &[&at("a.toml")], overwrite);
        for (content, other) in [
            (&b"\x89MCAP0\r\n"[..], "a recording"),
            (b"PAR1", "a Parquet file"),
            (b"\x7fELF", "a program"),
        ] {
            fs::write(at("report.html"), content).unwrap();
            let said = page("report.html").unwrap_err().to_string();
            assert!(
                said.contains(&format!("is {other}, and a web page would")),
                "{said}"
            );
        }
        // Nothing is lost with an empty file.
        fs::write(at("empty"), "").unwrap();
        page("empty").unwrap();

        fs::write(at("a.toml"), "title = 1").unwrap();
        symlink(at("a.toml"), at("input")).unwrap();
        for name in ["input", "./a.toml"] {
            let said = page(name).unwrap_err().to_string();
            assert!(said.contains("is an input of this command"), "{said}");
        }
        symlink(at("empty"), at("link")).unwrap();
        page("link").unwrap().write_bytes("<!DOCTYPE html>").unwrap();
        assert!(at("link").is_symlink());
        assert_eq!(fs::read_to_string(at("empty")).unwrap(), "<!DOCTYPE html>");
    }
}
