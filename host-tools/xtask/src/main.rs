//! `cargo xtask`: the commands that build, show and check the whole workspace.
//!
//! Exit status: 0 done; 1 a check or a build failed; 3 something is missing on this machine. If a `bead`
//! command of `demo` fails, `demo` ends with its status.

mod book;
mod campaign;
mod checks;
mod code_mutants;
mod comments;
mod compiler;
mod dist;
mod files;
mod fuzz;
mod image;
mod links;
mod lint;
mod miri;
mod mutants;
mod nightly;
mod packages;
mod paths;
mod python;
mod reproducible;
mod setup;
mod step;
mod suite;
mod supply;
mod test;

use std::process::ExitCode;

use clap::{Arg, Command};

use crate::packages::DEMO;
use crate::setup::{Need, setup};
use crate::step::{Line, Steps, Stop};

/// A command of xtask: its name, what it does, more about it, and the function that does it.
type Task = (
    &'static str,
    &'static str,
    &'static str,
    fn(&Steps) -> Result<(), Stop>,
);

const TASKS: &[Task] = &[
    (
        "setup",
        "Install what is missing: Rust's thumbv7em-none-eabihf target and QEMU's qemu-system-arm",
        "It says what it installs before it does, and removes nothing. QEMU comes by apt, as root or with a sudo that asks \
         for no password. Elsewhere it prints the command for this system and ends with status 3. A second run changes \
         nothing.",
        |steps| setup(steps, Need::Check),
    ),
    (
        "build",
        "Build the flash image and, in release, the host tools",
        "",
        |steps| {
            setup(steps, Need::Run)?;
            build(steps, &format!("{DEMO} -p bead-figures"))
        },
    ),
    (
        "demo",
        "Simulate a strike, run the flash image on it in QEMU, replay its samples, compare with the simulation",
        "The recording and report.html land in target/demo.",
        demo,
    ),
    (
        "chain",
        "Simulate a strike on a row of ten absorbers, run the flash image inside each in QEMU, compare them all",
        "It is Fig. 5 of the paper by measurement: what ten beads sense of one strike, on one time, and the energy that \
         their intruders leave. The recording, the pictures and report.html land in target/chain.",
        chain,
    ),
    (
        "test",
        "Run every check, on the host and in QEMU: format, lints, documentation, builds, tests",
        "It stops at the first step that fails, with the command that repeats this step.",
        test::test,
    ),
    (
        "lint",
        "Run the checks of `test` that run no program: format, lints, imports, documentation and its links",
        "",
        |steps| {
            setup(steps, Need::Check)?;
            lint::lint(steps)
        },
    ),
    (
        "numbers",
        "Measure what a sample costs and what the image takes, and write it into docs/budget.md",
        "",
        |steps| {
            setup(steps, Need::Run)?;
            build(steps, DEMO)?;
            let measure = Line::new("cargo test --release -p bead-tests --test all budget::")
                .env("BEAD_NUMBERS_WRITE", "1");
            steps.run("the budget", &measure)
        },
    ),
    (
        "book",
        "Render docs/ as a book with mdBook, into target/book",
        "It installs mdBook into target/tools if it is missing, which takes some minutes.",
        book::render,
    ),
    (
        BENCH,
        "Time the chain simulator and general solvers side by side, for a given error; takes some minutes",
        "Words that follow go to the benchmark: `--format json`; `--quick`; `--peers` for solvers of Python too; `--native` \
         to compare with a program compiled for this processor alone; `--plots FOLDER` for pictures. What it compares with \
         is compiled for it alone. docs/benchmarks.md says how to read it.",
        |steps| bench(steps, &[]),
    ),
    (
        "dist",
        "Make the archive of a release in target/dist, and try it from an empty folder without Rust",
        "In it are `bead` as `cargo install --path host-tools` makes it, with the emulator's overlay and the flash image \
         inside, completions, manual pages, the book, and the image for a debug probe.",
        |steps| {
            setup(steps, Need::Run)?;
            build(steps, DEMO)?;
            dist::make(steps, &image::path(steps))
        },
    ),
    (
        "notices",
        "Write THIRD-PARTY.md, and the licences' texts and bills of materials into target/notices",
        "What cargo links into image and tools is on the page, with the licence that it is taken under. deny.toml says \
         which licences are allowed. `dist` packs all of it.",
        supply::notices,
    ),
    (
        "reproducible",
        "Build the flash image in another folder with another home too, and compare all bytes",
        "It takes as long as a first build of the image. What is built is the commit, so sources of the image must not \
         differ from it.",
        |steps| {
            setup(steps, Need::Run)?;
            reproducible::check(steps)
        },
    ),
    (
        "python",
        "Set up target/python with pandas, polars, xarray, pyuff and mcap, which a test opens exported files with",
        "",
        python::setup,
    ),
    (
        MUTANTS,
        "Make mistakes in a copy, one by one, and see that checks and tests notice each: [PART] [SHARD]",
        "Alone it makes mistakes in the physics, which the figures' checks must notice. `model`, `wire`, `store` and \
         `solver` are parts whose code cargo-mutants changes in many places; all of one takes an hour, `store 0/16` a \
         sixteenth of that.",
        |steps| code_mutants::check(steps, &[]),
    ),
    (
        FUZZ,
        "Look for inputs that break a reader, by libFuzzer: [TARGET] [TIME], such as `frames 1h`; all for a minute each",
        "It needs Rust's nightly and cargo-fuzz, and says how to install them. The first build takes some minutes. What it \
         learns stays in target/fuzz/corpus; an input that breaks something is left in target/fuzz/found. \
         docs/reliability.md names the targets.",
        |steps| fuzz::fuzz(steps, &[]),
    ),
    (
        CAMPAIGN,
        "Run the image under scripts of faults that chance draws: N [--seed S], such as `300`; two a second",
        "A script that fails is made smaller as long as it fails, and left in target/campaign: it can join those in \
         fuzz/scripts, which `test` runs. docs/reliability.md says what has to hold.",
        |steps| campaign::campaign(steps, &[]),
    ),
    (
        "miri",
        "Run the tests of what runs on the bead under Miri, on a little-endian and on a big-endian machine",
        "It needs Rust's nightly with its components miri and rust-src, and says how to install them. It takes about \
         half an hour of a core, though loops are shorter than in `test`.",
        miri::miri,
    ),
];

fn main() -> ExitCode {
    if let Some(ended) = compiler::called() {
        return ended;
    }
    let mut cli = Command::new("cargo xtask")
        .bin_name("cargo xtask")
        .about("Set-up, build, demo and test of the sensing absorber bead")
        .after_help(
            "New here? `cargo xtask demo` needs nothing but Rust. It installs what is missing, says what, and shows \
             every command that it runs.",
        )
        .subcommand_required(true)
        .arg_required_else_help(true);
    for &(name, about, more, _) in TASKS {
        let words = Arg::new("words")
            .num_args(0..)
            .trailing_var_arg(true)
            .allow_hyphen_values(true);
        let command = Command::new(name).about(about).after_help(more);
        cli = cli.subcommand(match WITH_WORDS.iter().any(|(with, _)| *with == name) {
            true => command.arg(words),
            false => command,
        });
    }
    let matches = cli.get_matches();
    let (name, matches) = matches.subcommand().expect("a command is required");
    let with_words = WITH_WORDS.iter().find(|(with, _)| *with == name);
    let task = TASKS.iter().find(|(task, ..)| *task == name);
    let done = Steps::start().and_then(|steps| match (with_words, task) {
        (Some((_, run)), _) => {
            let words = matches.get_many::<String>("words").into_iter().flatten();
            run(&steps, &words.collect::<Vec<_>>())
        }
        (None, Some((.., run))) => run(&steps),
        (None, None) => Ok(()),
    });
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(stop) => {
            eprintln!("error: {}", stop.message);
            ExitCode::from(stop.status)
        }
    }
}

/// The command of the benchmark.
const BENCH: &str = "bench";
/// The command of the fuzz targets.
const FUZZ: &str = "fuzz";

/// The command of the mutants.
const MUTANTS: &str = "mutants";
/// The command of the fault campaign.
const CAMPAIGN: &str = "campaign";

/// A command that takes words, with them.
type WithWords = (&'static str, fn(&Steps, &[&String]) -> Result<(), Stop>);

const WITH_WORDS: &[WithWords] = &[
    (BENCH, bench),
    (FUZZ, fuzz::fuzz),
    (CAMPAIGN, campaign::campaign),
    (MUTANTS, code_mutants::check),
];

/// Runs the benchmark with these words. For `--native` it is compiled a second time, for this processor
/// alone.
fn bench(steps: &Steps, words: &[&String]) -> Result<(), Stop> {
    let mut line = Line::new("cargo run --release --package hertz-benchmarks --");
    for word in words {
        line = line.arg(word.as_str());
        if word.as_str() == NATIVE {
            let folder = steps.target.join("native");
            let build = Line::new("cargo build --release --package hertz-benchmarks --target-dir")
                .arg(&folder)
                .env("RUSTFLAGS", "-C target-cpu=native");
            steps.run("the same program for this processor alone", &build)?;
            line = line.arg(folder.join("release/hertz-benchmarks"));
        }
    }
    steps.run("the chain simulator and general solvers", &line)
}

/// The word of the benchmark for which there has to be a second program.
const NATIVE: &str = "--native";

/// Builds the host's packages in `packages`, and beside it the flash image.
fn build(steps: &Steps, packages: &str) -> Result<(), Stop> {
    let host = Line::new("cargo build --release").words(packages);
    image::build_if_there_is_one(steps)?;
    steps.both(|steps| steps.run("build the host tools", &host), image::build)
}

/// A command of the `bead` that was built.
fn bead(steps: &Steps, words: &str) -> Line {
    Line::program(steps.built("release/bead")).words(words)
}

fn demo(steps: &Steps) -> Result<(), Stop> {
    setup(steps, Need::Run)?;
    build(steps, DEMO)?;
    let scenario = "docs/scenarios/paper-strike.toml";
    let recording = steps.built("demo/bead-8.mcap");
    let report = steps.built("demo/report.html");
    let emulate = bead(steps, &format!("emulate {scenario} --bead 8 --firmware"))
        .arg(image::path(steps))
        .words("--overwrite --out")
        .arg(steps.built("demo"));
    let title = "a striker hits the chain; the flash image senses it inside bead 8, in QEMU";
    steps.run(title, &emulate)?;
    let title = "the recorded samples, through the same fixed-point code on this computer";
    steps.run(title, &bead(steps, "replay").arg(&recording))?;
    let compare = bead(steps, "compare")
        .arg(&recording)
        .words(&format!("--scenario {scenario} --overwrite --report"))
        .arg(&report);
    steps.run("device, replay and simulation, side by side", &compare)?;
    steps.announce(&format!("done. The report: {}", report.display()));
    Ok(())
}

fn chain(steps: &Steps) -> Result<(), Stop> {
    setup(steps, Need::Run)?;
    build(steps, DEMO)?;
    let folder = steps.built("chain");
    let (recording, report) = (steps.built("chain/chain.mcap"), steps.built("chain/report.html"));
    let emulate = bead(
        steps,
        "emulate docs/scenarios/row-of-ten.toml --bead all --firmware",
    )
    .arg(image::path(steps))
    .words("--overwrite --out")
    .arg(&folder);
    let title = "a striker hits a row of ten absorbers; the flash image senses it inside each, in QEMU";
    steps.run(title, &emulate)?;
    let compare = bead(steps, "compare")
        .arg(&recording)
        .words("--overwrite --report")
        .arg(&report)
        .words("--figures")
        .arg(&folder);
    steps.run("ten beads and one simulation, side by side", &compare)?;
    let picture = steps.built("chain/row.svg");
    steps.announce(&format!(
        "done. The picture: {}. The report: {}",
        picture.display(),
        report.display()
    ));
    Ok(())
}
