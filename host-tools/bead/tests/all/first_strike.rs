//! docs/first-strike.md, followed word for word: every command, in its order; and what a user gets with the
//! program.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::program::{PROGRAM, ROOT, SCENARIO, assert_says, done, python, shell, typed};
use bead_recording::file::{Part, Recording};

/// The blocks of the page that are to be typed: shell lines that are indented, and Python.
fn blocks(page: &str) -> Vec<(bool, String)> {
    let mut blocks = Vec::new();
    let mut python: Option<String> = None;
    for line in page.lines() {
        match (&mut python, line) {
            (None, "```python") => python = Some(String::new()),
            (Some(_), "```") => blocks.extend(python.take().map(|code| (true, code))),
            (Some(code), line) => *code += &format!("{line}\n"),
            (None, line) => blocks.extend(line.strip_prefix("    ").map(|line| (false, line.to_owned()))),
        }
    }
    blocks
}

#[test]
fn a_program_that_was_copied_away_emulates_with_what_it_carries() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("bead");
    fs::copy(PROGRAM, &program).unwrap();
    let mut emulate = Command::new(&program);
    emulate
        .current_dir(&folder)
        .args(["emulate", SCENARIO, "--bead", "8", "--out", "run"]);
    done(emulate.output().unwrap());
    let recording = Recording::open(&folder.path().join("run/bead-8.mcap")).unwrap();
    let report = String::from_utf8_lossy(&recording.parts[&Part::EmulatorReport]);
    assert_says(&report, "\"image\": \"carried by bead\"");
    assert!(fs::metadata(&program).unwrap().len() < 40 << 20);
}

/// In folders of their own, each with its copy of the image: a recording holds nothing of the machine or of
/// the time.
#[test]
fn equal_runs_leave_equal_files() {
    let image = bead_bench::image::find_image(None).unwrap();
    let [one, other] = [(); 2].map(|()| {
        let folder = tempfile::tempdir().unwrap();
        fs::copy(&image, folder.path().join("image.elf")).unwrap();
        let emulate = format!("emulate {SCENARIO} --bead 8 --out run --firmware image.elf");
        done(typed(folder.path(), &emulate));
        ["run/bead-8.mcap", "run/bead-8.settings"].map(|name| fs::read(folder.path().join(name)).unwrap())
    });
    assert!(one == other);
}

#[test]
fn a_stranger_gets_to_an_own_strike_in_pandas_by_the_commands_of_the_page() {
    let page = fs::read_to_string(format!("{ROOT}/docs/first-strike.md")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    copy_scenario(folder);
    let (mut typed, mut tables) = (0, Vec::new());
    for (is_python, text) in blocks(&page) {
        if is_python {
            tables.extend(python(folder, &["-c", &text]));
        } else {
            shell(folder, &text);
            typed += 1;
        }
    }
    assert_eq!(typed, 12);
    for made in [
        "report.html",
        "tables/samples.parquet",
        "mine/tables/strikes.parquet",
        "bead.settings",
    ] {
        assert!(folder.join(made).metadata().unwrap().len() > 100, "{made}");
    }
    // There is none without Python.
    if let [strikes, mine] = &tables[..] {
        assert_says(strikes, "absorbed_predicted_j");
        assert_says(strikes, "6.33");
        // A faster striker, and more absorbed than the 830 nJ at 0.45 m/s.
        let numbers = mine.split_whitespace().filter_map(|word| word.parse().ok());
        let numbers: Vec<f64> = numbers.collect();
        assert!(numbers[0] > 10.0 && numbers[1] > 1500.0, "{mine}");
    }
    assert!([0, 2].contains(&tables.len()), "{tables:?}");
}

/// Copies the paper's scenario to where the pages of docs/ name it.
pub(crate) fn copy_scenario(folder: &Path) {
    fs::create_dir_all(folder.join("docs/scenarios")).unwrap();
    fs::copy(SCENARIO, folder.join("docs/scenarios/paper-strike.toml")).unwrap();
}
