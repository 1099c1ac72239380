//! What runs on the bead, under Miri: no undefined behaviour, and the same results on a big-endian machine.

use crate::nightly;
use crate::step::{Steps, Stop};

/// The crates whose tests run there, each on both machines.
const CRATES: [&str; 3] = ["bead-wire", "bead-store", "bead-model"];
/// One that is not like this machine: big-endian.
const BIG_ENDIAN: &str = "s390x-unknown-linux-gnu";

/// Runs the tests.
///
/// # Errors
/// A test fails, or the nightly's components are missing.
pub(crate) fn miri(steps: &Steps) -> Result<(), Stop> {
    nightly::need("--version", "rustup toolchain install nightly")?;
    nightly::need(
        "miri --version",
        "rustup component add --toolchain nightly miri rust-src",
    )?;
    for machine in ["", BIG_ENDIAN] {
        for name in CRATES {
            let mut line = nightly::cargo("miri test -p")
                .arg(name)
                // Files are read, and what is drawn is drawn by a seed from the environment.
                .env("MIRIFLAGS", "-Zmiri-disable-isolation")
                .env("PROPTEST_CASES", "2")
                .env("CARGO_TARGET_DIR", &steps.target.join("miri").to_string_lossy());
            if !machine.is_empty() {
                line = line.words("--target").arg(machine);
            }
            let on = if machine.is_empty() {
                "this machine"
            } else {
                machine
            };
            steps.run(&format!("{name} under Miri, {on}"), &line)?;
        }
    }
    steps.announce("nothing undefined, and the same results on both machines");
    Ok(())
}
