//! What the licences ask for in a copy: who made the parts, and under which terms.
//!
//! # Design
//! The page names each package and its licence. It lies in the repository, and a test holds it to what cargo
//! would link. The texts, several hundred kilobytes with as many names, go into the archive of a release,
//! made from the very sources that its programs are made from.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;

use crate::packages::{Package, Packages, Product};
use crate::policy::Policy;

const HEAD: &str = "\
# What others made

`cargo xtask notices` writes this page from what cargo links, and a test holds it to that. The archive of a release
has the licences' texts beside it, and a bill of materials for each program. Where a package offers several licences,
the second column has them all and the third the one that is taken. [deny.toml](deny.toml) says which are allowed.
The image has no copyleft in it. Rust's own `core`, `alloc` and `std` (MIT OR Apache-2.0) are in each program as well.
";

const TITLES: [(Product, &str); 2] = [
    (Product::Image, "In the flash image"),
    (
        Product::Tools,
        "In `bead` and `bead-figures`, which carry the image too",
    ),
];

/// The page for the repository.
///
/// # Errors
/// A package has no licence that is allowed; in words.
pub fn page(packages: &Packages, policy: &Policy) -> Result<String, String> {
    let mut page = HEAD.to_owned();
    for (product, title) in TITLES {
        let others: Vec<_> = packages
            .linked(product)
            .filter(|package| package.source.is_some())
            .collect();
        let _ = write!(page, "\n## {title}\n\n{} packages.\n\n", others.len());
        page += "| package | offered under | taken under |\n|---|---|---|\n";
        for package in others {
            let Package { name, version, .. } = package;
            let offered = policy.licence(package).unwrap_or_default();
            let taken: Vec<_> = policy.taken(package)?.iter().map(ToString::to_string).collect();
            let link = format!("[{name} {version}](https://crates.io/crates/{name}/{version})");
            let _ = writeln!(page, "| {link} | {offered} | {} |", taken.join(" AND "));
        }
    }
    Ok(page)
}

/// How the files are called that hold licences, copyrights and notices.
const FILES: [&str; 6] = [
    "LICENSE",
    "LICENCE",
    "COPYING",
    "COPYRIGHT",
    "NOTICE",
    "UNLICENSE",
];

/// The texts of all licences in image and tools, each once, with the packages that bring it.
///
/// # Errors
/// A package's folder cannot be read, or it has neither a file nor an allowed licence; in words.
pub fn texts(packages: &Packages, policy: &Policy) -> Result<String, String> {
    // By the text without its line breaks, since many differ in nothing else.
    let mut texts: BTreeMap<String, (String, Vec<String>)> = BTreeMap::new();
    let linked = packages.image.union(&packages.tools).map(|id| &packages.all[id]);
    for package in linked.filter(|package| package.source.is_some()) {
        let mut found = files(package)?;
        if found.is_empty() {
            found = standard(package, policy)?;
        }
        for text in found {
            let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
            let (_, of) = texts.entry(words).or_insert_with(|| (text, Vec::new()));
            of.push(format!("{} {}", package.name, package.version));
        }
    }
    let mut all = String::new();
    let mut texts: Vec<_> = texts.into_values().collect();
    texts.sort_by(|(_, a), (_, b)| b.len().cmp(&a.len()).then_with(|| a.cmp(b)));
    for (text, of) in texts {
        let _ = write!(
            all,
            "{}\n{}\n\n{}\n\n",
            "=".repeat(100),
            of.join(", "),
            text.trim()
        );
    }
    Ok(all)
}

/// The texts that a package brings.
fn files(package: &Package) -> Result<Vec<String>, String> {
    let failed = |error| format!("{}: {error}", package.folder.display());
    let mut paths = Vec::new();
    for entry in fs::read_dir(&package.folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let name = path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .to_uppercase();
        if path.is_file() && FILES.iter().any(|start| name.starts_with(start)) {
            paths.push(path);
        }
    }
    paths.sort();
    paths
        .iter()
        .map(|path| fs::read_to_string(path).map_err(failed))
        .collect()
}

/// The texts of the licences of a package that brings none, as SPDX has them, with its authors.
fn standard(package: &Package, policy: &Policy) -> Result<Vec<String>, String> {
    let Package {
        name,
        version,
        authors,
        ..
    } = package;
    let by = match authors.is_empty() {
        true => format!("the authors of {name}"),
        false => authors.join(", "),
    };
    let taken = policy
        .taken(package)
        .map_err(|why| format!("{name} {version}: {why}"))?;
    let text = |taken: spdx::LicenseReq| {
        let id = taken
            .license
            .id()
            .ok_or(format!("{name} {version}: {taken} has no standard text"))?;
        Ok(format!(
            "{name} has no text of its licence with it: {taken}, by {by}.\n\n{}",
            id.text()
        ))
    };
    taken.into_iter().map(text).collect()
}
