//! `bead sweep`: rows that are those of single runs, the same bytes however they were computed, and what is
//! said when it cannot be.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use bead_tables::{Cell, Reader, Writer};
use hertz_chain::{EnsembleOptions, Scenario, ensemble};
use serde_json::Value;

use crate::program;

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
fn folder(sweep: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("paper.toml"), Scenario::paper().to_toml()).unwrap();
    fs::write(folder.path().join("sweep.toml"), sweep).unwrap();
    folder
}

fn command(folder: &Path, arguments: &str) -> Command {
    let mut command = program::interruptible(folder);
    command.arg("sweep").args(arguments.split_whitespace());
    command
}

fn bead(folder: &Path, arguments: &str) -> Output {
    command(folder, arguments).output().unwrap()
}

/// Runs a command that succeeds and returns its output.
fn done(folder: &Path, arguments: &str) -> String {
    let output = bead(folder, arguments);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{arguments}: {said}");
    String::from_utf8(output.stdout).unwrap()
}

/// The one line of a command that refuses.
fn refused(folder: &Path, arguments: &str) -> String {
    let output = bead(folder, arguments);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments}: {said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    said
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// The cells of a column.
fn cells(table: &Reader, column: &str) -> Vec<Cell> {
    let place = table.columns().iter().position(|one| one.name == column);
    let rows = table.all_batches().flat_map(|batch| batch.unwrap().into_rows());
    rows.map(|mut row| row.swap_remove(place.unwrap())).collect()
}

fn numbers(path: &Path, column: &str) -> Vec<f64> {
    let cells = cells(&Reader::open(path).unwrap(), column);
    let number = |cell| match cell {
        Cell::Number(number) => number,
        Cell::Whole(number) => number as f64,
        _ => f64::NAN,
    };
    cells.into_iter().map(number).collect()
}

#[test]
fn each_row_is_the_run_of_its_scenario() {
    let folder = folder(SWEEP);
    let said = done(folder.path(), "sweep.toml --out a.parquet");
    assert!(said.contains("a.parquet: 72 points"), "{said}");
    let index = r#"set_index(["striker_velocity_mps", "tuned", "sample"]).to_xarray()"#;
    assert!(said.contains(index), "{said}");
    assert_eq!(names(folder.path()), ["a.parquet", "paper.toml", "sweep.toml"]);

    let path = folder.path().join("a.parquet");
    let of = |column: &str| numbers(&path, column);
    let velocity = of("striker_velocity_mps");
    assert_eq!((velocity[0], velocity[71]), (0.2, 1.2));
    let (stiffness, tuned) = (of("intruder_1_stiffness_n_per_m"), of("tuned"));
    let (relaxation, mass) = (of("chain_relaxation_s"), of("intruder_1_mass_kg"));
    let mut scenarios = Vec::new();
    for row in 0..72 {
        let mut scenario = Scenario::paper();
        scenario.striker.velocity = velocity[row];
        scenario.chain.relaxation = relaxation[row];
        let intruder = &mut scenario.intruders[0];
        (intruder.stiffness, intruder.mass) = (stiffness[row], mass[row]);
        intruder.beads = [vec![8], vec![9], vec![3, 12]][tuned[row] as usize].clone();
        scenarios.push(scenario);
    }
    let options = EnsembleOptions::default().with_peaks(&[1, 8]);
    let outcomes = ensemble(&scenarios, &options);
    let (absorbed, of_injected) = (of("absorbed_j"), of("absorbed_of_injected"));
    let (peak, arrival) = (of("contact_8_peak_force_n"), of("contact_8_peak_time_s"));
    let (of_bead, behind) = (of("bead_8_intruder_dissipated_j"), of("behind_bead_8_j"));
    for (row, outcome) in outcomes.into_iter().enumerate() {
        let outcome = outcome.unwrap();
        assert_eq!(absorbed[row].to_bits(), outcome.absorbed().to_bits(), "row {row}");
        assert_eq!(of_injected[row], outcome.absorbed() / outcome.injected());
        let at_8 = outcome.peaks().iter().find(|peak| peak.contact == 8).unwrap();
        assert_eq!((peak[row], arrival[row]), (at_8.force, at_8.time));
        // Only the first of the three has it in bead 8.
        assert_eq!(of_bead[row].is_nan(), tuned[row] != 0.0);
        assert_eq!(behind[row], outcome.end().region(9..=16).mechanical());
    }
    let relaxations: std::collections::BTreeSet<_> = relaxation.iter().map(|tau| tau.to_bits()).collect();
    assert_eq!(
        relaxations.len(),
        8,
        "the drawn points are those of the axis, again for each other place"
    );
}

#[test]
fn a_table_has_the_same_bytes_whatever_the_threads_and_the_chunks() {
    let folder = folder(SWEEP);
    let at = |name: &str| fs::read(folder.path().join(name)).unwrap();
    done(folder.path(), "sweep.toml --out one.parquet --threads 1");
    done(folder.path(), "sweep.toml --out three.parquet --threads 3");
    assert_eq!(at("one.parquet"), at("three.parquet"));
    done(folder.path(), "plan sweep.toml --dir d --chunks 7");
    for chunk in [7, 3, 1, 2] {
        done(folder.path(), &format!("run d --chunk {chunk}/7 --threads 2"));
    }
    let said = refused(folder.path(), "merge d --out chunks.parquet");
    assert!(said.contains("3 of 7 chunks are missing: 4-6"), "{said}");
    assert!(done(folder.path(), "run d --chunk 3/7").contains("finished already"));
    let status: Value = serde_json::from_str(&done(folder.path(), "status d --format json")).unwrap();
    assert_eq!(
        (&status["finished"], &status["missing"]),
        (&4.into(), &serde_json::json!([4, 5, 6]))
    );
    done(folder.path(), "run d");
    done(folder.path(), "merge d --out chunks.parquet");
    assert_eq!(at("one.parquet"), at("chunks.parquet"));
    let said = refused(folder.path(), "plan sweep.toml --dir d --chunks 8");
    assert!(said.contains("in 7 chunks; leave --chunks 8 out"), "{said}");
    let said = refused(folder.path(), "merge d --out d/part-00003.parquet --overwrite");
    assert!(said.contains("lies among the parts"), "{said}");
}

#[test]
fn a_sweep_that_was_killed_goes_on_where_it_was() {
    let sweep =
        "scenario = \"paper.toml\"\n[[axis]]\nkey = \"striker.velocity\"\nlinspace = [0.2, 1.2, 12000]";
    let folder = folder(sweep);
    // The command alone makes chunks of five seconds; it goes on with those that are there.
    done(folder.path(), "plan sweep.toml --dir a.parquet.sweep --chunks 40");
    for signal in ["INT", "KILL"] {
        let mut child = command(folder.path(), "sweep.toml --out a.parquet --threads 1")
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let parts = || names(&folder.path().join("a.parquet.sweep")).len();
        let (before, started) = (parts(), Instant::now());
        while parts() < before + 4 {
            assert!(started.elapsed() < Duration::from_secs(60), "no parts");
            std::thread::sleep(Duration::from_millis(2));
        }
        let kill = format!("kill -{signal} {}", child.id());
        assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
        let code = child.wait().unwrap().code();
        let mut said = String::new();
        std::io::Read::read_to_string(&mut child.stderr.take().unwrap(), &mut said).unwrap();
        if signal == "INT" {
            assert_eq!(code, Some(130));
            assert!(said.contains("finished parts are in a.parquet.sweep"), "{said}");
        }
    }
    let said = done(folder.path(), "sweep.toml --out a.parquet --format json");
    let said: Value = serde_json::from_str(&said).unwrap();
    let computed = said["computed"].as_u64().unwrap();
    assert!(computed < 12_000 && computed.is_multiple_of(300), "{computed}");
    done(folder.path(), "sweep.toml --out b.parquet");
    let at = |name: &str| fs::read(folder.path().join(name)).unwrap();
    assert_eq!(at("a.parquet"), at("b.parquet"));
    assert_eq!(
        names(folder.path()),
        ["a.parquet", "b.parquet", "paper.toml", "sweep.toml"]
    );
}

#[test]
fn a_point_that_cannot_be_run_is_a_row_with_its_error() {
    let sweep =
        "scenario = \"paper.toml\"\n[[axis]]\nkey = \"intruder.1.mass\"\nvalues = [1e-3, 1.0, 2e-3, -1.0]";
    let folder = folder(sweep);
    let output = bead(folder.path(), "sweep.toml --out a.parquet");
    assert!(output.status.success());
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("2 of 4 points could not be computed"), "{said}");
    let table = Reader::open(&folder.path().join("a.parquet")).unwrap();
    let errors = cells(&table, "error");
    assert!(
        matches!(&errors[1], Cell::Text(why) if why.contains("as heavy as its host")),
        "{errors:?}"
    );
    assert!(
        matches!(&errors[3], Cell::Text(why) if why.contains("not a positive number")),
        "{errors:?}"
    );
    assert_eq!((&errors[0], &errors[2]), (&Cell::Null, &Cell::Null));
    let absorbed = cells(&table, "absorbed_j");
    assert!(
        absorbed
            .iter()
            .map(|cell| *cell == Cell::Null)
            .eq([false, true, false, true])
    );
}

#[test]
fn a_grid_typed_by_mistake_says_its_size_and_its_time_first() {
    let axis = |key: &str| format!("[[axis]]\nkey = \"{key}\"\nlinspace = [0.2, 1.2, 1000]\n");
    let sweep = format!(
        "scenario = \"paper.toml\"\n{}{}",
        axis("striker.velocity"),
        axis("striker.relaxation")
    );
    let folder = folder(&sweep);
    let said = refused(folder.path(), "sweep.toml --out a.parquet");
    assert!(
        said.contains("axes of 1,000 × 1,000 make 1,000,000 points, about ") && said.contains("--yes"),
        "{said}"
    );
    let said = refused(folder.path(), "plan sweep.toml --dir d");
    assert!(said.contains("1,000,000 points"), "{said}");
    assert_eq!(names(folder.path()), ["paper.toml", "sweep.toml"]);
    done(folder.path(), "plan sweep.toml --dir d --limit 1000000");
}

#[test]
fn what_is_of_another_plan_is_refused_and_stays() {
    let sweep = |to: f64| {
        format!("scenario = \"paper.toml\"\n[[axis]]\nkey = \"duration\"\nlinspace = [1e-3, {to}, 8]")
    };
    let folder = folder(&sweep(2e-3));
    let (path, at) = (folder.path(), |name: &str| folder.path().join(name));
    done(path, "plan sweep.toml --dir one --chunks 4");
    done(path, "run one");
    assert!(
        refused(path, "run one --chunk 2/5").contains("has 4 chunks; was the chunk of another plan meant?")
    );
    fs::write(at("sweep.toml"), sweep(3e-3)).unwrap();
    assert!(refused(path, "plan sweep.toml --dir one").contains("holds the parts of another sweep"));
    done(path, "plan sweep.toml --dir two --chunks 4");
    fs::copy(at("one/part-00002.parquet"), at("two/part-00002.parquet")).unwrap();
    let said = refused(path, "run two");
    assert!(
        said.contains("part-00002.parquet is not chunk 2 of this plan: it is of plan"),
        "{said}"
    );
    assert!(refused(path, "merge two --out a.parquet").contains("is not chunk 2 of this plan"));
    // A part under another's name, and one that is cut.
    fs::rename(at("one/part-00001.parquet"), at("one/part-00003.parquet")).unwrap();
    assert!(refused(path, "merge one --out a.parquet").contains("it has 2 rows of chunk 1/4"));
    let whole = fs::read(at("one/part-00004.parquet")).unwrap();
    fs::write(at("one/part-00004.parquet"), &whole[..whole.len() / 2]).unwrap();
    fs::remove_file(at("one/part-00003.parquet")).unwrap();
    assert!(refused(path, "status one").contains("is no Parquet file, or a damaged one"));
    // One whose columns stand in another order: their values would be taken for each other's.
    let (sound, other) = (at("one/part-00002.parquet"), at("other.parquet"));
    let part = Reader::open(&sound).unwrap();
    let notes = ["plan", "chunk"].map(|key| (key, part.note(key).unwrap()));
    let turned: Vec<_> = part.columns().iter().rev().cloned().collect();
    let mut file = fs::File::create(&other).unwrap();
    let mut table = Writer::parquet(&mut file, "sweep", &turned, &notes).unwrap();
    for row in part.all_batches().flat_map(|batch| batch.unwrap().into_rows()) {
        table.push(row.into_iter().rev().collect()).unwrap();
    }
    table.finish().unwrap();
    fs::rename(&other, &sound).unwrap();
    assert!(refused(path, "status one").contains("is not chunk 2 of this plan: it has other columns"));
    // A plan that was edited.
    let plan = fs::read_to_string(at("two/plan.toml")).unwrap();
    fs::write(at("two/plan.toml"), plan.replace("chunks = 4", "chunks = 0")).unwrap();
    assert!(refused(path, "status two").contains("has 8 points in 0 chunks"));
    fs::write(at("two/plan.toml"), plan.replace("points = 8", "points = 9")).unwrap();
    assert!(refused(path, "status two").contains("was changed after it was made"));
    assert!(refused(path, "status .").contains("holds no plan"));
    assert!(refused(path, "sweep.toml --out paper.toml --overwrite").contains("is a TOML file"));
    assert_eq!(bead(path, "sweep.toml").status.code(), Some(2), "it needs --out");
}

#[test]
fn a_plan_has_no_more_chunks_than_numbers() {
    let folder =
        folder("scenario = \"paper.toml\"\n[[axis]]\nkey = \"duration\"\nlinspace = [1e-3, 2e-3, 1e12]");
    done(folder.path(), "plan sweep.toml --dir d --chunks 99999 --yes");
    let many = bead(folder.path(), "plan sweep.toml --dir e --chunks 100000 --yes");
    assert_eq!(many.status.code(), Some(2));
    let file = folder.path().join("d/plan.toml");
    let plan = fs::read_to_string(&file).unwrap();
    let edited = plan.replace("chunks = 99999", "chunks = 100000");
    assert_ne!(plan, edited);
    fs::write(file, edited).unwrap();
    let said = refused(folder.path(), "status d");
    assert!(said.contains("1000000000000 points in 100000 chunks"), "{said}");
}

#[test]
fn a_disk_that_is_full_leaves_the_finished_parts() {
    let sweep = "scenario = \"paper.toml\"\n[[axis]]\nkey = \"duration\"\nlinspace = [1e-3, 2e-3, 800]";
    let folder = folder(sweep);
    done(folder.path(), "plan sweep.toml --dir d --chunks 4");
    done(folder.path(), "run d --chunk 1/4");
    // No file may grow beyond some kilobytes.
    let limited = format!(
        "trap '' XFSZ; ulimit -f 8; exec {} sweep run d",
        env!("CARGO_BIN_EXE_bead")
    );
    let output = Command::new("sh")
        .current_dir(folder.path())
        .args(["-c", &limited])
        .output()
        .unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        said.contains("cannot write d/part-00002.parquet") && said.lines().count() == 1,
        "{said}"
    );
    assert_eq!(
        names(&folder.path().join("d")),
        ["part-00001.parquet", "plan.toml"]
    );
    done(folder.path(), "run d");
}

#[test]
fn curves_and_maps_are_drawn_of_any_two_axes() {
    let folder = folder(SWEEP);
    let path = folder.path();
    let said = refused(path, "sweep.toml --out a.parquet --plot a.svg");
    assert!(
        said.contains(
            "more axes: tuned (3 values), sample (8 values); choose a place of each with --at tuned="
        ),
        "{said}"
    );
    assert!(!path.join("a.parquet").exists(), "it says so before the work");
    done(
        path,
        "sweep.toml --out a.parquet --plot a.svg --at sample=3 --x striker_velocity_mps --y tuned",
    );
    let map = fs::read_to_string(path.join("a.svg")).unwrap();
    assert_eq!(
        map.matches("crispEdges").count(),
        128 + 9,
        "the bar's colours, and a cell for each point"
    );
    assert!(map.contains("striker velocity (m/s)") && map.contains("absorbed (µJ)"));
    let curves = "plot a.parquet --x striker_velocity_mps --y contact_8_peak_force_n --by tuned --at chain_relaxation_s=0";
    done(path, &format!("{curves} --out b.svg"));
    let drawn = fs::read_to_string(path.join("b.svg")).unwrap();
    assert!(drawn.contains("contact 8 peak force (N)") && drawn.contains("by tuned"));
    for (arguments, part) in [
        ("--x nothing", "nothing is no column of an axis"),
        ("--map nothing --at sample=0", "nothing is no result"),
        (
            "--x tuned --y intruder_1_stiffness_n_per_m --map --at sample=1",
            "are of one",
        ),
        ("--at sample", "write COLUMN=VALUE"),
    ] {
        let said = refused(path, &format!("plot a.parquet {arguments} --out c.svg"));
        assert!(said.contains(part), "{arguments}: {said}");
    }
    let options = bead(path, "sweep.toml --out b.parquet --x tuned");
    let said = String::from_utf8(options.stderr).unwrap();
    assert!(
        options.status.code() == Some(2) && said.contains("--plot"),
        "{said}"
    );
    fs::write(path.join("x.parquet"), "PAR1").unwrap();
    assert!(refused(path, "plot x.parquet --out c.svg").contains("is no Parquet file, or a damaged one"));
}

#[test]
fn a_picture_that_cannot_be_drawn_hides_no_summary() {
    let folder =
        folder("scenario = \"paper.toml\"\n[[axis]]\nkey = \"intruder.1.mass\"\nvalues = [1.0, 2.0]");
    let output = bead(
        folder.path(),
        "sweep.toml --out a.parquet --plot a.svg --format json",
    );
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(said.contains("no point with a value of absorbed_j"), "{said}");
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["failed"], 2);
    assert_eq!(names(folder.path()), ["a.parquet", "paper.toml", "sweep.toml"]);
}

/// A Python with xarray, as `cargo xtask test` sets it up where it can.
fn python() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_BIN_EXE_bead")).ancestors().nth(2).unwrap();
    let own = std::env::var_os("BEAD_PYTHON").map(PathBuf::from);
    own.or_else(|| Some(folder.join("python/bin/python3")).filter(|path| path.exists()))
}

#[test]
fn the_printed_line_makes_a_cube_in_xarray() {
    let Some(python) = python() else {
        eprintln!("SKIPPED: no Python with pandas and xarray; `cargo xtask python` sets one up");
        return;
    };
    let folder = folder(SWEEP);
    let said = done(folder.path(), "sweep.toml --out a.parquet --format json");
    let said: Value = serde_json::from_str(&said).unwrap();
    let script = format!(
        "import pandas\ncube = {}\nprint(dict(cube.sizes), float(cube.absorbed_j[2, 1, 5]))",
        said["xarray"].as_str().unwrap()
    );
    let output = Command::new(python)
        .current_dir(folder.path())
        .args(["-c", &script])
        .output()
        .unwrap();
    let printed = String::from_utf8(output.stdout).unwrap();
    let expected = numbers(&folder.path().join("a.parquet"), "absorbed_j")[2 * 24 + 8 + 5];
    let sizes = "{'striker_velocity_mps': 3, 'tuned': 3, 'sample': 8} ";
    let value = printed.trim().strip_prefix(sizes);
    let value = value.unwrap_or_else(|| panic!("{printed} {}", String::from_utf8_lossy(&output.stderr)));
    assert_eq!(value.parse(), Ok(expected));
}
