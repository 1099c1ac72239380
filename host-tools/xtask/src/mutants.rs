//! Whether the checks of the figures would notice wrong physics. Each mutant is the simulator with one
//! mistake in it, and at least one check must fail on it.
//!
//! # Design
//! The workspace is copied to target/mutants. The mistakes are made there, one after another, by replacing
//! text that must stand in the file exactly once. A mutant that no longer fits the source stops the run
//! instead of testing nothing.

use std::path::Path;
use std::process::Command;

use crate::files::{below, read, write};
use crate::step::{Steps, Stop};

/// The equations of motion, and what follows from them.
const MODEL: &str = "host-tools/chain/src/model.rs";
/// The same on vectors, as a run computes them.
const LANES: &str = "host-tools/chain/src/solver/lanes.rs";
const KERNEL: &str = "host-tools/chain/src/solver/kernel.rs";
/// A contact that opens or closes inside a step.
const CROSSING: &str = "host-tools/chain/src/solver/crossing.rs";
/// The test of all checks of all figures.
pub(crate) const TEST: &str = "every_check_of_every_figure_passes";

/// How the model computes the force of viscosity, contact by contact.
const VISCOUS: &str = "1.5 * self.relaxation * self.stiffness * overlap.sqrt() * rate";
/// What a run computes it from.
const VISCOSITY: &str = "lanes.viscosity[at] = 1.5 * contact.relaxation;";

struct Mutant {
    mistake: &'static str,
    /// What stands in a file, and what is put in its place.
    changes: &'static [(&'static str, &'static str, &'static str)],
}

const MUTANTS: &[Mutant] = &[
    Mutant {
        mistake: "Hertz' exponent 1.49 in place of 1.5, force and energy alike",
        changes: &[
            (
                MODEL,
                "self.stiffness * overlap * overlap.sqrt()",
                "self.stiffness * overlap.powf(1.49)",
            ),
            (
                MODEL,
                "0.4 * overlap * self.elastic_force(overlap)",
                "overlap / 2.49 * self.elastic_force(overlap)",
            ),
            (
                LANES,
                "simd.mul_f64s(stiffness, simd.sqrt_f64s(overlap))",
                "simd.mul_f64s(stiffness, pulp::cast(pulp::cast::<f64x8, Block>(overlap).map(|x| x.powf(0.49))))",
            ),
            (
                CROSSING,
                "let stiff = self.stiffness * overlap.sqrt();",
                "let stiff = self.stiffness * overlap.powf(0.49);",
            ),
        ],
    },
    Mutant {
        mistake: "no viscosity: τ left out",
        changes: &[
            (MODEL, VISCOUS, "0.0 * rate"),
            (
                LANES,
                VISCOSITY,
                "lanes.viscosity[at] = 0.0 * contact.relaxation;",
            ),
        ],
    },
    Mutant {
        mistake: "viscosity without its 3/2",
        changes: &[
            (
                MODEL,
                VISCOUS,
                "self.relaxation * self.stiffness * overlap.sqrt() * rate",
            ),
            (LANES, VISCOSITY, "lanes.viscosity[at] = contact.relaxation;"),
        ],
    },
    Mutant {
        mistake: "M in place of M - m for a host, motion and energy alike",
        changes: &[(
            MODEL,
            "shells[bead] -= oscillator.mass;",
            "shells[bead] -= 0.0 * oscillator.mass;",
        )],
    },
    Mutant {
        mistake: "M in place of M - m for a host, in the energy alone",
        changes: &[(
            MODEL,
            "energies.chain += kinetic(self.shells[j], velocity)",
            "energies.chain += kinetic(self.masses[j], velocity)",
        )],
    },
    Mutant {
        mistake: "the clip lost: parting beads pull where they may not",
        changes: &[
            (
                MODEL,
                "if self.clipped { force.max(0.0) } else { force }",
                "force",
            ),
            (LANES, "clipped: model.clipped,", "clipped: false,"),
        ],
    },
    Mutant {
        mistake: "an intruder that the host does not feel",
        changes: &[(
            KERNEL,
            "total = simd.add_f64s(total, simd.mul_f64s(pull, one));",
            "total = simd.add_f64s(total, simd.mul_f64s(zero, simd.mul_f64s(pull, one)));",
        )],
    },
];

/// Tests every mutant.
///
/// # Errors
/// A mutant that no check notices, or that does not fit the source or does not compile.
pub(crate) fn check(steps: &Steps) -> Result<(), Stop> {
    let copy = steps.target.join("mutants");
    let failed = |error| {
        Stop::failed(format!(
            "cannot copy the workspace to {}: {error}",
            copy.display()
        ))
    };
    copy_tree(&steps.root, &copy).map_err(&failed)?;
    steps.announce("without a mistake every check must pass");
    if let Some(broken) = broken_checks(steps, &copy)? {
        let broken = broken.join("; ");
        return Err(Stop::failed(format!("checks fail without a mutant: {broken}")));
    }
    let mut survivors = Vec::new();
    for mutant in MUTANTS {
        steps.announce(mutant.mistake);
        for (file, from, to) in mutant.changes {
            let path = copy.join(file);
            let text = read(&path)?;
            if text.matches(from).count() != 1 {
                return Err(Stop::failed(format!(
                    "`{from}` does not stand in {file} exactly once; rewrite the mutant"
                )));
            }
            write(&path, text.replace(from, to).as_bytes()).map_err(&failed)?;
        }
        let broken = broken_checks(steps, &copy)?;
        for (file, ..) in mutant.changes {
            let sound = read(&steps.root.join(file))?;
            write(&copy.join(file), sound.as_bytes()).map_err(&failed)?;
        }
        match broken {
            Some(broken) => {
                let checks = if broken.len() == 1 { "check" } else { "checks" };
                eprintln!("          noticed by {} {checks}, such as", broken.len());
                for check in broken.iter().take(3) {
                    eprintln!("            {check}");
                }
            }
            None => survivors.push(mutant.mistake),
        }
    }
    if survivors.is_empty() {
        steps.announce(&format!("all {} mistakes are noticed", MUTANTS.len()));
        return Ok(());
    }
    let survivors = survivors.join("; ");
    Err(Stop::failed(format!("no check notices: {survivors}")))
}

/// The checks that fail in a copy of the workspace; none if all pass.
fn broken_checks(steps: &Steps, copy: &Path) -> Result<Option<Vec<String>>, Stop> {
    // The library's own test, so that no program with a mistake in it is left where programs are built.
    let output = Command::new("cargo")
        .args("test --release --quiet -p hertz-figures --lib".split(' '))
        .arg(TEST)
        .current_dir(copy)
        .env("CARGO_TARGET_DIR", &steps.target)
        .output()
        .map_err(|error| Stop::missing(format!("cannot start cargo: {error}")))?;
    let told = String::from_utf8_lossy(&output.stdout);
    if output.status.success() {
        return Ok(None);
    }
    let checks: Vec<String> = told
        .lines()
        .skip_while(|line| !line.contains("checks fail:"))
        .skip(1)
        .take_while(|line| line.contains(", expected "))
        .map(str::to_owned)
        .collect();
    match checks.is_empty() {
        false => Ok(Some(checks)),
        true if told.contains(TEST) => Ok(Some(vec!["a figure that could not be drawn at all".to_owned()])),
        true => {
            let why = String::from_utf8_lossy(&output.stderr);
            Err(Stop::failed(format!("the mutant does not compile:\n{why}")))
        }
    }
}

/// Copies what is source: no hidden entries but cargo's, nothing built.
pub(crate) fn copy_tree(from: &Path, to: &Path) -> std::io::Result<()> {
    let is_source = |path: &Path| {
        let name = path.file_name().unwrap_or_default();
        let hidden = name.to_string_lossy().starts_with('.') && name != ".cargo";
        !hidden && name != "target" && path != from.join("figures")
    };
    for path in below(from, &is_source)? {
        let goal = to.join(path.strip_prefix(from).unwrap_or(&path));
        write(&goal, &std::fs::read(path)?)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_mutant_fits_the_source() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap();
        for (file, from, _) in MUTANTS.iter().flat_map(|mutant| mutant.changes) {
            let text = read(&root.join(file)).unwrap();
            assert_eq!(text.matches(from).count(), 1, "`{from}` in {file}");
        }
    }

    #[test]
    fn a_copy_holds_the_source_and_nothing_built() {
        let (from, to) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        for name in [
            "src/a.rs",
            "target/a",
            ".git/a",
            ".cargo/config.toml",
            "Cargo.lock",
            "figures/a.svg",
        ] {
            let path = from.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "a").unwrap();
        }
        copy_tree(from.path(), to.path()).unwrap();
        let there = |name: &str| to.path().join(name).exists();
        assert!(there("src/a.rs") && there(".cargo/config.toml") && there("Cargo.lock"));
        assert!(!there("target") && !there(".git") && !there("figures"));
    }
}
