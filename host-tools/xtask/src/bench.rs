//! The benchmarks of the simulator, of the monitor and of the emulator.

use crate::packages::IMAGES;
use crate::setup::TARGET;
use crate::step::{CommandLine, Steps, Stop};

/// Runs the benchmark of the simulator with these words, that of the monitor for the word `monitor`, or that
/// of the emulator for `emulator`. With `--native` the simulator's is compiled a second time, only for this
/// processor.
pub(crate) fn bench(steps: &Steps, words: &[&String]) -> Result<(), Stop> {
    match words {
        [word] if *word == "monitor" => return monitor(steps),
        [word] if *word == "emulator" => return emulator(steps),
        _ => {}
    }
    let mut line = CommandLine::new("cargo run --release --package hertz-benchmarks --");
    for word in words {
        line = line.arg(word.as_str());
        if word.as_str() == "--native" {
            let folder = steps.target.join("native");
            let build = CommandLine::new("cargo build --release --package hertz-benchmarks --target-dir")
                .arg(&folder)
                .env("RUSTFLAGS", "-C target-cpu=native");
            steps.run("the same program, only for this processor", &build)?;
            line = line.arg(folder.join("release/hertz-benchmarks"));
        }
    }
    steps.run("the chain simulator and general solvers", &line)
}

/// Runs recorder and monitor on data that comes as fast as ten beads may send.
fn monitor(steps: &Steps) -> Result<(), Stop> {
    let line =
        CommandLine::new("cargo test --release --package absorber-bead --test all -- --nocapture --exact")
            .words("monitor_rate::ten_beads_at_a_megabyte_a_second_lose_nothing")
            .env("BEAD_MONITOR_SECONDS", "600");
    let title = "recorder and monitor at 1 MB/s of ten beads, for ten minutes";
    steps.run(title, &line)
}

/// Measures the emulator's speed while an image waits.
fn emulator(steps: &Steps) -> Result<(), Stop> {
    let image = CommandLine::new("cargo build --bin waits").words(IMAGES);
    steps.run("the image that waits", &image)?;
    let image = steps.target.join(TARGET).join("firmware/waits");
    let line = CommandLine::new("cargo run --release --package stm32f405-qemu --example waiting --");
    steps.run("the emulator while firmware waits", &line.arg(image))
}
