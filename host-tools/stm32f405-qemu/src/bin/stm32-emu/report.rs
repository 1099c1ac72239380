//! The result of a run, for a reader and for other programs.

use std::io::{self, Write};
use std::path::Path;

use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};
use serde::Serialize;
use stm32f405_qemu::{Chip, Outcome, RunEnd, RunError, UnknownRegister};

use super::arguments::Arguments;
use super::session::Session;

const FAILED: u8 = 1;
const WRONG_ARGUMENTS: u8 = 2;
const NO_RUN: u8 = 3;
const FAULT: u8 = 4;
const HANG: u8 = 5;
const UNKNOWN_REGISTER: u8 = 6;
const NOT_FOUND: u8 = 7;
/// The status of a program that SIGPIPE ends.
const CLOSED: u8 = 141;

/// The exit status, and the reason if it is not 0.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Verdict {
    pub(crate) status: u8,
    pub(crate) why: Option<String>,
}

impl Verdict {
    pub(crate) fn passed() -> Self {
        let (status, why) = (0, None);
        Self { status, why }
    }

    pub(crate) fn failed(status: u8, why: impl Into<String>) -> Self {
        let why = Some(why.into());
        Self { status, why }
    }

    pub(crate) fn test_cases_failed() -> Self {
        let (status, why) = (FAILED, None);
        Self { status, why }
    }

    pub(crate) fn no_run(error: &RunError) -> Self {
        let status = match error {
            RunError::Input(_) => WRONG_ARGUMENTS,
            _ => NO_RUN,
        };
        Self::failed(status, error.to_string())
    }
}

/// Judges a run.
pub(crate) fn verdict(session: &Session, arguments: &Arguments) -> Verdict {
    if session.closed {
        let (status, why) = (CLOSED, None);
        return Verdict { status, why };
    }
    let outcome = match &session.result {
        Ok(outcome) => outcome,
        Err(error @ (RunError::Stuck(_) | RunError::Timeout(..))) => {
            return Verdict::failed(HANG, error.to_string());
        }
        Err(error) => return Verdict::no_run(error),
    };
    let found = matches!(session.until, Some((_, true)));
    if let Err(why) = outcome.verdict()
        && !found
    {
        let status = match outcome.end {
            RunEnd::Faulted | RunEnd::LockedUp(_) => FAULT,
            RunEnd::Hung(_) | RunEnd::Stuck(_) => HANG,
            _ => FAILED,
        };
        return Verdict::failed(status, why);
    }
    if let Some(why) = unknown(outcome, arguments.chip).filter(|_| arguments.strict) {
        return Verdict::failed(UNKNOWN_REGISTER, why);
    }
    match &session.until {
        Some((pattern, false)) => {
            let why = format!("no line of the log, a UART or semihosting matches {pattern:?}");
            Verdict::failed(NOT_FOUND, why)
        }
        _ => Verdict::passed(),
    }
}

/// The register access or pin change for which a strict run fails.
fn unknown(outcome: &Outcome, chip: Chip) -> Option<String> {
    // A register without a clock reads as zero on silicon too: many images log a time before their timer
    // runs.
    let is_unknown = |register: &&UnknownRegister| !register.clock_off || register.writes > 0;
    let mut unknown = outcome.unknown_registers.iter().filter(is_unknown);
    if let Some(register) = unknown.next() {
        let more = match unknown.count() {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let name = &register.name;
        return Some(if register.clock_off {
            format!("the image wrote to {name}{more}: such a write is lost")
        } else {
            format!("the image accessed {name}{more}, which no model knows")
        });
    }
    let pin = outcome.pins.iter().find(|pin| !chip.has_pin(&pin.name))?;
    Some(format!(
        "the image moved {}, but the {chip} has no such pin",
        pin.name
    ))
}

/// Prints the result of a run for a reader.
pub(crate) fn summary(session: &Session) {
    if let Some(outcome) = session.outcome().filter(|_| !session.closed) {
        // A reader that closes the output early does not want the rest.
        let _ = tell(outcome, session, &mut io::stdout().lock());
    }
}

fn tell(outcome: &Outcome, session: &Session, to: &mut impl Write) -> io::Result<()> {
    for (port, bytes) in &session.sent {
        writeln!(to, "{bytes} bytes from {port}")?;
    }
    let (virtual_s, took) = (outcome.virtual_ns as f64 * 1e-9, session.took.as_secs_f64());
    writeln!(to, "{virtual_s:.6} s of the image's time in {took:.3} s")?;
    if let Some(s) = outcome.sampling {
        let overruns = outcome.overruns;
        writeln!(
            to,
            "{} scans from {:.3} ms on, {overruns} overruns",
            s.scans,
            s.first_ns as f64 / 1e6
        )?;
    }
    if !outcome.resets.is_empty() {
        writeln!(to, "{} resets", outcome.resets.len())?;
    }
    for line in &session.notes {
        writeln!(to, "{line}")?;
    }
    if let Some(instructions) = &outcome.instructions {
        writeln!(to, "{} instructions", instructions.total)?;
        if let Some(block) = instructions.worst_block {
            writeln!(
                to,
                "at most {:.1} instructions a scan",
                block.instructions_per_scan()
            )?;
        }
    }
    // Its BKPT is a fault to a core without a debugger, and no failure.
    let (faults, end) = match (&outcome.end, outcome.exceptions.split_last()) {
        (RunEnd::Breakpoint(at), Some((last, faults))) if last.breakpoint.is_some() => (faults, Some(at)),
        _ => (&outcome.exceptions[..], None),
    };
    for fault in faults {
        writeln!(to, "{fault}")?;
    }
    if let Some(at) = end {
        writeln!(to, "ended at the breakpoint {at}")?;
    }
    for register in &outcome.unknown_registers {
        let (reads, writes) = (register.reads, register.writes);
        let what = if register.clock_off {
            "no clock"
        } else {
            "no model"
        };
        writeln!(to, "{what}: {} ({reads} reads, {writes} writes)", register.name)?;
    }
    for what in &outcome.unmodelled {
        writeln!(to, "not modelled: {what}")?;
    }
    for what in &outcome.never_came {
        writeln!(to, "never came: {what}")?;
    }
    for interrupt in &outcome.interrupts {
        writeln!(to, "{} interrupted {} times", interrupt.name, interrupt.taken)?;
    }
    for pin in &outcome.pins {
        writeln!(to, "{} moved {} times", pin.name, pin.edges)?;
    }
    if outcome.end == RunEnd::Over
        && let Some(place) = &outcome.stopped_at
    {
        let busy = outcome
            .busy_with
            .as_ref()
            .map(|register| format!(", busy with {register}"));
        writeln!(
            to,
            "at the end the image was at {place}{}",
            busy.unwrap_or_default()
        )?;
    }
    Ok(())
}

/// The result of a run, in JSON.
#[derive(Serialize)]
struct Json<'a> {
    status: u8,
    why: Option<&'a str>,
    uart_bytes: &'a [(String, usize)],
    /// The outcome without contents of flash, and without the output shown while the image ran.
    outcome: Option<Outcome>,
}

/// Writes the requested files.
///
/// # Errors
/// [`RunError::Io`].
pub(crate) fn write(arguments: &Arguments, session: &Session, verdict: &Verdict) -> Result<(), RunError> {
    let outcome = session.outcome();
    if let Some(file) = &arguments.vcd
        && let Some(outcome) = outcome
    {
        put(file, outcome.vcd().as_bytes())?;
    }
    if let Some(file) = &arguments.json {
        let mut outcome = outcome.cloned();
        if let Some(outcome) = &mut outcome {
            (outcome.flash.1, outcome.rtt, outcome.log) = Default::default();
        }
        let (status, why) = (verdict.status, verdict.why.as_deref());
        let json = Json {
            status,
            why,
            uart_bytes: &session.sent,
            outcome,
        };
        let mut text = serde_json::to_vec_pretty(&json).expect("a plain struct has a JSON form");
        text.push(b'\n');
        put(file, &text)?;
    }
    if let Some(file) = &arguments.junit {
        let name = arguments.elf.file_stem().unwrap_or_default().to_string_lossy();
        junit(
            file,
            &name,
            [(name.to_string(), session.took, verdict.why.clone())],
        )?;
    }
    Ok(())
}

/// Writes a JUnit report: for each test its name, its time, and the reason for its failure.
///
/// # Errors
/// [`RunError::Io`].
pub(crate) fn junit(
    file: &Path,
    suite: &str,
    tests: impl IntoIterator<Item = (String, std::time::Duration, Option<String>)>,
) -> Result<(), RunError> {
    let mut report = Report::new("stm32-emu");
    let mut all = TestSuite::new(suite);
    for (name, took, failed) in tests {
        let status = match failed {
            None => TestCaseStatus::success(),
            Some(why) => {
                let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
                status.set_message(why);
                status
            }
        };
        let mut case = TestCase::new(name, status);
        case.set_time(took);
        all.add_test_case(case);
    }
    report.add_test_suite(all);
    let text = report
        .to_string()
        .map_err(|e| RunError::Io("cannot make the JUnit report", io::Error::other(e)))?;
    put(file, text.as_bytes())
}

fn put(file: &Path, bytes: &[u8]) -> Result<(), RunError> {
    std::fs::write(file, bytes).map_err(|e| {
        RunError::Input(format!(
            "cannot write {}: {e}; give another place",
            file.display()
        ))
    })
}
