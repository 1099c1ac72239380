//! Builds of the host tools, and the two demonstrations that run them: one strike, and a row of ten beads.

use crate::image;
use crate::setup::{Need, setup};
use crate::step::{CommandLine, Steps, Stop};

/// Builds packages of the host, and beside them the flash image.
///
/// # Errors
/// Something is missing on this machine, or does not build.
pub(crate) fn build(steps: &Steps, packages: &str) -> Result<(), Stop> {
    setup(steps, Need::Run)?;
    let host = CommandLine::new("cargo build --release").words(packages);
    image::build_if_there_is_one(steps)?;
    steps.both(|steps| steps.run("build the host tools", &host), image::build)
}

/// A command of the `bead` that was built.
pub(crate) fn bead(steps: &Steps, words: &str) -> CommandLine {
    CommandLine::program(steps.built("release/bead")).words(words)
}

/// Demonstrates one strike on one bead, with what is built.
///
/// # Errors
/// With the status of the `bead` command that failed.
pub(crate) fn strike(steps: &Steps) -> Result<(), Stop> {
    let scenario = "docs/scenarios/paper-strike.toml";
    let recording = steps.built("demo/bead-8.mcap");
    let report = steps.built("demo/report.html");
    let emulate = bead(steps, &format!("emulate {scenario} --bead 8 --firmware"))
        .arg(image::path(steps))
        .words("--uncertainty docs/scenarios/paper-bead.toml --overwrite --out")
        .arg(steps.built("demo"));
    let title = "a striker hits the chain; the flash image senses it inside bead 8, in QEMU";
    steps.run(title, &emulate)?;
    let title = "the recorded samples, through the same fixed-point code on this computer";
    steps.run(title, &bead(steps, "replay").arg(&recording))?;
    let compare = bead(steps, "compare")
        .arg(&recording)
        .words(&format!("--scenario {scenario} --overwrite --report"))
        .arg(&report);
    steps.run("device, replay and simulation, side by side", &compare)?;
    steps.announce(&format!("done. The report: {}", report.display()));
    Ok(())
}

/// Demonstrates one strike on a row of ten beads, with what is built.
pub(crate) fn row(steps: &Steps) -> Result<(), Stop> {
    let folder = steps.built("chain");
    let emulate = bead(
        steps,
        "emulate docs/scenarios/row-of-ten.toml --bead all --firmware",
    )
    .arg(image::path(steps))
    .words("--overwrite --out")
    .arg(&folder);
    let title = "a striker hits a row of ten absorbers; the flash image senses it inside each, in QEMU";
    steps.run(title, &emulate)?;
    let report = folder.join("report.html");
    let compare = bead(steps, "compare")
        .arg(folder.join("chain.mcap"))
        .words("--overwrite --report")
        .arg(&report)
        .words("--figures")
        .arg(&folder);
    steps.run("ten beads and one simulation, side by side", &compare)?;
    steps.announce(&format!(
        "done. The picture: {}. The report: {}",
        folder.join("row.svg").display(),
        report.display()
    ));
    Ok(())
}
