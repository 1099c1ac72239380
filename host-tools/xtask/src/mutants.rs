//! Mutants: mistakes made in a copy of the workspace, one by one, which checks or tests must notice.
//!
//! # Design
//! Mistakes in the physics are listed here and replace text that must stand in its file exactly once: a
//! mutant that no longer fits the source stops the run instead of testing nothing. The checks of the figures
//! have to notice each.
//!
//! Changes of the code, such as `<` for `<=`, are made by cargo-mutants, which runs the tests of the changed
//! crate on each. They are made in a profile that compiles fast (`mutants` in Cargo.toml). No test can
//! distinguish a few of them from the original code: docs/reliability.md lists these with their reasons.

use std::path::Path;
use std::process::Command;

use crate::files::{copy_tree, make, read, write};
use crate::step::{CommandLine, Steps, Stop};
use crate::tools;

/// Test that runs all checks of all figures.
pub(crate) const TEST: &str = "every_check_of_every_figure_passes";

/// Mistakes, each with its changes: a file, a text that occurs once in it, and the text that replaces it.
const MUTANTS: &str = "
Hertz' exponent 1.49 in place of 1.5, force and energy alike
    model/contact.rs: self.stiffness * overlap * overlap.sqrt() => self.stiffness * overlap.powf(1.49)
    model/contact.rs: 0.4 * overlap * self.elastic_force(overlap) => overlap / 2.49 * self.elastic_force(overlap)
    solver/lanes.rs: simd.mul_f64s(stiffness, simd.sqrt_f64s(overlap)) => simd.mul_f64s(stiffness, \
        pulp::cast(pulp::cast::<f64x8, LaneBlock>(overlap).map(|x| x.powf(0.49))))
    solver/crossing.rs: let stiff = self.stiffness * overlap.sqrt(); => let stiff = self.stiffness * overlap.powf(0.49);
no viscosity: τ left out
    model/contact.rs: 1.5 * self.relaxation * self.stiffness * overlap.sqrt() * rate => 0.0 * rate
    solver/lanes.rs: lanes.viscosity[at] = 1.5 * contact.relaxation; => lanes.viscosity[at] = 0.0 * contact.relaxation;
viscosity without its 3/2
    model/contact.rs: 1.5 * self.relaxation * self.stiffness => self.relaxation * self.stiffness
    solver/lanes.rs: lanes.viscosity[at] = 1.5 * contact.relaxation; => lanes.viscosity[at] = contact.relaxation;
M in place of M - m for a host, motion and energy alike
    model.rs: -= intruder.oscillator.mass; => -= 0.0 * intruder.oscillator.mass;
M in place of M - m for a host, in the energy alone
    model.rs: energies.chain += kinetic(self.shells[j], velocity) => energies.chain += kinetic(self.masses[j], velocity)
the clip lost: parting beads pull where they may not
    model.rs: if self.clipped { force.max(0.0) } else { force } => force
    solver/lanes.rs: clipped: model.clipped, => clipped: false,
an intruder that the host does not feel
    solver/kernel.rs: total = simd.add_f64s(total, simd.mul_f64s(pull, one)); => \
        total = simd.add_f64s(total, simd.mul_f64s(simd.splat_f64s(0.0), simd.mul_f64s(pull, one)));
";
/// The folder of the files.
const CHAIN: &str = "host-tools/hertz/chain/src";

/// The mistakes, each with its changes.
fn mutants() -> Vec<(&'static str, Vec<[&'static str; 3]>)> {
    let mut mutants: Vec<(_, Vec<_>)> = Vec::new();
    for line in MUTANTS.trim().lines() {
        let change = line.strip_prefix("    ").and_then(|change| {
            let (file, change) = change.split_once(": ")?;
            let (from, to) = change.split_once(" => ")?;
            Some([file, from, to])
        });
        match (change, mutants.last_mut()) {
            (Some(change), Some((_, changes))) => changes.push(change),
            _ => mutants.push((line, Vec::new())),
        }
    }
    mutants
}

/// A part of the code for cargo-mutants: its name, its crate, files if not all are meant, and tests to skip
/// because they take long or know the instructions of another profile.
const PARTS: [(&str, &str, &str, &str); 4] = [
    ("model", "bead-model", "", "--skip noise:: --skip spheres::"),
    ("wire", "bead-wire", "", ""),
    ("store", "bead-store", "", ""),
    (
        "solver",
        "hertz-chain",
        "-f host-tools/hertz/chain/src/solver/*.rs",
        "--skip counts:: --skip two_hundred --skip long_viscous --skip takes_longer",
    ),
];
/// The least share of changes that compile which the tests notice, in percent.
const LEAST: usize = 95;

/// Makes the mistakes that the words select: without words those of the physics, else a part and perhaps a
/// shard.
///
/// # Errors
/// The checks or tests do not notice enough, or something does not compile.
pub(crate) fn check(steps: &Steps, words: &[&String]) -> Result<(), Stop> {
    let (name, shard) = match words {
        [] => return physics(steps),
        [name] => (name.as_str(), "0/1"),
        [name, shard, ..] => (name.as_str(), shard.as_str()),
    };
    let part = PARTS.into_iter().find(|(part, ..)| *part == name);
    let Some(part) = part.filter(|_| words.len() <= 2 && is_shard(shard)) else {
        let parts = PARTS.map(|(name, ..)| name).join(", ");
        return Err(Stop::failed(format!(
            "give nothing, or one of {parts}, and optionally a shard, such as 0 of 16: `mutants store 0/16`"
        )));
    };
    code(steps, part, shard)
}

/// Changes the code of a part by cargo-mutants.
fn code(steps: &Steps, part: (&str, &str, &str, &str), shard: &str) -> Result<(), Stop> {
    let (name, package, files, skipped) = part;
    let program = tools::installed(steps, "cargo-mutants", "27.1.0", "")?;
    let output = steps.target.join("code-mutants").join(name);
    make(&output)?;
    // A change that makes a test hang is noticed too. The limit is far from what the tests need on a busy
    // machine. Failed cases are not kept in a file, as they would be tried on every other change.
    let changes = CommandLine::program(program)
        .words("mutants --profile mutants --no-shuffle --sharding round-robin --shard")
        .arg(shard)
        .words("--timeout-multiplier 8 --minimum-test-timeout 20 -p")
        .arg(package)
        .words(files)
        .arg("--output")
        .arg(&output)
        .words("-- --lib --tests --")
        .words(skipped)
        .env("PROPTEST_DISABLE_FAILURE_PERSISTENCE", "1");
    // It ends with status 2 if a change was missed, and with 3 if one timed out.
    let ran = steps.run(&format!("changes to {name}"), &changes);
    if let Err(stop) = ran.as_ref()
        && ![2, 3].contains(&stop.status)
    {
        return ran;
    }
    let count = |verdict: &str| -> Result<usize, Stop> {
        Ok(read(&output.join("mutants.out").join(verdict))?.lines().count())
    };
    let noticed = count("caught.txt")? + count("timeout.txt")?;
    let viable = noticed + count("missed.txt")?;
    let score = format!("{noticed} of {viable} changes were noticed");
    if viable == 0 || 100 * noticed < LEAST * viable {
        return Err(Stop::failed(format!(
            "{score}; at least {LEAST} of 100 are required"
        )));
    }
    steps.announce(&score);
    Ok(())
}

/// True for text such as `3/16`: counted from 0.
fn is_shard(word: &str) -> bool {
    let numbers = word
        .split_once('/')
        .map(|(a, b)| (a.parse::<u32>(), b.parse::<u32>()));
    matches!(numbers, Some((Ok(shard), Ok(all))) if shard < all)
}

/// Makes every mistake of [`mutants`].
///
/// # Errors
/// A mutant that no check notices, or that does not fit the source or does not compile.
fn physics(steps: &Steps) -> Result<(), Stop> {
    let copy = steps.target.join("mutants");
    copy_tree(&steps.root, &copy)?;
    steps.announce("without a mistake every check must pass");
    if let Some(broken) = broken_checks(steps, &copy)? {
        let broken = broken.join("; ");
        return Err(Stop::failed(format!("checks fail without a mutant: {broken}")));
    }
    let mut survivors = Vec::new();
    let mutants = mutants();
    for (mistake, changes) in &mutants {
        steps.announce(mistake);
        for [file, from, to] in changes {
            let path = copy.join(CHAIN).join(file);
            let text = read(&path)?;
            if text.matches(from).count() != 1 {
                return Err(Stop::failed(format!(
                    "`{from}` does not occur exactly once in {file}; rewrite the mutant"
                )));
            }
            write(&path, text.replace(from, to))?;
        }
        let broken = broken_checks(steps, &copy)?;
        for [file, ..] in changes {
            let sound = read(&steps.root.join(CHAIN).join(file))?;
            write(&copy.join(CHAIN).join(file), sound)?;
        }
        match broken {
            Some(broken) => {
                let checks = if broken.len() == 1 { "check" } else { "checks" };
                eprintln!("          noticed by {} {checks}, such as", broken.len());
                for check in broken.iter().take(3) {
                    eprintln!("            {check}");
                }
            }
            None => survivors.push(*mistake),
        }
    }
    if survivors.is_empty() {
        steps.announce(&format!("all {} mistakes are noticed", mutants.len()));
        return Ok(());
    }
    let survivors = survivors.join("; ");
    Err(Stop::failed(format!("no check notices: {survivors}")))
}

/// Runs the checks in a copy of the workspace, and returns those that fail; `None` if all pass.
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
    if !checks.is_empty() {
        return Ok(Some(checks));
    }
    if told.contains(TEST) {
        return Ok(Some(vec!["a figure that could not be drawn at all".to_owned()]));
    }
    let why = String::from_utf8_lossy(&output.stderr);
    Err(Stop::failed(format!("the mutant does not compile:\n{why}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_mutant_fits_the_source() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap();
        let mutants = mutants();
        assert_eq!(mutants.len(), 7);
        for [file, from, _] in mutants.iter().flat_map(|(_, changes)| changes) {
            let text = read(&root.join(CHAIN).join(file)).unwrap();
            assert_eq!(text.matches(from).count(), 1, "`{from}` in {file}");
        }
    }
}
