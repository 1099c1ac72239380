//! `cargo xtask test`: every check.
//!
//! # Design
//! Two series of commands run beside one another, one for the host and one for the part. Each has a cargo
//! lock of its own, and both keep two cores busy until all is compiled. What is compiled for the first time
//! is linted and documented at once (`compiler.rs`). Then everything that runs is put into one queue, and
//! beside it come lints and documentation of what was there already, which leave a core idle for half of
//! their time.

use crate::packages::{DEMO, HOST, IMAGES, ON_EMBASSY};
use crate::setup::{Need, TARGET, setup};
use crate::step::{Line, Steps, Stop};
use crate::suite::Job;
use crate::{checks, compiler, image, lint, mutants, python, suite, supply};

/// Runs every check.
///
/// # Errors
/// Of the first one that fails.
pub(crate) fn test(steps: &Steps) -> Result<(), Stop> {
    setup(steps, Need::Check)?;
    lint::text(steps)?;
    image::build_if_there_is_one(steps)?;
    compiler::put(steps)?;
    let (mut jobs, mut unchecked) = (Vec::new(), HOST);
    steps.both(
        |steps| {
            (jobs, unchecked) = programs(steps)?;
            Ok(())
        },
        part,
    )?;
    jobs.extend(slow_core(steps, &jobs));
    jobs.push(figures(steps));
    // Last: cargo compiles them, and waits for the lints.
    jobs.push(documented_examples());
    let mut passed = 0;
    steps.both(
        |steps| lint::host(steps, unchecked),
        |steps| {
            passed = suite::run(steps, jobs)?;
            Ok(())
        },
    )?;
    steps.announce(&format!("{passed} tests passed"));
    let table = steps.root.join(steps.built(TABLE));
    let rows = checks::compare(&steps.root.join("docs/checks.md"), &table)?;
    steps.announce(&format!("docs/checks.md tells the same in {rows} lines"));
    demo_is_compiled(steps)?;
    steps.announce(&format!("all checks pass, after {}", steps.elapsed()));
    Ok(())
}

/// Compiles all that the host needs, and gives the programs of the tests, and what is to be linted yet.
fn programs(steps: &Steps) -> Result<(Vec<Job>, &'static str), Stop> {
    let compile = Line::new("cargo test --no-run --all-targets --release").words(HOST);
    let made = steps.built("release/bead");
    let built = compiler::build(steps, "build the host tools and their tests", &compile, &made)?;
    // The figures' checks are left to the program that draws them as well.
    let programs = suite::programs(&built.told).into_iter();
    let programs = programs.map(|job| Job {
        line: job.line.words("--skip").arg(mutants::TEST),
        ..job
    });
    let unchecked = if built.checked { "-p xtask" } else { HOST };
    Ok((programs.collect(), unchecked))
}

/// Builds and checks what is for the part; and the readers of others, which come over the network.
fn part(steps: &Steps) -> Result<(), Stop> {
    if !image::build_and_check(steps)? {
        lint::image(steps)?;
    }
    images(steps)?;
    supply::check(steps)?;
    lint::packages(steps)?;
    let bare = format!(
        "cargo check --profile firmware --target {TARGET} -p bead-model -p bead-wire --no-default-features"
    );
    steps.run(
        "the shared crates without their default features",
        &Line::new(&bare),
    )?;
    python::setup_if_it_can_be(steps);
    Ok(())
}

/// Builds and lints the images of the emulator's tests.
fn images(steps: &Steps) -> Result<(), Stop> {
    let (title, line) = (
        "images of the emulator's tests",
        Line::new("cargo build").words(IMAGES),
    );
    let made = steps.built(&format!("{TARGET}/firmware"));
    let plain = compiler::build(steps, title, &line.clone().words("--bins"), &made.join("panics"))?;
    let on_embassy = compiler::build(steps, title, &line.words(ON_EMBASSY), &made.join("ports"))?;
    match plain.checked && on_embassy.checked {
        true => Ok(()),
        false => lint::images(steps),
    }
}

/// The end-to-end tests that depend on the core's speed.
const SPEED_MATTERS: &str = "strikes:: faults:: link::";

/// What depends on the core's speed, once more with 16 ns an instruction instead of 8: 2.7 clocks, which is
/// about the most that the core can take (docs/emulator.md).
fn slow_core(steps: &Steps, jobs: &[Job]) -> Vec<Job> {
    let tests = jobs
        .iter()
        .filter(|job| job.title.ends_with("-p bead-tests --test all"));
    let tests = tests.cloned().map(|Job { title, line }| Job {
        title: format!("{title} {SPEED_MATTERS}"),
        line: line.words(SPEED_MATTERS),
    });
    let corners = Job {
        title: "strikers and speeds at the corners of their ranges".to_owned(),
        line: Line::program(steps.built("release/bead"))
            .words("accuracy docs/scenarios/paper-strike.toml --bead 8 --strikes 2")
            .words("--radii 0.0045,0.0115 --velocity 0.45,5"),
    };
    let slow = |job: Job| Job {
        title: format!("{}, on a core half as fast", job.title),
        line: job.line.env("STM32F405_QEMU_SHIFT", "4"),
    };
    tests.chain([corners]).map(slow).collect()
}

fn documented_examples() -> Job {
    let line = Line::new("cargo test --release --doc").words(HOST);
    Job {
        title: line.to_string(),
        line,
    }
}

/// The table of checks that the figures write.
const TABLE: &str = "figures/checks.md";

fn figures(steps: &Steps) -> Job {
    Job {
        title: "the paper's figures, and every check of them".to_owned(),
        line: Line::program(steps.built("release/bead"))
            .words("figures --check --overwrite --out")
            .arg(steps.built("figures"))
            .words("--table")
            .arg(steps.built(TABLE))
            .words("--format json"),
    }
}

/// Nothing that the tests have compiled is compiled anew for the demo.
fn demo_is_compiled(steps: &Steps) -> Result<(), Stop> {
    let again = Line::new("cargo build --release --message-format json").words(DEMO);
    let told = steps.read("the demo finds all compiled", &again)?;
    match told.lines().find(|line| line.contains("\"fresh\":false")) {
        Some(stale) => Err(Stop::failed(format!(
            "the demo would compile anew what the tests use with other features: {stale}"
        ))),
        None => Ok(()),
    }
}
