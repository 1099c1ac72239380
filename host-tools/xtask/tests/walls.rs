//! Crates for recordings and comparisons build without the emulator, the command line and the image.

#![allow(clippy::unwrap_used, reason = "a tree that cannot be read fails the test")]

use std::process::Command;

/// Crates that come neither with recordings nor with comparisons.
const NO_BENCH: &[&str] = &["absorber-bead", "bead-bench", "stm32f405-qemu", "clap"];
/// Crates that the bead's application does without on the host.
const NO_EXECUTOR: &[&str] = &[
    "embassy-stm32",
    "embassy-time",
    "cortex-m",
    "bead-testing",
    "hertz-",
];

/// Crates that a wheel, a real board, a fuzz target or the host's tests of the bead build, with the crates
/// that must not come with them.
const WALLS: [(&str, &[&str]); 14] = [
    ("bead-app", NO_EXECUTOR),
    ("bead-tables", &["bead-", "hertz-", "stm32f405-qemu", "clap"]),
    ("bead-recording", NO_BENCH),
    ("bead-line", NO_BENCH),
    ("bead-monitor", NO_BENCH),
    ("bead-instrument", NO_BENCH),
    ("bead-compare", NO_BENCH),
    ("bead-spectra", NO_BENCH),
    ("bead-logbook", NO_BENCH),
    ("bead-limits", NO_BENCH),
    ("bead-calibrate", NO_BENCH),
    ("bead-identify", NO_BENCH),
    (
        "hertz-chain",
        &["bead-", "absorber-bead", "stm32f405-qemu", "clap"],
    ),
    ("stm32f405-qemu", &["bead-", "absorber-bead", "hertz-", "clap"]),
];

#[test]
fn what_knows_no_emulator_builds_without_it() {
    for (package, forbidden) in WALLS {
        let tree = Command::new(env!("CARGO"))
            .args("tree --locked --offline --prefix none --edges normal,build".split(' '))
            .args(["--format", "{p}", "--package", package])
            // The emulator is depended upon without its runner, which has a command line.
            .args((package == "stm32f405-qemu").then_some("--no-default-features"))
            .output()
            .unwrap();
        let text = String::from_utf8(tree.stdout).unwrap();
        let mut names = text.lines().filter_map(|line| line.split(' ').next());
        let said = String::from_utf8_lossy(&tree.stderr);
        assert_eq!(names.next(), Some(package), "{said}");
        for name in names {
            let refused = forbidden.iter().find(|start| name.starts_with(**start));
            assert_eq!(refused, None, "{package} builds {name}");
        }
    }
}
