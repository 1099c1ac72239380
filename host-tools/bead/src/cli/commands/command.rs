//! `bead command`: requests to a bead, except those for its settings.

use std::collections::HashSet;
use std::io::{BufWriter, Write};
use std::time::Duration;

use bead_bench::counted_cycles::{BUSIEST_BLOCK, CountedCycles, IDLE_BLOCK, MASKED};
use bead_compare::front_end::SAMPLE_RATE_HZ;
use bead_wire::{Check, Kind, Message, Request, SelfTest, Standing};
use clap::Subcommand;
use serde_json::{Map, Value};

use crate::cli::commands::prelude::*;
use crate::cli::line_options::LineOptions;
use bead_line::conversation::{Answer, LineError};
use bead_tables::printable::one_line;

const AFTER_HELP: &str = "\
A bead goes on measuring while it answers, except during a reboot.

Exit status 1 if the bead refuses or a check of its self-test fails, 3 if it does not answer.

Examples:
  bead command status --port /dev/ttyUSB0
  bead command self-test --port /dev/ttyUSB0 --format json
  bead command raw --port /dev/ttyUSB0 --duration 0.5 --out scans.csv
  bead command status --port /dev/ttyUSB0 \\
      --address 3 (one of several on a line)
  bead command reboot --port tcp:192.168.1.7:4000";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    action: BeadAction,
}

#[derive(Debug, Subcommand)]
enum BeadAction {
    /// Show the bead's identity: firmware, device, boot.
    Identity(CommandOptions),
    /// Show the bead's status: counts of samples, strikes, losses and faults, and of what came in over its
    /// line.
    Status(CommandOptions),
    /// Let the bead check itself: supply, sensors, settings, stack, estimators, flash.
    SelfTest(CommandOptions),
    /// Look for strikes, as a bead does after a reset.
    Arm(CommandOptions),
    /// Stop looking for strikes until the bead is armed or reset.
    Disarm(CommandOptions),
    /// Let the bead send every scan for a while, with or without a strike. About half of the scans fit the
    /// line.
    Raw {
        #[command(flatten)]
        common: CommandOptions,
        /// Duration, s; at most 10.
        #[arg(long, value_name = "SECONDS", value_parser = output::seconds_of_a_day)]
        duration: Duration,
        /// The codes as CSV, one scan a row; - for standard output, with the summary on standard error.
        #[arg(long, value_name = "F.csv")]
        out: PathBuf,
        #[command(flatten)]
        overwrite: Overwrite,
    },
    /// Measure a window at a given time, whatever the force does, as if a strike had triggered it. The bead
    /// must be armed.
    Keep {
        #[command(flatten)]
        common: CommandOptions,
        /// Time from now to the scan that counts as the trigger, s; at most 60.
        #[arg(long, value_name = "SECONDS", default_value = "0.5", value_parser = output::seconds_of_a_day)]
        after: Duration,
    },
    /// Set the counts of losses, faults and rejected input to 0.
    ResetCounters(CommandOptions),
    /// Reset the bead, and wait until it is back.
    Reboot(CommandOptions),
}

#[derive(Debug, Args)]
struct CommandOptions {
    #[command(flatten)]
    line: LineOptions,
    /// Format of the answer.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.action {
        BeadAction::Identity(common) => identity(common),
        BeadAction::Status(common) => status(common),
        BeadAction::SelfTest(common) => self_test(common),
        BeadAction::Arm(common) => simple(common, &Request::Arm, "armed"),
        BeadAction::Disarm(common) => simple(common, &Request::Disarm, "disarmed"),
        BeadAction::Raw {
            common,
            duration,
            out,
            overwrite,
        } => {
            let out = Some(out.as_path()).filter(|out| out.as_os_str() != "-");
            raw(common, *duration, overwrite.optional(out, FileKind::Table, &[])?)
        }
        BeadAction::Keep { common, after } => keep(common, *after),
        BeadAction::ResetCounters(common) => simple(common, &Request::ResetCounters, "counters reset"),
        BeadAction::Reboot(common) => {
            let boot = common.line.open()?.reboot()?;
            output::print(common.format, &Rebooted { boot }, || format!("in boot {boot}"))
        }
    }
}

/// The answer to a request that only says that it was done, as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct Done {
    outcome: &'static str,
}

/// One check of a self-test as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct CheckResult {
    check: String,
    passed: bool,
    value: u32,
}

/// The answer to a reboot as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct Rebooted {
    /// Number of the boot that the bead is in.
    boot: u32,
}

/// The answer to `keep` as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct Kept {
    /// Sample index of the scan that counts as the one that triggers.
    index: u64,
}

/// The counts of a raw stream as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct Streamed {
    scans: u64,
    received: usize,
    dropped_by_bead: u64,
    lost: u64,
}

/// Sends a request whose answer is only that it was done.
fn simple(common: &CommandOptions, request: &Request, done: &str) -> Result<(), Failure> {
    common.line.open()?.request_done(request)?;
    output::print(common.format, &Done { outcome: "done" }, || done.to_owned())
}

fn keep(common: &CommandOptions, after: Duration) -> Result<(), Failure> {
    let mut line = common.line.open()?;
    let answer = line.request_done(&Request::Status)?;
    let (newest, armed) = answer.last("status frame", |frame| match &frame.message {
        Message::Status(status) => Some((frame.header.sample_index, status.armed)),
        _ => None,
    })?;
    if !armed {
        bail!(
            Verdict,
            "the bead is disarmed and would measure no window; arm it first: bead command arm"
        );
    }
    let index = newest + (after.as_secs_f64() * f64::from(SAMPLE_RATE_HZ)).round() as u64;
    line.request_done(&Request::Keep { index })?;
    output::print(common.format, &Kept { index }, || {
        format!("the window around sample {index} will be measured, with the flag `triggered_on_request`")
    })
}

fn identity(common: &CommandOptions) -> Result<(), Failure> {
    let answer = common.line.open()?.request_done(&Request::Identity)?;
    let mut identity = body(&answer, Kind::Identity)?;
    // A bead of an earlier version sends none.
    let board = body(&answer, Kind::Board).unwrap_or_default();
    let text = rows([("", &identity), ("board", &board)]);
    if let Value::Object(members) = &mut identity {
        members.insert("board".to_owned(), board);
    }
    output::print(common.format, &identity, || text)
}

/// The body of the last frame of a kind.
fn body(answer: &Answer, kind: Kind) -> Result<Value, LineError> {
    answer.last(&format!("{} frame", kind.name()), |frame| {
        (frame.message.kind() == kind).then(|| frame.body())
    })
}

/// Frames that answer the request `status`, and those that a bead of an earlier version does not send.
pub(crate) const SENT: [Kind; 3] = [Kind::Status, Kind::Health, Kind::Link];
pub(crate) const SENT_LATELY: [Kind; 2] = [Kind::Guard, Kind::Load];

fn status(common: &CommandOptions) -> Result<(), Failure> {
    let answer = common.line.open()?.request_done(&Request::Status)?;
    let mut bodies = Map::new();
    for kind in SENT {
        bodies.insert(kind.name().to_owned(), body(&answer, kind)?);
    }
    for kind in SENT_LATELY {
        bodies.insert(kind.name().to_owned(), body(&answer, kind).unwrap_or_default());
    }
    output::print(common.format, &bodies, || {
        let rows = rows(bodies.iter().map(|(name, body)| (name.as_str(), body)));
        format!("{rows}\n{}", cycles(&bodies))
    })
}

/// The cycles of the load frame beside those that the emulator counts in this program's image. Empty for a
/// bead that sends no such frame.
fn cycles(bodies: &Map<String, Value>) -> String {
    let Some(load) = bodies.get(Kind::Load.name()).filter(|load| load.is_object()) else {
        return String::new();
    };
    let row = |(what, key, counted): (&str, &str, CountedCycles)| {
        let measured = load[key]
            .as_u64()
            .map_or("-".to_owned(), |cycles| cycles.to_string());
        [
            what.to_owned(),
            measured,
            counted.cached.to_string(),
            counted.at_most.to_string(),
        ]
    };
    let measured = [
        ("busiest block", "worst_cycles", BUSIEST_BLOCK),
        (
            "block on average, while the chain rests",
            "mean_cycles",
            IDLE_BLOCK,
        ),
        ("longest without interrupts", "masked_cycles", MASKED),
    ];
    output::table(
        "cycles | this bead | emulator, caches on | emulator, at most",
        measured.map(row),
    )
}

/// The members of JSON objects by name, one in each row. A key that came in an earlier row is preceded by
/// the name of its own object.
fn rows<'a>(objects: impl IntoIterator<Item = (&'a str, &'a Value)>) -> String {
    let members = objects.into_iter().flat_map(|(object, body)| {
        let members = body.as_object().into_iter().flatten();
        members.map(move |(key, value)| (object, key, value))
    });
    let mut names = HashSet::new();
    output::rows(members.map(|(object, key, value)| {
        let twice = !names.insert(key);
        let name = if twice {
            format!("{object} {key}")
        } else {
            key.clone()
        };
        let value = match value {
            Value::String(text) => text.clone(),
            Value::Array(items) if items.is_empty() => "none".to_owned(),
            Value::Array(items) => Vec::from_iter(items.iter().filter_map(Value::as_str)).join(", "),
            other => other.to_string(),
        };
        // A line end in the bead's text would begin another row.
        (name.replace('_', " "), one_line(&value).into_owned())
    }))
}

fn self_test(common: &CommandOptions) -> Result<(), Failure> {
    let checks = common.line.open()?.self_test()?;
    let result = |test: &SelfTest| CheckResult {
        check: test.check.to_string(),
        passed: test.passed,
        value: test.value,
    };
    let results: Vec<_> = checks.iter().map(result).collect();
    output::print(common.format, &results, || {
        let row = |test: &SelfTest| {
            let passed = output::either(test.passed, "passed", "FAILED");
            [test.check.to_string(), passed, found(test.check, test.value)]
        };
        output::table("check | | found", checks.iter().map(row))
    })?;
    let failed = results.into_iter().filter(|result| !result.passed);
    let failed: Vec<_> = failed.map(|result| result.check).collect();
    if failed.is_empty() {
        return Ok(());
    }
    bail!(
        Verdict,
        "the self-test failed: {}; docs/protocol.md says what each check looks at",
        failed.join(", ")
    )
}

fn found(check: Check, value: u32) -> String {
    match check {
        Check::Supply => format!("{value} mV"),
        Check::Force | Check::Acceleration => {
            let standing: Vec<_> = Standing::from_bits(value as u8).names().collect();
            if standing.is_empty() {
                "moves, clear of the rails".to_owned()
            } else {
                standing.join(", ")
            }
        }
        Check::Acquisition => format!("{value} blocks of samples in 20 ms"),
        Check::Settings => format!("{value} bytes"),
        Check::Stack => format!("{value} bytes never used"),
        Check::Estimators => format!("{value} results differ"),
        Check::Store => match value {
            0 => "nothing stored".to_owned(),
            _ => format!("{value} bytes stored"),
        },
        Check::Unknown(_) => value.to_string(),
    }
}

fn raw(common: &CommandOptions, duration: Duration, out: Option<Target>) -> Result<(), Failure> {
    let stream = common.line.open()?.raw(duration)?;
    let write = |to: &mut dyn Write| -> std::io::Result<()> {
        let mut to = BufWriter::new(to);
        writeln!(to, "sample_index,force_code,acceleration_code")?;
        for piece in &stream.pieces {
            for (place, codes) in (0..).zip(piece.codes.iter()) {
                // A bead may send an index near the end of the range.
                let index = piece.first_index.wrapping_add(place);
                let codes = codes.map(|code| code.to_string());
                writeln!(to, "{index},{}", codes.join(","))?;
            }
        }
        to.flush()
    };
    let received: usize = stream.pieces.iter().map(|piece| piece.codes.len()).sum();
    let (sent, dropped_by_bead) = (stream.sent, stream.dropped);
    let (scans, lost) = (
        sent.saturating_add(dropped_by_bead),
        sent.saturating_sub(received as u64),
    );
    let text = format!(
        "{received} of {scans} scans received; {dropped_by_bead} did not fit the line, {lost} were lost on it"
    );
    let Some(out) = out else {
        output::written(write(&mut std::io::stdout().lock()))?;
        note!("{text}");
        return Ok(());
    };
    out.write(|file| Ok(write(file)?))?;
    let summary = Streamed {
        scans,
        received,
        dropped_by_bead,
        lost,
    };
    output::print(common.format, &summary, || text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cycles_of_the_emulator_stand_beside_those_of_the_bead() {
        let mut bodies = Map::new();
        assert_eq!(cycles(&bodies), "");
        let load = serde_json::json!({"worst_cycles": 7001, "mean_cycles": 7002, "masked_cycles": 7003});
        bodies.insert("load".to_owned(), load);
        let text = cycles(&bodies);
        let numbers: Vec<Vec<u32>> = text
            .lines()
            .map(|line| {
                line.split_whitespace()
                    .filter_map(|word| word.parse().ok())
                    .collect()
            })
            .filter(|row: &Vec<_>| !row.is_empty())
            .collect();
        let row = |own, counted: CountedCycles| vec![own, counted.cached, counted.at_most];
        let wanted = [row(7001, BUSIEST_BLOCK), row(7002, IDLE_BLOCK), row(7003, MASKED)];
        assert_eq!(numbers, wanted, "{text}");
    }
}
