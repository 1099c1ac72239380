//! Compares the portable program, which finds its vectors when it starts, with one compiled for this
//! processor.

use std::path::Path;
use std::process::Command;

use crate::cases::Case;
use crate::report::{Aim, Measurements};
use crate::{ensemble, ours};

/// Names of the timed cases.
const NAMES: [&str; 3] = ["A, end only", "B, end only", "ensemble"];
/// Few, for on a shared computer a long piece is always disturbed.
const CHAINS: usize = 64;
/// Runs within one round: the least counts.
const RUNS: usize = 400;

/// Prints the least seconds of each of [`NAMES`], in one line. Both programs do this, in turn.
pub(crate) fn print() {
    let accuracy = hertz_chain::Accuracy::new(1e-8, 1.0);
    let [a, b] = Case::scenarios().map(|(.., scenario)| scenario);
    let chains = ensemble::scenarios(CHAINS);
    let seconds = [
        ours::least_seconds(RUNS, || ours::end(&a, accuracy)),
        ours::least_seconds(RUNS, || ours::end(&b, accuracy)),
        ours::least_seconds(RUNS / 4, || ensemble::alone(&chains)),
    ];
    println!("{}", seconds.map(|seconds| seconds.to_string()).join(" "));
}

/// Runs a round of a program.
fn round(program: &Path) -> Result<Vec<f64>, String> {
    let told = Command::new(program).arg("--pace").output();
    let told = told.map_err(|error| format!("cannot run {}: {error}", program.display()))?;
    let text = String::from_utf8_lossy(&told.stdout);
    let words = text.split_whitespace();
    let seconds: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
    if seconds.len() == NAMES.len() {
        return Ok(seconds);
    }
    Err(format!("{} printed no times", program.display()))
}

/// Compares this program with `native`, the same one compiled for this processor.
pub(crate) fn compare(report: &mut Measurements, native: &Path, rounds: usize) -> Result<(), String> {
    let own = std::env::current_exe().map_err(|error| error.to_string())?;
    let mut least = [[f64::INFINITY; NAMES.len()]; 2];
    for _ in 0..rounds {
        for (least, program) in least.iter_mut().zip([own.as_path(), native]) {
            for (least, seconds) in least.iter_mut().zip(round(program)?) {
                *least = least.min(seconds);
            }
        }
    }
    for (at, name) in NAMES.iter().enumerate() {
        let more = 100.0 * (least[0][at] / least[1][at] - 1.0);
        let name = format!("{name}: time of the portable program beyond that of a native one");
        report.goal(name, Some(more), Aim::AtMost(5.0), "%");
    }
    Ok(())
}
