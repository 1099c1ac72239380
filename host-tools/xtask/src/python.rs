//! A Python with the packages of others, for the tests that open what `bead export` writes, and that combine
//! what `bead budget` and `bead analyse` print.

use crate::files;
use crate::step::{CommandLine, Steps, Stop};

/// Its requirements.
const REQUIREMENTS: &str = "host-tools/bead/tests/requirements.txt";

/// Sets up `target/python`, unless it is there.
///
/// # Errors
/// There is no Python, or no network.
pub(crate) fn setup(steps: &Steps) -> Result<(), Stop> {
    let (folder, python) = (steps.built("python"), steps.built("python/bin/python3"));
    let ready = steps.built("python/ready");
    let wanted = std::fs::read_to_string(steps.root.join(REQUIREMENTS)).unwrap_or_default();
    // A folder of other requirements is set up anew.
    if std::fs::read_to_string(steps.root.join(&ready)).is_ok_and(|of| of == wanted) {
        steps.announce(&format!("{} is in place", folder.display()));
        return Ok(());
    }
    steps.run(
        "a separate Python environment",
        &CommandLine::new("python3 -m venv --clear").arg(&folder),
    )?;
    let install = CommandLine::program(&python)
        .words("-m pip install --quiet --no-compile --requirement")
        .arg(REQUIREMENTS);
    steps.run(
        "pandas, polars, xarray, pyuff, mcap, GTC, endaq, lmfit and maturin, some 700 MB",
        &install,
    )?;
    files::write(&steps.root.join(ready), wanted)
}

/// Runs [`setup`]. If it fails, as without a network, prints that the test that needs it is skipped.
pub(crate) fn setup_if_it_can_be(steps: &Steps) {
    if let Err(stop) = setup(steps) {
        eprintln!("{}", stop.message);
        steps.announce(
            "SKIPPED: the tests of what `bead export` writes, since pandas, polars, pyuff and mcap are missing",
        );
        // A half of it would be taken for the whole.
        let _ = std::fs::remove_dir_all(steps.target.join("python"));
    }
}
