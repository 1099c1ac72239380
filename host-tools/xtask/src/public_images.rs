//! The examples of the crate stm32f4xx-hal in the emulator. `public-images.toml` lists them with their
//! expected results. docs/emulator.md has the count.

use std::path::{Path, PathBuf};
use std::process::Command;

use toml::Table;

use crate::files::{copy_tree, read, write};
use crate::setup::{Need, TARGET, setup};
use crate::step::{CommandLine, Steps, Stop};

const TABLE: &str = include_str!("../public-images.toml");
/// A waveform of scenarios: the code 1000.
const LEVEL: &str = "x\n1000\n1000\n";
/// A package that only depends on the crate. It and the copy belong to no workspace.
const NEEDS_IT: &str = "\
[package]
name = \"needs-it\"
edition = \"2024\"

[dependencies]
stm32f4xx-hal = { version = \"=0.23.0\", features = [\"stm32f411\"] }

[workspace]
";

/// Builds the examples, runs each under `stm32-emu --strict`, and prints a table.
///
/// # Errors
/// An example does not build, or does not do what the table says.
pub(crate) fn check(steps: &Steps) -> Result<(), Stop> {
    setup(steps, Need::Run)?;
    let emulator = CommandLine::new("cargo build --release --package stm32f405-qemu");
    steps.run("the emulator", &emulator)?;
    let folder = steps.target.join("public-images");
    let hal = copy(steps, &folder)?;
    write(&folder.join("level.csv"), LEVEL)?;
    let table: Table = TABLE
        .parse()
        .map_err(|error| Stop::failed(format!("public-images.toml: {error}")))?;
    let (mut works, mut missing, mut other) = (0, 0, Vec::new());
    for group in tables(&table, "group") {
        build(steps, &hal, group)?;
        for image in tables(group, "image") {
            match run(steps, &folder, &hal, group, image)? {
                true if image.contains_key("missing") => missing += 1,
                true => works += 1,
                false => other.push(text(image, "name")),
            }
        }
    }
    println!("{works} work, {missing} report what is missing");
    if other.is_empty() {
        return Ok(());
    }
    let why = "not as host-tools/xtask/public-images.toml says";
    Err(Stop::failed(format!("{}: {why}", other.join(", "))))
}

/// A copy of the crate in which cargo can build its examples.
fn copy(steps: &Steps, folder: &Path) -> Result<PathBuf, Stop> {
    let (needs_it, hal) = (folder.join("needs-it"), folder.join("hal"));
    write(&needs_it.join("Cargo.toml"), NEEDS_IT)?;
    write(&needs_it.join("src/lib.rs"), "")?;
    let fetch = CommandLine::new("cargo fetch").within(&needs_it);
    steps.run("the source of stm32f4xx-hal", &fetch)?;
    let metadata = CommandLine::new("cargo metadata --format-version 1").within(&needs_it);
    let metadata = steps.read("where cargo keeps that source", &metadata)?;
    let metadata: serde_json::Value =
        serde_json::from_str(&metadata).map_err(|error| Stop::failed(format!("cargo metadata: {error}")))?;
    let mut packages = metadata["packages"].as_array().into_iter().flatten();
    let manifest = packages
        .find(|package| package["name"] == "stm32f4xx-hal")
        .and_then(|package| Path::new(package["manifest_path"].as_str()?).parent())
        .ok_or_else(|| Stop::failed("cargo has no stm32f4xx-hal"))?;
    copy_tree(manifest, &hal)?;
    let whole = read(&manifest.join("Cargo.toml"))? + "\n[workspace]\n";
    write(&hal.join("Cargo.toml"), whole)?;
    Ok(hal)
}

/// Builds all images of a group with one set of features.
fn build(steps: &Steps, hal: &Path, group: &Table) -> Result<(), Stop> {
    let line = CommandLine::new("cargo build --release --target-dir target --features");
    let mut line = line.arg(text(group, "features")).within(hal);
    for image in tables(group, "image") {
        line = line.arg("--example").arg(text(image, "name"));
    }
    steps.run(&format!("examples for {}", text(group, "part")), &line)
}

/// Runs an image, prints a line, and returns `true` if it does what the table says.
fn run(steps: &Steps, folder: &Path, hal: &Path, group: &Table, image: &Table) -> Result<bool, Stop> {
    let name = text(image, "name");
    let of = |key| Some(text(image, key)).filter(|own| !own.is_empty());
    let part = of("part").unwrap_or_else(|| text(group, "part"));
    let mut command = Command::new(steps.target.join("release/stm32-emu"));
    command
        .args(["--strict", "--chip", part, "--for"])
        .arg(of("for").unwrap_or("2s"));
    command.args(text(image, "options").split_whitespace());
    if let Some(scenario) = of("scenario") {
        let path = folder.join(name).with_extension("toml");
        write(&path, scenario)?;
        command.arg("--scenario").arg(path);
    }
    command.arg(
        hal.join("target")
            .join(TARGET)
            .join("release/examples")
            .join(name),
    );
    let ran = command
        .output()
        .map_err(|error| Stop::failed(format!("stm32-emu: {error}")))?;
    let said = String::from_utf8_lossy(&ran.stdout) + String::from_utf8_lossy(&ran.stderr);
    let took = said.lines().find(|line| line.contains("of the image's time in"));
    let status = image.get("status").and_then(toml::Value::as_integer).unwrap_or(0);
    let is_said = is_said(&said, &words(image, "expected")) && is_said(&said, &words(image, "missing"));
    let as_expected = is_said && ran.status.code().map(i64::from) == Some(status);
    let verdict = match (as_expected, image.contains_key("missing")) {
        (false, _) => "other",
        (true, true) => "missing",
        (true, false) => "works",
    };
    println!("{verdict:8} {part:12} {name:40} {}", took.unwrap_or_default());
    if !as_expected {
        println!("{said}\nstatus {:?}, expected {status}", ran.status.code());
    }
    Ok(as_expected)
}

/// Returns `true` if these texts come in this order.
fn is_said(said: &str, expected: &[&str]) -> bool {
    let mut rest = said;
    expected.iter().all(|text| {
        let found = rest.split_once(text);
        rest = found.map_or("", |(_, after)| after);
        found.is_some()
    })
}

fn tables<'a>(table: &'a Table, key: &str) -> impl Iterator<Item = &'a Table> {
    let list = table.get(key).and_then(toml::Value::as_array);
    list.into_iter().flatten().filter_map(toml::Value::as_table)
}

fn text<'a>(table: &'a Table, key: &str) -> &'a str {
    table.get(key).and_then(toml::Value::as_str).unwrap_or_default()
}

fn words<'a>(table: &'a Table, key: &str) -> Vec<&'a str> {
    let list = table.get(key).and_then(toml::Value::as_array);
    list.into_iter()
        .flatten()
        .filter_map(toml::Value::as_str)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_image_of_the_table_has_a_name_a_part_and_a_text_that_is_expected() {
        let table: Table = TABLE.parse().unwrap();
        let mut names = Vec::new();
        for group in tables(&table, "group") {
            assert!(!text(group, "features").is_empty() && !text(group, "part").is_empty());
            for image in tables(group, "image") {
                let name = text(image, "name");
                assert!(
                    !words(image, "expected").is_empty() || !words(image, "missing").is_empty(),
                    "{name}"
                );
                names.push(name);
            }
        }
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert!(count > 30 && names.len() == count);
    }

    #[test]
    fn texts_are_looked_for_in_their_order() {
        assert!(is_said("one two three", &["one", "three"]) && is_said("", &[]));
        assert!(!is_said("one two three", &["three", "one"]));
    }
}
