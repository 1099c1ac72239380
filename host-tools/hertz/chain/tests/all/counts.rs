//! Counts the instructions of fixed runs with valgrind, so that any computer notices a slower solver.
//!
//! Valgrind shows every program the same processor, with vectors of 256 bits. The counts belong to the
//! compiler that `rust-toolchain.toml` names; a new one may change them. `COUNTS=overwrite cargo test
//! --release -p hertz-chain counts` writes them anew, and the change of `data/instructions.txt` belongs in
//! the commit that causes it.

use std::fmt::Write;
use std::hint::black_box;
use std::path::PathBuf;
use std::process::Command;

use hertz_chain::{Accuracy, EnsembleOptions, Run, Scenario, ensemble, summarise};

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/all/data/instructions.txt");
/// Part by which a count may differ: what a change elsewhere in the crate moves by other inlining.
const SLACK: f64 = 0.02;

const ACCURACY: Accuracy = Accuracy::new(1e-8, 1.0);

/// The chains of `docs/benchmarks.md`.
fn chain(beads: usize, relaxation: f64, host: usize, stiffness: f64) -> Scenario {
    let mut scenario = Scenario::paper();
    scenario.duration = 0.010;
    scenario.chain.beads = beads;
    scenario.chain.relaxation = relaxation;
    (scenario.intruders[0].beads, scenario.intruders[0].stiffness) = (vec![host], stiffness);
    scenario
}

fn a() -> Scenario {
    chain(16, 4.2e-6, 8, 3.95e5)
}

fn b() -> Scenario {
    chain(46, 0.0, 15, 1e5)
}

fn end(scenario: &Scenario) {
    let mut run = Run::new(scenario, ACCURACY).expect("the chain is sound");
    run.to(scenario.duration).expect("it runs");
    black_box(run.snapshot().velocity(1));
}

#[inline(never)]
fn counted_end_of_a() {
    end(&a());
}

#[inline(never)]
fn counted_end_of_b() {
    end(&b());
}

#[inline(never)]
fn counted_samples_of_b() {
    let scenario = b();
    let (mut sum, mut next) = (0.0, 0);
    let mut run = Run::new(&scenario, ACCURACY).expect("the chain is sound");
    let watched = run.watch(scenario.duration, |step| {
        while next <= 1000 && f64::from(next) * 1e-5 <= step.to() {
            let at = step.at(f64::from(next) * 1e-5);
            sum += (0..=scenario.chain.beads)
                .map(|body| at.velocity(body))
                .sum::<f64>();
            next += 1;
        }
    });
    watched.expect("it runs");
    black_box(sum);
}

#[inline(never)]
fn counted_summary_of_a() {
    let options = hertz_chain::Options::with(ACCURACY);
    black_box(summarise(&a(), &options).expect("it runs"));
}

#[inline(never)]
fn counted_ensemble_like_a() {
    let mut scenarios = [(); 8].map(|()| a());
    scenarios[0].intruders[0].stiffness = 1e5;
    black_box(ensemble(&scenarios, &EnsembleOptions::default()));
}

const CASES: [(&str, fn()); 5] = [
    ("counted_end_of_a", counted_end_of_a),
    ("counted_end_of_b", counted_end_of_b),
    ("counted_samples_of_b", counted_samples_of_b),
    ("counted_summary_of_a", counted_summary_of_a),
    ("counted_ensemble_like_a", counted_ensemble_like_a),
];

/// The runs that valgrind counts. This is a test because a test program has no other entry.
#[test]
#[ignore = "of use under valgrind alone"]
fn runs_that_are_counted() {
    for (_, case) in CASES {
        case();
    }
}

/// Instructions of each case, in their order; none without valgrind.
fn counts() -> Option<Vec<u64>> {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("counts-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder can be made");
    let found = Command::new("valgrind")
        .args(["--tool=callgrind", "--collect-atstart=no"])
        .arg(format!("--callgrind-out-file={}", folder.join("part").display()))
        .arg("--toggle-collect=*::counted_*")
        // A file of its own for each case.
        .args(CASES.map(|(name, _)| format!("--dump-after=all::counts::{name}")))
        .arg(std::env::current_exe().expect("this program has a name"))
        .args("--exact counts::runs_that_are_counted --ignored --test-threads=1".split(' '))
        // All work runs in the thread that is watched.
        .env("RAYON_NUM_THREADS", "1")
        .output();
    let printed = found.ok()?.stderr;
    let count = |number: usize| {
        let part = std::fs::read_to_string(folder.join(format!("part.{number}"))).unwrap_or_default();
        let total = part.lines().find_map(|line| line.strip_prefix("totals: "));
        let total = total.and_then(|total| total.trim().parse().ok());
        total.unwrap_or_else(|| panic!("valgrind counts nothing: {}", String::from_utf8_lossy(&printed)))
    };
    let counts = (1..=CASES.len()).map(count).collect();
    std::fs::remove_dir_all(&folder).expect("a folder can be removed");
    Some(counts)
}

#[test]
fn fixed_runs_take_as_many_instructions_as_they_did() {
    if !cfg!(target_arch = "x86_64") {
        println!("counts are of x86-64: not compared");
        return;
    }
    let Some(counts) = counts() else {
        println!("no valgrind: instructions are not compared");
        return;
    };
    let (mut text, mut wrong) = (String::new(), String::new());
    let known = std::fs::read_to_string(FILE).unwrap_or_default();
    for ((name, _), now) in CASES.iter().zip(counts) {
        writeln!(text, "{name} {now}").unwrap();
        let of = |line: &str| line.strip_prefix(name)?.trim().parse().ok();
        let before: f64 = known.lines().find_map(of).unwrap_or(0.0);
        let change = now as f64 / before - 1.0;
        println!("{name}: {now}, {:+.2} %", 100.0 * change);
        if change.abs() > SLACK {
            writeln!(wrong, "{name} takes {now} instructions, {before} before").unwrap();
        }
    }
    if std::env::var("COUNTS").is_ok_and(|value| value == "overwrite") {
        std::fs::write(FILE, text).unwrap();
        return;
    }
    assert!(
        wrong.is_empty(),
        "{wrong}if that is meant: COUNTS=overwrite cargo test --release -p hertz-chain counts"
    );
}
