//! `cargo xtask`: the commands that build, show and check the whole workspace.
//!
//! Exit status: 0 done; 1 a check or a build failed; 3 something is missing on this machine. If a `bead`
//! command of `demo` fails, `demo` ends with its status.

mod bench;
mod board_table;
mod boards;
mod book;
mod campaign;
mod checks;
mod code_lines;
mod coverage;
mod demo;
mod dist;
mod files;
mod fuzz;
mod image;
mod lines;
mod links;
mod lint;
mod miri;
mod mutants;
mod nightly;
mod packages;
mod paths;
mod public_images;
mod python;
mod reproducible;
mod setup;
mod step;
mod style;
mod suite;
mod supply;
mod test;
mod tools;
mod wheel;

use std::process::ExitCode;

use clap::{Arg, Command};

use crate::packages::DEMO;
use crate::setup::{Need, setup};
use crate::step::{CommandLine, Steps, Stop};

/// A command of xtask.
struct XtaskCommand {
    name: &'static str,
    about: &'static str,
    more: &'static str,
    run: TaskFunction,
}

/// The function of a command, with or without words after the command.
enum TaskFunction {
    Alone(fn(&Steps) -> Result<(), Stop>),
    WithWords(fn(&Steps, &[&String]) -> Result<(), Stop>),
}

const TASKS: &[XtaskCommand] = &[
    XtaskCommand {
        name: "setup",
        about: "Install what is missing: Rust's thumbv7em-none-eabihf target and QEMU's qemu-system-arm",
        more: "It says what it installs before it does so, and removes nothing. QEMU comes from apt, as root or with a \
               sudo that asks for no password. Elsewhere it prints the command for this system and ends with status 3. A \
               second run changes nothing.",
        run: TaskFunction::Alone(|steps| setup(steps, Need::Check)),
    },
    XtaskCommand {
        name: "build",
        about: "Build the flash image and, in release, the host tools; or the image for a BOARD, such as `weact-f405`",
        more: "The boards are the rows of firmware/boards.txt; `boards` builds the images of all. They are left in \
               target/boards. The other commands take the image for the first board.",
        run: TaskFunction::WithWords(boards::build),
    },
    XtaskCommand {
        name: "public-key",
        about: "Print the public part of the signing key in a FILE, for BEAD_UPDATE_KEY",
        more: "The file has 64 hexadecimal digits; BEAD_SIGNING_KEY names it to `build`. docs/security.md says how to make \
               one.",
        run: TaskFunction::WithWords(image::public_key),
    },
    XtaskCommand {
        name: "demo",
        about: "Simulate a strike, run the flash image on it in QEMU, replay its samples, compare with the simulation",
        more: "The recording and report.html land in target/demo.",
        run: TaskFunction::Alone(|steps| {
            demo::build(steps, DEMO)?;
            demo::strike(steps)
        }),
    },
    XtaskCommand {
        name: "chain",
        about: "Simulate a strike on a row of ten absorbers, run the flash image inside each in QEMU, compare them all",
        more: "It reproduces Fig. 5 of the paper by measurement: what ten beads sense of one strike, on a common time, \
               and the energy that their intruders leave. The recording, the pictures and report.html land in target/chain.",
        run: TaskFunction::Alone(|steps| {
            demo::build(steps, DEMO)?;
            demo::row(steps)
        }),
    },
    XtaskCommand {
        name: "test",
        about: "Run every check, on the host and in QEMU: format, lints, documentation, builds, tests",
        more: "It takes about half an hour on two cores if nothing is compiled yet. It stops at the first step that fails, \
               and prints the command that repeats this step.",
        run: TaskFunction::Alone(test::test),
    },
    XtaskCommand {
        name: "lint",
        about: "Run the checks of `test` that run no program: format, lints, imports, documentation and its links",
        more: "",
        run: TaskFunction::Alone(|steps| {
            setup(steps, Need::Check)?;
            lint::lint(steps)
        }),
    },
    XtaskCommand {
        name: "lines",
        about: "Print the lines of Rust of each crate, source and tests",
        more: "",
        run: TaskFunction::Alone(lines::print),
    },
    XtaskCommand {
        name: "coverage",
        about: "Run the tests that run the image, and list the lines of the image that none of them reaches",
        more: "It measures the flash image itself, in QEMU: a line is reached if one of its instructions was executed. It \
               leaves image.lcov and unreached.txt in target/coverage, prints a table by file, and fails below 90 % of \
               the image's own lines. `join` combines the runs that are there, and runs no test.",
        run: TaskFunction::WithWords(coverage::measure),
    },
    XtaskCommand {
        name: "numbers",
        about: "Measure what a sample costs and what the image takes, and write it into docs/budget.md",
        more: "",
        run: TaskFunction::Alone(|steps| {
            demo::build(steps, DEMO)?;
            let measure = CommandLine::new("cargo test --release -p bead-tests --test all budget::")
                .env("BEAD_NUMBERS_WRITE", "1");
            steps.run("the budget", &measure)
        }),
    },
    XtaskCommand {
        name: "book",
        about: "Render docs/ as a book with mdBook, into target/book",
        more: "It installs mdBook into target/tools if it is missing, which takes some minutes.",
        run: TaskFunction::Alone(book::render),
    },
    XtaskCommand {
        name: "bench",
        about: "Time the chain simulator and general solvers side by side, for a given error; takes some minutes",
        more: "`monitor` benchmarks `bead monitor` instead, for ten minutes; `emulator` measures how fast firmware waits \
               in the emulator. Other words are options of the benchmark: \
               `--format json`; `--quick`; `--peers` for a solver of Python too; \
               `--native` to compare with a program compiled only for this processor; `--plots FOLDER` for pictures. \
               The other solvers are compiled only for this command. docs/benchmarks.md says how to read it.",
        run: TaskFunction::WithWords(bench::bench),
    },
    XtaskCommand {
        name: "public-images",
        about: "Build the examples of stm32f4xx-hal, run each in the emulator, and print the results; takes some minutes",
        more: "host-tools/xtask/public-images.toml lists them and what is expected; it fails if one does something else. \
               It needs a network. `test` does not run it. docs/emulator.md has the count.",
        run: TaskFunction::Alone(public_images::check),
    },
    XtaskCommand {
        name: "dist",
        about: "Make the archive of a release in target/dist, and try it from an empty folder without Rust",
        more: "It has `bead` as `cargo install --path host-tools/bead` makes it, with the emulator's overlay and the flash \
               image inside, completions, manual pages, the book, notices, bills of materials, and the images for all boards \
               with their SHA-256. The archive's own SHA-256 is next to it.",
        run: TaskFunction::Alone(|steps| {
            setup(steps, Need::Run)?;
            boards::build_images(steps)?;
            demo::build(steps, DEMO)?;
            dist::make(steps, &image::path(steps))
        }),
    },
    XtaskCommand {
        name: "notices",
        about: "Write THIRD-PARTY.md, and the licences' texts and bills of materials into target/notices",
        more: "The page names each package that cargo links into image and tools, with its licence. about.toml and \
               deny.toml say which licences are allowed. It installs cargo-about and cargo-cyclonedx into target/tools \
               if they are missing, which takes some minutes.",
        run: TaskFunction::Alone(supply::notices),
    },
    XtaskCommand {
        name: "reproducible",
        about: "Build the images for all boards in another folder with another home too, and compare all bytes",
        more: "It takes as long as a first build of the image, and a minute more for each board. It prints the SHA-256 of \
               each, the same as those of `dist`. It builds the commit, so sources of the image must \
               not differ from it.",
        run: TaskFunction::Alone(|steps| {
            setup(steps, Need::Run)?;
            reproducible::check(steps)
        }),
    },
    XtaskCommand {
        name: "wheel",
        about: "Build the Python package hertz-chain, and try it in an empty environment: target/wheels",
        more: "It needs Python 3.10 and a network. docs/python.md says how to install and use it.",
        run: TaskFunction::Alone(wheel::wheel),
    },
    XtaskCommand {
        name: "python",
        about: "Set up target/python with pandas, endaq, GTC and more, which tests compare exports, budgets and spectra with",
        more: "",
        run: TaskFunction::Alone(python::setup),
    },
    XtaskCommand {
        name: "mutants",
        about: "Make mistakes in a copy of the code, one by one, and check that each is noticed: [PART] [SHARD]",
        more: "Without a PART it makes mistakes in the physics, which the figures' checks must notice. `model`, `wire`, `store` \
               and `solver` are parts whose code cargo-mutants changes in many places; a whole part takes an hour, `store \
               0/16` a sixteenth of that. It installs cargo-mutants into target/tools if it is missing.",
        run: TaskFunction::WithWords(mutants::check),
    },
    XtaskCommand {
        name: "fuzz",
        about: "Look for inputs that break a reader, with libFuzzer: [TARGET] [TIME], such as `frames 1h`; all for a minute each",
        more: "It needs Rust's nightly and cargo-fuzz, and says how to install them. The first build takes some minutes. \
               What it learns stays in target/fuzz/corpus; an input that breaks something is left in target/fuzz/found. \
               docs/reliability.md names the targets.",
        run: TaskFunction::WithWords(fuzz::fuzz),
    },
    XtaskCommand {
        name: "campaign",
        about: "Run the image under N random scripts of faults, two a second: N [--seed S], such as `300`; or cut the \
                power in each operation of an update: `update`",
        more: "A script that fails is made smaller while it still fails, and left in target/campaign: it can be added to \
               those in fuzz/scripts, which `test` runs. docs/reliability.md says what has to hold.",
        run: TaskFunction::WithWords(campaign::campaign),
    },
    XtaskCommand {
        name: "miri",
        about: "Run the tests of the bead's own code under Miri, on a little-endian and on a big-endian machine",
        more: "It needs Rust's nightly with its components miri and rust-src, and says how to install them. It takes \
               about half an hour on one core, though loops are shorter than in `test`.",
        run: TaskFunction::Alone(miri::miri),
    },
];

fn main() -> ExitCode {
    let words = Arg::new("words")
        .num_args(0..)
        .trailing_var_arg(true)
        .allow_hyphen_values(true);
    let subcommands = TASKS.iter().map(|task| {
        let command = Command::new(task.name).about(task.about).after_help(task.more);
        match task.run {
            TaskFunction::Alone(_) => command,
            TaskFunction::WithWords(_) => command.arg(words.clone()),
        }
    });
    let matches = Command::new("cargo xtask")
        .bin_name("cargo xtask")
        .about("Set-up, build, demo and test of the sensing absorber bead")
        .after_help(
            "New here? `cargo xtask demo` needs nothing but Rust. It installs what is missing, says what, and shows \
             every command that it runs.",
        )
        .subcommand_required(true)
        .arg_required_else_help(true)
        .subcommands(subcommands)
        .get_matches();
    let done = Steps::start().and_then(|steps| {
        let Some((name, matches)) = matches.subcommand() else {
            return Ok(());
        };
        match TASKS.iter().find(|task| task.name == name).map(|task| &task.run) {
            Some(TaskFunction::Alone(run)) => run(&steps),
            Some(TaskFunction::WithWords(run)) => {
                let words = matches.get_many::<String>("words").into_iter().flatten();
                run(&steps, &words.collect::<Vec<_>>())
            }
            None => Ok(()),
        }
    });
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(stop) => {
            eprintln!("error: {}", stop.message);
            ExitCode::from(stop.status)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_that_no_task_knows_are_refused_before_anything_is_built() {
        let steps = Steps::start().unwrap();
        let fuzz = "`frame` is neither a target nor a time; give one of beads, ";
        let (campaign, mutants) = ("give the number of scripts", "give nothing, or one of model");
        for (name, words, why) in [
            (
                "build",
                "feather-f405",
                "feather-f405 cannot be a bead: PA0, PA1 and PA2 are not connected",
            ),
            ("build", "weact-f405 boards", "give one board"),
            ("public-key", "", "give the file with the key"),
            (
                "public-key",
                "no-such-file",
                "the key in no-such-file: No such file",
            ),
            (
                "public-key",
                "Cargo.toml",
                "the key in Cargo.toml: give a file of 64 hexadecimal digits",
            ),
            ("coverage", "all", "give nothing, or `join`"),
            ("fuzz", "frame", fuzz),
            ("campaign", "", campaign),
            ("campaign", "many", campaign),
            ("campaign", "3 --sed 1", campaign),
            ("campaign", "3 --seed", campaign),
            ("mutants", "tests", mutants),
            ("mutants", "store 1", mutants),
            ("mutants", "store 4/4", mutants),
            ("mutants", "store a/b", mutants),
            ("mutants", "wire 0/2 x", mutants),
        ] {
            let task = TASKS.iter().find(|task| task.name == name).unwrap();
            let TaskFunction::WithWords(run) = task.run else {
                panic!("{name} takes no words");
            };
            let words: Vec<String> = words.split_whitespace().map(str::to_owned).collect();
            let stop = run(&steps, &words.iter().collect::<Vec<_>>()).unwrap_err();
            assert!(stop.message.starts_with(why), "{}", stop.message);
        }
    }
}
