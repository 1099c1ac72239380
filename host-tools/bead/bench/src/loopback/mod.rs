//! The checks of `bead bench`, on a bead without sensors whose outputs are wired back to its inputs: a real
//! board, or one in the emulator.
//!
//! # Design
//! The bead plays levels and made-up strikes to itself and sends what it samples. The host judges
//! everything by frames: the straight line from output to input by raw scans, the strikes by what the
//! bead's own code makes of the same codes here. A check that needs wires is skipped where they are
//! missing. The bead ends with its own settings, and armed or not as before; after the checks that reset it,
//! it is armed.

mod levels;
mod report;
mod resets;
mod strikes;
mod wires;

use std::time::Instant;

use bead_line::conversation::{Answer, Conversation, LineError};
use bead_model::Settings;
use bead_wire::{Image, Link, Load, Message, Request, Status};

pub use report::{BenchBoard, BenchReport, CheckRow, CheckVerdict};
pub use wires::Wiring;

use levels::Levels;
use strikes::{Expected, Strikes};

/// Greatest share of the time between two blocks that the busiest block may take.
const BUSIEST: f64 = 0.45;

/// Options of the checks, and the image to compare with.
pub struct Given<'a> {
    /// Number of requests of the check of requests.
    pub requests: u32,
    /// True to reset the bead and write its settings, for the checks of both.
    pub resets: bool,
    /// The bytes that an image with these addresses should have, if the image is known.
    pub flash: &'a dyn Fn(u32, u32) -> Option<Vec<u8>>,
    /// True if the bead's time is this computer's, as at a serial port.
    pub shares_time: bool,
    /// Time now, for the report.
    pub date: String,
    /// Returns true if the user asks for the end. Called when the bead has its own settings again.
    pub stop: &'a dyn Fn() -> bool,
}

/// Counts that must not grow while the checks run.
#[derive(Clone, Copy)]
struct Losses {
    status: Status,
    link: Link,
    load: Load,
}

fn losses(answer: &Answer) -> Result<Losses, LineError> {
    Ok(Losses {
        status: answer.last("status frame", |frame| match frame.message {
            Message::Status(status) => Some(status),
            _ => None,
        })?,
        link: answer.last("link frame", |frame| match frame.message {
            Message::Link(link) => Some(link),
            _ => None,
        })?,
        load: answer.last("load frame", |frame| match frame.message {
            Message::Load(load) => Some(load),
            _ => None,
        })?,
    })
}

/// Runs every check. `step` takes the name of each before it begins. If the bead falls silent or refuses,
/// the results until then are returned beside the error.
///
/// # Errors
/// The bead does not identify itself.
pub fn run(
    bead: &mut Conversation,
    given: &Given<'_>,
    mut step: impl FnMut(&str),
) -> Result<(BenchReport, Result<(), LineError>), LineError> {
    step("identity");
    let identity = bead.request_done(&Request::Identity)?;
    let mut report = BenchReport::of(&identity, given.date.clone())?;
    let ended = checks(bead, given, step, &mut report);
    Ok((report, ended))
}

fn checks(
    bead: &mut Conversation,
    given: &Given<'_>,
    mut step: impl FnMut(&str),
    report: &mut BenchReport,
) -> Result<(), LineError> {
    let answer = bead.request_done(&Request::Image)?;
    let image = answer.last("image frame", |frame| match frame.message {
        Message::Image(image) => Some(image),
        _ => None,
    })?;
    report.board.image_bytes = image.bytes;
    report.board.image_crc = format!("{:08x}", image.crc);
    report.checks.push(identity_row(&image, given));
    let before = losses(&bead.request_done(&Request::Status)?)?;
    step("wires");
    let wiring = Wiring::find(bead)?;
    report.checks.push(wiring.row());
    if wiring.is_right() {
        step("levels");
        let levels = Levels::measure(bead)?;
        report.checks.extend(levels.rows());
        step("strikes");
        report.checks.extend(strike_rows(bead, &levels)?);
    } else {
        let names = levels::NAMES.iter().chain(&strikes::NAMES);
        let rows = names.map(|name| CheckRow::not_done(name, "needs both wires"));
        report.checks.extend(rows);
    }
    step("self-test");
    report.checks.push(self_test_row(bead)?);
    step("requests");
    report.checks.push(requests_row(bead, given.requests)?);
    let after = losses(&bead.request_done(&Request::Status)?)?;
    report.checks.push(acquisition_row(&before.status, &after.status));
    report.checks.push(line_row(bead, &before.link, &after.link));
    if given.resets {
        step("settings");
        report.checks.push(resets::settings_row(bead)?);
        if (given.stop)() {
            report
                .checks
                .push(CheckRow::not_done(resets::WATCHDOG, "interrupted"));
            return Ok(());
        }
        step("watchdog");
        report.checks.push(resets::watchdog_row(bead, given.shares_time)?);
    } else {
        let row = |name: &&str| CheckRow::not_done(name, "needs resets");
        report.checks.extend(resets::NAMES.iter().map(row));
    }
    Ok(())
}

fn identity_row(image: &Image, given: &Given<'_>) -> CheckRow {
    let seen = format!("CRC-32 {:08x}", image.crc);
    let Some(bytes) = (given.flash)(image.address, image.bytes) else {
        let expected = "the image that was flashed: --firmware ELF";
        return CheckRow::of("image", seen, expected, false);
    };
    let crc = bead_crc::checksum(&bytes);
    let expected = format!("{crc:08x}");
    CheckRow::of("image", seen, expected, crc == image.crc)
}

fn strike_rows(bead: &mut Conversation, levels: &Levels) -> Result<Vec<CheckRow>, LineError> {
    let block = bead
        .request_done(&Request::ReadSettings)?
        .last("settings frame", |frame| match &frame.message {
            Message::Settings(settings) => Some(settings.block.clone()),
            _ => None,
        })?;
    let settings = Settings::decode(block.bytes()).map_err(|error| {
        LineError::Failed(format!(
            "the bead has a {error}; give it one by `bead settings write`"
        ))
    })?;
    let expected = Expected::of(&settings, levels);
    // This request restarts the counts of the load.
    bead.request_done(&Request::Status)?;
    let one = Strikes::play(bead, &settings, 1)?;
    let train = Strikes::play(bead, &settings, strikes::TRAIN)?;
    let load = losses(&bead.request_done(&Request::Status)?)?.load;
    let mut rows = one.rows_of_one(&train, expected.as_ref());
    rows.push(train.row_of_train(&one));
    rows.push(budget_row(&load));
    Ok(rows)
}

fn budget_row(load: &Load) -> CheckRow {
    let share = |cycles: u32| f64::from(cycles) / f64::from(load.period_cycles.max(1));
    let (worst, mean) = (share(load.worst_cycles), share(load.mean_cycles));
    let row = CheckRow::of(
        strikes::BUDGET,
        format!(
            "{:.1} % in the busiest block, mean {:.1} %",
            100.0 * worst,
            100.0 * mean
        ),
        format!("at most {:.0} %", 100.0 * BUSIEST),
        worst <= BUSIEST && load.blocks > 0,
    );
    row.with("worst_cycles", load.worst_cycles)
        .with("mean_cycles", load.mean_cycles)
}

fn self_test_row(bead: &mut Conversation) -> Result<CheckRow, LineError> {
    let tests = bead.self_test()?;
    let failed: Vec<_> = tests.iter().filter(|test| !test.passed).collect();
    // Open inputs may stand still; another check covers the wires.
    let of_sensor =
        |check: bead_wire::Check| matches!(check, bead_wire::Check::Force | bead_wire::Check::Acceleration);
    let names = |sensors: bool| {
        let tests = failed.iter().filter(|test| of_sensor(test.check) == sensors);
        tests
            .map(|test| format!("{} ({})", test.check, test.value))
            .collect::<Vec<_>>()
            .join(", ")
    };
    let (ours, open) = (names(false), names(true));
    let seen = match (ours.is_empty(), open.is_empty()) {
        (true, true) => format!("{} checks passed", tests.len()),
        (true, false) => format!(
            "{} checks passed; failed at the open inputs: {open}",
            tests.len() - failed.len()
        ),
        (false, _) => format!("failed: {ours}"),
    };
    let passed = ours.is_empty();
    Ok(CheckRow::of("self-test", seen, "all", passed))
}

/// Sends `count` requests, in turn for identity, status, settings and kept strikes.
fn requests_row(bead: &mut Conversation, count: u32) -> Result<CheckRow, LineError> {
    let questions = [
        Request::Identity,
        Request::Status,
        Request::ReadSettings,
        Request::ListKept,
    ];
    let began = Instant::now();
    let mut again = 0;
    for number in 0..count {
        let answer = bead.request_done(&questions[number as usize % questions.len()])?;
        again += answer.attempts - 1;
    }
    let rate = f64::from(count) / began.elapsed().as_secs_f64().max(1e-9);
    let seen = format!("{} of {count} answered at once", count - again.min(count));
    let row = CheckRow::of("requests", seen, "all", again == 0);
    Ok(row
        .with("asked", count)
        .with("asked_again", again)
        .told("each_second", rate))
}

fn acquisition_row(before: &Status, after: &Status) -> CheckRow {
    let counts = [
        ("overruns", before.overruns, after.overruns),
        ("blocks dropped", before.blocks_dropped, after.blocks_dropped),
        ("epochs", before.epoch, after.epoch),
        (
            "frames dropped",
            before.frames_dropped_queue_full,
            after.frames_dropped_queue_full,
        ),
        (
            "frames too long",
            before.frames_dropped_too_long,
            after.frames_dropped_too_long,
        ),
    ];
    let grown: Vec<_> = counts
        .iter()
        .filter(|(_, before, after)| before != after)
        .map(|(name, before, after)| format!("{} {name}", after.wrapping_sub(*before)))
        .collect();
    let seen = if grown.is_empty() {
        "nothing lost".to_owned()
    } else {
        grown.join(", ")
    };
    CheckRow::of("acquisition", seen, "nothing", grown.is_empty())
}

fn line_row(bead: &Conversation, before: &Link, after: &Link) -> CheckRow {
    let rejected = |link: &Link| {
        [
            link.overruns,
            link.line_errors,
            link.rejected_too_long,
            link.rejected_cobs,
            link.rejected_too_short,
            link.rejected_crc,
            link.rejected_version,
            link.rejected_kind,
            link.rejected_body,
            link.rejected_trailing,
        ]
        .iter()
        .map(|count| u64::from(*count))
        .sum::<u64>()
    };
    let by_bead = rejected(after).saturating_sub(rejected(before));
    let counters = bead.counters();
    let (by_host, lost) = (counters.rejected.total(), counters.lost);
    let row = CheckRow::of(
        "line",
        format!("{by_bead} rejected by bead, {by_host} here, {lost} frames lost"),
        "none",
        by_bead + by_host + lost == 0,
    );
    row.with("by_bead", by_bead as f64)
        .with("here", by_host as f64)
        .with("lost", lost as f64)
}
