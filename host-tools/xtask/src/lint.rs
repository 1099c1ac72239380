//! The checks that run no program of ours: links, imports, format, lints, documentation.

use crate::links;
use crate::packages::{CASES, HOST, IMAGE, IMAGES, PUBLISHED};
use crate::step::{CommandLine, Steps, Stop};
use crate::style;
use crate::supply;

/// Runs all of them.
pub(crate) fn lint(steps: &Steps) -> Result<(), Stop> {
    text(steps)?;
    let imports = CommandLine::new("cargo test --release --quiet -p xtask --test imports -- --nocapture");
    steps.run("imports inside each crate", &imports)?;
    steps.both(
        |steps| host(steps, HOST),
        |steps| {
            image(steps)?;
            images(steps)?;
            supply(steps)
        },
    )
}

/// Licences of the packages of others, and the crates as they are published.
pub(crate) fn supply(steps: &Steps) -> Result<(), Stop> {
    supply::check(steps)?;
    // crates.io refuses a crate without description or licence, with a dependency that has no version, or
    // with a readme that is not there.
    let package = CommandLine::new("cargo package --quiet --no-verify --allow-dirty").words(PUBLISHED);
    steps.run("the crates as they are published", &package)
}

/// Checks of text: links, comments and format.
pub(crate) fn text(steps: &Steps) -> Result<(), Stop> {
    steps.announce("links of the documentation");
    let followed = links::check(&steps.root)?;
    steps.announce(&format!("{followed} links lead somewhere"));
    steps.announce("comments");
    style::check(&steps.root)?;
    steps.run("format", &CommandLine::new("cargo fmt --all --check"))
}

/// Lints and documentation of these packages of the host.
pub(crate) fn host(steps: &Steps, packages: &str) -> Result<(), Stop> {
    let packages = format!("--release {packages}");
    steps.run("lints, host", &clippy(&format!("{packages} --all-targets")))?;
    steps.run("documentation, host", &doc(&packages))
}

/// Lints and documentation of the flash image.
pub(crate) fn image(steps: &Steps) -> Result<(), Stop> {
    steps.run("lints, image", &clippy(IMAGE))?;
    steps.run("documentation, image", &doc(IMAGE))
}

/// Lints of the images and cases of the emulator's tests.
pub(crate) fn images(steps: &Steps) -> Result<(), Stop> {
    let images = format!("{IMAGES} --features embassy");
    steps.run("lints, images of the emulator's tests", &clippy(&images))?;
    steps.run("lints, cases of the emulator's tests", &clippy(CASES))
}

fn clippy(what: &str) -> CommandLine {
    CommandLine::new(&format!("cargo clippy {what} -- -D warnings"))
}

fn doc(what: &str) -> CommandLine {
    CommandLine::new(&format!("cargo doc --no-deps {what}")).env("RUSTDOCFLAGS", "-D warnings")
}
