//! docs/first-strike.md, followed word for word: every command, in its order.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use bead_recording::file::{Part, Recording};

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

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

fn run(command: &mut Command, what: &str) -> Output {
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{what}: {said}");
    output
}

#[test]
fn a_program_that_was_copied_away_emulates_with_what_it_carries() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("bead");
    fs::copy(env!("CARGO_BIN_EXE_bead"), &program).unwrap();
    let scenario = format!("{ROOT}/docs/scenarios/paper-strike.toml");
    let mut emulate = Command::new(&program);
    emulate
        .current_dir(folder.path())
        .args(["emulate", &scenario, "--bead", "8", "--out", "run"]);
    run(&mut emulate, "emulate");
    let recording = Recording::open(&folder.path().join("run/bead-8.mcap")).unwrap();
    let report = String::from_utf8_lossy(&recording.parts[&Part::EmulatorReport]);
    assert!(report.contains("\"image\": \"carried by bead\""), "{report}");
    assert!(fs::metadata(&program).unwrap().len() < 40 << 20);
}

/// In folders of their own, each with its copy of the image.
#[test]
fn equal_runs_leave_equal_files() {
    let scenario = format!("{ROOT}/docs/scenarios/paper-strike.toml");
    let image = bead_bench::image::find_image(None).unwrap();
    let files = [(); 2].map(|()| {
        let folder = tempfile::tempdir().unwrap();
        fs::copy(&image, folder.path().join("image.elf")).unwrap();
        let own = folder.path().join("image.elf");
        let mut emulate = Command::new(env!("CARGO_BIN_EXE_bead"));
        emulate
            .current_dir(folder.path())
            .args(["emulate", &scenario, "--bead", "8", "--out", "run", "--firmware"])
            .arg(own);
        run(&mut emulate, "emulate");
        ["run/bead-8.mcap", "run/bead-8.settings"].map(|name| fs::read(folder.path().join(name)).unwrap())
    });
    assert!(
        files[0] == files[1],
        "a recording holds something of the machine or of the time"
    );
}

#[test]
fn every_shell_gets_completions_and_every_command_its_page() {
    let folder = tempfile::tempdir().unwrap();
    let program = env!("CARGO_BIN_EXE_bead");
    for (shell, begins) in [
        ("bash", "_bead()"),
        ("zsh", "#compdef bead"),
        ("fish", "# Print an optspec"),
    ] {
        let script = run(Command::new(program).args(["completions", shell]), shell).stdout;
        let script = String::from_utf8(script).unwrap();
        assert!(
            script.starts_with(begins) && script.contains("emulate"),
            "{shell}: {}",
            &script[..80]
        );
    }
    let pages = folder.path().join("man1");
    run(Command::new(program).arg("man").arg(&pages), "man");
    let page = |name: &str| fs::read_to_string(pages.join(format!("{name}.1"))).unwrap();
    assert!(page("bead").contains("bead\\-emulate(1)"), "{}", page("bead"));
    assert!(page("bead-settings-make").contains("bead settings make \\-\\-template bead.toml"));
    // Pages that are there are not replaced.
    let again = Command::new(program).arg("man").arg(&pages).output().unwrap();
    assert_eq!(again.status.code(), Some(2));
}

#[test]
fn a_stranger_gets_to_an_own_strike_in_pandas_by_the_commands_of_the_page() {
    let page = fs::read_to_string(format!("{ROOT}/docs/first-strike.md")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::create_dir_all(folder.join("docs/scenarios")).unwrap();
    let scenario = "docs/scenarios/paper-strike.toml";
    fs::copy(format!("{ROOT}/{scenario}"), folder.join(scenario)).unwrap();
    let program = Path::new(env!("CARGO_BIN_EXE_bead"));
    let path = format!(
        "{}:{}",
        program.parent().unwrap().display(),
        std::env::var("PATH").unwrap()
    );
    // As tests/export.rs finds it.
    let own = std::env::var_os("BEAD_PYTHON").map(PathBuf::from);
    let set_up = program.ancestors().nth(2).unwrap().join("python/bin/python3");
    let python = own.or_else(|| Some(set_up).filter(|path| path.exists()));

    let (mut typed, mut read) = (0, Vec::new());
    for (is_python, text) in blocks(&page) {
        let mut command = match (is_python, &python) {
            (false, _) => {
                let mut command = Command::new("sh");
                command.args(["-ec", &text]);
                command
            }
            (true, Some(python)) => {
                let mut command = Command::new(python);
                command.args(["-c", &text]);
                command
            }
            (true, None) => {
                eprintln!("SKIPPED: no Python with pandas; `cargo xtask python` sets one up");
                continue;
            }
        };
        let output = run(command.current_dir(folder).env("PATH", &path), &text);
        typed += usize::from(!is_python);
        read.extend(is_python.then(|| String::from_utf8(output.stdout).unwrap()));
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
    if python.is_some() {
        let [strikes, mine] = &read[..] else {
            panic!("{read:?}")
        };
        assert!(
            strikes.contains("absorbed_predicted_j") && strikes.contains("6.33"),
            "{strikes}"
        );
        // A faster striker, and more absorbed than the 830 nJ at 0.45 m/s.
        let numbers: Vec<f64> = mine
            .split_whitespace()
            .filter_map(|word| word.parse().ok())
            .collect();
        assert!(numbers[0] > 10.0 && numbers[1] > 1500.0, "{mine}");
    }
}
