//! The fuzz targets of `fuzz/`, by cargo-fuzz.

use std::path::Path;

use crate::files;
use crate::nightly;
use crate::step::{Steps, Stop};

/// Default duration of each target, s.
const SECONDS: u64 = 60;
/// Longest input, bytes: as in the short run of `fuzz/tests/seeded.rs`.
const LONGEST: usize = 16 << 10;
/// Limits of an input: s and MB.
const LIMITS: &str = "-timeout=10 -rss_limit_mb=1024 -malloc_limit_mb=256";
/// Targets that take TOML: they get a list of its words.
const OF_TOML: [&str; 5] = ["beads", "faults", "limits", "scenarios", "sweeps"];
/// No address sanitizer: the project's code has no `unsafe` here, so it would cost two thirds of the speed to
/// check only dependencies.
const OPTIONS: &str = "--fuzz-dir fuzz --sanitizer none --features libfuzzer";

/// Runs a target, or all of them, for a time. The words are `[TARGET] [TIME]`.
///
/// # Errors
/// An input breaks something, or the nightly or cargo-fuzz is missing.
pub(crate) fn fuzz(steps: &Steps, words: &[&String]) -> Result<(), Stop> {
    let all = targets(&steps.root)?;
    let (mut chosen, mut seconds) = (all.clone(), SECONDS);
    for word in words {
        match (all.iter().find(|target| target == word), time(word)) {
            (Some(target), _) => chosen = vec![target.clone()],
            (None, Some(time)) => seconds = time,
            (None, None) => {
                let all = all.join(", ");
                return Err(Stop::failed(format!(
                    "`{word}` is neither a target nor a time; give one of {all}, or a time such as 90s, 10m or 1h"
                )));
            }
        }
    }
    nightly::need("--version", "rustup toolchain install nightly")?;
    nightly::need("fuzz --version", "cargo install cargo-fuzz --locked")?;
    let target = steps.target.join("fuzz");
    for name in &chosen {
        let [learned, found] = ["corpus", "found"].map(|folder| target.join(folder).join(name));
        for folder in [&learned, &found] {
            files::make(folder)?;
        }
        // libFuzzer keeps what it learns in the first folder that it is given.
        let mut line = nightly::cargo("fuzz run")
            .words(OPTIONS)
            .arg(name)
            .arg(&learned)
            .words(&format!("fuzz/corpus/{name} --"))
            .words(&format!("-max_total_time={seconds} -max_len={LONGEST} {LIMITS}"))
            // Nobody reads the notes about damaged files a million times.
            .words("-print_final_stats=1 -close_fd_mask=2")
            .arg(format!("-artifact_prefix={}/", found.display()))
            .env("CARGO_TARGET_DIR", &target.to_string_lossy());
        if OF_TOML.contains(&name.as_str()) {
            line = line.words("-dict=fuzz/toml.words");
        }
        steps.run(&format!("{name}, for {seconds} s"), &line)?;
    }
    steps.announce(&format!(
        "{} ran for {seconds} s each, and nothing was found",
        chosen.join(", ")
    ));
    Ok(())
}

/// The targets, by their folders of seeds.
fn targets(root: &Path) -> Result<Vec<String>, Stop> {
    let folders = files::entries(&root.join("fuzz/corpus"))?;
    let names = folders.iter().filter_map(|folder| folder.file_name()?.to_str());
    Ok(names.map(str::to_owned).collect())
}

/// A time such as `90s`, `10m` or `1h`, in s.
fn time(word: &str) -> Option<u64> {
    let unit = match word.chars().last()? {
        's' => 1,
        'm' => 60,
        'h' => 3600,
        _ => return None,
    };
    let number: u64 = word[..word.len() - 1].parse().ok()?;
    number.checked_mul(unit).filter(|seconds| *seconds > 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_has_a_unit_and_is_not_nothing() {
        assert_eq!(
            [time("90s"), time("10m"), time("2h")],
            [Some(90), Some(600), Some(7200)]
        );
        for word in ["90", "0s", "h", "", "1d", "-1s", "99999999999999999999h"] {
            assert_eq!(time(word), None, "{word}");
        }
    }
}
