//! `bead calibrate`: the page typed word for word, rigs that go wrong, the emulated bead, a live line.

use std::fs;
use std::io::{Read, Write};
use std::os::unix::net::UnixListener;
use std::thread;
use std::time::Duration;

use bead_calibrate::drop::DropInputs;
use bead_calibrate::quantity::{Dimension, Stated};
use bead_calibrate::simulated::drop::{DropFault, DropRig};
use bead_calibrate::simulated::{SimulatedBead, chance};
use bead_recording::file::Recording;
use bead_tables::whole::Target;
use bead_testing::{block, paper_settings};
use serde_json::Value;

use crate::answering::AnsweringBead;
use crate::first_strike::{blocks, copy_scenario};
use crate::program::{ROOT, TestFolder, assert_says, said, shell};

const STATED: &str = "--ball-mass 3.046g±1mg --height 100mm±0.3mm --gravity 9.812±0.001";

fn stated(dimension: Dimension, text: &str) -> Stated {
    dimension.parse(text).unwrap()
}

/// Records six drops from 100 mm, of which some go wrong; returns the true force of a code.
fn record(folder: &TestFolder, name: &str, faults: Vec<(usize, DropFault)>) -> f64 {
    let settings = paper_settings();
    let bead = SimulatedBead::drawn(&settings, &mut chance(3, 0));
    let rig = DropRig {
        stated: DropInputs {
            ball_mass: stated(Dimension::Mass, "3.046g±1mg"),
            heights: vec![stated(Dimension::Length, "100mm±0.3mm")],
            gravity: stated(Dimension::Acceleration, "9.812±0.001"),
            tilt: 1.0_f64.to_radians(),
            high_pass: Some(stated(Dimension::Time, "1.03s±20%")),
        },
        drops: 6,
        faults,
        seed: 3,
    };
    rig.record(&bead, 0, &Target::new(folder.join(name))).unwrap();
    settings.description().force.per_code * bead.gains[0]
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn a_person_without_hardware_calibrates_a_bead_by_the_commands_of_the_page() {
    let page = fs::read_to_string(format!("{ROOT}/docs/calibration.md")).unwrap();
    let folder = TestFolder::new();
    copy_scenario(&folder);
    // Formulas and printed tables stand between fences.
    let page: String = page.split("```").step_by(2).collect();
    let lines: Vec<String> = blocks(&page).into_iter().map(|(_, line)| line).collect();
    // A line that ends with a backslash continues.
    let typed = lines.join("\n").replace("\\\n", "");
    let printed: Vec<_> = typed.lines().map(|line| (line, shell(&folder, line))).collect();
    assert_eq!(printed.len(), 15);
    let made = "drop.html force.html shaker.html bead.settings drops.mcap run/bead-8.mcap";
    for made in made.split(' ') {
        assert!(folder.join(made).metadata().unwrap().len() > 100, "{made}");
    }
    let settings = folder.text("bead.toml");
    let keys = "force_gain acceleration_gain front_mass intruder_mass bead_mass stiffness damping stiffness_with_damping \
                stiffness_with_mass damping_with_mass calibration calibrated voltage";
    for key in keys.split(' ') {
        assert_says(&settings, &format!("\n{key} = "));
    }
    assert_eq!(settings.matches("# calibrated ").count(), 10, "{settings}");
    let mut budgets = printed.iter().filter(|(line, _)| line.contains("bead budget"));
    let (_, budget) = budgets.next().unwrap();
    assert_says(budget, "unknown uncertainties: ");
    assert!(!budget.contains("unknown uncertainties: force gain,"), "{budget}");
}

#[test]
fn a_drop_that_missed_or_grazed_is_named_and_the_others_give_the_gain() {
    let folder = TestFolder::new();
    let faults = vec![(1, DropFault::Missed), (3, DropFault::Grazed)];
    let truth = record(&folder, "drops.mcap", faults);
    let output = folder.run(&format!("calibrate drop drops.mcap {STATED} --format json"));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let result = &report["results"][0];
    let off = number(&result["value"]) - truth;
    println!("{:+.3} U", off / number(&result["expanded"]));
    assert!(off.abs() < number(&result["expanded"]), "{result}");
    assert_eq!(report["observations"].as_array().unwrap().len(), 4);
    let said = said(&output);
    for out in [
        "drop 1: no second landing came within 0.286 s",
        "drop 3: its impulse differs from the others' by -50 %",
    ] {
        assert_says(&said, &format!("left out: drops.mcap, {out}"));
    }
}

#[test]
fn heights_that_disagree_fail_and_leave_the_settings_as_they_were() {
    let folder = TestFolder::new();
    for name in ["low.mcap", "high.mcap"] {
        record(&folder, name, Vec::new());
    }
    folder.done("settings make --template bead.toml");
    let before = folder.read("bead.toml");
    // The ruler slipped by 4 mm for the second recording.
    let line = "calibrate drop low.mcap high.mcap --ball-mass 3.046g±1mg --height 100mm±0.3mm --height 104mm±0.3mm \
        --gravity 9.812±0.001 --update bead.toml --page page.html";
    let output = folder.run(line);
    assert_eq!(output.status.code(), Some(1));
    assert_says(&said(&output), "gain from 0.1040 m against that from 0.1000 m: ");
    assert_says(&folder.text("page.html"), "class=\"verdict fail\"");
    assert_eq!(folder.read("bead.toml"), before);
    folder.done(&line.replace("104mm", "100mm").replace("page.html", "other.html"));
    assert_ne!(folder.read("bead.toml"), before);
}

#[test]
fn conformity_takes_the_uncertainty_into_account_and_an_expired_reference_is_refused_or_named() {
    let folder = TestFolder::new();
    let truth = record(&folder, "drops.mcap", Vec::new());
    let off = 100.0 * (truth / paper_settings().description().force.per_code - 1.0);
    let judged = |tolerance: f64| {
        let tolerance = off.abs() + tolerance;
        let line = format!("calibrate drop drops.mcap {STATED} --tolerance {tolerance:.4}%");
        folder.run(&line).status.code()
    };
    println!("the settings are off by {off:.2} %");
    // U is some 0.3 %: a tolerance that exceeds the deviation by less than that is no acceptance.
    assert_eq!((judged(1.0), judged(0.05)), (Some(0), Some(1)));

    folder.done("calibrate about about.toml");
    let reference =
        "\n[[reference]]\nname = \"balance 7\"\ncertificate = \"K-1\"\nvalid_until = \"2026-03-31\"\n";
    folder.write("about.toml", folder.text("about.toml") + reference);
    let line = format!("calibrate drop drops.mcap {STATED} --about about.toml --page page.html --date");
    folder.refused(&format!(
        "2 | the certificate K-1 of balance 7 expired on 2026-03-31 | {line} 2026-04-01"
    ));
    folder.done(&format!("{line} 2026-04-01 --doubtful"));
    assert_says(
        &folder.text("page.html"),
        "Made despite a doubt: the certificate K-1",
    );
    folder.done(&format!("{line} 2026-03-31 --overwrite"));
    assert!(!folder.text("page.html").contains("Made despite a doubt"));
}

#[test]
fn the_image_in_qemu_calibrates_to_its_truth() {
    let folder = TestFolder::new();
    let line = format!("calibrate drop --from emulated --drops 4 {STATED} --seed 5 --format json");
    let drop = folder.json(&line);
    let taps = "calibrate ring-down --from emulated --taps 5 --intruder-mass 3.7g±4mg --bead-mass 51.0g±10mg --format json";
    let taps = folder.json(taps);
    for truth in [&drop["truth"][0], &taps["truth"][0], &taps["truth"][1]] {
        println!("{truth}");
        assert!(number(&truth["deviation_over_expanded"]).abs() < 1.2, "{truth}");
    }
}

#[test]
fn a_live_bead_is_recorded_until_its_drops_are_done() {
    let folder = TestFolder::new();
    let truth = record(&folder, "sent.mcap", Vec::new());
    let sent = Recording::open(&folder.join("sent.mcap")).unwrap();
    let sent: Vec<u8> = sent.pieces().unwrap().flat_map(|piece| piece.bytes).collect();
    let listener = UnixListener::bind(folder.join("line.sock")).unwrap();
    let bead = thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        stream.write_all(&sent).unwrap();
        // A bead keeps sending, if only its status, until the program hangs up.
        while stream.write_all(&[0]).is_ok() {
            thread::sleep(Duration::from_millis(50));
        }
    });
    let line = format!("calibrate drop live.mcap --port unix:line.sock --drops 6 {STATED} --format json");
    let output = folder.run(&line);
    bead.join().unwrap();
    let said = said(&output);
    assert_says(&said, "drop the ball from 100.0 mm, 6 times");
    assert_says(&said, "now, 6 of 6");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let [value, expanded] = ["value", "expanded"].map(|key| number(&report["results"][0][key]));
    assert!((value - truth).abs() < expanded, "{said}");
    assert!(folder.join("live.mcap").exists());
}

/// A tone of 160 Hz at both sensors, 400 codes of force and 700 of acceleration at its top.
fn tone(index: u64) -> [u16; 2] {
    let sine = (std::f64::consts::TAU * 160.0 * index as f64 * 1e-5).sin();
    [2000.0 + 400.0 * sine, 2048.0 + 700.0 * sine].map(|code: f64| code.round() as u16)
}

#[test]
fn tones_of_a_live_bead_are_taken_beside_the_reference_that_is_typed() {
    let folder = TestFolder::new();
    let listener = UnixListener::bind(folder.join("line.sock")).unwrap();
    let bead = thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut bead = AnsweringBead::new(3, &block(&paper_settings()));
        bead.scans = Some(tone);
        let mut buffer = [0; 4096];
        while let Ok(length @ 1..) = stream.read(&mut buffer) {
            bead.hear(&buffer[..length]);
            let _ = stream.write_all(&std::mem::take(&mut bead.speaker.bytes));
        }
    });
    // The third is no tone of the bead, and the fourth no tone at all.
    let lines = "160 35\\n160.4 35.2\\n90 3\\neighty 3\\n160 34.9\\n\\n";
    let line = format!(
        "printf '{lines}' | bead calibrate reference tones.csv --port unix:line.sock --reference-u 0.5% --open --format json \
         2>&1 >out.json | tee said"
    );
    println!("{}", shell(&folder, &line));
    let report: Value = serde_json::from_str(&folder.text("out.json")).unwrap();
    bead.join().unwrap();
    let lines = folder.text("said");
    assert_says(&lines, "type its frequency in Hz and the reference's rms");
    assert_says(&lines, "have a tone of 160.00 Hz, but 90 Hz was typed");
    assert_says(&lines, "type two numbers above 0");
    assert_eq!(folder.text("tones.csv").lines().count(), 4);
    let found = number(&report["results"][0]["value"]);
    // The low-pass of 40 kHz takes 8e-6 of a tone of 160 Hz.
    let exact = (35.0 + 35.2 + 34.9) / 3.0 / (700.0 / 2.0_f64.sqrt());
    assert!((found / exact - 1.0).abs() < 1e-4, "{found} {exact}");
    let refused = folder.run("calibrate reference tones.csv --port unix:line.sock --reference-u 0.5%");
    assert_says(&said(&refused), "tones.csv already exists");
}
