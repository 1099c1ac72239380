//! The fault campaign: runs the image under scripts of faults drawn at random, and an update whose power is
//! cut in each operation.

use crate::image;
use crate::packages::DEMO;
use crate::setup::{Need, setup};
use crate::step::{CommandLine, Steps, Stop};

/// Runs as many scripts as the words say, `N [--seed S]`, or the power cuts: `update`.
///
/// # Errors
/// A script fails; the smallest one that does is in target/campaign. Or a power cut leaves a bead without an
/// image.
pub(crate) fn campaign(steps: &Steps, words: &[&String]) -> Result<(), Stop> {
    if words == ["update"] {
        let line = "cargo test --release -p bead-update --test power_cuts -- --ignored --nocapture";
        return steps.run(
            "an update, with a power cut in each operation",
            &CommandLine::new(line),
        );
    }
    let number = |word: &&String| word.parse::<u64>().is_ok();
    let good = match words {
        [count] => number(count),
        [count, option, seed] => number(count) && *option == "--seed" && number(seed),
        _ => false,
    };
    if !good {
        return Err(Stop::failed(
            "give the number of scripts, and optionally the seed of the first: `campaign 300 --seed 1000`; or `update`",
        ));
    }
    setup(steps, Need::Run)?;
    image::build(steps)?;
    let overlay = CommandLine::new("cargo build --release").words(DEMO);
    steps.run("the host tools", &overlay)?;
    let line = CommandLine::new("cargo run --release --quiet -p bead-fuzz --example campaign --");
    let line = words.iter().fold(line, |line, word| line.arg(word.as_str()));
    steps.run("scripts of faults", &line)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    #[test]
    fn the_program_that_runs_the_scripts_is_there() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        assert!(root.join("fuzz/examples/campaign.rs").is_file());
    }
}
