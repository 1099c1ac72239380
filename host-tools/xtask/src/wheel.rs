//! The Python package: its wheel, and a try in an environment that has nothing else.

use crate::files;
use crate::packages::DEMO;
use crate::python;
use crate::step::{CommandLine, Steps, Stop};
use crate::suite::Job;

/// Its folder.
const PACKAGE: &str = "host-tools/python";
/// Directories of programs, without Rust.
const PATH: &str = "/usr/bin:/bin";

/// Builds the wheel, checks its types, installs it in an empty environment, and runs its tests there.
///
/// # Errors
/// There is no Python, no network, or something fails.
pub(crate) fn wheel(steps: &Steps) -> Result<(), Stop> {
    python::setup(steps)?;
    let tools = steps.root.join(steps.built("python/bin"));
    let wheels = steps.root.join(steps.built("wheels"));
    // One of another version would be installed too.
    let _ = std::fs::remove_dir_all(&wheels);
    let build = CommandLine::program(tools.join("maturin"))
        .words("build --release --strip --features beside-bead --manifest-path")
        .arg(format!("{PACKAGE}/Cargo.toml"))
        .words("--out")
        .arg(&wheels);
    steps.run("the wheel", &build)?;
    let types = CommandLine::program(tools.join("mypy"))
        .words("--strict --cache-dir")
        .arg(steps.built("mypy"))
        .arg(format!("{PACKAGE}/python/hertz_chain"));
    steps.run("the types of the package", &types)?;
    let demo = CommandLine::new("cargo build --release").words(DEMO);
    steps.run("the command line that the wheel is tried with", &demo)?;

    let empty = steps.built("wheel");
    steps.run(
        "an empty environment without Rust",
        &CommandLine::new("python3 -m venv --clear").arg(&empty),
    )?;
    let [wheel] = &files::entries(&wheels)?[..] else {
        return Err(Stop::failed(format!(
            "{} should have one wheel, the one that maturin built",
            wheels.display()
        )));
    };
    let python = steps.root.join(&empty).join("bin/python3");
    let install = CommandLine::program(&python)
        .words("-m pip install --quiet --no-compile")
        .arg(format!("{}[tables]", wheel.display()))
        .words("matplotlib");
    steps.run("the wheel in it", &install.env("PATH", PATH))?;
    let test = CommandLine::program(&python)
        .arg(format!("{PACKAGE}/tests/test_package.py"))
        .env("PATH", PATH)
        .env(
            "BEAD",
            &steps.root.join(steps.built("release/bead")).display().to_string(),
        )
        .env("REPOSITORY", &steps.root.display().to_string());
    steps.run("the tests of the package", &test)?;
    steps.announce(&format!("pip install {}", wheel.display()));
    Ok(())
}

/// The job that runs [`wheel`] among the tests; without the Python that it needs, `None` and a line that says
/// so.
pub(crate) fn job(steps: &Steps) -> Option<Job> {
    if !steps.root.join(steps.built("python/ready")).exists() {
        steps.announce("SKIPPED: the Python package, since there is no Python to build it with");
        return None;
    }
    // By its name: the build of the tests may have put another file there than the one that runs.
    let this = format!("release/xtask{}", std::env::consts::EXE_SUFFIX);
    let line = CommandLine::program(steps.target.join(this)).words("wheel");
    Some(Job::new("the Python package", line))
}
