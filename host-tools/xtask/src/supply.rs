//! Packages of others in image and tools: their licences, origins, notices and bills of materials.
//!
//! # Design
//! THIRD-PARTY.md names each package that `cargo tree` says is linked, with its licence, and the check
//! compares the page with what cargo says now: a package cannot come in unseen. deny.toml says which
//! licences, origins and second versions are allowed, and cargo-deny holds the tree to it where it is
//! installed, as in CI. A release carries the texts of the licences, by cargo-about, and bills of materials,
//! by cargo-cyclonedx.

use std::collections::BTreeSet;
use std::path::Path;

use crate::files::{self, copy_tree, read, write};
use crate::paths::cargo_home;
use crate::setup::output;
use crate::step::{CommandLine, Steps, Stop};
use crate::tools;

/// Something that a release carries.
struct Product {
    title: &'static str,
    /// Its packages, for cargo.
    packages: &'static str,
    /// The folder of its manifest. For the tools that of `bead-figures`, which depends on `bead`.
    folder: &'static str,
    /// Its name in the files of a release.
    name: &'static str,
    targets: &'static [&'static str],
}

const PRODUCTS: [Product; 2] = [
    Product {
        title: "In the flash image",
        packages: "-p bead-firmware",
        folder: "firmware",
        name: "bead-firmware",
        targets: &["thumbv7em-none-eabihf"],
    },
    Product {
        title: "In `bead` and `bead-figures`, which carry the image too",
        packages: "-p absorber-bead -p bead-figures",
        folder: "host-tools/hertz/figures-command",
        name: "bead",
        targets: &["x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu"],
    },
];

const PAGE: &str = "THIRD-PARTY.md";
const HEAD: &str = "\
# What others made

`cargo xtask notices` writes this page from what cargo links, and a check compares the two. The archive of a release
has the licences' texts next to it, and a bill of materials for each program. Where a package offers several licences,
it is taken under the first that [deny.toml](deny.toml) allows. The image has no copyleft in it. Rust's own `core`,
`alloc` and `std` (MIT OR Apache-2.0) are in each program as well.
";
/// The section about code that is no package of cargo's. The text of its licence lies beside it.
const VENDORED: &str = "
## In the page of `bead monitor --web`

| package | licence |
|---|---|
| uPlot 1.6.32, in [host-tools/bead/monitor/page](host-tools/bead/monitor/page) | [MIT](host-tools/bead/monitor/page/uPlot.LICENSE) |
";

/// The text of THIRD-PARTY.md for the packages that cargo would link now.
fn page(steps: &Steps) -> Result<String, Stop> {
    let mut page = HEAD.to_owned();
    for product in &PRODUCTS {
        let tree =
            CommandLine::new("cargo tree --locked --prefix none --edges normal,no-proc-macro --format")
                .arg("{p}|{l}")
                .words(product.packages);
        let targets = product.targets.iter();
        let tree = targets.fold(tree, |tree, target| tree.arg("--target").arg(target));
        let linked = steps.read(product.title, &tree)?;
        let rows: BTreeSet<String> = linked.lines().filter_map(row).collect();
        page += &format!("\n## {}\n\n{} packages.\n\n", product.title, rows.len());
        page += "| package | licence |\n|---|---|\n";
        page.extend(rows);
    }
    page += VENDORED;
    Ok(page)
}

/// The row of a package, from "serde v1.0.229|MIT OR Apache-2.0 (*)"; `None` for one of this workspace.
fn row(line: &str) -> Option<String> {
    let (package, licence) = line.trim_end_matches(" (*)").split_once('|')?;
    let (name, version) = package.split_once(" v")?;
    let version = version.trim_end_matches(" (proc-macro)");
    if version.contains('(') {
        return None;
    }
    // Before there was SPDX, a slash stood for OR.
    let licence = licence.replace(" / ", " OR ").replace('/', " OR ");
    let licence = if licence.is_empty() {
        "by its file"
    } else {
        &licence
    };
    Some(format!(
        "| [{name} {version}](https://crates.io/crates/{name}/{version}) | {licence} |\n"
    ))
}

/// Compares THIRD-PARTY.md with what cargo links, and runs cargo-deny where it is installed.
///
/// # Errors
/// The page is out of date; a licence, an origin or a second version is not allowed by deny.toml; an advisory
/// is known.
pub(crate) fn check(steps: &Steps) -> Result<(), Stop> {
    if page(steps)? != read(&steps.root.join(PAGE))? {
        return Err(Stop::failed(format!(
            "{PAGE} does not list what cargo links: `cargo xtask notices` rewrites it"
        )));
    }
    if output("cargo deny --version").is_none() {
        steps.announce(
            "cargo-deny is not installed, so licences, origins and advisories are not checked: \
             cargo install cargo-deny --locked",
        );
        return Ok(());
    }
    let deny = CommandLine::new("cargo deny --locked check --hide-inclusion-graph bans licenses sources");
    steps.run("licences, origins and second versions of packages", &deny)?;
    if !has_advisories(&cargo_home().unwrap_or_default()) {
        steps.announce("advisories are not checked: `cargo deny fetch db` gets their database");
        return Ok(());
    }
    // The advisories as last fetched: a check must not fail because of the day.
    let deny = CommandLine::new("cargo deny --locked --offline check --hide-inclusion-graph advisories");
    steps.run("advisories about packages", &deny)
}

/// True if cargo-deny has fetched a database of advisories into this home of cargo.
fn has_advisories(home: &Path) -> bool {
    let entries = std::fs::read_dir(home.join("advisory-dbs")).into_iter().flatten();
    entries.flatten().any(|entry| entry.path().is_dir())
}

/// Writes THIRD-PARTY.md, and the notices of a release into target/notices.
pub(crate) fn notices(steps: &Steps) -> Result<(), Stop> {
    write(&steps.root.join(PAGE), page(steps)?)?;
    release(steps, &steps.target.join("notices"))
}

/// Writes into `folder` what a release carries: the licences' texts, and a bill of materials for image and
/// tools.
///
/// # Errors
/// A licence is not allowed by about.toml, or a tool cannot be installed.
pub(crate) fn release(steps: &Steps, folder: &Path) -> Result<(), Stop> {
    let about = tools::installed(steps, "cargo-about", "0.9.3", "--features cli")?;
    let cyclonedx = tools::installed(steps, "cargo-cyclonedx", "0.5.9", "")?;
    files::make(folder)?;
    // cargo-cyclonedx writes beside every manifest of a workspace.
    let copy = steps.target.join("notices-tree");
    copy_tree(&steps.root, &copy)?;
    for product in &PRODUCTS {
        let manifest = Path::new(product.folder).join("Cargo.toml");
        let mut texts = CommandLine::program(&about)
            .words("about generate --locked --fail --config host-tools/xtask/about.toml --manifest-path")
            .arg(&manifest)
            .arg("--output-file")
            .arg(folder.join(format!("{}-licences.txt", product.name)));
        for target in product.targets {
            texts = texts.arg("--target").arg(target);
        }
        let texts = texts.arg("host-tools/xtask/about.hbs");
        steps.run(&format!("the licences' texts of {}", product.name), &texts)?;
        let bill = CommandLine::program(steps.root.join(&cyclonedx))
            .words("cyclonedx --format json --spec-version 1.5 --manifest-path")
            .arg(&manifest)
            .words("--target")
            .arg(product.targets[0])
            .words("--override-filename bill.cdx")
            .within(&copy);
        steps.run(&format!("the bill of materials of {}", product.name), &bill)?;
        let from = copy.join(product.folder).join("bill.cdx.json");
        files::copy(&from, &folder.join(format!("{}.cdx.json", product.name)))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_package_has_a_row_with_its_licence_and_ours_have_none() {
        assert_eq!(
            row("serde v1.0.229|MIT/Apache-2.0 (*)").unwrap(),
            "| [serde 1.0.229](https://crates.io/crates/serde/1.0.229) | MIT OR Apache-2.0 |\n"
        );
        assert!(row("slsqp v1.0.2|").unwrap().ends_with("| by its file |\n"));
        assert_eq!(row("bead-wire v0.1.0 (/w/firmware/wire)|MIT"), None);
    }

    #[test]
    fn a_database_of_advisories_is_a_folder_beside_cargo_denys_lock() {
        let home = tempfile::tempdir().unwrap();
        let databases = home.path().join("advisory-dbs");
        assert!(!has_advisories(home.path()));
        std::fs::create_dir(&databases).unwrap();
        std::fs::write(databases.join("db.lock"), "").unwrap();
        assert!(!has_advisories(home.path()));
        std::fs::create_dir(databases.join("advisory-db-1")).unwrap();
        assert!(has_advisories(home.path()));
    }
}
