//! `bead bench`: a board without sensors checks itself, by two wires.

use std::cell::OnceCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::cli::commands::prelude::*;
use crate::cli::line_options::LineOptions;
use crate::cli::provenance::now;
use bead_bench::image::{find_image, flash_bytes};
use bead_bench::loopback::{self, BenchReport, CheckVerdict, Given};
use bead_line::port::Address;
use bead_recording::json::SCHEMA_VERSION;

const AFTER_HELP: &str = "\
Two jumper wires lead from the board's outputs to its inputs, PA4 to PA0 and PA5 to PA2; no sensor is \
connected. The bead plays levels and made-up strikes to itself, and each check says what was seen, what was \
expected, and whether the two agree. docs/bench.md draws the wires.

The wide channels, PA1 and PA3, may stay open. A divider of 15 kΩ from the output and 1 kΩ to ground gives \
them a sixteenth of it: PA4 to PA1, PA5 to PA3.

The bead is reset four times and its settings are written twice; --no-resets leaves that out. \
Afterwards it has its own settings again. --out also writes the result to a file that you can send: board, date, \
checksum of the image, and all numbers.

Exit status 1 if a check fails, 3 if the bead does not answer.

Examples:
  bead bench --port /dev/ttyUSB0
  bead bench --port /dev/ttyUSB0 --out capture.json
  bead bench --port /dev/ttyUSB0 --firmware bead-weact-f405.elf
  bead emulate docs/scenarios/paper-strike.toml --bead 8 \\
      --listen unix:bead.sock
    and, meanwhile: bead bench --port unix:bead.sock --requests 200";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    #[command(flatten)]
    line: LineOptions,
    /// The image that was flashed [default: as `cargo xtask build` leaves it, else the one inside this
    /// program].
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
    /// Number of requests that have to be answered.
    #[arg(long, value_name = "N", default_value_t = 10_000, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    requests: u32,
    /// Do not reset the bead or write its settings: leave out the checks that need this.
    #[arg(long)]
    no_resets: bool,
    /// Keep the result in this file, as JSON.
    #[arg(long, value_name = "F.json")]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// State of a bead that was left in the middle of the check of settings.
const LEFT: &str = "the bead may still have a threshold 1.25 times its own: `bead settings read` shows it; `bead \
                    settings write` restores yours, and `bead settings reset` the built-in ones or those of a probe";

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let image = find_image(arguments.firmware.as_deref())?;
    let inputs: Vec<&Path> = arguments.firmware.iter().map(PathBuf::as_path).collect();
    let out = arguments
        .overwrite
        .optional(arguments.out.as_deref(), FileKind::Json, &inputs)?;
    let mut bead = arguments.line.open()?;
    let (steps, stop) = (OnceCell::new(), OnceCell::<Arc<AtomicBool>>::new());
    let given = Given {
        requests: arguments.requests,
        resets: !arguments.no_resets,
        flash: &|address, bytes| flash_bytes(&image, address, bytes),
        shares_time: matches!(arguments.line.port(), Address::Serial(_)),
        date: now().format("%Y-%m-%dT%H:%M:%SZ").to_string(),
        stop: &|| stop.get().is_some_and(|stop| stop.load(Ordering::Relaxed)),
    };
    let (report, ended) = loopback::run(&mut bead, &given, |step| {
        if step == "settings" {
            // From here the bead has other settings for a while.
            let _ = stop.set(interrupt::orderly(LEFT.to_owned()));
        }
        steps
            .get_or_init(|| output::spinner(""))
            .set_message(step.to_owned());
    })?;
    if let Some(steps) = steps.get() {
        steps.finish_and_clear();
    }
    // The result is printed even if the disk is full.
    let kept = out.map(|out| out.write(|file| Ok(write(file, &report)?)));
    output::print(arguments.format, &report, || table(&report))?;
    kept.transpose()?;
    ended?;
    if (given.stop)() {
        bail!(Verdict, "interrupted; the bead has its own settings again");
    }
    let failed: Vec<_> = report.failed().map(|row| &*row.check).collect();
    if failed.is_empty() {
        return Ok(());
    }
    // A fault of the wires explains all that is missing.
    match report.failed().find(|row| row.check == "wires") {
        Some(wires) => bail!(Verdict, "{}", wires.seen),
        None => bail!(
            Verdict,
            "failed: {}; docs/bench.md says what each check looks at and what to do next",
            failed.join("; ")
        ),
    }
}

/// Writes the report as it is printed with `--format json`.
fn write(file: &mut dyn std::io::Write, report: &BenchReport) -> std::io::Result<()> {
    let mut value = serde_json::to_value(report)?;
    value["schema_version"] = SCHEMA_VERSION.into();
    serde_json::to_writer_pretty(&mut *file, &value)?;
    writeln!(file)
}

fn table(report: &BenchReport) -> String {
    let board = &report.board;
    let rows = report.checks.iter().map(|row| {
        let expected = match row.verdict {
            CheckVerdict::Reported => String::new(),
            _ => row.expected.clone(),
        };
        [
            row.check.clone(),
            row.seen.clone(),
            expected,
            row.verdict.word().to_owned(),
        ]
    });
    format!(
        "{} ({}), part {}, crystal {} MHz, firmware {} ({})\n\n{}",
        board.name,
        board.uid,
        board.part,
        board.crystal_mhz,
        board.firmware,
        board.git,
        output::table("check | seen | expected |", rows)
    )
}
