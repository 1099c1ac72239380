//! What others made in image and tools: their licences, where they come from, what is known about them.

use std::path::Path;

use crate::paths::cargo_home;
use crate::setup::output;
use crate::step::{Line, Steps, Stop};

/// Checks the packages by cargo-deny, where it is installed. What needs no program for it is a test of
/// `bead-inventory`.
///
/// # Errors
/// A licence, an origin or a second version is not allowed by deny.toml, or an advisory is known.
pub(crate) fn check(steps: &Steps) -> Result<(), Stop> {
    if output("cargo deny --version").is_none() {
        steps.announce(
            "cargo-deny is not installed, so that advisories are not looked at: cargo install cargo-deny --locked",
        );
        return Ok(());
    }
    let deny = Line::new("cargo deny --locked check --hide-inclusion-graph bans licenses sources");
    steps.run("licences, origins and second versions of packages", &deny)?;
    if !has_advisories(&cargo_home().unwrap_or_default()) {
        steps.announce(
            "advisories are not looked at, since no database is here: cargo deny fetch db gets one",
        );
        return Ok(());
    }
    // As they were when somebody fetched them: a check shall not fail because of the day.
    let deny = Line::new("cargo deny --locked --offline check --hide-inclusion-graph advisories");
    steps.run("advisories about packages", &deny)
}

/// Whether cargo-deny has fetched a database of advisories into this home of cargo.
fn has_advisories(home: &Path) -> bool {
    let entries = std::fs::read_dir(home.join("advisory-dbs")).into_iter().flatten();
    entries.flatten().any(|entry| entry.path().is_dir())
}

/// The same by the test of `bead-inventory`, and whether THIRD-PARTY.md is what cargo would link.
///
/// # Errors
/// It is not.
pub(crate) fn inventory(steps: &Steps) -> Result<(), Stop> {
    let test = Line::new("cargo test --release --quiet -p bead-inventory");
    steps.run("what image and tools are made of", &test)
}

/// Writes THIRD-PARTY.md anew, and into target/notices the licences' texts and a bill of materials for image
/// and tools.
///
/// # Errors
/// A licence is not allowed.
pub(crate) fn notices(steps: &Steps) -> Result<(), Stop> {
    let page = tool().words("page");
    steps.run("what others made, for the repository", &page)?;
    release(steps, &steps.built("notices"))
}

/// Writes into a folder what a release carries: the licences' texts, and a bill of materials for image and
/// tools.
///
/// # Errors
/// A licence is not allowed, or a package's texts cannot be read.
pub(crate) fn release(steps: &Steps, folder: &Path) -> Result<(), Stop> {
    let release = tool().words("release").arg(folder);
    steps.run("the licences' texts and the bills of materials", &release)
}

fn tool() -> Line {
    Line::new("cargo run --release --quiet -p bead-inventory --")
}

#[cfg(test)]
mod tests {
    use super::*;

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
