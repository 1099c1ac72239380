//! Whether the tests would notice wrong code, by cargo-mutants: it makes one change after another, such as
//! `<` for `<=` or a function that returns nothing, and runs the tests of the crate on each.
//!
//! # Design
//! All changes of a part take an hour, so they can be made in shards. A few cannot be told from the code as
//! it is, by any test; docs/reliability.md lists these with their reasons.
//!
//! **A change has to be cheap.** The changes are made in a copy of the workspace that stays, so nothing but
//! the changed crate is compiled anew, and in a profile that compiles fast (`mutants` in Cargo.toml). Most
//! changes are noticed by the unit tests, which need one program. So these are run alone first, and all tests
//! only for what they let pass. The model's meter is tested by others, which are quick as well.
//!
//! **A change that makes a test hang** counts as noticed. So the limit has to be far from what the tests need
//! on a busy machine: the tests are run without a change first, and the limit is eight times as long, and at
//! least 20 s.

use std::collections::BTreeSet;
use std::path::Path;

use crate::files::read;
use crate::mutants;
use crate::step::{Line, Steps, Stop};

/// What can be changed: its name, its crate, the files if not all are meant, and the tests that are tried
/// first.
const PARTS: [(&str, &str, &str, &str); 4] = [
    (
        "model",
        "bead-model",
        "",
        "--cargo-arg=--lib --cargo-arg=--test=all -- -- --skip noise:: --skip spheres::",
    ),
    ("wire", "bead-wire", "", UNIT_TESTS),
    ("store", "bead-store", "", UNIT_TESTS),
    (
        "solver",
        "hertz-chain",
        "-f host-tools/chain/src/solver/*.rs",
        "--cargo-arg=--lib -- -- --skip two_hundred --skip long_viscous --skip takes_longer",
    ),
];
const UNIT_TESTS: &str = "--cargo-arg=--lib";
/// The test that counts instructions knows those of the profile release.
const OTHER_PROFILE: &str = "-- --skip counts::";
/// The tests notice at least this many of 100 changes that compile.
const LEAST: usize = 95;
/// When a test counts as hanging.
const LIMIT: &str = "--timeout-multiplier 8 --minimum-test-timeout 20";

/// Runs the mutants that the words name: none for those of the physics, or a part and perhaps a shard.
///
/// # Errors
/// A check or the tests do not notice enough, or cargo-mutants is missing.
pub(crate) fn check(steps: &Steps, words: &[&String]) -> Result<(), Stop> {
    let part = |name: &String| PARTS.into_iter().find(|(part, ..)| *part == name.as_str());
    let (part, shard) = match words {
        [] => return mutants::check(steps),
        [name] => (part(name), Some("0/1".to_owned())),
        [name, shard] => (part(name), is_shard(shard).then(|| (*shard).clone())),
        _ => (None, None),
    };
    let Some(((name, package, files, quick), shard)) = part.zip(shard) else {
        let parts = PARTS.map(|(name, ..)| name).join(", ");
        return Err(Stop::failed(format!(
            "give nothing, or one of {parts}, and perhaps which shard of how many: `mutants store 0/16`"
        )));
    };
    let installed = Line::new("cargo mutants --version").command().output();
    if !installed.is_ok_and(|output| output.status.success()) {
        return Err(Stop::missing(
            "cargo-mutants is not installed: cargo install cargo-mutants --locked",
        ));
    }
    let folder = steps.target.join("code-mutants");
    let copy = folder.join("tree");
    mutants::copy_tree(&steps.root, &copy).map_err(|error| {
        Stop::failed(format!(
            "cannot copy the workspace to {}: {error}",
            copy.display()
        ))
    })?;
    let line = |words: &str| {
        Line::new(words)
            .within(&copy)
            .env("CARGO_TARGET_DIR", &folder.join("target").to_string_lossy())
            // A file of cases that failed once would be tried on every other change.
            .env("PROPTEST_DISABLE_FAILURE_PERSISTENCE", "1")
    };
    let sound = line("cargo test --quiet --profile mutants --lib --tests -p")
        .arg(package)
        .words(OTHER_PROFILE);
    steps.run(&format!("the tests of {name} without a change"), &sound)?;
    let output = folder.join(name);
    let changes = |words: &str| {
        line("cargo mutants --in-place --profile mutants --no-shuffle --colors never -p")
            .arg(package)
            .arg("--output")
            .arg(&output)
            .words(&format!("{LIMIT} {words}"))
    };
    std::fs::create_dir_all(&output)
        .map_err(|error| Stop::failed(format!("cannot make {}: {error}", output.display())))?;
    let told = |what: &str| lines(&output.join("mutants.out").join(what));
    let noticed = || told("caught.txt").len() + told("timeout.txt").len();
    // It ends with a status of its own if a change is missed.
    let some = format!("{files} --shard {shard} --sharding round-robin {quick}");
    let mut ran = steps.run(&format!("changes of {name}: the quick tests"), &changes(&some));
    let (by_quick, mut missed, mut by_others) = (noticed(), told("missed.txt"), 0);
    if !missed.is_empty() {
        let title = format!("changes of {name}: all tests, on the {} others", missed.len());
        let files: BTreeSet<&str> = missed.iter().filter_map(|name| name.split(':').next()).collect();
        let others = files
            .into_iter()
            .fold(changes(""), |line, file| line.arg("-f").arg(file));
        let others = missed
            .iter()
            .fold(others, |line, name| line.arg("--re").arg(exactly(name)));
        ran = steps.run(&title, &others.words("-- --lib --tests").words(OTHER_PROFILE));
        // It makes the changes that leave out a field of a structure as well, whatever it is asked for.
        let asked = |what: &str| {
            let told = told(what).into_iter();
            told.filter(|name| missed.contains(name)).collect::<Vec<_>>()
        };
        by_others = asked("caught.txt").len() + asked("timeout.txt").len();
        let left = asked("missed.txt");
        if by_others + left.len() < missed.len() {
            ran?;
            return Err(Stop::failed("cargo-mutants did not try all that were left"));
        }
        missed = left;
    }
    let noticed = by_quick + by_others;
    let viable = noticed + missed.len();
    if viable == 0 {
        ran?;
        return Err(Stop::failed("cargo-mutants made no change that compiles"));
    }
    for change in &missed {
        eprintln!("          not noticed: {change}");
    }
    let score = format!("{noticed} of {viable} changes were noticed");
    match 100 * noticed >= LEAST * viable {
        true => {
            steps.announce(&score);
            Ok(())
        }
        false => Err(Stop::failed(format!("{score}; {LEAST} of 100 are meant"))),
    }
}

/// Such as `3/16`: counted from 0.
fn is_shard(word: &str) -> bool {
    let numbers = word
        .split_once('/')
        .map(|(a, b)| (a.parse::<u32>(), b.parse::<u32>()));
    matches!(numbers, Some((Ok(shard), Ok(all))) if shard < all)
}

/// The regular expression of this text and no other.
fn exactly(text: &str) -> String {
    let special = |letter: &char| r".*+?()|[]{}^$\".contains(*letter);
    let escaped = text.chars().flat_map(|letter| {
        Some('\\')
            .filter(|_| special(&letter))
            .into_iter()
            .chain([letter])
    });
    format!("^{}$", escaped.collect::<String>())
}

fn lines(path: &Path) -> Vec<String> {
    read(path).map_or_else(|_| Vec::new(), |text| text.lines().map(str::to_owned).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_part_and_no_shard_is_refused_before_anything_is_built() {
        let steps = Steps::start().unwrap();
        for words in [
            &["tests"][..],
            &["store", "1"],
            &["store", "4/4"],
            &["store", "a/b"],
            &["wire", "0/2", "x"],
        ] {
            let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
            let stop = check(&steps, &words.iter().collect::<Vec<_>>()).unwrap_err();
            assert!(
                stop.message.starts_with("give nothing, or one of model, wire"),
                "{}",
                stop.message
            );
        }
        assert!(is_shard("0/1") && is_shard("15/16"));
    }

    #[test]
    fn a_change_is_named_by_an_expression_that_fits_nothing_else() {
        assert_eq!(
            exactly("a_b.rs:1:2: replace <X as F>::f -> [u8; 2] with x | (1 + 2)"),
            r"^a_b\.rs:1:2: replace <X as F>::f -> \[u8; 2\] with x \| \(1 \+ 2\)$"
        );
    }
}
