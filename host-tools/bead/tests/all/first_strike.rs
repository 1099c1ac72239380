//! docs/first-strike.md, followed word for word, and the image that the program carries.

use std::fs;
use std::path::Path;

use crate::program::{PROGRAM, ROOT, SCENARIO, TestFolder, assert_says, python, shell};
use bead_recording::file::{Part, Recording};

/// Blocks of the page to type: indented lines for a shell, and Python. True for Python.
pub(crate) fn blocks(page: &str) -> Vec<(bool, String)> {
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
    let folder = TestFolder::new();
    let program = folder.join("bead");
    fs::copy(PROGRAM, &program).unwrap();
    shell(&folder, &format!("./bead emulate {SCENARIO} --bead 8 --out run"));
    let recording = Recording::open(&folder.join("run/bead-8.mcap")).unwrap();
    let report = String::from_utf8_lossy(&recording.parts[&Part::EmulatorReport]);
    assert_says(&report, "\"image\": \"carried by bead\"");
    // The image is 0.2 MB of it, and the monitor's two pages are 3 MB.
    assert!(fs::metadata(&program).unwrap().len() < 44 << 20);
}

#[test]
fn equal_runs_leave_equal_files() {
    let image = bead_bench::image::find_image(None).unwrap();
    let [one, other] = [(); 2].map(|()| {
        let folder = TestFolder::new();
        fs::copy(&image, folder.join("image.elf")).unwrap();
        let emulate = format!("emulate {SCENARIO} --bead 8 --out run --firmware image.elf");
        folder.done(&emulate);
        ["run/bead-8.mcap", "run/bead-8.settings"].map(|name| folder.read(name))
    });
    assert!(one == other);
}

#[test]
fn a_stranger_gets_to_an_own_strike_in_pandas_by_the_commands_of_the_page() {
    let page = fs::read_to_string(format!("{ROOT}/docs/first-strike.md")).unwrap();
    let folder = TestFolder::new();
    copy_scenario(&folder);
    let (mut typed, mut tables) = (0, Vec::new());
    for (is_python, text) in blocks(&page) {
        if is_python {
            tables.extend(python(&folder, &["-c", &text]));
        } else {
            shell(&folder, &text);
            typed += 1;
        }
    }
    assert_eq!(typed, 12);
    let made = "report.html tables/samples.parquet mine/tables/strikes.parquet bead.settings";
    for made in made.split(' ') {
        assert!(folder.join(made).metadata().unwrap().len() > 100, "{made}");
    }
    // Without Python there are no tables.
    if let [strikes, mine] = &tables[..] {
        assert_says(strikes, "absorbed_predicted_j");
        assert_says(strikes, "6.33");
        // The striker is faster, and the bead absorbs more than the 830 nJ at 0.45 m/s.
        let numbers = mine.split_whitespace().filter_map(|word| word.parse().ok());
        let numbers: Vec<f64> = numbers.collect();
        assert!(numbers[0] > 10.0 && numbers[1] > 1500.0, "{mine}");
    }
    assert!([0, 2].contains(&tables.len()), "{tables:?}");
}

/// Copies the paper's scenario to its path in the pages of docs/.
pub(crate) fn copy_scenario(folder: &Path) {
    fs::create_dir_all(folder.join("docs/scenarios")).unwrap();
    for name in ["paper-strike.toml", "bench.toml"] {
        let scenarios = Path::new(SCENARIO).parent().unwrap();
        fs::copy(scenarios.join(name), folder.join("docs/scenarios").join(name)).unwrap();
    }
}
