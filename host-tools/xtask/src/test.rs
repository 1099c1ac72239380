//! `cargo xtask test`: every check.
//!
//! # Design
//! Two series of commands run beside one another, one for the host and one for the part. Each has a cargo
//! lock of its own, and both keep two cores busy until all is compiled. Then all programs run from one queue,
//! beside lints and documentation of the host, since the tests wait for half of their time.

use serde_json::Value;

use crate::packages::{CASES, DEMO, HOST, IMAGES, ON_EMBASSY};
use crate::setup::{Need, TARGET, setup};
use crate::step::{CommandLine, Steps, Stop};
use crate::suite::Job;
use crate::{boards, checks, demo, image, lint, mutants, python, suite, wheel};

/// Runs every check.
pub(crate) fn test(steps: &Steps) -> Result<(), Stop> {
    steps.announce(
        "every check: about half an hour on two cores if nothing is compiled yet, a quarter of an hour if all is",
    );
    setup(steps, Need::Check)?;
    lint::text(steps)?;
    image::build_if_there_is_one(steps)?;
    let mut jobs = Vec::new();
    steps.both(
        |steps| {
            jobs = programs(steps, HOST)?;
            Ok(())
        },
        part,
    )?;
    jobs.extend(slow_core(steps, &jobs));
    jobs.push(figures(steps));
    jobs.push(silent_strikes(steps));
    // Last: cargo compiles them, and waits for the lints.
    jobs.extend(wheel::job(steps));
    jobs.push(documented_examples());
    let mut passed = 0;
    steps.both(
        |steps| lint::host(steps, HOST),
        |steps| {
            passed = suite::run(steps, jobs)?;
            Ok(())
        },
    )?;
    steps.announce(&format!("{passed} tests passed"));
    let table = steps.root.join(steps.built(TABLE));
    let rows = checks::compare(&steps.root.join("docs/checks.md"), &table)?;
    steps.announce(&format!("docs/checks.md agrees in all {rows} lines"));
    demo_is_compiled(steps)?;
    demo::strike(steps)?;
    demo::row(steps)?;
    steps.announce(&format!("all checks pass, after {}", steps.elapsed()));
    Ok(())
}

/// Compiles programs and tests of packages of the host, and lists the programs of the tests.
pub(crate) fn programs(steps: &Steps, packages: &str) -> Result<Vec<Job>, Stop> {
    let compile = CommandLine::new("cargo test --no-run --all-targets --release").words(packages);
    let compile = compile.words("--message-format json-render-diagnostics");
    let built = steps.read("build the host tools and their tests", &compile)?;
    // The program that draws the figures runs their checks as well.
    let but_figures = |job: Job| Job::new(job.title, job.line.words("--skip").arg(mutants::TEST));
    Ok(suite::programs(&built).into_iter().map(but_figures).collect())
}

/// Builds and checks the images, packs the crates, and fetches a Python over the network.
fn part(steps: &Steps) -> Result<(), Stop> {
    image::build(steps)?;
    boards::build_images(steps)?;
    lint::image(steps)?;
    let images = CommandLine::new("cargo build").words(IMAGES);
    for programs in ["--bins", ON_EMBASSY] {
        steps.run("images of the emulator's tests", &images.clone().words(programs))?;
    }
    let cases = CommandLine::new("cargo test --no-run").words(CASES);
    steps.run("cases of the emulator's tests", &cases)?;
    lint::images(steps)?;
    lint::supply(steps)?;
    let bare = format!(
        "cargo check --profile firmware --target {TARGET} -p bead-model -p bead-wire --no-default-features"
    );
    steps.run(
        "the shared crates without their default features",
        &CommandLine::new(&bare),
    )?;
    python::setup_if_it_can_be(steps);
    Ok(())
}

/// The end-to-end tests that depend on the core's speed.
const SPEED_MATTERS: &str = "strikes:: faults::";

/// Jobs that depend on the core's speed, once more with 16 ns an instruction instead of 8: 2.7 clocks, about
/// the most that the core can take (docs/emulator.md).
pub(crate) fn slow_core(steps: &Steps, jobs: &[Job]) -> Vec<Job> {
    let tests = jobs
        .iter()
        .filter(|job| job.title.ends_with("-p bead-tests --test all"));
    let tests = tests
        .cloned()
        .map(|Job { title, line }| Job::new(format!("{title} {SPEED_MATTERS}"), line.words(SPEED_MATTERS)));
    let corners = "proof accuracy docs/scenarios/paper-strike.toml --bead 8 --strikes 2 --radii 0.0045,0.0115 \
                   --velocity 0.45,5";
    let title = "strikers and speeds at the corners of their ranges";
    let slow = |Job { title, line }: Job| {
        let title = format!("{title}, on a core half as fast");
        Job::new(title, line.env("STM32F405_QEMU_SHIFT", "4"))
    };
    let corners = Job::new(title, demo::bead(steps, corners));
    tests.chain([corners]).map(slow).collect()
}

fn documented_examples() -> Job {
    let line = CommandLine::new("cargo test --release --doc").words(HOST);
    Job::new(line.to_string(), line)
}

/// The rows of docs/doubts.md: no strike is off unless a flag names the cause.
pub(crate) fn silent_strikes(steps: &Steps) -> Job {
    Job::new(
        "strikes that are wrong, and say so",
        demo::bead(steps, "proof silent"),
    )
}

/// The table of checks that the figures write.
const TABLE: &str = "figures/checks.md";

fn figures(steps: &Steps) -> Job {
    let line = demo::bead(steps, "figures --check --overwrite --out")
        .arg(steps.built("figures"))
        .words("--table")
        .arg(steps.built(TABLE))
        .words("--format json");
    Job::new("the paper's figures, and every check of them", line)
}

/// Fails if the demo would compile anew what the tests have compiled.
fn demo_is_compiled(steps: &Steps) -> Result<(), Stop> {
    let again = CommandLine::new("cargo build --release --message-format json").words(DEMO);
    let messages = steps.read("the demo finds all compiled", &again)?;
    let Some(stale) = messages.lines().find(|line| line.contains("\"fresh\":false")) else {
        return Ok(());
    };
    let stale: Value = serde_json::from_str(stale).unwrap_or_default();
    Err(Stop::failed(format!(
        "the demo would compile {} with the features {}, but the tests compile it with others",
        stale["package_id"], stale["features"]
    )))
}
