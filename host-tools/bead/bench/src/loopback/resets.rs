//! Settings that outlive a reset, and the watchdog.

use std::time::{Duration, Instant};

use bead_line::conversation::{Conversation, LineError};
use bead_model::Settings;
use bead_wire::{Block, Identity, Message, Outcome, Request, ResetCauses, SettingsSource};

use super::report::CheckRow;
use crate::emulation::block_of;

const SETTINGS: &str = "settings";
pub(super) const WATCHDOG: &str = "watchdog";
pub(super) const NAMES: [&str; 2] = [SETTINGS, WATCHDOG];

/// Time-out for the return from the watchdog of a bead whose time is not this computer's.
const BACK: Duration = Duration::from_secs(20);
/// Time of the watchdog, whose oscillator runs at 17 to 47 kHz (DocID022152, LSI characteristics), and of a
/// start, s.
const WATCHDOG_S: std::ops::RangeInclusive<f64> = 1.2..=4.5;

/// The block in force.
fn block(bead: &mut Conversation) -> Result<Vec<u8>, LineError> {
    let answer = bead.request_done(&Request::ReadSettings)?;
    answer.last("settings frame", |frame| match &frame.message {
        Message::Settings(settings) => Some(settings.block.bytes().to_vec()),
        _ => None,
    })
}

/// Source of the settings in force.
fn source(bead: &mut Conversation) -> Result<SettingsSource, LineError> {
    let answer = bead.request_done(&Request::Status)?;
    answer.last("status frame", |frame| match &frame.message {
        Message::Status(status) => Some(status.settings_source),
        _ => None,
    })
}

/// A block of these settings with another threshold.
fn changed(before: &[u8]) -> Option<Vec<u8>> {
    let mut description = *Settings::decode(before).ok()?.description();
    description.capture.threshold *= 1.25;
    block_of(&Settings::new(&description).ok()?).ok()
}

/// Writes a block. A bead whose store is full makes room when it starts. Returns the number of resets for
/// that.
fn write(bead: &mut Conversation, block: &[u8]) -> Result<u64, LineError> {
    let too_long = |_| LineError::Failed("the settings block is longer than a request".to_owned());
    let request = Request::WriteSettings {
        block: Block::try_from(block).map_err(too_long)?,
    };
    let answer = bead.request(&request)?;
    match answer.reply.outcome {
        Outcome::Done => Ok(0),
        Outcome::StoreFull => {
            bead.reboot()?;
            bead.request_done(&request).map(|_| 1)
        }
        _ => Err(answer.refusal()),
    }
}

/// Restores the settings that were in force before.
fn restore(bead: &mut Conversation, source: SettingsSource, before: &[u8]) -> Result<(), LineError> {
    match source {
        SettingsSource::Stored => write(bead, before).map(drop),
        _ => bead.request_done(&Request::EraseSettings).map(drop),
    }
}

/// Writes other settings, reads them back after a reset, then restores the bead's own, also across a reset.
pub(super) fn settings_row(bead: &mut Conversation) -> Result<CheckRow, LineError> {
    let before = block(bead)?;
    let origin = source(bead)?;
    let Some(other) = changed(&before) else {
        return Ok(CheckRow::not_done(
            SETTINGS,
            "needs a valid threshold at 1.25 times the present one",
        ));
    };
    let restarts = bead.counters().restarts;
    let kept = write(bead, &other).and_then(|resets| {
        if bead.counters().restarts != restarts + resets {
            return Err(LineError::Failed("the bead was reset while it wrote".to_owned()));
        }
        bead.reboot()?;
        block(bead)
    });
    // The bead's own settings are restored after a failed check, too.
    let restored = restore(bead, origin, &before).and_then(|()| {
        bead.reboot()?;
        block(bead)
    });
    let word = |found: &Result<Vec<u8>, LineError>, expected: &[u8]| match found {
        Ok(found) if found == expected => "as written".to_owned(),
        Ok(_) => "NOT as written".to_owned(),
        Err(error) => error.to_string(),
    };
    let (kept_word, restored_word) = (word(&kept, &other), word(&restored, &before));
    let passed = kept.is_ok_and(|kept| kept == other) && restored.is_ok_and(|restored| restored == before);
    Ok(CheckRow::of(
        SETTINGS,
        format!("test block {kept_word}, own {restored_word}"),
        "as written, over resets",
        passed,
    ))
}

/// Lets the bead hang, and waits for its watchdog. Then resets the bead once more, so that its light does
/// not show a fault.
pub(super) fn watchdog_row(bead: &mut Conversation, shares_time: bool) -> Result<CheckRow, LineError> {
    bead.request_done(&Request::Hang)?;
    let began = Instant::now();
    let back: Option<Identity> = bead.listen(BACK, |frame| match frame.message {
        Message::Identity(identity) if frame.header.sequence == 0 => Some(identity),
        _ => None,
    })?;
    let seconds = began.elapsed().as_secs_f64();
    let expected = "by the watchdog, 1.2 to 4.5 s";
    let Some(identity) = back else {
        return Ok(CheckRow::of(
            WATCHDOG,
            format!("not back within {} s", BACK.as_secs()),
            expected,
            false,
        ));
    };
    let by_watchdog = identity.reset_cause.has(ResetCauses::INDEPENDENT_WATCHDOG);
    let in_time = !shares_time || WATCHDOG_S.contains(&seconds);
    let causes: Vec<_> = identity.reset_cause.names().collect();
    let time = if shares_time {
        format!(" after {seconds:.1} s")
    } else {
        String::new()
    };
    let row = CheckRow::of(
        WATCHDOG,
        format!("back{time}, by {}", causes.join(", ")),
        expected,
        by_watchdog && in_time,
    );
    bead.reboot()?;
    Ok(row.told("seconds", seconds))
}
