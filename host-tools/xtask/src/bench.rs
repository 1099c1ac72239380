//! The benchmark of the simulator.

use crate::step::{CommandLine, Steps, Stop};

/// Runs the benchmark with these words. For `--native` it is compiled a second time, for this processor
/// alone.
///
/// # Errors
/// It does not build, or ends with an error.
pub(crate) fn bench(steps: &Steps, words: &[&String]) -> Result<(), Stop> {
    let mut line = CommandLine::new("cargo run --release --package hertz-benchmarks --");
    for word in words {
        line = line.arg(word.as_str());
        if word.as_str() == "--native" {
            let folder = steps.target.join("native");
            let build = CommandLine::new("cargo build --release --package hertz-benchmarks --target-dir")
                .arg(&folder)
                .env("RUSTFLAGS", "-C target-cpu=native");
            steps.run("the same program for this processor alone", &build)?;
            line = line.arg(folder.join("release/hertz-benchmarks"));
        }
    }
    steps.run("the chain simulator and general solvers", &line)
}
