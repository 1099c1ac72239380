//! One run of an image, shown while it lasts.

use std::time::{Duration, Instant};

use stm32f405_qemu::{Inputs, LogLine, Outcome, Passed, Run, RunError, Scenario, functions};

use super::arguments::Arguments;
use super::uart::{Lines, SEMIHOSTING, Ways};

/// Virtual time from stop to stop, ns.
const STEP_NS: u64 = 10_000_000;

/// The result of a run.
pub(crate) struct Session {
    pub(crate) result: Result<Outcome, RunError>,
    /// Pattern of `--until`, and true if it was found.
    pub(crate) until: Option<(String, bool)>,
    /// True once nobody reads the output any more.
    pub(crate) closed: bool,
    pub(crate) took: Duration,
    /// Bytes that each USART sent.
    pub(crate) sent: Vec<(String, usize)>,
    /// Remarks: waveforms that ended before the run did, missing symbols, a crystal that nobody specified.
    pub(crate) notes: Vec<String>,
}

impl Session {
    /// The outcome of the run, even of a failed one.
    pub(crate) fn outcome(&self) -> Option<&Outcome> {
        outcome_of(&self.result)
    }
}

/// Runs an image.
///
/// # Errors
/// [`RunError`] if the run does not start. Later failures are in the session.
pub(crate) fn run(run: Run, arguments: &Arguments, lines: &mut Lines) -> Result<Session, RunError> {
    let has_symbols = !functions(&run.elf, "")?.is_empty();
    let crystal = f64::from(run.hse_hz) / 1e6;
    let mut ways = Ways::open(&arguments.uart)?;
    let began = Instant::now();
    let mut last = None;
    let mut result = through(run, arguments, lines, &mut ways, &mut last);
    // The verdict quotes the last line.
    if let Ok(outcome) = &mut result
        && outcome.log.is_empty()
    {
        outcome.log.extend(last);
    }
    if let Some(outcome) = outcome_of(&result) {
        lines.text(SEMIHOSTING, outcome.semihosting.as_bytes(), Some(String::new()));
    }
    lines.finish();
    let scenario = arguments.scenario.as_ref().zip(result.as_ref().ok());
    let mut notes = scenario.map_or_else(Vec::new, |(scenario, outcome)| scenario.ended_early(outcome));
    if !has_symbols {
        notes.push("no symbols: neither the log nor a panic of a stripped image can be read".into());
    }
    let is_named = arguments.scenario.as_deref().is_some_and(Scenario::names_crystal);
    if outcome_of(&result).is_some_and(|outcome| outcome.crystal_started) && !is_named {
        notes.push(format!(
            "the image started a crystal, which is assumed to have {crystal} MHz: a scenario with [clock] crystal_hz \
             can set another frequency"
        ));
    }
    Ok(Session {
        result,
        until: arguments
            .until
            .as_ref()
            .map(|until| (until.to_string(), lines.found)),
        closed: lines.closed,
        took: began.elapsed(),
        notes,
        sent: std::mem::take(&mut lines.sent).into_iter().collect(),
    })
}

fn outcome_of(result: &Result<Outcome, RunError>) -> Option<&Outcome> {
    result.as_ref().map_or_else(RunError::outcome, Some)
}

fn through(
    run: Run,
    arguments: &Arguments,
    lines: &mut Lines,
    ways: &mut Ways,
    last: &mut Option<LogLine>,
) -> Result<Outcome, RunError> {
    let (tail_ns, limited) = (run.tail_ns, run.gdb.is_none());
    let deadline = u64::try_from(arguments.time.as_nanos()).unwrap_or(u64::MAX);
    let mut live = run.start()?;
    let began = Instant::now();
    let mut ends_at = deadline;
    loop {
        let now = live.now_ns();
        if now >= ends_at {
            break;
        }
        // Input that is present from the beginning waits until the image may have set up its ports.
        let uart = if now < STEP_NS {
            Vec::new()
        } else {
            ways.received(now)
        };
        let inputs = Inputs {
            uart,
            ..Inputs::default()
        };
        let passed = live.advance((now + STEP_NS).min(ends_at), inputs)?;
        show(&passed, lines, ways, last);
        if passed.ended || lines.found || lines.closed {
            break;
        }
        // An image that samples ends after the stimulus.
        ends_at = passed
            .codes_until_ns
            .filter(|_| arguments.scenario.is_none())
            .map_or(deadline, |until| until.saturating_add(tail_ns));
        if limited && began.elapsed() > arguments.timeout {
            let outcome = live.finish()?;
            return Err(RunError::Timeout(arguments.timeout, Box::new(outcome)));
        }
        if ways.have_input() {
            // A user types in real time.
            std::thread::sleep(Duration::from_nanos(passed.now_ns).saturating_sub(began.elapsed()));
        }
    }
    live.finish()
}

fn show(passed: &Passed, lines: &mut Lines, ways: &mut Ways, last: &mut Option<LogLine>) {
    for line in &passed.log {
        lines.line(&line.to_string());
    }
    *last = passed.log.last().cloned().or_else(|| last.take());
    lines.text(SEMIHOSTING, passed.semihosting.as_bytes(), Some(String::new()));
    for uart in &passed.uarts {
        lines.uart(uart);
        ways.send(uart);
    }
}
