//! xtask as cargo's compiler: rustc, then clippy and rustdoc on the same crate.
//!
//! # Design
//! `cargo clippy` and `cargo doc` have no use for what has been compiled: they type-check each of the 300
//! packages that ours rest on once more, which takes a tenth of a whole test from nothing. Beside rustc, both
//! find what they need. So where nothing is there yet, xtask is cargo's `RUSTC_WRAPPER`: cargo calls it with
//! rustc's path and arguments. A wrapper changes neither what cargo makes nor the names of it.
//!
//! What cargo does not compile, because it is there already, is not checked in this way: `lint.rs` sees to
//! that.

use std::env;
use std::fs;
use std::path::Path;
use std::process::{Command, ExitCode};

use crate::step::{Line, Steps, Stop};

/// Where the wrapper is, and what clippy and rustdoc write.
const FOLDER: &str = "lints";

/// Puts a copy of this program where [`build`] has cargo find it. Cargo may put another one in the place of
/// this.
///
/// # Errors
/// The copy cannot be written.
pub(crate) fn put(steps: &Steps) -> Result<(), Stop> {
    let copy = || {
        fs::create_dir_all(steps.target.join(FOLDER))?;
        let to = steps.target.join(FOLDER).join("rustc-and-lints");
        // A program that runs cannot be written over.
        fs::remove_file(&to).or_else(|error| match error.kind() {
            std::io::ErrorKind::NotFound => Ok(()),
            _ => Err(error),
        })?;
        fs::copy(env::current_exe()?, to)
    };
    copy().map(drop).map_err(|error| {
        let folder = steps.target.join(FOLDER);
        Stop::failed(format!("{}: cannot copy xtask there: {error}", folder.display()))
    })
}

/// What a build has made, as cargo tells it, and whether all of it has been checked.
pub(crate) struct Built {
    pub(crate) told: String,
    pub(crate) checked: bool,
}

/// Runs a build of cargo. Unless `made` is there already, each crate of ours is checked as it is compiled.
/// Documentation goes into target/lints/doc.
///
/// # Errors
/// Of the build.
pub(crate) fn build(steps: &Steps, title: &str, line: &Line, made: &Path) -> Result<Built, Stop> {
    let line = line.clone().words("--message-format json-render-diagnostics");
    // A wrapper of the user's own, such as a cache of compiled crates, stays.
    if steps.root.join(made).exists() || env::var_os("RUSTC_WRAPPER").is_some() {
        let told = steps.read(title, &line)?;
        return Ok(Built { told, checked: false });
    }
    let wrapper = steps.built(&format!("{FOLDER}/rustc-and-lints"));
    let told = steps.read(title, &line.env("RUSTC_WRAPPER", &wrapper.to_string_lossy()))?;
    let checked = all_compiled(&told);
    Ok(Built { told, checked })
}

/// Whether cargo says that it has just compiled all of ours. (It has compiled xtask before this runs.)
fn all_compiled(told: &str) -> bool {
    let ours = |line: &&str| {
        line.starts_with(r#"{"reason":"compiler-artifact","#) && line.contains(r#""package_id":"path+file:"#)
    };
    let mut ours = told.lines().filter(ours);
    ours.all(|line| line.contains(r#""fresh":false"#) || line.contains("/xtask#"))
}

/// Compiles and checks one crate, if cargo has called this program for that; then with the status to end
/// with.
pub(crate) fn called() -> Option<ExitCode> {
    let mut words = env::args_os().skip(1);
    let rustc = words.next()?;
    if Path::new(&rustc).file_stem()? != "rustc" {
        return None;
    }
    let words: Vec<String> = words.map(|word| word.to_string_lossy().into_owned()).collect();
    let folder = env::current_exe().ok();
    let folder = folder
        .as_deref()
        .and_then(Path::parent)?
        .to_string_lossy()
        .into_owned();
    let compile = Command::new(&rustc).args(&words).status();
    // Build scripts of others try through this program too what rustc can do: nothing may change what they
    // see.
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2)?;
    let ours = env::var_os("CARGO_MANIFEST_DIR").is_some_and(|package| Path::new(&package).starts_with(root));
    let checks = match ours {
        true => checks(&words, &folder, env::var_os("CARGO_PRIMARY_PACKAGE").is_some()),
        false => Vec::new(),
    };
    let checks = checks
        .iter()
        .map(|check| Command::new(&check[0]).args(&check[1..]).status());
    for ended in [compile].into_iter().chain(checks) {
        match ended {
            Ok(status) if status.success() => {}
            Ok(_) => return Some(ExitCode::FAILURE),
            Err(error) => {
                eprintln!("rustc, clippy-driver or rustdoc could not start: {error}");
                return Some(ExitCode::FAILURE);
            }
        }
    }
    Some(ExitCode::SUCCESS)
}

/// The commands that check what these words have rustc compile: as `cargo clippy` and `cargo doc` have them.
fn checks(words: &[String], folder: &str, primary: bool) -> Vec<Vec<String>> {
    let has = |wanted: &str| words.iter().any(|word| word == wanted);
    let compiles = words.iter().any(|word| word.starts_with("--emit="));
    // What is not ours has this.
    if !compiles || has("--cap-lints") {
        return Vec::new();
    }
    let mut kept = Vec::new();
    let mut rest = words.iter();
    while let Some(word) = rest.next() {
        match word.as_str() {
            "--out-dir" => drop(rest.next()),
            word if word.starts_with("--emit=") => {}
            // Cargo waits for files by this, and has rustc's.
            word if word.starts_with("--json=") => kept.push(word.replace(",artifacts", "")),
            word => kept.push(word.to_owned()),
        }
    }
    kept.extend(["-D", "warnings"].map(str::to_owned));
    let line = |program: &[&str], more: &[&str]| {
        let program = program.iter().map(|word| (*word).to_owned());
        let more = more.iter().map(|word| (*word).to_owned());
        program.chain(kept.clone()).chain(more).collect::<Vec<_>>()
    };
    let mut lines = vec![line(
        &["clippy-driver", "rustc"],
        &["--emit=metadata", "--out-dir", folder],
    )];
    let documented = primary && !has("--test") && !has("build_script_build");
    if documented {
        let documentation = format!("{folder}/doc");
        // Of a program there is nothing public.
        let private = has("bin").then_some("--document-private-items");
        let more = ["-o", &documentation].into_iter().chain(private);
        let mut line = line(&["rustdoc"], &more.collect::<Vec<_>>());
        // Names of folders that the image shall not have. Only nightly's rustdoc knows them.
        line.retain(|word| !word.starts_with("--remap-path-prefix="));
        lines.push(line);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Vec<String> {
        line.split_whitespace().map(str::to_owned).collect()
    }

    #[test]
    fn a_crate_of_ours_is_linted_and_documented_by_what_rustc_was_told() {
        let library = words(
            "--crate-name bead --edition=2024 src/lib.rs --crate-type lib --json=a,artifacts,b \
             --emit=dep-info,metadata,link --warn=missing_docs --out-dir deps -L dependency=deps \
             --remap-path-prefix=/home=~",
        );
        let kept = "--crate-name bead --edition=2024 src/lib.rs --crate-type lib --json=a,b --warn=missing_docs \
                    -L dependency=deps";
        let clippy = words(&format!(
            "clippy-driver rustc {kept} --remap-path-prefix=/home=~ -D warnings --emit=metadata --out-dir lints"
        ));
        let rustdoc = words(&format!("rustdoc {kept} -D warnings -o lints/doc"));
        assert_eq!(checks(&library, "lints", true), [clippy.clone(), rustdoc]);
        assert_eq!(checks(&library, "lints", false), [clippy]);
    }

    #[test]
    fn tests_are_linted_alone_and_what_others_made_is_not() {
        let test = words("--crate-name bead --test --emit=dep-info,link src/lib.rs");
        let linted = checks(&test, "lints", true);
        assert_eq!(linted.len(), 1);
        assert!(linted[0].contains(&"--test".to_owned()));
        let other = words("--crate-name serde --cap-lints allow --emit=dep-info,link lib.rs");
        let asked = words("- --crate-name ___ --print=file-names");
        for line in [other, asked] {
            assert!(checks(&line, "lints", false).is_empty());
        }
    }

    #[test]
    fn what_was_there_already_has_not_been_checked() {
        let made = |package: &str, fresh: bool| {
            format!(
                r#"{{"reason":"compiler-artifact","package_id":"{package}","profile":{{}},"fresh":{fresh}}}"#
            )
        };
        let told = |lines: &[String]| all_compiled(&lines.join("\n"));
        let ours = made("path+file:///w/host-tools#bead@0.1.0", false);
        let serde = made(
            "registry+https://github.com/rust-lang/crates.io-index#serde@1.0.0",
            true,
        );
        let xtask = made("path+file:///w/host-tools/xtask#0.1.0", true);
        let there = made("path+file:///w/firmware/wire#bead-wire@0.1.0", true);
        let script =
            r#"{"reason":"build-script-executed","package_id":"path+file:///w/host-tools#bead@0.1.0"}"#;
        assert!(told(&[ours.clone(), serde, xtask, script.to_owned()]));
        assert!(!told(&[ours, there]));
    }
}
