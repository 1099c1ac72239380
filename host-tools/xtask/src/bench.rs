//! The benchmarks of the simulator and of the monitor.

use crate::step::{CommandLine, Steps, Stop};

/// Runs the benchmark of the simulator with these words, or that of the monitor with the word `monitor`. For
/// `--native` it is compiled a second time, for this processor alone.
///
/// # Errors
/// It does not build, or ends with an error.
pub(crate) fn bench(steps: &Steps, words: &[&String]) -> Result<(), Stop> {
    if let [word] = words
        && word.as_str() == "monitor"
    {
        let name = "monitor_rate::ten_beads_at_a_megabyte_a_second_lose_nothing";
        let line = CommandLine::new(
            "cargo test --release --package absorber-bead --test all -- --nocapture --exact",
        )
        .arg(name)
        .env("BEAD_MONITOR_SECONDS", "600");
        return steps.run(
            "recorder and monitor at 1 MB/s of ten beads, for ten minutes",
            &line,
        );
    }
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
