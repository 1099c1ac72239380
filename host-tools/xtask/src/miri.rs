//! Code of the bead under Miri: no undefined behaviour, and equal results on a big-endian machine.

use crate::nightly;
use crate::step::{Steps, Stop};

/// The crates whose tests run there, each on both machines.
const CRATES: [&str; 3] = ["bead-wire", "bead-store", "bead-model"];
/// Machines that Miri emulates, whatever it runs on: one with words of 32 bits as on the bead, and a
/// big-endian one. For both, `libm` computes roots in Rust; for x86-64 it has assembler, which Miri cannot
/// run.
const MACHINES: [&str; 2] = ["armv7-unknown-linux-gnueabihf", "s390x-unknown-linux-gnu"];
/// No isolation, as tests read files. No rounding errors, as Miri would change the last bits of a sine at
/// random, and tests compare pulses that they compute twice.
const FLAGS: &str = "-Zmiri-disable-isolation -Zmiri-no-extra-rounding-error";

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
    for machine in MACHINES {
        for name in CRATES {
            let line = nightly::cargo("miri test -p")
                .arg(name)
                .words("--target")
                .arg(machine)
                .env("MIRIFLAGS", FLAGS)
                .env("PROPTEST_CASES", "1")
                .env("CARGO_TARGET_DIR", &steps.target.join("miri").to_string_lossy());
            steps.run(&format!("{name} under Miri, {machine}"), &line)?;
        }
    }
    steps.announce("nothing undefined, and the same results on both machines");
    Ok(())
}
