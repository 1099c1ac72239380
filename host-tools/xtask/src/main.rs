//! `cargo xtask`: the commands that build, show and check the whole workspace.
//!
//! Exit status: 0 done; 1 a check or a build failed; 3 something is missing on this machine. `demo` ends with the status
//! of the `bead` command that ended it.

mod checks;
mod image;
mod links;
mod mutants;
mod setup;
mod step;

use std::path::{Path, PathBuf};
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
    let place = Place::find()?;
    let steps = Steps::new(place.root.clone(), place.target.clone());
    match task {
        Task::Setup => setup(&steps, Need::Check),
        Task::Build => {
            setup(&steps, Need::Run)?;
            build(&steps, &place)
        }
        Task::Demo => demo(&steps, &place),
        Task::Lint => {
            setup(&steps, Need::Check)?;
            lint(&steps, &place)
        }
        Task::Test => test(&steps, &place),
        Task::Mutants => mutants::check(&steps, &place),
    }
}

/// Where the workspace is and where it builds.
struct Place {
    root: PathBuf,
    target: PathBuf,
}

impl Place {
    fn find() -> Result<Self, Stop> {
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
        let root = manifest.ancestors().nth(2).unwrap_or(manifest).to_owned();
        // Cargo has put this program into <target>/release: that honours CARGO_TARGET_DIR and cargo's configuration.
        let program =
            std::env::current_exe().map_err(|error| Stop::failed(format!("where is xtask? {error}")))?;
        let target = program.ancestors().nth(2).unwrap_or(&root).to_owned();
        Ok(Place { root, target })
    }

    /// A path below the target directory, written relative to the root where it can be.
    fn built(&self, path: &str) -> PathBuf {
        let full = self.target.join(path);
        full.strip_prefix(&self.root).map(Path::to_owned).unwrap_or(full)
    }

    /// The flash image.
    fn image(&self) -> PathBuf {
        self.built(&format!("{TARGET}/firmware/bead-firmware"))
    }
}

fn build(steps: &Steps, place: &Place) -> Result<(), Stop> {
    let image = format!("cargo build --profile firmware --target {TARGET} -p bead-firmware");
    steps.run("build the flash image", &Line::new(&image))?;
    let size = Size::of(&place.root.join(place.image()))?;
    steps.announce(&format!("the image {} takes {size}", place.image().display()));
    steps.run(
        "build the host tools",
        &Line::new("cargo build --release -p bead -p stm32f405-qemu"),
    )
}

fn demo(steps: &Steps, place: &Place) -> Result<(), Stop> {
    setup(steps, Need::Run)?;
    build(steps, place)?;
    let scenario = "docs/scenarios/paper-strike.toml";
    let bead = |words: &str| Line::program(place.built("release/bead")).words(words);
    let recording = place.built("demo/bead-8.mcap");
    let report = place.built("demo/report.html");
    let emulate = bead(&format!("emulate {scenario} --bead 8 --firmware"))
        .arg(place.image())
        .words("--out")
        .arg(place.built("demo"));
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

fn lint(steps: &Steps, place: &Place) -> Result<(), Stop> {
    let host = "--release --workspace --exclude bead-firmware";
    let thumb = format!("--profile firmware --target {TARGET} -p bead-firmware");
    steps.announce("links of the documentation");
    let followed = links::check(&place.root)?;
    steps.announce(&format!("{followed} links lead somewhere"));
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

fn test(steps: &Steps, place: &Place) -> Result<(), Stop> {
    setup(steps, Need::Check)?;
    lint(steps, place)?;
    build(steps, place)?;
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
    let (figures, table) = (place.built("figures"), place.built("figures/checks.md"));
    let draw = Line::program(place.built("release/bead"))
        .words("figures --check --out")
        .arg(&figures)
        .words("--table")
        .arg(&table)
        .words("--format json");
    steps.run_quietly("the paper's figures, and every check of them", &draw)?;
    let rows = checks::compare(&place.root.join("docs/checks.md"), &place.root.join(&table))?;
    steps.announce(&format!("docs/checks.md tells the same in {rows} lines"));
    steps.announce(&format!("all checks pass, after {}", steps.elapsed()));
    Ok(())
}
