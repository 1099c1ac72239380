//! Lines of Rust by crate.

use std::collections::BTreeMap;
use std::path::Path;

use crate::files::texts;
use crate::step::{Steps, Stop};

/// Prints a row for each crate: lines of source and of tests. Lines of tests are those in files below a
/// folder `tests`, in files called `tests.rs`, and in modules `tests` under `cfg(test)`.
pub(crate) fn print(steps: &Steps) -> Result<(), Stop> {
    let mut crates: BTreeMap<&Path, [usize; 2]> = BTreeMap::new();
    let files = texts(&steps.root, ".rs")?;
    for (file, text) in &files {
        let mut folders = file.ancestors().skip(1);
        let Some(folder) = folders.find(|folder| folder.join("Cargo.toml").exists()) else {
            continue;
        };
        let inside = file.strip_prefix(folder).unwrap_or(file);
        let is_test = inside.components().any(|part| part.as_os_str() == "tests")
            || inside.ends_with("tests.rs")
            || file.starts_with(steps.root.join("tests"));
        let all = text.lines().count();
        let tests = if is_test { all } else { lines_of_tests(text) };
        let row = crates.entry(folder).or_default();
        row[0] += all - tests;
        row[1] += tests;
    }
    let mut sum = [0, 0];
    println!("{:<34} {:>7} {:>7}", "crate", "source", "tests");
    for (folder, [source, tests]) in crates {
        let folder = folder.strip_prefix(&steps.root).unwrap_or(folder).display();
        println!("{folder:<34} {source:>7} {tests:>7}");
        sum = [sum[0] + source, sum[1] + tests];
    }
    println!(
        "{:<34} {:>7} {:>7}  total {}",
        "all",
        sum[0],
        sum[1],
        sum[0] + sum[1]
    );
    Ok(())
}

/// Lines from `#[cfg(test)]` before a `mod … {` at the margin to the brace that closes it.
fn lines_of_tests(text: &str) -> usize {
    let lines: Vec<&str> = text.lines().collect();
    let starts = (1..lines.len()).filter(|&at| {
        let is_module = lines[at].starts_with("mod ") && lines[at].ends_with('{');
        is_module
            && lines[..at]
                .iter()
                .rev()
                .take(4)
                .any(|line| *line == "#[cfg(test)]")
    });
    starts
        .map(|at| 2 + lines[at..].iter().take_while(|line| **line != "}").count())
        .sum()
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_module_of_tests_counts_from_its_attribute_to_its_brace() {
        let text = "fn f() {\n}\n\n#[cfg(test)]\nmod tests {\n    fn g() {\n    }\n}\n";
        assert_eq!(super::lines_of_tests(text), 5);
    }
}
