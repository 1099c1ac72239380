//! `bead-figures` as scripts see it: exit status, files, keys of JSON.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

#[path = "../../../bead/tests/all/schema.rs"]
mod schema;

use std::fs;
use std::process::{Command, Output};

use bead_console::schema::of;
use hertz_figures::plan::FigureOutcome;
use serde_json::Value;

fn figures(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bead-figures"))
        .args(arguments)
        .output()
        .unwrap()
}

/// Standard error of a command that must end with `status`: one line, which holds every one of `parts`.
fn refused(arguments: &[&str], status: i32, parts: &[&str]) {
    let output = figures(arguments);
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(status), "{arguments:?}: {error}");
    assert_eq!(error.lines().count(), 1, "{arguments:?}: {error}");
    for part in parts {
        assert!(
            error.contains(part),
            "{arguments:?}: \"{part}\" is not in: {error}"
        );
    }
}

fn json(arguments: &[&str]) -> Value {
    let output = figures(arguments);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn the_help_fits_a_terminal_of_80_columns() {
    let mut figures = Command::new(env!("CARGO_BIN_EXE_bead-figures"));
    figures.env("COLUMNS", "80").arg("--help");
    let help = String::from_utf8(figures.output().unwrap().stdout).unwrap();
    assert!(help.contains("Usage:"), "{help}");
    for line in help.lines() {
        assert!(line.chars().count() <= 80, "{line}");
    }
}

#[test]
fn a_figure_leaves_its_picture_its_data_and_its_checks() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("new/figures");
    let table = directory.path().join("checks.md");
    let [out_text, table_text] = [&out, &table].map(|path| path.to_str().unwrap());
    let figures = json(&[
        "2C", "--check", "--out", out_text, "--table", table_text, "--format", "json",
    ]);
    let figure = &figures[0];
    assert_eq!(figures.as_array().unwrap().len(), 1);
    assert_eq!((&figure["name"], &figure["pass"]), (&"2c".into(), &true.into()));
    let schemas = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../docs/schemas");
    schema::hold(schemas, "figures", &of::<Vec<FigureOutcome>>("figures"));
    schema::assert_valid(schemas, "figures", &figures);
    assert_eq!(figure["files"].as_array().unwrap().len(), 5);
    assert_eq!(figure["plate_files"].as_array().unwrap().len(), 0);
    let bytes = |extension: &str| fs::read(out.join(format!("figure-2c.{extension}"))).unwrap();
    assert!(bytes("svg").starts_with(b"<svg "));
    assert!(bytes("png").starts_with(b"\x89PNG"));
    assert!(bytes("pdf").starts_with(b"%PDF-"));
    assert!(bytes("parquet").starts_with(b"PAR1"));
    let csv = String::from_utf8(bytes("csv")).unwrap();
    assert!(csv.starts_with("panel,curve,x_quantity,x,y_quantity,y\n"));
    let y = |line: &str| line.rsplit(',').next().unwrap().parse::<f64>().unwrap();
    let highest = csv.lines().skip(1).map(y).fold(0.0, f64::max);
    assert!(
        (highest - 133.23).abs() < 0.05,
        "the curve's own maximum, {highest} m/s²"
    );
    let table = fs::read_to_string(table).unwrap();
    assert!(table.contains("| 2c | highest acceleration | 133.233 m/s² |"));
    let index = fs::read_to_string(out.join("index.html")).unwrap();
    assert!(index.contains("figure-2c.svg"));
}

#[test]
fn all_figures_of_a_number_make_a_plate() {
    let directory = tempfile::tempdir().unwrap();
    let figures = json(&[
        "A6",
        "--out",
        directory.path().to_str().unwrap(),
        "--format",
        "json",
    ]);
    let plates = |figure: usize| figures[figure]["plate_files"].as_array().unwrap();
    assert_eq!((plates(0).len(), plates(0)), (3, plates(1)));
    let svg = fs::read_to_string(directory.path().join("plate-A6.svg")).unwrap();
    assert!(svg.contains(">(a)</text>") && svg.contains(">(b)</text>"));
    let page = fs::read_to_string(directory.path().join("index.html")).unwrap();
    assert!(page.contains("plate-A6.pdf"));
    // The font is in the file, so that the page looks the same everywhere.
    let pdf = fs::read(directory.path().join("plate-A6.pdf")).unwrap();
    assert!(
        pdf.windows(10).any(|bytes| bytes == b"/FontFile2"),
        "{} bytes",
        pdf.len()
    );
}

#[test]
fn a_figure_that_is_none_and_a_place_that_is_no_directory_are_refused() {
    refused(&["2e"], 2, &["2e: no such figure", "2d, 3a"]);
    let file = tempfile::NamedTempFile::new().unwrap();
    let into = ["2a", "--out", file.path().to_str().unwrap()];
    refused(&into, 2, &["cannot make the directory", "give another directory"]);
    let list = json(&["--list", "--format", "json"]);
    assert!(list.as_array().unwrap().len() > 50);
}
