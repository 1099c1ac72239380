//! `cargo xtask`: the commands that build, show and check the whole workspace.
//!
//! Exit status: 0 done; 1 a check or a build failed; 3 something is missing on this machine. `demo` ends with the status
//! of the `bead` command that ended it.

mod checks;
mod image;
mod imports;
mod links;
mod mutants;
mod setup;
mod step;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::image::Size;
use crate::setup::{Need, TARGET, setup};
use crate::step::{Line, Steps, Stop};

#[derive(Debug, Parser)]
#[command(
    name = "cargo xtask",
    bin_name = "cargo xtask",
    about = "Set-up, build, demo and test of the sensing absorber bead",
    after_help = "New here? `cargo xtask demo` needs nothing but Rust: it installs what is missing, saying what, \
                  and shows every command that it runs."
)]
struct Cli {
    #[command(subcommand)]
    command: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Install what is missing: Rust's thumbv7em-none-eabihf target and QEMU's qemu-system-arm
    ///
    /// Says what it installs before it does. QEMU comes by apt, as root or with a sudo that asks for no password;
    /// elsewhere the command for this system is printed and the exit status is 3. Run again, it changes nothing.
    Setup,
    /// Build the flash image and, in release, the host tools
    Build,
    /// Simulate a strike, run the flash image on it in QEMU, replay its samples, compare with the simulation
    ///
    /// Everything lands in target/demo: the recording, and report.html.
    Demo,
    /// Run every check, host and QEMU: format, lints, documentation, builds, tests
    ///
    /// Stops at the first step that fails, with the command that repeats it.
    Test,
    /// The checks of `test` that run nothing: format, lints, documentation and its links
    Lint,
    /// Make mistakes in a copy of the simulator, one by one, and see that the figures' checks notice each
    Mutants,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    match run(cli.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(stop) => {
            eprintln!("error: {}", stop.message);
            ExitCode::from(stop.status)
        }
    }
}

fn run(task: Task) -> Result<(), Stop> {
    let steps = Steps::start()?;
    match task {
        Task::Setup => setup(&steps, Need::Check),
        Task::Build => {
            setup(&steps, Need::Run)?;
            build(&steps)
        }
        Task::Demo => demo(&steps),
        Task::Lint => {
            setup(&steps, Need::Check)?;
            lint(&steps)
        }
        Task::Test => test(&steps),
        Task::Mutants => mutants::check(&steps),
    }
}

/// The flash image.
fn image(steps: &Steps) -> PathBuf {
    steps.built(&format!("{TARGET}/firmware/bead-firmware"))
}

fn build(steps: &Steps) -> Result<(), Stop> {
    let line = format!("cargo build --profile firmware --target {TARGET} -p bead-firmware");
    steps.run("build the flash image", &Line::new(&line))?;
    let size = Size::of(&steps.root.join(image(steps)))?;
    steps.announce(&format!("the image {} takes {size}", image(steps).display()));
    steps.run(
        "build the host tools",
        &Line::new("cargo build --release -p bead -p stm32f405-qemu"),
    )
}

fn demo(steps: &Steps) -> Result<(), Stop> {
    setup(steps, Need::Run)?;
    build(steps)?;
    let scenario = "docs/scenarios/paper-strike.toml";
    let bead = |words: &str| Line::program(steps.built("release/bead")).words(words);
    let recording = steps.built("demo/bead-8.mcap");
    let report = steps.built("demo/report.html");
    let emulate = bead(&format!("emulate {scenario} --bead 8 --firmware"))
        .arg(image(steps))
        .words("--out")
        .arg(steps.built("demo"));
    steps.run(
        "a striker hits the chain; the flash image senses it inside bead 8, in QEMU",
        &emulate,
    )?;
    let replay = bead("replay").arg(&recording);
    steps.run(
        "the recorded samples, through the same fixed-point code on this computer",
        &replay,
    )?;
    let compare = bead("compare")
        .arg(&recording)
        .words(&format!("--scenario {scenario} --report"))
        .arg(&report);
    steps.run("device, replay and simulation, side by side", &compare)?;
    steps.announce(&format!("done. The report: {}", report.display()));
    Ok(())
}

fn lint(steps: &Steps) -> Result<(), Stop> {
    let host = "--release --workspace --exclude bead-firmware";
    let thumb = format!("--profile firmware --target {TARGET} -p bead-firmware");
    steps.announce("links of the documentation");
    let followed = links::check(&steps.root)?;
    steps.announce(&format!("{followed} links lead somewhere"));
    steps.announce(&imports::check(&steps.root)?);
    steps.run("format", &Line::new("cargo fmt --all --check"))?;
    steps.run(
        "lints, host",
        &Line::new(&format!("cargo clippy {host} --all-targets -- -D warnings")),
    )?;
    steps.run(
        "lints, image",
        &Line::new(&format!("cargo clippy {thumb} -- -D warnings")),
    )?;
    let doc =
        |what: &str| Line::new(&format!("cargo doc --no-deps {what}")).env("RUSTDOCFLAGS", "-D warnings");
    steps.run("documentation, host", &doc(host))?;
    steps.run("documentation, image", &doc(&thumb))?;
    Ok(())
}

fn test(steps: &Steps) -> Result<(), Stop> {
    setup(steps, Need::Check)?;
    lint(steps)?;
    build(steps)?;
    let bare = format!(
        "cargo build --profile firmware --target {TARGET} -p bead-model -p bead-wire --no-default-features"
    );
    steps.run(
        "build the shared crates without their default features",
        &Line::new(&bare),
    )?;
    steps.run(
        "tests",
        &Line::new("cargo test --release --workspace --exclude bead-firmware"),
    )?;
    let (figures, table) = (steps.built("figures"), steps.built("figures/checks.md"));
    let draw = Line::program(steps.built("release/bead"))
        .words("figures --check --out")
        .arg(&figures)
        .words("--table")
        .arg(&table)
        .words("--format json");
    steps.run_quietly("the paper's figures, and every check of them", &draw)?;
    let rows = checks::compare(&steps.root.join("docs/checks.md"), &steps.root.join(&table))?;
    steps.announce(&format!("docs/checks.md tells the same in {rows} lines"));
    steps.announce(&format!("all checks pass, after {}", steps.elapsed()));
    Ok(())
}
