//! The command line: the command tree, and below it the commands, their options and their output.

mod chosen;
mod commands;
mod folder_options;
mod line_options;
mod note_options;
mod provenance;
mod recordings;
pub mod schemas;
mod table_file;
mod waveform_options;

use anyhow::Context;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use bead_console::failure::Failure;
use bead_console::interrupt;
use commands::{
    analyse, bench, budget, calibrate, clock, command, compare, decode, emulate, export, fetch, figures,
    flash, identify, judge, list, manual, monitor, note, proof, record, recover, replay, settings, trend,
};
use hertz_commands::{optimise, optimise_search, periodic, simulate, sweep};

const AFTER_HELP: &str = "\
Exit status: 0 done, 1 a check failed or a bead refused, 2 usage or input error, 3 device or emulator failure. \
Results go to standard output, everything else to standard error.

Examples:
  bead simulate docs/scenarios/paper-strike.toml
  bead sweep docs/scenarios/stiffness-and-speed.toml --out map.parquet
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --out run
  bead replay run/bead-8.mcap
  bead compare run/bead-8.mcap --scenario docs/scenarios/paper-strike.toml \\
      --report report.html
  bead budget run/bead-8.mcap
  bead calibrate drop --from simulated --ball-mass 3.046g±1mg \\
      --height 100mm±0.3mm
  bead analyse srs run/bead-8.mcap
  bead identify taps.mcap
  bead judge run/bead-8.mcap --limits limits.toml
  bead export run/bead-8.mcap --out tables
  bead note run/bead-8.mcap operator=Ana specimen=A12
  bead list archive --note specimen=A12
  bead trend archive --picture trend.svg
  bead record --port /dev/ttyUSB0
  bead monitor --port /dev/ttyUSB0
  bead fetch --port /dev/ttyUSB0 --out kept.mcap
  bead command self-test --port /dev/ttyUSB0
  bead settings write --port /dev/ttyUSB0 run/bead-8.settings
  bead flash --probe --board weact-f405
  bead bench --port /dev/ttyUSB0";

/// Host tools of the sensing absorber bead.
#[derive(Debug, Parser)]
#[command(name = "bead", version, after_help = AFTER_HELP)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run the full f64 chain of a scenario.
    Simulate(simulate::Arguments),
    /// Run the flash image in QEMU on what a bead would sense.
    Emulate(Box<emulate::Arguments>),
    /// Record what a bead sends, and print its strikes.
    Record(record::Arguments),
    /// Show live beads on a terminal or in a browser, and record them.
    Monitor(Box<monitor::Arguments>),
    /// Add notes to recordings, or print them: operator, specimen, place.
    Note(note::Arguments),
    /// Find the recordings of a folder by note, date, bead, flag and verdict.
    List(list::Arguments),
    /// Follow energies, their ratio, frequency, gains and clock over days, with control limits.
    Trend(trend::Arguments),
    /// List the strikes that a bead keeps, or fetch them to a recording.
    Fetch(fetch::Arguments),
    /// Put an image into a bead: over its own line, by a debug probe, or with the loader in the part's ROM.
    Flash(flash::Arguments),
    /// Repair a recording that is cut or damaged, as far as possible.
    Recover(recover::Arguments),
    /// Send a bead a request: status, identity, self-test, arm, raw samples, reboot.
    #[command(name = "command")]
    Request(command::Arguments),
    /// Check a board without sensors: it plays strikes to itself over two wires.
    Bench(bench::Arguments),
    /// Read, write and show a bead's settings.
    Settings(settings::Arguments),
    /// Print the frames of a recording or of raw bytes, one JSON object a line.
    Decode(decode::Arguments),
    /// Run the recorded samples through the bead's code, and check every result bit for bit.
    Replay(replay::Arguments),
    /// Compare a recording with the simulation: device, replay, f64 from the same samples, full chain.
    Compare(compare::Arguments),
    /// Print the uncertainty budget of a strike: what each input adds to the uncertainty of A, B and A − B.
    Budget(budget::Arguments),
    /// Calibrate a bead: drop test, reference, front mass, ring-down, shaker; with budget and certificate.
    Calibrate(calibrate::Arguments),
    /// Compute strikes' spectra: shock response, power density, Fourier, transfer from force to acceleration.
    Analyse(analyse::Arguments),
    /// Find k, c, gains and contacts of a bead from its strikes, with their uncertainties.
    Identify(identify::Arguments),
    /// Judge strikes by your own limits: pass or fail, by a rule that uses the uncertainty.
    Judge(Box<judge::Arguments>),
    /// Write strikes and samples as tables in SI units: Parquet, CSV, or UFF.
    Export(export::Arguments),
    /// Measure the drift of recorded beads' clocks against this host, and against one another.
    Clock(clock::Arguments),
    /// Find the intruders that leave the least energy in the chain.
    Optimise(optimise_search::Arguments),
    /// Find periodic motions of a driven chain, their stability, and where they meet and vanish.
    Periodic(periodic::Arguments),
    /// Run a scenario over axes of its parameters, into one table.
    Sweep(Box<sweep::Arguments>),
    /// Tabulate the errors of the image's estimates: the project's own proofs.
    Proof(proof::Arguments),
    /// Draw the paper's figures, with their data and their checks.
    Figures(figures::Arguments),
    /// Print the script that lets a shell complete commands and options: bash, zsh, fish.
    Completions(manual::Completions),
    /// Write the manual pages of all commands.
    Man(manual::Manual),
}

impl Cli {
    /// Parses the command line. Ends the program if it is no command, or asks for help.
    pub fn typed() -> Self {
        let matches = with_negative_numbers(Self::command()).try_get_matches();
        matches
            .and_then(|matches| Self::from_arg_matches(&matches))
            .unwrap_or_else(|error| bead_console::words::exit(&error))
    }

    /// Runs the command that was given.
    ///
    /// # Errors
    /// [`Failure`], which carries the exit status.
    pub fn run(self) -> Result<(), Failure> {
        interrupt::watch().context("cannot listen for signals")?;
        match self.command {
            Command::Simulate(arguments) => simulate::run(&arguments),
            Command::Emulate(arguments) => emulate::run(&arguments),
            Command::Record(arguments) => record::run(&arguments),
            Command::Monitor(arguments) => monitor::run(&arguments),
            Command::Judge(arguments) => judge::run(&arguments),
            Command::Note(arguments) => note::run(&arguments),
            Command::List(arguments) => list::run(&arguments),
            Command::Trend(arguments) => trend::run(&arguments),
            Command::Fetch(arguments) => fetch::run(&arguments),
            Command::Flash(arguments) => flash::run(&arguments),
            Command::Recover(arguments) => recover::run(&arguments),
            Command::Request(arguments) => command::run(&arguments),
            Command::Bench(arguments) => bench::run(&arguments),
            Command::Settings(arguments) => settings::run(&arguments),
            Command::Decode(arguments) => decode::run(&arguments),
            Command::Replay(arguments) => replay::run(&arguments),
            Command::Compare(arguments) => compare::run(&arguments),
            Command::Export(arguments) => export::run(&arguments),
            Command::Analyse(arguments) => analyse::run(&arguments),
            Command::Identify(arguments) => identify::run(&arguments),
            Command::Budget(arguments) => budget::run(&arguments),
            Command::Calibrate(arguments) => calibrate::run(&arguments),
            Command::Clock(arguments) => clock::run(&arguments),
            Command::Optimise(arguments) => optimise::run(&arguments),
            Command::Periodic(arguments) => periodic::run(&arguments),
            Command::Sweep(arguments) => sweep::run(&arguments),
            Command::Proof(arguments) => proof::run(&arguments),
            Command::Figures(arguments) => figures::run(&arguments),
            Command::Completions(arguments) => manual::completions(&arguments, Self::command()),
            Command::Man(arguments) => manual::manual(&arguments, Self::command()),
        }
    }
}

/// A command whose options take `-1` as a number, and say themselves what is wrong with it.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    command
        .mut_args(|argument| {
            let takes_values = argument.get_action().takes_values();
            argument.allow_negative_numbers(takes_values)
        })
        .mut_subcommands(with_negative_numbers)
}
