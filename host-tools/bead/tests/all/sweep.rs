//! `bead sweep`: rows equal to single runs, the same bytes however they were computed, and refusals.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

use bead_tables::{Cell, Reader, Writer};
use hertz_chain::{EnsembleOptions, Scenario, ensemble};
use serde_json::Value;

use crate::program::{self, PROGRAM, TestFolder, assert_says, done, names, python, said, until};

/// Two axes, keys that go together, and drawn points: 3 × 3 × 8 points.
const SWEEP: &str = r#"
title = "A small one"
scenario = "paper.toml"
[[axis]]
key = "striker.velocity"
logspace = [0.2, 1.2, 3]
[[axis]]
name = "tuned"
zip = [
    { key = "intruder.1.stiffness", linspace = [1e5, 4e5, 3] },
    { key = "intruder.1.beads", values = [8, 9, [3, 12]] },
]
[[axis]]
quasirandom = 8
seed = 4
over = [{ key = "chain.relaxation", uniform = [0, 8e-6] }, { key = "intruder.1.mass", loguniform = [2e-3, 6e-3] }]
[outputs]
energies = true
intruders = [8]
peaks = [1, 8]
arrivals = [8]
transmission = [8]
"#;

/// A folder with a scenario and a sweep over it.
fn folder(sweep: &str) -> TestFolder {
    let folder = TestFolder::new();
    folder.write("paper.toml", Scenario::paper().to_toml());
    folder.write("sweep.toml", sweep);
    folder
}

/// A sweep along one axis.
fn axis(key: &str, values: &str) -> String {
    format!("scenario = \"paper.toml\"\n[[axis]]\nkey = \"{key}\"\n{values}\n")
}

/// The cells of a column of a table.
fn cells(table: &Path, column: &str) -> Vec<Cell> {
    let table = Reader::open(table).unwrap();
    let place = table.columns().iter().position(|one| one.name == column).unwrap();
    let rows = table.all_batches().flat_map(|batch| batch.unwrap().into_rows());
    rows.map(|mut row| row.swap_remove(place)).collect()
}

fn numbers(table: &Path, column: &str) -> Vec<f64> {
    let number = |cell| match cell {
        Cell::Number(number) => number,
        Cell::Whole(number) => number as f64,
        _ => f64::NAN,
    };
    cells(table, column).into_iter().map(number).collect()
}

#[test]
fn each_row_is_the_run_of_its_scenario() {
    let folder = folder(SWEEP);
    let printed = folder.done("sweep sweep.toml --out a.parquet");
    assert_says(&printed, "a.parquet: 72 points");
    let index = r#"set_index(["striker_velocity_mps", "tuned", "sample"]).to_xarray()"#;
    assert_says(&printed, index);
    assert_eq!(folder.names(), "a.parquet paper.toml sweep.toml");

    let of = |column: &str| numbers(&folder.join("a.parquet"), column);
    let velocity = of("striker_velocity_mps");
    assert_eq!((velocity[0], velocity[71]), (0.2, 1.2));
    let (stiffness, tuned) = (of("intruder_1_stiffness_n_per_m"), of("tuned"));
    let (relaxation, mass) = (of("chain_relaxation_s"), of("intruder_1_mass_kg"));
    let scenario = |row: usize| {
        let mut scenario = Scenario::paper();
        scenario.striker.velocity = velocity[row];
        scenario.chain.relaxation = relaxation[row];
        let intruder = &mut scenario.intruders[0];
        (intruder.stiffness, intruder.mass) = (stiffness[row], mass[row]);
        intruder.beads = [vec![8], vec![9], vec![3, 12]][tuned[row] as usize].clone();
        scenario
    };
    let scenarios: Vec<_> = (0..72).map(scenario).collect();
    let outcomes = ensemble(&scenarios, &EnsembleOptions::default().with_peaks(&[1, 8]));
    let (absorbed, of_injected) = (of("absorbed_j"), of("absorbed_of_injected"));
    let (peak, arrival) = (of("contact_8_peak_force_n"), of("contact_8_peak_time_s"));
    let (of_bead, behind) = (of("bead_8_intruder_dissipated_j"), of("behind_bead_8_j"));
    for (row, outcome) in outcomes.into_iter().enumerate() {
        let outcome = outcome.unwrap();
        assert_eq!(absorbed[row].to_bits(), outcome.absorbed().to_bits(), "row {row}");
        assert_eq!(of_injected[row], outcome.absorbed() / outcome.injected());
        let at_8 = outcome.peaks().iter().find(|peak| peak.contact == 8).unwrap();
        assert_eq!((peak[row], arrival[row]), (at_8.force, at_8.time));
        // Bead 8 has an intruder in the first of three cases only.
        assert_eq!(of_bead[row].is_nan(), tuned[row] != 0.0);
        assert_eq!(behind[row], outcome.end().region(9..=16).mechanical());
    }
    // The points drawn for the axis repeat at each place of the others.
    let relaxations: BTreeSet<_> = relaxation.iter().map(|tau| tau.to_bits()).collect();
    assert_eq!(relaxations.len(), 8);
}

#[test]
fn a_table_has_the_same_bytes_whatever_the_threads_and_the_chunks() {
    let folder = folder(SWEEP);
    folder.done("sweep sweep.toml --out one.parquet --threads 1");
    folder.done("sweep sweep.toml --out three.parquet --threads 3");
    assert!(folder.read("one.parquet") == folder.read("three.parquet"));
    folder.done("sweep plan sweep.toml --dir d --chunks 7");
    for chunk in [7, 3, 1, 2] {
        folder.done(&format!("sweep run d --chunk {chunk}/7 --threads 2"));
    }
    folder.refused("2 | 3 of 7 chunks are missing: 4-6 | sweep merge d --out chunks.parquet");
    assert_says(&folder.done("sweep run d --chunk 3/7"), "finished already");
    let status = folder.json("sweep status d --format json");
    let expected = (&4.into(), &serde_json::json!([4, 5, 6]));
    assert_eq!((&status["finished"], &status["missing"]), expected);
    folder.done("sweep run d");
    folder.done("sweep merge d --out chunks.parquet");
    assert!(folder.read("one.parquet") == folder.read("chunks.parquet"));
    folder.refused("2 | in 7 chunks; leave out --chunks 8 | sweep plan sweep.toml --dir d --chunks 8");
    folder.refused(
        "2 | is in the folder of the plan's parts | sweep merge d --out d/part-00003.parquet --overwrite",
    );
}

#[test]
fn a_sweep_that_was_killed_goes_on_where_it_was() {
    let folder = folder(&axis("striker.velocity", "linspace = [0.2, 1.2, 12000]"));
    // The command itself would make chunks of five seconds. It continues with planned ones.
    folder.done("sweep plan sweep.toml --dir a.parquet.sweep --chunks 40");
    let parts = || names(&folder.join("a.parquet.sweep")).len();
    for signal in ["INT", "KILL"] {
        let before = parts();
        let sweep = "sweep sweep.toml --out a.parquet --threads 1";
        let mut running = folder.start(sweep);
        until("four parts more are there", || parts() >= before + 4);
        running.signal(signal);
        if signal == "INT" {
            let said = running.end(130);
            assert_says(&said, "finished parts are in a.parquet.sweep");
        } else {
            running.child.wait().unwrap();
        }
    }
    let report = folder.json("sweep sweep.toml --out a.parquet --format json");
    let computed = report["computed"].as_u64().unwrap();
    assert!(computed < 12_000 && computed.is_multiple_of(300), "{computed}");
    folder.done("sweep sweep.toml --out b.parquet");
    assert!(folder.read("a.parquet") == folder.read("b.parquet"));
    assert_eq!(folder.names(), "a.parquet b.parquet paper.toml sweep.toml");
}

#[test]
fn a_point_that_cannot_be_run_is_a_row_with_its_error_and_a_picture_of_none_hides_no_summary() {
    let folder = folder(&axis("intruder.1.mass", "values = [1e-3, 1.0, 2e-3, -1.0]"));
    let output = folder.run("sweep sweep.toml --out a.parquet");
    let notes = said(&output);
    assert_says(&notes, "2 of 4 points could not be computed");
    done(output);
    let errors = cells(&folder.join("a.parquet"), "error");
    let absorbed = numbers(&folder.join("a.parquet"), "absorbed_j");
    for (row, reason) in [(1, "as heavy as its host"), (3, "not a positive number")] {
        let Cell::Text(why) = &errors[row] else {
            panic!("{errors:?}");
        };
        assert_says(why, reason);
        assert!(absorbed[row].is_nan() && absorbed[row - 1].is_finite());
        assert_eq!(errors[row - 1], Cell::Null);
    }

    folder.write("sweep.toml", axis("intruder.1.mass", "values = [1.0, 2.0]"));
    let output = folder.run("sweep sweep.toml --out b.parquet --plot b.svg --format json");
    assert_eq!(output.status.code(), Some(2));
    assert_says(&said(&output), "no point with a value of absorbed_j");
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["failed"], 2);
    assert_eq!(folder.names(), "a.parquet b.parquet paper.toml sweep.toml");
}

#[test]
fn a_grid_typed_by_mistake_says_its_size_and_its_time_first() {
    let values = "linspace = [0.2, 1.2, 1000]";
    let second = format!("{values}\n[[axis]]\nkey = \"striker.relaxation\"\n{values}");
    let folder = folder(&axis("striker.velocity", &second));
    let output = folder.run("sweep sweep.toml --out a.parquet");
    program::refused(&output, 2, "axes of 1,000 × 1,000 make 1,000,000 points: about ");
    assert!(said(&output).contains("--yes"));
    folder.refused("2 | 1,000,000 points | sweep plan sweep.toml --dir d");
    assert_eq!(folder.names(), "paper.toml sweep.toml");
    folder.done("sweep plan sweep.toml --dir d --limit 1000000");
}

#[test]
fn what_is_of_another_plan_is_refused_and_stays() {
    let folder = folder(&axis("duration", "linspace = [1e-3, 2e-3, 8]"));
    folder.done("sweep plan sweep.toml --dir one --chunks 4");
    folder.done("sweep run one");
    folder.refused("2 | give K/4, or the folder of another plan | sweep run one --chunk 2/5");
    folder.write("sweep.toml", axis("duration", "linspace = [1e-3, 3e-3, 8]"));
    folder.refused("2 | holds the parts of another sweep | sweep plan sweep.toml --dir one");
    folder.done("sweep plan sweep.toml --dir two --chunks 4");
    let cut = folder.read("one/part-00004.parquet");
    folder.write("two/part-00002.parquet", folder.read("one/part-00002.parquet"));
    folder.refused("2 | is not chunk 2 of this plan: it belongs to plan | sweep run two");
    folder.refused("2 | is not chunk 2 of this plan | sweep merge two --out a.parquet");
    // One part has the name of another, and one is cut.
    folder.write("one/part-00003.parquet", folder.read("one/part-00001.parquet"));
    folder.refused("2 | it has 2 rows of chunk 1/4 | sweep merge one --out a.parquet");
    folder.write("one/part-00004.parquet", &cut[..cut.len() / 2]);
    fs::remove_file(folder.join("one/part-00003.parquet")).unwrap();
    folder.refused("2 | is not a Parquet file, or is damaged | sweep status one");
    // A part has its columns in another order.
    let part = Reader::open(&folder.join("one/part-00002.parquet")).unwrap();
    let notes = ["plan", "chunk"].map(|key| (key, part.note(key).unwrap()));
    let turned: Vec<_> = part.columns().iter().rev().cloned().collect();
    let mut file = fs::File::create(folder.join("other.parquet")).unwrap();
    let mut table = Writer::parquet(&mut file, "sweep", &turned, &notes).unwrap();
    for row in part.all_batches().flat_map(|batch| batch.unwrap().into_rows()) {
        table.push(row.into_iter().rev().collect()).unwrap();
    }
    table.finish().unwrap();
    folder.write("one/part-00002.parquet", folder.read("other.parquet"));
    folder.refused("2 | is not chunk 2 of this plan: it has other columns | sweep status one");
    // A plan that was edited.
    let plan = folder.text("two/plan.toml");
    for (was, is, why) in [
        ("chunks = 4", "chunks = 0", "divides 8 points into 0 chunks"),
        (
            "chunks = 4",
            "chunks = 100000",
            "divides 8 points into 100000 chunks",
        ),
        ("points = 8", "points = 9", "was changed after it was made"),
    ] {
        folder.write("two/plan.toml", plan.replace(was, is));
        folder.refused(&format!("2 | {why} | sweep status two"));
    }
    folder.refused("2 | is a TOML file | sweep sweep.toml --out paper.toml --overwrite");
}

#[test]
fn a_disk_that_is_full_leaves_the_finished_parts() {
    let folder = folder(&axis("duration", "linspace = [1e-3, 2e-3, 800]"));
    folder.done("sweep plan sweep.toml --dir d --chunks 4");
    folder.done("sweep run d --chunk 1/4");
    // No file may grow beyond some kilobytes.
    let limited = format!("trap '' XFSZ; ulimit -f 8; exec {PROGRAM} sweep run d");
    let mut shell = Command::new("sh");
    let output = shell.current_dir(&*folder).args(["-c", &limited]).output();
    program::refused(&output.unwrap(), 2, "cannot write d/part-00002.parquet");
    let left = names(&folder.join("d")).join(" ");
    assert_eq!(left, "part-00001.parquet plan.toml");
}

#[test]
fn curves_and_maps_are_drawn_of_any_two_axes() {
    let folder = folder(SWEEP);
    folder.refused(
        "2 | more axes: tuned (3 values), sample (8 values); choose a place on each with --at tuned= | \
         sweep sweep.toml --out a.parquet --plot a.svg",
    );
    // The refusal comes before the work.
    assert_eq!(folder.names(), "paper.toml sweep.toml");
    let plot = "--plot a.svg --at sample=3 --x striker_velocity_mps --y tuned";
    folder.done(&format!("sweep sweep.toml --out a.parquet {plot}"));
    let curves = "--x striker_velocity_mps --y contact_8_peak_force_n --by tuned --at chain_relaxation_s=0";
    folder.done(&format!("sweep plot a.parquet {curves} --out b.svg"));
    let [map, curves] = ["a.svg", "b.svg"].map(|name| folder.text(name));
    // The bar's colours, and a cell for each point.
    assert_eq!(map.matches("crispEdges").count(), 128 + 9);
    assert!(map.contains("striker velocity (m/s)") && map.contains("absorbed (µJ)"));
    assert!(curves.contains("contact 8 peak force (N)") && curves.contains("by tuned"));
}

#[test]
fn the_printed_line_makes_a_cube_in_xarray() {
    let folder = folder(SWEEP);
    let report = folder.json("sweep sweep.toml --out a.parquet --format json");
    let line = report["xarray"].as_str().unwrap();
    let print = "print(dict(cube.sizes), float(cube.absorbed_j[2, 1, 5]))";
    let script = format!("import pandas\ncube = {line}\n{print}");
    let Some(printed) = python(&folder, &["-c", &script]) else {
        return;
    };
    let value = numbers(&folder.join("a.parquet"), "absorbed_j")[2 * 24 + 8 + 5];
    let (sizes, printed) = printed.trim().rsplit_once(' ').unwrap();
    assert_eq!(sizes, "{'striker_velocity_mps': 3, 'tuned': 3, 'sample': 8}");
    assert_eq!(printed.parse(), Ok(value));
}
