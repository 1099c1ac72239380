//! The cases of `cases/`, which are made with embedded-test, run by plain `cargo test` with `stm32-emu` as
//! its runner.

#![expect(clippy::unwrap_used, reason = "in helpers of tests")]

use std::path::PathBuf;
use std::process::Command;

/// Runs `cargo test` with options of the runner and words for the harness. Returns its status and output.
fn cargo_test(options: &[&str], words: &[&str]) -> (i32, String) {
    let target = "thumbv7em-none-eabihf";
    let mut runner = vec![
        env!("CARGO_BIN_EXE_stm32-emu"),
        "--chip",
        "STM32F405RG",
        "--strict",
    ];
    runner.extend(options);
    let mut cargo = Command::new(env!("CARGO"));
    cargo
        .args(["test", "--quiet", "-p", "stm32f405-qemu-cases"])
        .args(["--profile", "firmware", "--target", target, "--"])
        .args(words)
        .env("CARGO_TARGET_THUMBV7EM_NONE_EABIHF_RUNNER", runner.join(" "))
        .current_dir(PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../.."));
    let ran = cargo.output().unwrap();
    (ran.status.code().unwrap(), super::said(&ran))
}

#[test]
fn the_cases_of_a_crate_pass_under_cargo_test_each_from_power_up() {
    let (status, said) = cargo_test(&[], &[]);
    assert_eq!(status, 0, "{said}");
    assert!(said.contains("running 25 tests"), "{said}");
    assert!(
        said.contains("23 passed; 0 failed; 2 ignored; 0 measured; 0 filtered out"),
        "{said}"
    );
    let panics = "test ends::a_division_by_a_prescaler_of_zero_panics ... ok";
    assert!(said.contains(panics), "{said}");
}

#[test]
fn names_choose_among_the_cases_as_with_other_tests() {
    let exact = "timers::a_prescaler_of_15_counts_microseconds";
    for (words, selected) in [
        (&["timers::", "clocks::"][..], 7),
        (&["timers::", "--skip", "pulse"], 3),
        (&["--exact", exact], 1),
        (&["--exact", "timers"], 0),
    ] {
        let list = [words, &["--list"]].concat();
        let (status, said) = cargo_test(&[], &list);
        assert_eq!(status, 0, "{said}");
        assert_eq!(said.matches(": test\n").count(), selected, "{words:?}: {said}");
        let (status, said) = cargo_test(&[], words);
        let (filtered, line) = (25 - selected, format!("ok. {selected} passed; 0 failed"));
        assert_eq!(status, 0, "{said}");
        assert!(
            said.contains(&line) && said.contains(&format!("{filtered} filtered out")),
            "{words:?}: {said}"
        );
    }
}

#[test]
fn a_case_that_fails_fails_cargo_test_and_is_in_the_report() {
    let folder = tempfile::tempdir().unwrap();
    let report = folder.path().join("report.xml");
    let options = ["--junit", report.to_str().unwrap()];
    let (status, said) = cargo_test(&options, &["ends::", "--include-ignored"]);
    assert_ne!(status, 0, "{said}");
    let limit = "it did not end within 1 s of the image";
    for words in ["2 passed; 2 failed; 0 ignored", limit, "ERROR panicked at"] {
        assert!(said.contains(words), "{said}");
    }
    let report = std::fs::read_to_string(&report).unwrap();
    for words in ["tests=\"4\"", "failures=\"2\"", limit] {
        assert!(report.contains(words), "{report}");
    }
}
