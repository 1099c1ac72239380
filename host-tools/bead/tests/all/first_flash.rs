//! docs/first-flash.md, followed word for word, with a program that plays the probe and an emulated bead.

use std::fs;

use crate::first_strike::{blocks, copy_scenario};
use crate::flash::FakeProbe;
use crate::program::{ROOT, RunningProgram, assert_says, shell};

#[test]
fn a_stranger_gets_from_a_board_to_a_strike_by_the_commands_of_the_page() {
    let page = fs::read_to_string(format!("{ROOT}/docs/first-flash.md")).unwrap();
    let probe = FakeProbe::new();
    let folder = &probe.folder;
    copy_scenario(folder);
    let emulate = "emulate docs/scenarios/bench.toml --bead 8 --listen unix:bead.sock";
    let mut bead = RunningProgram::start(folder, emulate);
    assert_says(&bead.error_line(), "bead.sock");

    let typed = blocks(&page).into_iter().map(|(_, line)| {
        // The image that the probe gets is a file of the test, the bench is shorter, and a busy computer is
        // given time.
        let line = line
            .replace("--board weact-f405", "image")
            .replace("--requests 1000", "--requests 20")
            .replace("--after 3", "--after 0.5")
            .replace("--duration 5", "--duration 8")
            .replace("/dev/ttyUSB0", "unix:bead.sock");
        let asks = line.starts_with("bead command") || line.starts_with("bead bench");
        let line = if asks { line + " --timeout 20" } else { line };
        let line = format!("PATH=$PWD/bin:$PATH; {line}");
        (shell(folder, &line), line)
    });
    let said: Vec<_> = typed.collect();
    let of = |command: &str| {
        let found = said.iter().find(|(_, line)| line.contains(command));
        &found.unwrap_or_else(|| panic!("the page has no {command}")).0
    };
    assert_eq!(said.len(), 8);
    assert_says(of("flash --probe"), "weact-f405");
    assert_says(of("identity"), "stm32f405rg");
    assert_says(of("bench"), "passed");
    assert_says(of("replay"), "identical");
    for made in ["capture.json", "first.mcap", "tables/strikes.parquet"] {
        assert!(folder.join(made).metadata().unwrap().len() > 100, "{made}");
    }
}
